//! Every flag that a message, a help text or a page names is one of a command.

use crate::support::resight;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Flags of other programs that pages and messages name: cargo, its benches and tests, maturin, Kalibr, ROS, Blender and the scripts of the
/// repository.
const OF_OTHERS: [&str; 49] = [
    "all",
    "all-targets",
    "alone",
    "approx-sync",
    "bag",
    "bench",
    "child-frame-id",
    "compatibility",
    "count",
    "curves",
    "data",
    "example",
    "features",
    "frame",
    "frame-id",
    "ignored",
    "lib",
    "nocapture",
    "nx",
    "ny",
    "open",
    "part",
    "pitch",
    "port",
    "python",
    "qw",
    "qx",
    "qy",
    "qz",
    "release",
    "resight",
    "roll",
    "ros-args",
    "rounds",
    "seconds",
    "seeds",
    "sessions",
    "test",
    "topic",
    "tsize",
    "tspace",
    "type",
    "workspace",
    "write",
    "x",
    "y",
    "yaw",
    "z",
    "zig",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn below(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.is_dir() {
            true => below(&entry, ending, found),
            false if entry.extension().is_some_and(|is| is == ending) => found.push(entry),
            false => {}
        }
    }
}

/// Pages and sources, without lines that accept an old name or are no text that a user sees.
fn texts() -> Vec<(String, String)> {
    let mut files = Vec::new();
    below(&root().join("docs"), "md", &mut files);
    for krate in std::fs::read_dir(root().join("crates")).unwrap().map(|krate| krate.unwrap().path()) {
        if krate.join("src").is_dir() {
            below(&krate.join("src"), "rs", &mut files);
        }
    }
    files.extend(
        ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "ARCHITECTURE.md"].map(|name| root().join(name)),
    );
    let text = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        let is_seen = |line: &&str| {
            !line.contains("alias") && (!line.trim_start().starts_with("//") || line.contains("///"))
        };
        (path.display().to_string(), text.lines().filter(is_seen).collect::<Vec<_>>().join("\n"))
    };
    files.into_iter().map(text).collect()
}

/// Names behind `--` in a text; a name that ends in `-` stands for all that begin so (`--print-…`).
fn named(text: &str) -> BTreeSet<&str> {
    let is_edge = |before: &str| {
        !before.ends_with("var(") && !before.ends_with(|c: char| c.is_alphanumeric() || "-_".contains(c))
    };
    let flags = text.match_indices("--").filter(|(at, _)| is_edge(&text[..*at])).map(|(at, _)| {
        let rest = &text[at + 2..];
        let end = rest.find(|c: char| !(c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-'));
        &rest[..end.unwrap_or(rest.len())]
    });
    flags.filter(|flag| flag.starts_with(|c: char| c.is_ascii_lowercase()) && 1 < flag.len()).collect()
}

/// All flags of all commands, as the shell completes them.
fn known() -> BTreeSet<String> {
    let run = resight(&["completions", "fish"]);
    let words: Vec<&str> = run.stdout.split_whitespace().collect();
    words.windows(2).filter(|pair| pair[0] == "-l").map(|pair| pair[1].to_string()).collect()
}

#[test]
fn every_flag_that_is_named_is_one() {
    let (known, mut checked, mut wrong) = (known(), 0, Vec::new());
    assert!(known.contains("correlated-deg") && !known.contains("bias-deg"), "{known:?}");
    for (file, text) in texts() {
        for flag in named(&text) {
            checked += 1;
            let is_family = flag.ends_with('-') && known.iter().any(|known| known.starts_with(flag));
            if !(is_family || known.contains(flag) || OF_OTHERS.contains(&flag)) {
                wrong.push(format!("{file}: --{flag}"));
            }
        }
    }
    assert!(500 < checked, "only {checked} seen");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(named("give `--bias-deg` or (--tag-…), not a--b"), ["bias-deg", "tag-"].into());
}
