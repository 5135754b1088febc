//! Landmarks on recorded images: photographs rotated by exact homographies, and cameras that stood still while people moved.

use crate::landmarks_support::{camera, exposed, photographed, turned};
use crate::recorded::{frames, recorded};
use nalgebra::{Matrix3, Rotation3};
use resight::GrayImage;
use resight::landmarks::Landmarks;
use resight::render::Pcg;

/// Off by, degrees, and over its own standard deviations.
fn error(landmark_observation: &resight::landmarks::LandmarkObservation, truth: &Matrix3<f64>) -> (f64, f64) {
    let off = truth * landmark_observation.relative_rotation.now_from_reference.transpose();
    let e = Rotation3::from_matrix_unchecked(off).scaled_axis();
    let inverse = landmark_observation.relative_rotation.covariance.try_inverse().expect("a covariance");
    (e.norm().to_degrees(), e.dot(&(inverse * e)).sqrt())
}

/// A photograph of a street or a room, seen again by a camera that turned, with other light and noise.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn photographs_turned_by_known_angles() {
    let photographs = [
        ("apriltag_detection_truth", "34085369442_304b6bafd9_c.jpg"),
        ("opencv_stereo_chessboard", "left05.jpg"),
        ("opencv_stereo_chessboard", "right13.jpg"),
    ];
    for (set, name) in photographs {
        let folder = recorded(set);
        let image = GrayImage::read(folder.join(name)).expect("a photograph");
        let camera = camera(image.width_px / 2, image.height_px / 2, 0.45 * f64::from(image.width_px));
        let mut chance = Pcg::new(5);
        let still = photographed(&image, &camera, &Matrix3::identity());
        let reference = exposed(&camera, &still, 1.0, 1.0, &mut chance);
        let landmarks = Landmarks::new(&reference, &camera).expect("landmarks");
        for degrees in
            [[0.02, 0.0, 0.0], [0.0, -0.2, 0.0], [0.0, 0.0, 0.3], [0.5, -1.0, 0.7], [2.0, 4.0, -2.0]]
        {
            let truth = turned(degrees);
            for (light, noise) in [(1.0, 1.0), (0.6, 3.0), (1.2, 2.0)] {
                let seen =
                    exposed(&camera, &photographed(&image, &camera, &truth), light, noise, &mut chance);
                let landmark_observation =
                    landmarks.observe(&seen, None).unwrap_or_else(|e| panic!("{name} {degrees:?}: {e}"));
                let (off, sigmas) = error(&landmark_observation, &truth);
                println!(
                    "{name} {degrees:?} light {light}: off by {off:.5}°, {sigmas:.1} σ, {} of {}",
                    landmark_observation.relative_rotation.used.len(),
                    landmark_observation.in_view
                );
                assert!(off < 0.02 && sigmas < 6.0, "{name} {degrees:?}: {off}° {sigmas}");
            }
        }
    }
}

/// As a camera stores it, with JPEG's quality 75.
fn stored(image: &GrayImage) -> GrayImage {
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 75);
    let (width, height) = (image.width_px, image.height_px);
    encoder.encode(&image.data, width, height, image::ExtendedColorType::L8).expect("JPEG");
    let data = image::load_from_memory(&bytes).expect("JPEG").to_luma8().into_raw();
    GrayImage { width_px: width, height_px: height, data }
}

/// Turns of less than a pixel, which shift all landmarks by nearly the same fraction of one: with noise, stored as JPEG, and with more
/// light, which clips what is bright. Eight turns each of three photographs.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn small_turns_of_photographs_are_as_sure_as_reported() {
    let photographs = [
        ("apriltag_detection_truth", "34085369442_304b6bafd9_c.jpg"),
        ("apriltag_detection_truth", "33369213973_9d9bb4cc96_c.jpg"),
        ("opencv_stereo_chessboard", "right13.jpg"),
    ];
    let mut chance = Pcg::new(6);
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for (set, name) in photographs {
        let folder = recorded(set);
        let image = GrayImage::read(folder.join(name)).expect("a photograph");
        let camera = camera(image.width_px / 2, image.height_px / 2, 0.45 * f64::from(image.width_px));
        let still = photographed(&image, &camera, &Matrix3::identity());
        for _ in 0..8 {
            let truth = turned([(); 3].map(|()| chance.between(-0.1, 0.1)));
            let moved = photographed(&image, &camera, &truth);
            let mut taken = |grey: &[f64], light: f64| exposed(&camera, grey, light, 2.0, &mut chance);
            let pairs = [
                (taken(&still, 1.0), taken(&moved, 1.0)),
                (stored(&taken(&still, 1.0)), stored(&taken(&moved, 1.0))),
                (taken(&still, 1.0), taken(&moved, 1.2)),
            ];
            for (all, (reference, now)) in all.iter_mut().zip(pairs) {
                let landmarks = Landmarks::new(&reference, &camera).expect("landmarks");
                let landmark_observation = landmarks.observe(&now, None).expect("a turn");
                all.push(error(&landmark_observation, &truth).1.powi(2));
            }
        }
    }
    for (what, all) in ["noise", "JPEG", "light"].iter().zip(all) {
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let within = all.iter().filter(|nees| **nees < 7.815).count();
        println!("{what}: NEES {mean:.2}, {within} of {} within 95 %", all.len());
        assert!((1.5..4.2).contains(&mean), "{what}: {mean}");
    }
}

/// Four webcams before which somebody waves a board: none of them turned, by the first frame as reference.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn cameras_that_stood_still_did_not_turn() {
    for name in ["cam_0", "cam_1", "cam_2", "cam_3"] {
        let frames = frames(name);
        let first = GrayImage::read(&frames[0]).expect("a frame");
        let camera = camera(first.width_px, first.height_px, 0.8 * f64::from(first.width_px));
        let landmarks = Landmarks::new(&first, &camera).expect("landmarks");
        let (mut near, mut worst, mut seen) = (None, 0.0f64, 0);
        for path in &frames[1..] {
            let image = GrayImage::read(path).expect("a frame");
            let Ok(landmark_observation) = landmarks.observe(&image, near.as_ref()) else { continue };
            let (relative_rotation, _) = landmark_observation.relative_rotation.old_from_new();
            if landmark_observation.relative_rotation.is_consistent() {
                (worst, seen) = (worst.max(relative_rotation.xy().norm().to_degrees()), seen + 1);
            }
            near = Some(landmark_observation.relative_rotation.now_from_reference);
        }
        println!(
            "{name}: {seen} of {} frames, {worst:.4}° at most, {} landmarks",
            frames.len() - 1,
            landmarks.count()
        );
        assert!(2 * seen > frames.len() && worst < 0.05, "{name}: {seen} of {}, {worst}°", frames.len());
    }
}
