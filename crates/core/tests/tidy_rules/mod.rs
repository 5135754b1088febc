//! House rules that hold in every crate of pure mathematics, checked on the sources of the crate that runs them.

use std::fs;
use std::path::{Path, PathBuf};

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Every source file but unit tests in files of their own: path relative to `src`, contents.
pub fn files() -> Vec<(String, String)> {
    let (mut found, mut folders) = (Vec::new(), vec![source()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a source folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
                let name =
                    path.strip_prefix(source()).expect("below src").to_string_lossy().replace('\\', "/");
                found.push((name, fs::read_to_string(&path).expect("a source file")));
            }
        }
    }
    assert!(10 < found.len());
    found.sort();
    found
}

/// Without its unit tests, which may use anything.
pub fn product(text: &str) -> &str {
    text.split("#[cfg(test)]").next().unwrap_or(text)
}

/// The code of a line, without a comment.
pub fn code(line: &str) -> &str {
    line.split("//").next().unwrap_or(line)
}

/// Modules in the order a file lists them.
pub fn modules(text: &str) -> Vec<String> {
    let name = |line: &str| {
        let line = line.trim().trim_start_matches("pub ").trim_start_matches("pub(crate) ");
        line.strip_prefix("mod ")?.strip_suffix(';').map(str::to_string)
    };
    product(text).lines().filter_map(name).collect()
}

/// First path segments named by the `use` items (and inline paths) that start with `prefix`.
fn used(text: &str, prefix: &str) -> Vec<String> {
    let text: String = product(text).lines().map(code).collect::<Vec<_>>().join(" ");
    let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut names = Vec::new();
    for tail in text.split(prefix).skip(1) {
        let Some(list) = tail.strip_prefix('{') else {
            names.push(word(tail));
            continue;
        };
        let (mut depth, mut item) = (0, String::new());
        for c in list.chars() {
            match c {
                '}' if depth == 0 => break,
                ',' if depth == 0 => names.push(word(std::mem::take(&mut item).trim())),
                _ => {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    item.push(c);
                }
            }
        }
        names.push(word(item.trim()));
    }
    names.into_iter().filter(|n| !n.is_empty()).collect()
}

/// The module that a name re-exported at the root comes from.
fn root_export(root: &str, name: &str) -> Option<String> {
    let exports = product(root).lines().filter_map(|line| line.trim().strip_prefix("pub use "));
    exports
        .filter_map(|line| line.split_once("::"))
        .find(|(_, names)| names.split(|c: char| !c.is_alphanumeric()).any(|n| n == name))
        .map(|(module, _)| module.to_string())
}

/// A module uses those listed above it in `lib.rs`, never those below.
pub fn modules_use_only_those_above_them(at_least: usize) {
    let files = files();
    let root = &files.iter().find(|f| f.0 == "lib.rs").expect("lib.rs").1;
    let order = modules(root);
    let place = |module: &str| order.iter().position(|m| m == module);
    let mut checked = 0;
    for (name, text) in files.iter().filter(|f| f.0 != "lib.rs") {
        let own = name.split(['/', '.']).next().expect("a name");
        let own_place = place(own).unwrap_or_else(|| panic!("{name} is not listed in lib.rs"));
        for used in used(text, "crate::") {
            let module = root_export(root, &used).unwrap_or(used);
            if let Some(used_place) = place(&module) {
                assert!(used_place <= own_place, "{name} uses {module}, which stands below {own} in lib.rs");
                checked += 1;
            }
        }
    }
    assert!(at_least < checked, "only {checked} imports seen: does the parser still read them?");
}

/// The same below a module with files of its own: `solve/planar.rs` uses `sqpnp`, so `sqpnp` stands above it in `solve.rs`; and
/// `multiview/rig/start.rs` uses `crate::multiview::relative` only if `relative` stands above `rig` in `multiview.rs`.
pub fn submodules_use_only_those_above_them(at_least: usize) {
    let files = files();
    let mut checked = 0;
    for (name, text) in &files {
        let path: Vec<&str> = name.trim_end_matches(".rs").split('/').collect();
        for depth in 1..path.len() {
            let (parent, own) = (path[..depth].join("/"), path[depth]);
            let parent_text = &files.iter().find(|f| f.0 == format!("{parent}.rs")).expect("the parent").1;
            let order = modules(parent_text);
            let place = |module: &str| order.iter().position(|m| m == module);
            let own_place = place(own).unwrap_or_else(|| panic!("{name} is not listed in {parent}.rs"));
            let by_path = used(text, &format!("crate::{}::", parent.replace('/', "::")));
            let by_parent = if depth + 1 == path.len() { used(text, "super::") } else { Vec::new() };
            for used in by_path.iter().chain(&by_parent).filter(|used| *used != own) {
                if let Some(used_place) = place(used) {
                    let below = format!("{name} uses {used}, which stands below {own} in {parent}.rs");
                    assert!(used_place < own_place, "{below}");
                    checked += 1;
                }
            }
        }
    }
    assert!(at_least < checked, "only {checked} imports seen");
}

/// No file, clock, thread, socket, environment or printing.
pub fn nothing_outside_is_touched() {
    const BANNED: [&str; 12] = [
        "std::fs",
        "std::time",
        "std::thread",
        "std::net",
        "std::env",
        "std::process",
        "std::io",
        "println!",
        "eprintln!",
        "print!(",
        "dbg!",
        "static mut",
    ];
    for (name, text) in files() {
        for (number, line) in text.lines().enumerate() {
            for banned in BANNED {
                assert!(!code(line).contains(banned), "{name}:{}: {banned}", number + 1);
            }
        }
    }
}

/// No panic by `unwrap`, `expect`, `panic!`, `todo!` in what users run.
pub fn nothing_panics_on_purpose() {
    const BANNED: [&str; 6] = [".unwrap()", ".expect(", "panic!", "todo!", "unimplemented!", "unreachable!"];
    for (name, text) in files() {
        for (number, line) in product(&text).lines().enumerate() {
            for banned in BANNED {
                assert!(!code(line).contains(banned), "{name}:{}: {banned}", number + 1);
            }
        }
    }
}

/// Every `docs/math/….md eq. (n)` in the code exists in that document.
pub fn every_cited_equation_exists(at_least: usize) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut cited = 0;
    for (name, text) in files() {
        for line in text.lines() {
            for tail in line.split("docs/math/").skip(1) {
                let Some((document, rest)) = tail.split_once(".md") else { continue };
                let path = root.join(format!("docs/math/{document}.md"));
                let written = fs::read_to_string(&path);
                let Ok(written) = written else { panic!("{name}: docs/math/{document}.md is missing") };
                for number in equation_numbers(rest) {
                    let listed = written.lines().any(|l| l.trim_end().ends_with(&format!("({number})")));
                    assert!(listed, "{name}: {document}.md has no eq. ({number})");
                    cited += 1;
                }
            }
        }
    }
    assert!(at_least < cited, "only {cited} citations seen");
}

/// The numbers of ` eq. (4)`, ` eqs. (10)–(14)`.
fn equation_numbers(rest: &str) -> Vec<u32> {
    let Some(list) = rest.trim_start().strip_prefix("eq") else { return Vec::new() };
    let list: String = list.chars().take_while(|c| "s. ()–-, ".contains(*c) || c.is_ascii_digit()).collect();
    let numbers: Vec<u32> =
        list.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect();
    match numbers[..] {
        [first, last] if list.contains('–') => (first..=last).collect(),
        _ => numbers,
    }
}
