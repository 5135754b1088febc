//! Tells the tests whether there are recordings, and an optimised program from which commit it was built.

use std::path::Path;
use std::process::Command;

#[path = "../core/build.rs"]
mod recordings;

fn main() {
    recordings::main();
    println!("cargo::rerun-if-env-changed=RESIGHT_COMMIT");
    // A development build would be linked anew after each commit.
    let is_released = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let given = std::env::var("RESIGHT_COMMIT").ok().filter(|commit| !commit.is_empty());
    let commit = given.or_else(|| if is_released { commit() } else { None });
    println!("cargo::rustc-env=RESIGHT_BUILT_FROM={}", commit.map_or(String::new(), |c| format!(" ({c})")));
}

/// Returns the commit of the checkout and its date, or none outside a checkout.
fn commit() -> Option<String> {
    let git = Path::new("../../.git");
    for file in ["HEAD", "logs/HEAD"].map(|name| git.join(name)).iter().filter(|file| file.exists()) {
        println!("cargo::rerun-if-changed={}", file.display());
    }
    git.exists().then_some(())?;
    let words = ["log", "-1", "--format=%h, %cd", "--date=format-local:%Y-%m-%d", "--abbrev=9"];
    let run = Command::new("git").args(words).env("TZ", "UTC").output().ok()?;
    run.status.success().then(|| String::from_utf8_lossy(&run.stdout).trim().to_string())
}
