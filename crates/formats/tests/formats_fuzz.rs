//! Whatever the bytes, reading ends with an answer or a refusal: no panic, no unbounded work.

use proptest::prelude::*;
use resight_formats::{
    CameraFile, Format, NamedCamera, OutFile, convert, explain_from_bytes, read_cameras_from_bytes,
    read_target_from_bytes, write_cameras,
};
use std::path::{Path, PathBuf};

fn examples() -> Vec<(PathBuf, Vec<u8>)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats");
    let mut paths = crate::support::files_below(&folder);
    paths.sort();
    paths.into_iter().map(|p| (p.clone(), std::fs::read(&p).unwrap())).collect()
}

/// Both readers; whatever is accepted must be usable without a surprise.
fn read_both(path: &Path, bytes: &[u8]) {
    // Files of poses alone are explained too.
    let _ = explain_from_bytes(path, bytes.to_vec());
    if let Ok(file) = read_cameras_from_bytes(path, bytes.to_vec()) {
        let said = explain_from_bytes(path, bytes.to_vec()).unwrap();
        assert!(!said.contains("NaN"), "{said}");
        write_all(&file.cameras);
        write_pictures(&file.cameras);
        convert_all(&file);
        for camera in file.cameras {
            assert!(camera.camera.parameters().iter().all(|(_, x)| x.is_finite()));
            assert!(
                camera.placement.is_none_or(|p| p.b_from_a.matrix().iter().flatten().all(|x| x.is_finite()))
            );
        }
    }
    if let Ok(file) = read_target_from_bytes(path, bytes.to_vec()) {
        assert!(file.target.features().len() <= 4_000_000);
    }
}

/// What one of our writers accepts, our reader reads: the same lenses, in the same order.
fn write_all(cameras: &[NamedCamera]) {
    for format in [
        Format::Own,
        Format::OpenCv,
        Format::RosCameraInfo,
        Format::Kalibr,
        Format::Caliscope,
        Format::Aniposelib,
        Format::Multical,
        Format::McCalib,
        Format::Mrcal,
        Format::PhotonVision,
    ] {
        let Ok(files) = write_cameras(cameras, format) else { continue };
        let [OutFile { text, .. }] = files.as_slice() else { continue };
        let back = read_cameras_from_bytes(Path::new("x"), text.clone().into_bytes());
        let back = back.unwrap_or_else(|e| panic!("{format:?}: {e}\n{text}"));
        assert_eq!(back.format, format, "{text}");
        assert_eq!(back.cameras.len(), cameras.len());
        for (a, b) in back.cameras.iter().zip(cameras) {
            assert_eq!(a.camera.size, b.camera.size);
            assert!(format != Format::Own || (a.name == b.name && a.camera == b.camera), "{text}");
        }
    }
}

/// The formats of robots and data sets: what is accepted reads back the same, in the same places.
fn convert_all(rig: &CameraFile) {
    for format in [
        Format::Euroc,
        Format::Basalt,
        Format::Kitti,
        Format::KittiOdometry,
        Format::NuScenes,
        Format::StaticTransforms,
        Format::StaticTransformsYaml,
        Format::Urdf,
        Format::OpenCvXml,
        Format::NerfTransforms,
    ] {
        if let Err(reason) = convert(rig, format, None) {
            let reason = reason.to_string();
            let ours = reason.contains("read again") || reason.contains("reads back");
            assert!(!ours, "{format:?}: {reason}\n{rig:?}");
        }
    }
}

/// What is only written must not panic either.
fn write_pictures(cameras: &[NamedCamera]) {
    for format in [Format::Colmap, Format::FSpy, Format::Blender, Format::Gltf, Format::EasyHandeyeOnHand] {
        if let Ok(files) = write_cameras(cameras, format) {
            assert!(files.iter().all(|f| !f.text.contains("NaN") && !f.text.contains("inf")), "{files:?}");
        }
    }
}

/// What people and disks do to files.
#[derive(Debug, Clone)]
enum Damage {
    Cut(prop::sample::Index),
    Byte(prop::sample::Index, u8),
    Remove(prop::sample::Index, usize),
    Repeat(prop::sample::Index, usize),
    Word(prop::sample::Index, &'static str),
}

fn damage() -> impl Strategy<Value = Damage> {
    let words = prop::sample::select(vec![
        "nan",
        ".Nan",
        "1e999",
        "-1",
        "0",
        "null",
        "[",
        "]",
        "{",
        "}",
        ":",
        "\"",
        "'",
        "#",
        "\n",
        "4294967295",
        "é",
        "&a",
        "*a",
        "- ",
        "<",
    ]);
    prop_oneof![
        any::<prop::sample::Index>().prop_map(Damage::Cut),
        (any::<prop::sample::Index>(), any::<u8>()).prop_map(|(i, b)| Damage::Byte(i, b)),
        (any::<prop::sample::Index>(), 1..40usize).prop_map(|(i, n)| Damage::Remove(i, n)),
        (any::<prop::sample::Index>(), 1..40usize).prop_map(|(i, n)| Damage::Repeat(i, n)),
        (any::<prop::sample::Index>(), words).prop_map(|(i, w)| Damage::Word(i, w)),
    ]
}

fn damaged(mut bytes: Vec<u8>, damages: &[Damage]) -> Vec<u8> {
    for damage in damages {
        if bytes.is_empty() {
            return bytes;
        }
        let n = bytes.len();
        match damage {
            Damage::Cut(i) => bytes.truncate(i.index(n)),
            Damage::Byte(i, b) => bytes[i.index(n)] = *b,
            Damage::Remove(i, count) => drop(bytes.drain(i.index(n)..(i.index(n) + count).min(n))),
            Damage::Repeat(i, count) => {
                let piece = bytes[i.index(n)..(i.index(n) + count).min(n)].to_vec();
                bytes.splice(i.index(n)..i.index(n), piece);
            }
            Damage::Word(i, word) => drop(bytes.splice(i.index(n)..i.index(n), word.bytes())),
        }
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        read_both(Path::new("x"), &bytes);
    }

    #[test]
    fn random_text_never_panics(text in "[ \\[\\]{}:,=\"'#%<>/a-z0-9.\\n*&!|-]{0,120}") {
        read_both(Path::new("x"), text.as_bytes());
    }

    #[test]
    fn damaged_files_never_panic(which in any::<prop::sample::Index>(), damages in prop::collection::vec(damage(), 1..5)) {
        let all = examples();
        let (path, bytes) = &all[which.index(all.len())];
        read_both(path, &damaged(bytes.clone(), &damages));
    }
}
