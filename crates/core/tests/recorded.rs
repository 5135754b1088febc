//! Where recordings lie that the repository does not hold. Tests that need one are ignored where `build.rs` saw no RESIGHT_DATA.

use std::path::PathBuf;

fn below(variable: &str, name: &str) -> PathBuf {
    let root =
        std::env::var_os(variable).unwrap_or_else(|| panic!("{variable} is not set: ./test.sh sets it"));
    let folder = PathBuf::from(root).join(name);
    assert!(folder.is_dir(), "{variable} is set, but {} is missing", folder.display());
    folder
}

/// The folder of a set of recordings.
#[allow(dead_code)] // Not every crate reads sets.
pub fn recorded(set: &str) -> PathBuf {
    below("RESIGHT_DATA", set)
}

/// The folder of a recorded video's frames (`scripts/unpack_videos.sh`).
#[allow(dead_code)] // Not every crate reads videos.
pub fn recorded_frames(camera: &str) -> PathBuf {
    below("RESIGHT_FRAMES", camera)
}

/// The frames of one camera, in order.
#[allow(dead_code)] // Not every crate reads videos.
pub fn frames(camera: &str) -> Vec<PathBuf> {
    let folder = recorded_frames(camera);
    let mut all: Vec<PathBuf> =
        std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("a file").path()).collect();
    all.retain(|path| path.extension().is_some_and(|e| e == "png" || e == "jpg"));
    all.sort();
    all
}
