//! Landmarks in rendered images: the rotation since the reference against truth, how uncertain it is, and when it is not reported at all.

use crate::landmarks_support::{blurred, camera, exposed, pass_by, picture, picture_with_floor, turned};
use nalgebra::{Matrix3, Rotation3, Vector3};
use resight::GrayImage;
use resight::core::Camera;
use resight::landmarks::{LandmarkObservation, Landmarks, NotObserved};
use resight::render::Pcg;

const NOISE: f64 = 2.0;

fn small() -> Camera {
    camera(640, 480, 550.0)
}

/// A reference image of a scene, with noise.
fn reference(camera: &Camera, seed: u64, chance: &mut Pcg) -> (GrayImage, Landmarks) {
    let image = exposed(camera, &picture(camera, &Matrix3::identity(), seed), 1.0, NOISE, chance);
    let landmarks = Landmarks::new(&image, camera).expect("landmarks");
    (image, landmarks)
}

/// Error of the rotation, degrees about each axis, and its square over the covariance.
fn error(
    landmark_observation: &LandmarkObservation,
    now_from_reference: &Matrix3<f64>,
) -> (Vector3<f64>, f64) {
    let off = now_from_reference * landmark_observation.relative_rotation.now_from_reference.transpose();
    let e = Rotation3::from_matrix_unchecked(off).scaled_axis();
    let nees =
        e.dot(&landmark_observation.relative_rotation.covariance.cholesky().expect("a covariance").solve(&e));
    (e.map(f64::to_degrees), nees)
}

/// From a fiftieth of a degree to five about every axis, with the last rotation known and without. A pixel is 0.1° here: all are right to
/// a hundredth of one, and within five of their own standard deviations.
#[test]
fn turns_about_every_axis_are_measured() {
    let camera = small();
    let mut chance = Pcg::new(0x1a1);
    let (_, landmarks) = reference(&camera, 7, &mut chance);
    for (axis, degrees) in (0..3).flat_map(|axis| [0.02, -0.3, 5.0].map(|degrees| (axis, degrees))) {
        let mut about = [0.0; 3];
        about[axis] = degrees;
        let truth = turned(about);
        let image = exposed(&camera, &picture(&camera, &truth, 7), 1.0, NOISE, &mut chance);
        for near in [None, Some(turned(about.map(|x| 0.95 * x)))] {
            let landmark_observation = landmarks.observe(&image, near.as_ref()).expect("a turn");
            let (e, nees) = error(&landmark_observation, &truth);
            let (reported, sigma) = landmark_observation.relative_rotation.old_from_new();
            println!("{about:?}: off by {:.5}° ± {:.5}°", e.norm(), sigma.trace().sqrt().to_degrees());
            assert!(e.xy().norm() < 0.001 && e.z.abs() < 0.003 && nees < 25.0, "{about:?}: {e} {nees}");
            assert!((reported[axis].to_degrees() - degrees).abs() < 0.003, "{about:?}: {reported}");
            assert!(landmark_observation.relative_rotation.is_consistent());
        }
    }
}

/// A camera that rotated right by 0.5° has the image 0.5° · 9.6 px/° = 4.8 px farther left.
#[test]
fn the_shift_of_the_image_is_reported() {
    let camera = small();
    let mut chance = Pcg::new(0x1a2);
    let (_, landmarks) = reference(&camera, 8, &mut chance);
    let image = exposed(&camera, &picture(&camera, &turned([0.0, 0.5, 0.0]), 8), 1.0, NOISE, &mut chance);
    let shift = landmarks.observe(&image, None).expect("a turn").shift.expect("a shift");
    let expected = -550.0 * 0.5f64.to_radians().tan();
    assert!((shift.px.x - expected).abs() < 0.02 && shift.px.y.abs() < 0.02, "{}", shift.px);
    let sigma = shift.covariance_px2.diagonal().map(f64::sqrt);
    assert!(0.001 < sigma.x && sigma.x < 0.02, "{sigma}");
}

/// Twenty scenes, each with a reference and a turn of its own: the mean of χ²₃ is 3 ± 0.55, and within three times that here (of these scenes
/// 2.01). Sigmas that are off by a factor of two either way cannot pass: they make it 12, or 0.75.
#[test]
fn covariances_cover_the_errors() {
    let camera = small();
    let mut chance = Pcg::new(0x1a3);
    let mut all = Vec::new();
    for seed in 100..120 {
        let (_, landmarks) = reference(&camera, seed, &mut chance);
        let truth = turned([(); 3].map(|()| chance.between(-1.0, 1.0)));
        let image = exposed(&camera, &picture(&camera, &truth, seed), 1.0, NOISE, &mut chance);
        all.push(error(&landmarks.observe(&image, None).expect("a turn"), &truth).1);
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    println!("NEES {mean:.2}: {all:.1?}");
    assert!((3.0 - 3.0 * 0.55..3.0 + 3.0 * 0.55).contains(&mean), "{mean}");
}

/// A curve that lifts what is dark bends down, one that presses it bends up; the more, the more.
#[test]
fn a_bent_tone_curve_is_reported_by_its_sign() {
    let camera = small();
    let mut chance = Pcg::new(0x1a9);
    let grey = picture(&camera, &Matrix3::identity(), 210);
    let reference = exposed(&camera, &grey, 1.0, 1.0, &mut chance);
    let landmarks = Landmarks::new(&reference, &camera).expect("landmarks");
    let mut bend = |gamma: f64| {
        let developed: Vec<f64> = grey.iter().map(|g| 255.0 * (g / 255.0).max(0.0).powf(gamma)).collect();
        let image = exposed(&camera, &developed, 1.0, 1.0, &mut chance);
        landmarks.observe(&image, None).expect("a turn").relative_rotation.bend
    };
    let [lifted, half, straight, pressed] = [0.6, 0.8, 1.0, 1.6].map(&mut bend);
    println!("{lifted:.3} {half:.3} {straight:.3} {pressed:.3}");
    assert!(lifted < half && half < straight && straight < pressed, "{lifted} {half} {straight} {pressed}");
    assert!(half < -0.05 && 0.05 < pressed && straight.abs() < 0.05, "{half} {straight} {pressed}");
}

/// Noise alone: what each landmark is said to err by, it errs by, so that their common factor is one. Grey values read between pixels
/// err as their neighbours do; taken for independent, the factor is above two.
#[test]
fn landmarks_err_as_much_as_noise_makes_them() {
    let camera = small();
    let mut chance = Pcg::new(0x1a8);
    let mut sum = 0.0;
    for seed in 200..204 {
        let grey = picture(&camera, &Matrix3::identity(), seed);
        let reference = exposed(&camera, &grey, 1.0, 5.0, &mut chance);
        let landmarks = Landmarks::new(&reference, &camera).expect("landmarks");
        let image = exposed(&camera, &grey, 1.0, 5.0, &mut chance);
        sum += landmarks.observe(&image, None).expect("a turn").relative_rotation.noise_factor / 4.0;
    }
    println!("factor {sum:.2}");
    assert!((0.7..1.5).contains(&sum), "{sum}");
}

#[test]
fn light_noise_and_blur_are_borne() {
    let camera = small();
    let mut chance = Pcg::new(0x1a4);
    let (_, landmarks) = reference(&camera, 9, &mut chance);
    let truth = turned([0.2, -0.4, 0.3]);
    let seen = picture(&camera, &truth, 9);
    let soft = blurred(&seen, &camera);
    for (light, noise, grey) in [(0.5, 2.0, &seen), (1.5, 2.0, &seen), (1.0, 10.0, &seen), (0.7, 4.0, &soft)]
    {
        let image = exposed(&camera, grey, light, noise, &mut chance);
        let landmark_observation = landmarks.observe(&image, None).expect("a turn");
        let (e, nees) = error(&landmark_observation, &truth);
        println!("light {light}, noise {noise}: off by {:.5}°, NEES {nees:.1}", e.norm());
        assert!(e.norm() < 0.01 && nees < 25.0, "{light} {noise}: {e} {nees}");
    }
}

/// Something crosses the image, a fifth of it, three pixels a frame: the rotation stays where it is.
#[test]
fn passers_by_turn_nothing() {
    let camera = small();
    let mut chance = Pcg::new(0x1a5);
    let still = picture(&camera, &Matrix3::identity(), 10);
    let (_, landmarks) = reference(&camera, 10, &mut chance);
    let mut near = None;
    for frame in 0..40 {
        let mut image = exposed(&camera, &still, 1.0, NOISE, &mut chance);
        pass_by(&mut image, (100 + 3 * frame, 40), (160, 384), 99);
        let landmark_observation = landmarks.observe(&image, near.as_ref()).expect("a turn");
        let (e, nees) = error(&landmark_observation, &Matrix3::identity());
        assert!(
            landmark_observation.relative_rotation.is_consistent() && e.norm() < 0.003 && nees < 25.0,
            "{frame}: {e} {nees}"
        );
        near = Some(landmark_observation.relative_rotation.now_from_reference);
    }
}

/// The camera goes 0.1 m to the side over a floor: what is near contradicts a rotation. Either so many do that it is said, or the far ones
/// decide, within their errors; never a wrong turn told for sure.
#[test]
fn a_camera_that_goes_aside_tells_no_wrong_turn() {
    let camera = small();
    let mut chance = Pcg::new(0x1a6);
    for (seed, place) in
        [(11, Vector3::new(0.1, 0.0, 0.0)), (12, Vector3::new(0.0, -0.1, 0.1)), (13, Vector3::z())]
    {
        let still = picture_with_floor(&camera, Vector3::zeros(), seed);
        let landmarks =
            Landmarks::new(&exposed(&camera, &still, 1.0, NOISE, &mut chance), &camera).expect("landmarks");
        let image = exposed(&camera, &picture_with_floor(&camera, place, seed), 1.0, NOISE, &mut chance);
        match landmarks.observe(&image, None) {
            Err(reason) => println!("{place:?}: {reason}"),
            Ok(landmark_observation) => {
                let (e, nees) = error(&landmark_observation, &Matrix3::identity());
                println!(
                    "{place:?}: {} of {}, off by {e:.4?}, NEES {nees:.1}",
                    landmark_observation.relative_rotation.used.len(),
                    landmark_observation.relative_rotation.given
                );
                assert!(
                    !landmark_observation.relative_rotation.is_consistent() || nees < 25.0,
                    "{place:?}: {e} {nees}"
                );
            }
        }
    }
}

#[test]
fn blank_and_foreign_pictures_say_why() {
    let camera = small();
    let mut chance = Pcg::new(0x1a7);
    let (_, landmarks) = reference(&camera, 14, &mut chance);
    let near = Matrix3::identity();
    for near in [None, Some(&near)] {
        let dark = exposed(&camera, &vec![3.0; 640 * 480], 1.0, 0.5, &mut chance);
        let reason = landmarks.observe(&dark, near).expect_err("nothing to see");
        assert!(matches!(reason, NotObserved::Blank { .. }), "{reason}");
        let noise = exposed(&camera, &vec![120.0; 640 * 480], 1.0, 20.0, &mut chance);
        let reason = landmarks.observe(&noise, near).expect_err("noise alone");
        assert!(matches!(reason, NotObserved::TooFew { needed, .. } if 15 <= needed), "{reason}");
        for seed in 50..55 {
            let other =
                exposed(&camera, &picture(&camera, &Matrix3::identity(), seed), 1.0, NOISE, &mut chance);
            let reason = landmarks.observe(&other, near).expect_err("another scene");
            assert!(matches!(reason, NotObserved::TooFew { .. }), "{reason}");
        }
        let reason = landmarks.observe(&GrayImage::filled(320, 240, 9), near).expect_err("another size");
        assert_eq!(
            reason.to_string(),
            "the image is 320×240 px, the reference 640×480; take a reference of the same size"
        );
    }
    let reason = Landmarks::new(&GrayImage::filled(640, 480, 100), &camera).err().expect("no reference");
    assert!(reason.to_string().contains("0 landmarks, 30 are needed"), "{reason}");
}
