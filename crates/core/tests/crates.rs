//! The crates of the workspace: no file in a circle with others, and the map in ARCHITECTURE.md is theirs.

use crate::crates_support::drawing::{arrows, map};
use crate::crates_support::tree::Tree;
use crate::crates_support::{Package, circles, in_order, packages, root};
use std::collections::{BTreeMap, BTreeSet};

/// A topic's own file may hold what the files below it share (`rig.rs` and `rig/job.rs`); otherwise files of which each uses the other,
/// also by way of third ones, can only be understood and changed together.
#[test]
fn no_files_of_a_crate_use_each_other_in_a_circle() {
    let (mut n_files, mut n_uses) = (0, 0);
    for package in packages() {
        let uses = Tree::read(&root().join("crates").join(&package.folder).join("src")).uses();
        (n_files, n_uses) = (n_files + uses.len(), n_uses + uses.values().map(BTreeSet::len).sum::<usize>());
        if let Some(circle) = circles(&uses).into_iter().next() {
            let among = |file: &String| uses[file].intersection(&circle).cloned().collect::<Vec<_>>();
            let lines: Vec<String> =
                circle.iter().map(|file| format!("{file} uses {}", among(file).join(", "))).collect();
            panic!("{}: {} files in a circle\n{}", package.name, circle.len(), lines.join("\n"));
        }
    }
    assert!(500 < n_files && 1500 < n_uses, "only {n_uses} uses among {n_files} files seen");
}

fn circles_of(files: &[(&str, &str)]) -> Vec<BTreeSet<String>> {
    circles(&Tree::of(files.iter().map(|(name, text)| (name.to_string(), text.to_string()))).uses())
}

/// Imports in all their forms, paths in code, and what is passed on by third files.
#[test]
fn circles_are_found_through_imports_paths_and_re_exports() {
    let by = |a: &str, b: &str, root: &str| {
        let found = circles_of(&[("lib.rs", root), ("a.rs", a), ("b.rs", b), ("c.rs", "pub fn three() {}")]);
        found.len() == 1 && found[0].len() == 2
    };
    let lib = "mod a; mod b; mod c; pub use a::one; pub(crate) use b::{two, Two};";
    assert!(by("use crate::b::two; pub fn one() {}", "use super::a::one; pub fn two() {}", lib));
    assert!(by(
        "use crate::two; pub fn one() {}",
        "use crate::{c::three, one as first}; pub fn two() {}",
        lib
    ));
    assert!(by("pub fn one() { crate::b::two() }", "pub fn two() { super::a::one() }", lib));
    assert!(by("use super::b; pub fn one() { b::two() }", "use crate::a::*; pub fn two() {}", lib));
    assert!(by(
        "use crate::Two as T; pub fn one(_: T) {}",
        "pub struct Two; impl Two { fn f() { crate::one() } }",
        lib
    ));
    // What only tests use, stands in comments or texts, or is merely passed on, makes none.
    assert!(!by(
        "use crate::b::two; pub fn one() {}",
        "pub fn two() {} #[cfg(test)] mod tests { use crate::a::one; }",
        lib
    ));
    assert!(!by(
        "use crate::b::two; pub fn one() {}",
        "pub fn two() { /* crate::a::one */ f(\"crate::a::one\") }",
        lib
    ));
    assert!(!by(
        "use crate::b::two; pub fn one() {}",
        "pub use crate::a::one as first; pub fn two() {}",
        lib
    ));
    assert!(!by("use crate::b::two; pub fn one() {}", "use other::a::one; pub fn two() {}", lib));
}

/// A file below a topic's own file may use what that holds; two files below may not use each other.
#[test]
fn a_topics_own_file_may_be_used_from_below() {
    let own = ("rig.rs", "mod a; mod b; use a::one; pub struct Rig; fn f() { one() }");
    let a = "use super::Rig; pub fn one(_: Rig) {}";
    assert!(
        circles_of(&[own, ("rig/a.rs", a), ("rig/b.rs", "use super::a::one; pub fn two() {}")]).is_empty()
    );
    let a = "use super::b::two; pub fn one() {}";
    assert_eq!(
        circles_of(&[own, ("rig/a.rs", a), ("rig/b.rs", "use super::a::one; pub fn two() {}")]).len(),
        1
    );
}

/// Crates that need nothing but mathematics and text remain so, and no crate uses the program.
#[test]
fn arrows_between_crates_go_one_way() {
    let packages = packages();
    let order = in_order(&packages).expect("an order in which each crate stands behind those that it uses");
    assert_eq!((order[0].folder.as_str(), order.last().expect("crates").folder.as_str()), ("core", "python"));
    let of = |folder: &str| packages.iter().find(|one| one.folder == folder).expect("a crate");
    let uses = |folder: &str| of(folder).dependencies.iter().map(String::as_str).collect::<Vec<_>>();
    assert!(uses("core").is_empty());
    assert_eq!(uses("whisker"), ["resight-core"]);
    assert_eq!(uses("formats"), ["resight-core", "resight-recording"]);
    assert!(of("formats").optional.contains("resight-recording"));
    assert!(!uses("resight").contains(&"resight-watch"));
}

/// Every crate that the lock file brings along with one, without what a feature of it switches on.
fn brought_along(package: &Package) -> BTreeSet<String> {
    let lock = std::fs::read_to_string(root().join("Cargo.lock")).expect("the lock file");
    let mut uses: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for entry in lock.split("[[package]]").skip(1) {
        let quoted: Vec<&str> = entry.split('"').skip(1).step_by(2).collect();
        let listed = entry.split_once("dependencies = [").map_or("", |(_, list)| list);
        let listed = listed.split('"').skip(1).step_by(2);
        let names = listed.filter_map(|name| name.split(' ').next()).map(str::to_string);
        uses.entry(quoted[0].to_string()).or_default().extend(names);
    }
    let (mut seen, mut open) = (BTreeSet::new(), vec![package.name.clone()]);
    while let Some(name) = open.pop() {
        let next = uses.get(&name).into_iter().flatten();
        let next = next.filter(|one| name != package.name || !package.optional.contains(*one));
        open.extend(next.filter(|one| seen.insert((*one).clone())).cloned());
    }
    seen
}

/// Reading one Kalibr file must not build a tag detector, SQLite and zstd.
#[test]
fn formats_bring_no_detector_database_or_decompression() {
    const HEAVY: [&str; 7] =
        ["apriltag-sys", "calib-targets-core", "image", "rusqlite", "libsqlite3-sys", "zstd-sys", "mcap"];
    let packages = packages();
    let of = |folder: &str| brought_along(packages.iter().find(|one| one.folder == folder).expect("a crate"));
    let (formats, cli) = (of("formats"), of("cli"));
    assert!(HEAVY.iter().all(|name| cli.contains(*name)), "the lock file is not read any more");
    let heavy: Vec<&&str> = HEAVY.iter().filter(|name| formats.contains(**name)).collect();
    assert!(heavy.is_empty() && formats.contains("toml"), "{heavy:?}");
}

/// The crates that a selection of packages is built from, each with its features.
fn built_from(selection: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    let cargo = std::process::Command::new(env!("CARGO"))
        .args(["tree", "--locked", "--prefix", "none", "--format", "{p}|{f}"])
        .args(selection)
        .current_dir(root())
        .output()
        .expect("cargo runs");
    let text = String::from_utf8(cargo.stdout).expect("text");
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (package, features) in text.lines().filter_map(|line| line.split_once('|')) {
        let features = features.trim_end_matches(" (*)").to_string();
        all.entry(package.replace(" (proc-macro)", "")).or_default().insert(features);
    }
    all
}

/// Cargo builds a crate again where another selection of packages asks other features of it: the wheel after the program, or after the tests.
#[test]
fn one_build_serves_program_wheel_and_tests() {
    let program = built_from(&["-p", "resight-cli", "-e", "normal,build"]);
    let wheel = built_from(&["-p", "resight-python", "-e", "normal,build"]);
    let tests = built_from(&["--workspace", "--exclude", "resight-c", "-e", "normal,build,dev"]);
    let with_c = built_from(&["--workspace", "-e", "normal,build,dev"]);
    assert!(200 < program.len(), "only {} crates seen", program.len());
    for (others, name) in [(&wheel, "wheel"), (&tests, "tests")] {
        let differs =
            |(package, features): &(&String, &BTreeSet<String>)| others.get(*package) != Some(*features);
        let told = |(package, features): (&String, &BTreeSet<String>)| {
            format!("{package}: program {features:?}, {name} {:?}", others.get(package))
        };
        let again: Vec<String> = program.iter().filter(differs).map(told).collect();
        assert!(
            again.is_empty(),
            "asked for in crates/cli/Cargo.toml they are built once:\n{}",
            again.join("\n")
        );
    }
    // cbindgen, which the tests of the C library use, has crates with other features beside those of the program, never in their place.
    for (package, features) in &program {
        let seen = with_c.get(package);
        assert!(
            seen.is_some_and(|seen| features.is_subset(seen)),
            "{package}: program {features:?}, all {seen:?}"
        );
    }
}

/// Every crate with what its manifest says of it, and the arrows between them; written anew with RESIGHT_BLESS=1.
#[test]
fn the_map_in_architecture_is_that_of_the_manifests() {
    const MARKS: [&str; 2] = ["<!-- the crates, from their manifests -->\n", "<!-- end of the crates -->\n"];
    let path = root().join("ARCHITECTURE.md");
    let text = std::fs::read_to_string(&path).expect("ARCHITECTURE.md");
    let packages = packages();
    let order = in_order(&packages).expect("an order");
    let drawn = format!("```text\n{}\n{}```\n", map(&order), arrows(&order));
    let (before, rest) = text.split_once(MARKS[0]).expect("the first mark");
    let (written, after) = rest.split_once(MARKS[1]).expect("the second mark");
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        let [first, last] = MARKS;
        std::fs::write(&path, format!("{before}{first}{drawn}{last}{after}")).expect("written");
        return;
    }
    assert!(
        written == drawn,
        "ARCHITECTURE.md draws\n{written}\nbut the manifests say\n{drawn}\n\
         RESIGHT_BLESS=1 cargo test -p resight-core --test it the_map_in_architecture writes it"
    );
}
