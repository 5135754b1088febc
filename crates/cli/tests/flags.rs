//! Every flag that a message, a help text, a page or the changelog names is accepted by a command, by the one that stands before it where one does.

use crate::book_support::root;
use crate::support::resight;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Flags of other programs that pages and messages name: cargo, its benches and tests, maturin, CMake, pkg-config, Kalibr, ROS, Blender and the scripts of the
/// repository.
const OF_OTHERS: [&str; 55] = [
    "all",
    "all-targets",
    "alone",
    "approx-sync",
    "bag",
    "bench",
    "build",
    "cflags",
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
    "libs",
    "locked",
    "nocapture",
    "now",
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
    "static",
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

fn below(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.is_dir() {
            true => below(&entry, ending, found),
            false if entry.extension().is_some_and(|is| is == ending) => found.push(entry),
            false => {}
        }
    }
}

/// Pages, sources, and the texts of the page of `resight serve`, without lines that accept an old name or are no text that a user sees.
fn texts() -> Vec<(String, String)> {
    let mut files = Vec::new();
    below(&root().join("docs"), "md", &mut files);
    below(&root().join("web/src/texts"), "ts", &mut files);
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

/// The flags of each command, as the shell completes them; commands of `whisker` are `whisker solve` and so on, and those of the program itself
/// have no name.
fn known() -> BTreeMap<String, BTreeSet<String>> {
    let mut known: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in resight(&["completions", "fish"]).stdout.lines() {
        let Some((condition, rest)) = line.split_once(" -n \"").and_then(|(_, rest)| rest.split_once('"'))
        else {
            continue;
        };
        let Some((_, flag)) = rest.split_once(" -l ") else { continue };
        let after = |key: &str| {
            condition
                .split_once(key)
                .map_or("", |(_, rest)| rest.trim_matches([' ', ';']).split([' ', ';']).next().unwrap())
        };
        let second = if condition.contains(" not ") { "" } else { after("__fish_seen_subcommand_from") };
        let command = format!("{} {second}", after("__fish_resight_using_subcommand"));
        let flag = flag.split(' ').next().unwrap_or_default();
        known.entry(command.trim().to_string()).or_default().insert(flag.to_string());
    }
    known
}

/// Commands with their flags in the examples of a text: `resight COMMAND … --flag …`, up to what ends a command.
fn examples<'a>(text: &'a str, known: &BTreeMap<String, BTreeSet<String>>) -> BTreeSet<(String, &'a str)> {
    let ends = ['`', '|', ';', '#', '&', '"', '(', ')'];
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices("resight ") {
        let rest = &text[at + "resight ".len()..];
        // A line that ends in a backslash continues.
        let line_end = rest.match_indices('\n').find(|(at, _)| !rest[..*at].ends_with('\\')).map(|end| end.0);
        let line = &rest[..line_end.unwrap_or(rest.len())];
        let line = line.split(ends).next().unwrap_or_default();
        let words: Vec<&str> = line.split_whitespace().take(2).collect();
        let names = [words.join(" "), words.first().copied().unwrap_or_default().to_string()];
        let Some(command) = names.into_iter().find(|name| known.contains_key(name)) else {
            continue;
        };
        found.extend(named(line).into_iter().map(|flag| (command.clone(), flag)));
    }
    found
}

/// Whether a command accepts a flag: it is run with it, and with `--help`, so that nothing is done.
fn is_accepted(command: &str, flag: &str) -> bool {
    let flag = format!("--{flag}");
    let arguments: Vec<&str> =
        command.split_whitespace().chain([flag.as_str(), "--help", "--help"]).collect();
    !resight(&arguments).stderr.contains("unexpected argument")
}

#[test]
fn every_flag_that_is_named_is_accepted() {
    let (known, mut checked, mut wrong) = (known(), 0, Vec::new());
    let mut accepted: BTreeMap<(String, String), bool> = BTreeMap::new();
    let mut runs = |command: &str, flag: &str| {
        let key = (command.to_string(), flag.to_string());
        *accepted.entry(key).or_insert_with(|| is_accepted(command, flag))
    };
    let mut scripts = Vec::new();
    below(&root().join("crates/python/examples"), "py", &mut scripts);
    let scripts: String = scripts.iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    let is_of_script = |flag: &str| scripts.contains(&format!("add_argument(\"--{flag}\""));
    assert!(runs("watch", "correlated-deg") && !runs("watch", "bias-deg") && !runs("locate", "bias-deg"));
    for (file, text) in texts() {
        for flag in named(&text) {
            checked += 1;
            let begins = |known: &String| flag.ends_with('-') && known.starts_with(flag);
            let owner = known.iter().find(|(_, flags)| flags.contains(flag) || flags.iter().any(begins));
            let is_one = match owner {
                Some((command, _)) => flag.ends_with('-') || runs(command, flag),
                None => OF_OTHERS.contains(&flag) || is_of_script(flag),
            };
            if !is_one {
                wrong.push(format!("{file}: --{flag}"));
            }
        }
        for (command, flag) in examples(&text, &known) {
            checked += 1;
            if !(flag.ends_with('-') || runs(&command, flag)) {
                wrong.push(format!("{file}: resight {command} --{flag}"));
            }
        }
    }
    assert!(1000 < checked, "only {checked} seen");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn flags_are_found_in_texts() {
    assert_eq!(named("give `--bias-deg` or (--tag-…), not a--b"), ["bias-deg", "tag-"].into());
    let known = BTreeMap::from([
        ("watch".to_string(), BTreeSet::new()),
        ("whisker solve".to_string(), BTreeSet::new()),
    ]);
    let text = "`resight watch a --one 1 \\\n --two` --no\nresight whisker solve --three | jq --no";
    let found = examples(text, &known);
    let found: Vec<(&str, &str)> = found.iter().map(|(command, flag)| (command.as_str(), *flag)).collect();
    assert_eq!(found, [("watch", "one"), ("watch", "two"), ("whisker solve", "three")]);
}
