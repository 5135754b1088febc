//! What the tests of files share: examples, goldens, poses along chains, and the comparison by pixels.

use resight_formats::core::{Pixel, Point, Pose};
use resight_formats::{
    CameraFile, Format, NamedCamera, OutFile, Placement, WriteError, read_cameras, read_rig, write_cameras,
};
use std::path::{Path, PathBuf};

/// Returns the path of a file of testdata/formats.
pub fn example(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats").join(name)
}

pub fn text(name: &str) -> String {
    std::fs::read_to_string(example(name)).unwrap()
}

#[track_caller]
pub fn read(name: &str, format: Format) -> CameraFile {
    let file = read_cameras(example(name)).unwrap_or_else(|reason| panic!("{reason}"));
    assert_eq!(file.format, format, "{name}");
    file
}

pub fn cameras(name: &str) -> Vec<NamedCamera> {
    read_cameras(example(name)).unwrap().cameras
}

pub fn golden(folder: &str) -> PathBuf {
    example("golden/rigs").join(folder)
}

/// Files, those in folders below included, with their paths from here.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries.flat_map(|p| if p.is_dir() { files_below(&p) } else { vec![p] }).collect()
}

/// The folder holds exactly these files; set RESIGHT_BLESS to write them anew, then read the difference.
#[track_caller]
pub fn assert_golden(folder: &str, files: &[OutFile]) {
    let folder = golden(folder);
    for file in files {
        let path = folder.join(&file.name);
        if std::env::var_os("RESIGHT_BLESS").is_some() {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &file.text).unwrap();
        }
        let expected = std::fs::read_to_string(&path).unwrap_or_default();
        assert_eq!(file.text, expected, "{}", path.display());
    }
    assert_eq!(files_below(&folder).len(), files.len(), "{}", folder.display());
}

pub fn read_back(folder: &str) -> CameraFile {
    read_rig(&[golden(folder)]).unwrap()
}

/// `b_from_a` along any chain of the cameras' placements.
#[track_caller]
pub fn between(cameras: &[NamedCamera], b: &str, a: &str) -> Pose {
    chained(cameras.iter().filter_map(|c| c.placement.as_ref()), b, a)
}

/// `b_from_a` along any chain of placements: written here anew, so that it does not share the library's mistakes.
#[track_caller]
pub fn chained<'a>(placements: impl Iterator<Item = &'a Placement>, b: &str, a: &str) -> Pose {
    let all: Vec<&Placement> = placements.collect();
    let mut known = vec![(a.to_owned(), Pose::identity())];
    loop {
        if let Some((_, pose)) = known.iter().find(|(frame, _)| frame == b) {
            return *pose;
        }
        let before = known.len();
        for p in &all {
            let of = |frame: &str| known.iter().find(|(f, _)| f == frame).map(|(_, pose)| *pose);
            match (of(&p.a), of(&p.b)) {
                (Some(a_from), None) => known.push((p.b.clone(), p.b_from_a * a_from)),
                (None, Some(b_from)) => known.push((p.a.clone(), p.b_from_a.inverse() * b_from)),
                _ => {}
            }
        }
        assert!(before < known.len(), "nothing joins {b} to {a}");
    }
}

/// Points that a camera sees all over its image, in the frame of the camera, with their pixels.
pub fn seen_points(camera: &NamedCamera) -> Vec<(Point, Pixel)> {
    let size = camera.camera.size.unwrap();
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let mut points = Vec::new();
    for (i, (u, v)) in
        [(0.1, 0.15), (0.5, 0.2), (0.85, 0.1), (0.2, 0.5), (0.55, 0.45), (0.9, 0.6), (0.15, 0.9), (0.6, 0.85)]
            .into_iter()
            .enumerate()
    {
        let x =
            camera.camera.bearing(&Pixel::new(u * w, v * h)).unwrap().into_inner() * (1.0 + 0.3 * i as f64);
        points.push((x, camera.camera.project(&x).unwrap()));
    }
    points
}

/// The frame among the placements that is no camera.
pub fn root_of(cameras: &[NamedCamera]) -> Option<String> {
    let frames = cameras.iter().filter_map(|c| c.placement.as_ref()).flat_map(|p| [p.a.clone(), p.b.clone()]);
    frames.into_iter().find(|frame| cameras.iter().all(|c| c.name != *frame))
}

/// The same lens and the same poses, between all cameras and to the frame they stand in, whatever it is called.
#[track_caller]
pub fn assert_same_rig(read: &[NamedCamera], written: &[NamedCamera], names: &[(&str, &str)]) {
    assert_eq!(read.len(), written.len());
    let name_of =
        |name: &str| names.iter().find(|(w, _)| *w == name).map_or(name.to_owned(), |(_, r)| (*r).to_owned());
    for w in written {
        let r = read.iter().find(|c| c.name == name_of(&w.name)).unwrap_or_else(|| panic!("no {}", w.name));
        assert_eq!(r.camera.size, w.camera.size);
        for (x, pixel) in seen_points(w) {
            // A principal point shifted by half a pixel and back, a rotation through a quaternion or a vector: 1e-13 of
            // the pixel, as many as 2000 of them.
            assert!((r.camera.project(&x).unwrap() - pixel).norm() < 1e-9, "{}", w.name);
        }
        let first = (written[0].name.clone(), name_of(&written[0].name));
        let roots = [Some(first), root_of(written).zip(root_of(read))];
        for (ours, theirs) in roots.into_iter().flatten() {
            let (ours, theirs) = (between(written, &w.name, &ours), between(read, &r.name, &theirs));
            assert!(ours.angle_to_rad(&theirs) < 1e-12, "{}", w.name);
            assert!((ours.translation - theirs.translation).norm() < 1e-12, "{}", w.name);
        }
    }
}

#[track_caller]
pub fn round_trip(source: &str, format: Format, folder: &str, names: &[(&str, &str)]) -> CameraFile {
    let written = cameras(source);
    let files = write_cameras(&written, format).unwrap();
    assert_golden(folder, &files);
    let read = read_back(folder);
    assert_same_rig(&read.cameras, &written, names);
    read
}

pub fn refusal(source: &str, format: Format) -> String {
    let WriteError(reason) = write_cameras(&cameras(source), format).unwrap_err();
    reason
}

#[track_caller]
pub fn assert_says(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "`{word}` is not in: {text}");
    }
}
