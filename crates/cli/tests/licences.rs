//! The licences of all crates of the lock file, on every platform.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// A crate's licence is an SPDX expression: alternatives (`OR`, formerly `/`) of terms that all hold (`AND`), at most one level deep.
fn is_permissive(expression: &str, allowed: &[&str]) -> bool {
    let plain = expression.replace('/', " OR ").replace(['(', ')'], " ");
    let words: Vec<&str> = plain.split_whitespace().collect();
    let text = words.join(" ");
    let is_allowed = |term: &str| allowed.contains(&term.trim());
    // Without looking at parentheses every factor of a conjunction needs an allowed alternative.
    text.split(" AND ").all(|factor| factor.split(" OR ").any(is_allowed))
}

fn words(list: &toml::Value) -> Vec<&str> {
    list.as_array().unwrap().iter().filter_map(|one| one.as_str()).collect()
}

#[test]
fn every_crate_has_a_permissive_licence() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let text = std::fs::read_to_string(root.join("deny.toml")).unwrap();
    let deny: toml::Value = toml::from_str(&text).unwrap();
    let allowed = words(&deny["licenses"]["allow"]);
    let of_crate = |name: &str| {
        let excepted = deny["licenses"]["exceptions"].as_array().unwrap().iter();
        let own =
            excepted.filter(|one| one["crate"].as_str() == Some(name)).flat_map(|one| words(&one["allow"]));
        allowed.iter().copied().chain(own).collect::<Vec<_>>()
    };
    let run = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(&root)
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let metadata: Value = serde_json::from_slice(&run.stdout).unwrap();
    let crates = metadata["packages"].as_array().unwrap();
    let refused: Vec<String> = crates
        .iter()
        .filter(|one| {
            let allowed = of_crate(one["name"].as_str().unwrap());
            !one["license"].as_str().is_some_and(|licence| is_permissive(licence, &allowed))
        })
        .map(|one| format!("{} {}", one["name"], one["license"]))
        .collect();
    assert!(refused.is_empty(), "{refused:?}");
    assert!(300 < crates.len(), "{} crates", crates.len());
}

#[test]
fn a_licence_needs_one_allowed_alternative_of_each_of_its_terms() {
    let allowed = ["MIT", "Apache-2.0", "ISC", "Apache-2.0 WITH LLVM-exception"];
    for right in ["MIT", "MIT/Apache-2.0", "MIT OR LGPL-2.1-or-later", "(MIT OR Apache-2.0) AND ISC"] {
        assert!(is_permissive(right, &allowed), "{right}");
    }
    for wrong in ["GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Apache-2.0) AND MPL-2.0", "LGPL-2.1 OR MPL-2.0", ""]
    {
        assert!(!is_permissive(wrong, &allowed), "{wrong}");
    }
}
