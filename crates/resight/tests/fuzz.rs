//! Every reader fed spoilt copies of every shipped file: an answer or an error in time, never a panic, and no number that is none.
//!
//! Some seconds by default; `RESIGHT_FUZZ_SECONDS=3600` runs for an hour, `RESIGHT_FUZZ_SEED` draws others. A failure prints seed, case
//! and file, and writes the spoilt copy below target/tmp.

use crate::fuzz_support::{Draw, files_below, setting, spoilt};
use resight::{GrayImage, formats, rig};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// No file of at most 2 MiB takes longer, also on a machine that does much besides.
const DEADLINE: Duration = Duration::from_secs(10);

/// A pose that is read holds numbers, and a covariance that could be one.
fn check_cameras(file: &formats::CameraFile) {
    for camera in &file.cameras {
        // Names may hold any letters.
        let pose = camera.placement.as_ref().map(|placement| &placement.b_from_a);
        let shown = format!("{:?} {pose:?}", camera.camera);
        assert!(!shown.contains("NaN"), "{shown}");
        let infinite = shown.contains(": inf") || shown.contains("[inf") || shown.contains("-inf");
        assert!(!infinite, "{shown}");
    }
}

/// What is done with one spoilt file.
fn read(path: &Path, bytes: &[u8], counts: &mut BTreeMap<&'static str, u64>) {
    // A file may call a camera so.
    let is_in_file = bytes.windows(3).any(|letters| letters == b"NaN");
    let mut count = |what, is_read: bool| {
        *counts.entry(what).or_default() += 1;
        *counts.entry("of them read").or_default() += u64::from(is_read);
    };
    match formats::read_cameras_from_bytes(path, bytes.to_vec()) {
        Ok(file) => {
            check_cameras(&file);
            for format in [formats::Format::Own, formats::Format::OpenCv, formats::Format::Kalibr] {
                let _ = formats::write_rig(&file, format);
            }
            count("cameras", true);
        }
        Err(fault) => {
            assert!(!fault.reason.is_empty());
            count("cameras", false);
        }
    }
    let target = formats::read_target_from_bytes(path, bytes.to_vec());
    if let Ok(file) = &target {
        let shown = format!("{:?}", file.target);
        assert!(!shown.contains("NaN") || is_in_file, "{shown}");
        // What passes for a target can be looked for, or is refused.
        let _ = resight::detect::Detector::new(&file.target);
    }
    count("targets", target.is_ok());
    count("pairs", rig::pairs::pairs_from_bytes(path, bytes).is_ok());
    let explained = formats::explain_from_bytes(path, bytes.to_vec());
    count("explanations", explained.is_ok());
    if let Ok(text) = explained {
        assert!(!text.contains("NaN") || is_in_file, "{text}");
    }
    if path.extension().is_some_and(|ending| ending == "png" || ending == "jpg") {
        count("pictures", GrayImage::decode(bytes).is_ok());
    }
}

#[test]
fn spoilt_files_are_read_or_refused() {
    let (seconds, seed) = (setting("RESIGHT_FUZZ_SECONDS", 15), setting("RESIGHT_FUZZ_SEED", 1));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata");
    let shipped: Vec<(PathBuf, Vec<u8>)> = files_below(&root)
        .into_iter()
        .map(|path| (path.clone(), std::fs::read(&path).expect("a shipped file")))
        .filter(|(_, bytes)| bytes.len() < 1 << 20)
        .collect();
    assert!(100 < shipped.len(), "{} files", shipped.len());
    let (began, mut case, mut slowest) = (Instant::now(), 0u64, Duration::ZERO);
    let mut counts = BTreeMap::new();
    while began.elapsed().as_secs() < seconds {
        let mut draw = Draw::of(seed, case);
        let (path, original) = &shipped[draw.below(shipped.len())];
        let other = &shipped[draw.below(shipped.len())].1;
        let bytes = spoilt(original, other, &mut draw);
        let call = Instant::now();
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(path, &bytes, &mut counts)));
        let took = call.elapsed();
        if done.is_err() || DEADLINE < took {
            let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{seed}-{case}"));
            std::fs::write(&kept, &bytes).expect("written");
            panic!(
                "seed {seed}, case {case}, a copy of {}: {took:?}, kept as {}",
                path.display(),
                kept.display()
            );
        }
        slowest = slowest.max(took);
        case += 1;
    }
    println!(
        "{case} spoilt copies of {} files, seed {seed}, the slowest {slowest:?}: {counts:?}",
        shipped.len()
    );
}
