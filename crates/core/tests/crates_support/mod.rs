//! The crates of the workspace as their sources have them: which files use which, and which crates.

pub mod drawing;
pub mod source;
pub mod tree;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A crate: its folder below `crates`, its package, and the packages of the workspace that it depends on.
pub struct Package {
    pub folder: String,
    pub name: String,
    pub description: String,
    pub dependencies: BTreeSet<String>,
    /// Those of `dependencies` that a feature switches on.
    pub optional: BTreeSet<String>,
}

/// All crates, by folder.
pub fn packages() -> Vec<Package> {
    let manifests = fs::read_dir(root().join("crates")).expect("crates/");
    let mut all: Vec<Package> =
        manifests.filter_map(|entry| package(&entry.expect("a crate").path())).collect();
    let names: BTreeSet<String> = all.iter().map(|one| one.name.clone()).collect();
    for one in &mut all {
        one.dependencies.retain(|name| names.contains(name));
        one.optional.retain(|name| names.contains(name));
    }
    all.sort_by(|a, b| a.folder.cmp(&b.folder));
    all
}

fn package(folder: &Path) -> Option<Package> {
    let text = fs::read_to_string(folder.join("Cargo.toml")).ok()?;
    let value = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key)?.trim().strip_prefix('='));
        line.map(|rest| rest.trim().trim_matches('"').to_string())
    };
    let (mut section, mut dependencies, mut optional) = ("", BTreeSet::new(), BTreeSet::new());
    for line in text.lines() {
        if let Some(header) = line.strip_prefix('[') {
            section = header.trim_end_matches(']');
        } else if section.ends_with("dependencies")
            && section != "dev-dependencies"
            && let Some(name) = line.split(['.', ' ', '=']).next().filter(|name| !name.is_empty())
        {
            dependencies.insert(name.to_string());
            if line.contains("optional = true") {
                optional.insert(name.to_string());
            }
        }
    }
    let folder = folder.file_name()?.to_string_lossy().to_string();
    Some(Package { folder, name: value("name")?, description: value("description")?, dependencies, optional })
}

/// The crates in an order in which each stands behind those that it depends on; none where there is no such order.
pub fn in_order(packages: &[Package]) -> Option<Vec<&Package>> {
    let (mut order, mut left): (Vec<&Package>, Vec<&Package>) = (Vec::new(), packages.iter().collect());
    while !left.is_empty() {
        let is_ready = |one: &&Package| {
            one.dependencies.iter().all(|name| order.iter().any(|before| before.name == *name))
        };
        let at = left.iter().position(is_ready)?;
        order.push(left.remove(at));
    }
    Some(order)
}

/// Which files use which, in the sets that form circles; each with the uses among them.
pub fn circles(uses: &BTreeMap<String, BTreeSet<String>>) -> Vec<BTreeSet<String>> {
    let reach = |from: &str| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.to_string()]);
        while let Some(file) = open.pop() {
            for next in uses.get(&file).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let reached: BTreeMap<&String, BTreeSet<String>> = uses.keys().map(|file| (file, reach(file))).collect();
    let mut found: Vec<BTreeSet<String>> = Vec::new();
    for (file, ahead) in &reached {
        let back = |other: &&String| reached.get(other).is_some_and(|theirs| theirs.contains(*file));
        let circle: BTreeSet<String> = ahead.iter().filter(back).cloned().collect();
        if 1 < circle.len() && !found.contains(&circle) {
            found.push(circle);
        }
    }
    found
}
