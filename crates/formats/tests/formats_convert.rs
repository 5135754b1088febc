//! Conversions between all formats: what is kept agrees, what is not is said, and where cameras stand is drawn.

use resight_formats::core::{Matrix6, Pose};
use resight_formats::{CameraFile, Conversion, Format, Placement, convert, read_rig, scene};
use std::path::PathBuf;

fn rig_of(name: &str) -> CameraFile {
    read_rig(&[PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats").join(name)]).unwrap()
}

#[track_caller]
fn assert_lost(conversion: &Conversion, sentences: &[&str]) {
    let lost = &conversion.lost;
    assert_eq!(lost.len(), sentences.len(), "{lost:#?}");
    for (found, wanted) in lost.iter().zip(sentences) {
        assert!(found.contains(wanted), "`{wanted}` is not in `{found}`");
    }
}

/// Every format that can be written, from every kind of rig: an answer that reads back the same, or a refusal in words.
#[test]
fn every_pair_converts_or_says_why_not() {
    let mut converted = 0;
    for source in [
        "placed_rig.toml",
        "placed_wide.toml",
        "kalibr_imucam.yaml",
        "opencv_stereo.yml",
        "kitti_object.txt",
        "nuscenes",
        "euroc_tree",
        "basalt.json",
        "caliscope.toml",
        "own_photogrammetric.toml",
        "left.cameramodel",
    ] {
        let rig = rig_of(source);
        for (format, words) in Format::writable() {
            assert!(!words.is_empty(), "{format:?} has no word for --to");
            assert_eq!(Format::to_write(words[0]), Some(format));
            match convert(&rig, format, None) {
                Ok(conversion) => {
                    assert!(!conversion.files.is_empty());
                    converted += 1;
                }
                Err(reason) => {
                    let reason = reason.to_string();
                    // These two are our own faults, not a format's limits.
                    assert!(!reason.contains("read again"), "{source} to {format:?}: {reason}");
                    assert!(!reason.contains("reads back"), "{source} to {format:?}: {reason}");
                }
            }
        }
    }
    assert!(80 < converted, "only {converted} pairs converted");
}

#[test]
fn what_is_not_kept_is_said() {
    let imu = rig_of("kalibr_imucam.yaml");
    assert_lost(&convert(&imu, Format::Own, None).unwrap(), &[]);
    assert_lost(&convert(&imu, Format::Kalibr, None).unwrap(), &[]);
    let euroc = convert(&imu, Format::Euroc, None).unwrap();
    assert_lost(&euroc, &["frame `imu`, which is `body` there", "clock offset of `cam0` (1.000 ms)"]);
    assert_lost(
        &convert(&imu, Format::RosCameraInfo, None).unwrap(),
        &["all poses: this format holds intrinsics only", "clock offset"],
    );
    assert_lost(&convert(&imu, Format::OpenCv, None).unwrap(), &["frame `imu`", "clock offset"]);
    let rig = rig_of("placed_rig.toml");
    assert_lost(
        &convert(&rig, Format::Urdf, None).unwrap(),
        &["the intrinsics: this format holds poses only"],
    );
    let raw = rig_of("kitti_raw");
    let sizes = ["image size of camera `cam0`", "image size of camera `cam1`"];
    assert_lost(&convert(&raw, Format::Kitti, None).unwrap(), &sizes);
    let rect = ["image size", "image size", "`cam0_unrectified`", "frame `imu`"];
    assert_lost(&convert(&raw, Format::KittiOdometry, None).unwrap(), &rect);
    let stereo = rig_of("opencv_stereo.yml");
    assert_lost(&convert(&stereo, Format::OpenCvXml, None).unwrap(), &[]);
    let mut named = rig_of("kalibr_imucam.yaml");
    named.cameras[1].name = "right".into();
    named.cameras[1].placement.as_mut().unwrap().b = "right".into();
    assert_lost(
        &convert(&named, Format::Kalibr, None).unwrap(),
        &["name of camera `right`, which is `cam1` there"],
    );
}

/// A covariance goes along to our own files, is said to be lost elsewhere, and is not invented through other frames.
#[test]
fn covariances_are_kept_or_said() {
    let mut rig = rig_of("placed_rig.toml");
    let variance = Matrix6::from_diagonal_element(1e-8);
    for camera in &mut rig.cameras {
        camera.placement.as_mut().unwrap().covariance = Some(variance);
    }
    assert_lost(&convert(&rig, Format::Own, None).unwrap(), &[]);
    let urdf = convert(&rig, Format::Urdf, None).unwrap();
    assert_lost(&urdf, &["the intrinsics", "the covariance of 3 poses; only resight files"]);
    let moved = convert(&rig, Format::Own, Some("left")).unwrap();
    assert_lost(&moved, &["covariance of `right` against `world`", "covariance of `world` against `tele`"]);
}

/// Against a camera, every other one is placed in it, and the old parent stays as a frame.
#[test]
fn a_reference_changes_the_frame_and_not_the_rig() {
    let rig = rig_of("placed_rig.toml");
    let text = convert(&rig, Format::Own, Some("right")).unwrap().files[0].text.clone();
    let back = resight_formats::read_cameras_from_bytes(PathBuf::from("x"), text.into_bytes()).unwrap();
    let place = |rig: &CameraFile, name: &str| -> Placement {
        rig.cameras.iter().find(|c| c.name == name).unwrap().placement.clone().unwrap()
    };
    let (left, right) = (place(&rig, "left").b_from_a, place(&rig, "right").b_from_a);
    let moved = place(&back, "left");
    assert_eq!((moved.b.as_str(), moved.a.as_str()), ("left", "right"));
    let left_from_right = left * right.inverse();
    assert!((moved.b_from_a.translation - left_from_right.translation).norm() < 1e-14);
    assert!(moved.b_from_a.angle_to_rad(&left_from_right) < 1e-14);
    assert!(back.cameras.iter().all(|c| c.name != "right" || c.placement.is_none()));
    assert_eq!((back.relations[0].b.as_str(), back.relations[0].a.as_str()), ("right", "world"));
    let reason = convert(&rig, Format::Own, Some("wrold")).unwrap_err().to_string();
    assert_eq!(reason, "no frame `wrold`; there are left, right, tele, world");
}

/// M2 stands at −Rᵀ T = (0.0752, 0, −0.0564) and looks along the third row of R.
#[test]
fn the_scene_says_where_cameras_stand_and_look() {
    let scene = scene(&rig_of("opencv_stereo.yml"), None).unwrap();
    assert_eq!(scene.reference, "M1");
    let text = scene.text();
    for sentence in [
        "Cameras in frame `M1` (x right, y down, z forward), metres:",
        "2 M2      at (0.0752, 0.0000, -0.0564)   looks along (0.6000, 0.0000, 0.8000)",
        "Sketch: x to the right, z up",
    ] {
        assert!(text.contains(sentence), "`{sentence}` is not in:\n{text}");
    }
    // The second stands to the right of the first and behind it, which is below on paper.
    let lines: Vec<&str> = text.lines().skip_while(|l| !l.starts_with("Sketch")).skip(1).collect();
    let find = |sign: char| {
        let at =
            |(row, line): (usize, &&str)| line.chars().position(|c| c == sign).map(|column| (row, column));
        lines.iter().enumerate().find_map(at).unwrap_or_else(|| panic!("no {sign} in:\n{text}"))
    };
    let ((row1, column1), (row2, column2)) = (find('1'), find('2'));
    assert!(column1 < column2 && row1 < row2, "{text}");
    assert_eq!((find('↑'), find('↗')), ((row1 - 1, column1), (row2 - 1, column2 + 2)), "{text}");
}

/// Cameras that stand in one point, or that nothing joins, make no sketch and no nonsense.
#[test]
fn a_scene_without_extent_has_no_sketch() {
    let mut rig = rig_of("opencv_stereo.yml");
    rig.cameras[1].placement = None;
    let text = scene(&rig, None).unwrap().text();
    assert!(text.contains("M2      no pose joins it to `M1`") && !text.contains("Sketch"), "{text}");
    let b_from_a = Pose::identity();
    let (b, a) = ("M2".into(), "M1".into());
    rig.cameras[1].placement = Some(Placement { b, a, b_from_a, covariance: None });
    let text = scene(&rig, None).unwrap().text();
    assert!(text.contains("2 M2      at (0.0000, 0.0000, 0.0000)") && !text.contains("Sketch"), "{text}");
}
