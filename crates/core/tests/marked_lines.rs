//! Marked lines of three directions: focal length, tilt, roll, heading and height within what is said of them, and what cannot be is refused.
//!
//! A road seen from 6 m above it, 1280 × 720 px, f = 900 px, 0.5 px of noise, through lenses as far from an ideal one as is stated.

use crate::budget::assert_parts;
use crate::common::Rng;
use nalgebra::{Matrix3, Vector2, Vector3};
use resight_core::budget::ErrorSource;
use resight_core::camera::{BrownConrady, ImageSize};
use resight_core::locate::unknown_focal::LensPrior;
use resight_core::locate::unknown_focal::marked_lines::*;
use resight_core::{Camera, CameraMatrix, Error, Pixel, Point, Pose, Vector6};

const SIZE: ImageSize = ImageSize { width_px: 1280, height_px: 720 };
const HEIGHT_M: f64 = 6.0;
/// Tilt, roll and heading, degrees.
const ANGLES_DEG: [f64; 3] = [14.0, 3.0, 20.0];
const F_PX: f64 = 900.0;
const SIGMA_PX: f64 = 0.5;

fn prior() -> LensPrior {
    LensPrior {
        size: SIZE,
        principal_point_sigma_px: 25.6,
        aspect_sigma: 0.004,
        bend_sigma_per_rad: 0.15 / 70f64.to_radians(),
    }
}

/// A lens drawn from the prior.
fn lens(rng: &mut Rng) -> Camera {
    let p = prior();
    let field = 2.0 * (640.0 / F_PX).atan();
    let bend = p.bend_sigma_per_rad * field * rng.normal();
    let k1 = bend * (F_PX / 640f64.hypot(360.0)).powi(2);
    let half = 0.5 * p.aspect_sigma * rng.normal();
    let matrix = CameraMatrix {
        fx_px: F_PX * (-half).exp(),
        fy_px: F_PX * half.exp(),
        cx_px: 639.5 + p.principal_point_sigma_px * rng.normal(),
        cy_px: 359.5 + p.principal_point_sigma_px * rng.normal(),
    };
    Camera::new(BrownConrady::new(matrix, &[k1, 0.0, 0.0, 0.0]).expect("a lens"), Some(SIZE))
        .expect("a camera")
}

fn ideal() -> Camera {
    let matrix = CameraMatrix { fx_px: F_PX, fy_px: F_PX, cx_px: 639.5, cy_px: 359.5 };
    Camera::new(BrownConrady::new(matrix, &[0.0; 4]).expect("a lens"), Some(SIZE)).expect("a camera")
}

/// The camera above (0, 0, HEIGHT_M).
fn cam_from_scene(angles_deg: [f64; 3]) -> Pose {
    let [tilt, roll, heading] = angles_deg.map(f64::to_radians);
    let about = |x: f64, y: f64, z: f64| Pose::exp(&Vector6::new(x, y, z, 0.0, 0.0, 0.0)).rotation;
    // Level, looking along y: x right, y down, z forward.
    let level = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    // Rotations of the camera: the scene's are the inverse.
    let rotation = about(0.0, 0.0, -roll) * about(tilt, 0.0, 0.0) * level * about(0.0, 0.0, heading);
    Pose::new(rotation, rotation * Point::new(0.0, 0.0, -HEIGHT_M))
}

fn along(x: f64, y: [f64; 2]) -> (Axis, [Point; 2]) {
    (Axis::Along, [Point::new(x, y[0], 0.0), Point::new(x, y[1], 0.0)])
}

fn across(y: f64, x: [f64; 2]) -> (Axis, [Point; 2]) {
    (Axis::Across, [Point::new(x[0], y, 0.0), Point::new(x[1], y, 0.0)])
}

fn post(x: f64, y: f64, height_m: f64) -> (Axis, [Point; 2]) {
    (Axis::Up, [Point::new(x, y, 0.0), Point::new(x, y, height_m)])
}

/// A scene turned by the heading, so that its middle is in view.
fn road() -> Vec<(Axis, [Point; 2])> {
    vec![
        along(2.0, [16.0, 60.0]),
        along(5.5, [16.0, 60.0]),
        along(9.0, [16.0, 60.0]),
        across(18.0, [2.0, 9.0]),
        across(28.0, [2.0, 9.0]),
        across(45.0, [0.0, 14.0]),
        post(3.0, 25.0, 4.0),
        post(14.0, 30.0, 5.0),
    ]
}

fn marked(
    rng: &mut Rng,
    camera: &Camera,
    pose: &Pose,
    scene: &[(Axis, [Point; 2])],
    sigma_px: f64,
) -> Vec<MarkedLine> {
    let mark = |rng: &mut Rng, x: &Point| -> Pixel {
        let pixel = camera.project(&(pose * x)).expect("in front of the camera");
        assert!(camera.contains(&pixel), "{pixel:?} is outside the image");
        pixel + Vector2::new(rng.normal(), rng.normal()) * sigma_px
    };
    let line = |(axis, ends): &(Axis, [Point; 2])| MarkedLine {
        ends_px: [mark(rng, &ends[0]), mark(rng, &ends[1])],
        sigma_px: sigma_px.max(1e-3),
        axis: *axis,
        length: None,
    };
    scene.iter().map(line).collect()
}

/// Two points of the horizon, 28° to the left and to the right of a heading.
fn horizon_line(rng: &mut Rng, camera: &Camera, pose: &Pose, middle_deg: f64, sigma_px: f64) -> MarkedLine {
    let far = |by_deg: f64| {
        let (sin, cos) = (middle_deg + by_deg).to_radians().sin_cos();
        Point::new(sin, cos, 0.0) * 1e9
    };
    let lines = marked(rng, camera, pose, &[(Axis::Horizon, [far(-28.0), far(28.0)])], sigma_px);
    lines[0]
}

/// The first line across is 7 m long, to 2 cm.
fn with_length(mut lines: Vec<MarkedLine>, at: usize, metres: f64) -> Vec<MarkedLine> {
    lines[at].length = Some(Length { metres, sigma_m: 0.02 });
    lines
}

fn assert_near(name: &str, found: &Estimate, truth: f64, off: f64) {
    assert!(
        (found.value - truth).abs() < off && found.sigma.is_finite(),
        "{name}: {found:?}, in truth {truth}"
    );
}

/// Exact marks give the truth, by every kind of length.
#[test]
fn exact_lines_give_the_truth() {
    let (mut rng, pose) = (Rng::new(1), cam_from_scene(ANGLES_DEG));
    let lines = marked(&mut rng, &ideal(), &pose, &road(), 0.0);
    for (at, metres) in [(3, 7.0), (6, 4.0), (0, 44.0)] {
        for lens in [LineCamera::Unknown(&prior()), LineCamera::Known(&ideal(), None)] {
            let found = scene_view(&with_length(lines.clone(), at, metres), lens).expect("an answer");
            if let Some(focal_px) = &found.focal_px {
                assert_near("f", focal_px, F_PX, 0.01);
            }
            let angles = [
                ("tilt", found.tilt_rad),
                ("roll", found.roll_rad),
                ("heading", found.heading_rad.expect("a heading")),
            ];
            for ((name, found), truth) in angles.into_iter().zip(ANGLES_DEG) {
                assert_near(name, &found, truth.to_radians(), 1e-5);
            }
            assert_near("height", &found.height_m.expect("a height"), HEIGHT_M, 1e-3);
            let apart = found.cam_from_scene.inverse() * pose;
            assert!(apart.translation.norm() < 1e-3, "{apart:?}");
            let corner = ground_point(&found, &lines[3].ends_px[1]).expect("on the ground");
            assert!((corner - Point::new(9.0, 18.0, 0.0)).norm() < 1e-2, "{corner:?}");
            assert!(!found.is_inconsistent && found.chi2 < 1e-2, "{}", found.chi2);
        }
    }
}

/// What the trials of a scene came to.
struct Trials {
    answered: u32,
    inconsistent: u32,
    /// Mean squares of focal length, tilt, roll, heading and height over their variances.
    squares: [f64; 5],
    /// Of the pose.
    nees: f64,
    /// Mean χ² over its degrees of freedom.
    chi2_per_degree: f64,
    degrees_of_freedom: usize,
}

const TRIALS: u32 = 200;

/// Lenses drawn from what is stated of lenses unless the lens is known, marks with noise; the line `measured` has a length.
fn trials(
    known: bool,
    scene: &[(Axis, [Point; 2])],
    horizon: Option<f64>,
    angles_deg: [f64; 3],
    measured: (usize, f64),
) -> Trials {
    let (mut rng, pose) = (Rng::new(2), cam_from_scene(angles_deg));
    let mut sums = Trials {
        answered: 0,
        inconsistent: 0,
        squares: [0.0; 5],
        nees: 0.0,
        chi2_per_degree: 0.0,
        degrees_of_freedom: 0,
    };
    for _ in 0..TRIALS {
        let camera = if known { ideal() } else { lens(&mut rng) };
        let mut lines = marked(&mut rng, &camera, &pose, scene, SIGMA_PX);
        lines[measured.0].length = Some(Length { metres: measured.1 + 0.02 * rng.normal(), sigma_m: 0.02 });
        lines.extend(horizon.map(|middle_deg| horizon_line(&mut rng, &camera, &pose, middle_deg, SIGMA_PX)));
        let (prior, camera) = (prior(), ideal());
        let lens = if known { LineCamera::Known(&camera, None) } else { LineCamera::Unknown(&prior) };
        let Ok(found) = scene_view(&lines, lens) else { continue };
        sums.answered += 1;
        sums.inconsistent += u32::from(found.is_inconsistent);
        assert_parts(&found.budget, &found.covariance, "marked lines");
        assert!(found.budget.has(ErrorSource::Pixels) && found.budget.has(ErrorSource::Distances));
        assert_eq!(found.budget.has(ErrorSource::Lens), !known);
        let [tilt, roll, heading] = angles_deg.map(f64::to_radians);
        let or_exact =
            |estimate: Option<Estimate>, value: f64| estimate.unwrap_or(Estimate { value, sigma: 1.0 });
        let all = [
            or_exact(found.focal_px, F_PX),
            found.tilt_rad,
            found.roll_rad,
            or_exact(found.heading_rad, heading),
            found.height_m.expect("a height"),
        ];
        for ((sum, e), truth) in sums.squares.iter_mut().zip(all).zip([F_PX, tilt, roll, heading, HEIGHT_M]) {
            *sum += ((e.value - truth) / e.sigma).powi(2);
        }
        // The translation moves along itself only, and a heading by definition not at all: four numbers are independent, or three.
        let xi = (pose * found.cam_from_scene.inverse()).log();
        sums.nees +=
            found.covariance.pseudo_inverse(1e-12).map_or(f64::NAN, |inverse| xi.dot(&(inverse * xi)));
        sums.chi2_per_degree += found.chi2 / found.degrees_of_freedom as f64;
        sums.degrees_of_freedom = found.degrees_of_freedom;
    }
    let n = f64::from(sums.answered);
    let squares = sums.squares.map(|sum| sum / n);
    let found = Trials { squares, nees: sums.nees / n, chi2_per_degree: sums.chi2_per_degree / n, ..sums };
    println!(
        "known {known}, horizon {horizon:?}: {} answered, {squares:.2?}, {} inconsistent, NEES {:.2}, χ²/dof {:.2}",
        found.answered, found.inconsistent, found.nees, found.chi2_per_degree
    );
    assert!(9 * TRIALS <= 10 * found.answered, "{}", found.answered);
    assert!(found.inconsistent <= 2, "{}", found.inconsistent);
    found
}

/// Squared errors are those of the stated standard deviations.
#[test]
fn errors_are_as_large_as_stated() {
    for known in [false, true] {
        let found = trials(known, &road(), None, ANGLES_DEG, (3, 7.0));
        for mean in found.squares.into_iter().skip(usize::from(known)) {
            assert!((0.7..1.4).contains(&mean), "{mean}");
        }
        assert!((3.2..4.8).contains(&found.nees), "{}", found.nees);
    }
}

/// Errors of views with a horizon, which gives two equations: beside lines of three directions, and with posts alone, where the heading is zero by
/// definition and the pose has three degrees of freedom. For an unknown lens it needs five posts: with three the distortion is so open that
/// squared errors of the height are four times those stated.
#[test]
fn errors_with_a_horizon_are_as_large_as_stated() {
    let posts = [
        post(-6.0, 16.0, 4.0),
        post(6.0, 16.0, 5.0),
        post(2.0, 20.0, 6.0),
        post(-8.0, 25.0, 6.0),
        post(9.0, 25.0, 6.0),
    ];
    for known in [false, true] {
        let without = trials(known, &road(), None, ANGLES_DEG, (3, 7.0)).degrees_of_freedom;
        let beside = trials(known, &road(), Some(ANGLES_DEG[2]), ANGLES_DEG, (3, 7.0));
        assert_eq!(beside.degrees_of_freedom, without + 2);
        let [tilt, roll, _] = ANGLES_DEG;
        let n_posts = if known { 3 } else { 5 };
        let alone = trials(known, &posts[..n_posts], Some(0.0), [tilt, roll, 0.0], (1, 5.0));
        // Two of the horizon, the posts and a length; tilt, roll, height, and the focal length where it is not known.
        assert_eq!(alone.degrees_of_freedom, if known { 3 } else { 4 });
        for (found, independent, has_heading) in [(beside, 4.0, true), (alone, 3.0, false)] {
            for (i, mean) in found.squares.into_iter().enumerate() {
                let is_estimated = (i != 0 || !known) && (i != 3 || has_heading);
                assert!(!is_estimated || (0.7..1.4).contains(&mean), "{i}: {mean}");
            }
            assert!((0.8 * independent..1.2 * independent).contains(&found.nees), "{}", found.nees);
            assert!((0.8..1.2).contains(&found.chi2_per_degree), "{}", found.chi2_per_degree);
        }
    }
}

/// A horizon and two posts give focal length, tilt and roll, and with the length of one the height; the heading is zero by definition.
#[test]
fn a_horizon_and_two_posts_give_the_focal_length() {
    let (mut rng, pose) = (Rng::new(6), cam_from_scene([14.0, 3.0, 0.0]));
    let mut lines = marked(&mut rng, &ideal(), &pose, &[post(-6.0, 20.0, 4.0), post(8.0, 25.0, 5.0)], 0.0);
    lines.push(horizon_line(&mut rng, &ideal(), &pose, 0.0, 0.0));
    let of_road = scene_view(&lines, LineCamera::Unknown(&prior())).expect("an answer");
    assert_near("f", &of_road.focal_px.expect("a focal length"), F_PX, 0.01);
    assert_eq!((of_road.degrees_of_freedom, of_road.heading_rad), (1, None));
    assert!(of_road.height_m.is_none());
    // For the height five posts are needed; of a known camera one is enough.
    lines[1].length = Some(Length { metres: 5.0, sigma_m: 0.01 });
    let refused = scene_view(&lines, LineCamera::Unknown(&prior())).expect_err("too few posts");
    assert!(matches!(refused, Error::DegenerateView { metric: 2.0, needed: 5.0, .. }), "{refused:?}");
    let others = [post(2.0, 20.0, 6.0), post(-8.0, 25.0, 6.0), post(5.0, 18.0, 5.0)];
    let mut five = lines.clone();
    five.extend(marked(&mut rng, &ideal(), &pose, &others, 0.0));
    for (lines, lens) in
        [(&five[..], LineCamera::Unknown(&prior())), (&lines[1..], LineCamera::Known(&ideal(), None))]
    {
        let found = scene_view(lines, lens).expect("an answer");
        assert_near("tilt", &found.tilt_rad, 14f64.to_radians(), 1e-5);
        assert_near("roll", &found.roll_rad, 3f64.to_radians(), 1e-5);
        assert_near("height", &found.height_m.expect("a height"), HEIGHT_M, 1e-3);
        let apart = found.cam_from_scene.inverse() * pose;
        assert!(apart.log().norm() < 1e-3, "{apart:?}");
        // Along is the way that the camera looks, by definition: what turns the axis across towards the camera's has no variance.
        let across = found.cam_from_scene.rotation.column(0).into_owned();
        let heading = across.cross(&Vector3::z());
        let of_heading = heading.dot(&(found.covariance.fixed_view::<3, 3>(0, 0) * heading));
        assert!(of_heading < 1e-12, "{of_heading}");
    }
}

/// An edge of a roof that is taken for the horizon contradicts the lines and is named.
#[test]
fn a_wrong_horizon_is_named() {
    let (mut rng, pose) = (Rng::new(7), cam_from_scene(ANGLES_DEG));
    for known in [false, true] {
        let mut lines = marked(&mut rng, &ideal(), &pose, &road(), SIGMA_PX);
        let roof = (Axis::Horizon, [Point::new(0.0, 30.0, 3.0), Point::new(18.0, 45.0, 3.0)]);
        lines.extend(marked(&mut rng, &ideal(), &pose, &[roof], SIGMA_PX));
        let (prior, camera) = (prior(), ideal());
        let lens = if known { LineCamera::Known(&camera, None) } else { LineCamera::Unknown(&prior) };
        let found = scene_view(&lines, lens).expect("an answer");
        assert!(found.is_inconsistent && found.worst.0 == road().len(), "{found:?}");
    }
}

/// A horizon says nothing of the focal length by itself, nor with lines whose vanishing point is on it, and it has no length.
#[test]
fn what_a_horizon_cannot_say_is_refused() {
    let (mut rng, pose) = (Rng::new(8), cam_from_scene(ANGLES_DEG));
    let lines = marked(&mut rng, &ideal(), &pose, &road(), SIGMA_PX);
    let horizon = horizon_line(&mut rng, &ideal(), &pose, ANGLES_DEG[2], SIGMA_PX);
    for n in [1, 3] {
        assert!(refused(&vec![horizon; n]).to_string().contains("two upright lines"), "{n}");
        let known = scene_view(&vec![horizon; n], LineCamera::Known(&ideal(), None)).expect_err("no answer");
        assert!(known.to_string().contains("an upright line"), "{known}");
    }
    let one_post = [horizon, lines[6]];
    assert!(matches!(refused(&one_post), Error::TooFewPoints { seen: 3, needed: 4 }));
    let lanes = [horizon, lines[0], lines[1], lines[2]];
    assert!(matches!(refused(&lanes), Error::UndeterminedFocal { .. }), "{}", refused(&lanes));
    assert!(scene_view(&lanes, LineCamera::Known(&ideal(), None)).is_ok(), "the focal length is known");
    let mut long = lines.clone();
    long.extend(with_length(vec![horizon], 0, 7.0));
    let reason = refused(&long).to_string();
    assert!(reason.contains("length of a horizon") && reason.contains("line of the scene"), "{reason}");
}

/// A camera's file with a covariance: lenses drawn from it, and the errors are as large as stated; taken as exact they are not.
#[test]
fn uncertain_intrinsics_widen_the_answer() {
    let sigmas = [15.0, 15.0, 8.0, 8.0, 0.02, 0.0, 0.0, 0.0];
    let covariance: Vec<f64> =
        (0..64).map(|k| if k % 9 == 0 { sigmas[k / 9] * sigmas[k / 9] } else { 0.0 }).collect();
    let (mut rng, pose, stated) = (Rng::new(3), cam_from_scene(ANGLES_DEG), ideal());
    let mut squares = [0.0; 2];
    let trials = 200;
    for _ in 0..trials {
        let values: Vec<f64> = stated
            .parameters()
            .iter()
            .zip(sigmas)
            .map(|((_, value), sigma)| value + sigma * rng.normal())
            .collect();
        let camera = stated.with_parameters(&values).expect("a camera");
        let lines = marked(&mut rng, &camera, &pose, &road(), SIGMA_PX);
        for (sum, covariance) in squares.iter_mut().zip([Some(covariance.as_slice()), None]) {
            let found = scene_view(&lines, LineCamera::Known(&stated, covariance)).expect("an answer");
            assert_eq!(found.budget.has(ErrorSource::Lens), covariance.is_some());
            *sum += ((found.tilt_rad.value - ANGLES_DEG[0].to_radians()) / found.tilt_rad.sigma).powi(2);
        }
    }
    let [with, without] = squares.map(|sum| sum / f64::from(trials));
    assert!((0.6..1.4).contains(&with) && 3.0 * with < without, "{with} {without}");
}

fn refused(lines: &[MarkedLine]) -> Error {
    scene_view(lines, LineCamera::Unknown(&prior())).expect_err("no answer")
}

/// What the lines cannot say is refused, with the way out.
#[test]
fn what_the_lines_cannot_say_is_refused() {
    let (mut rng, pose) = (Rng::new(4), cam_from_scene(ANGLES_DEG));
    let lines = marked(&mut rng, &ideal(), &pose, &road(), SIGMA_PX);
    assert!(matches!(refused(&lines[..4]), Error::TooFewPoints { seen: 4, needed: 5 }));
    let lane: Vec<_> = (0..6).map(|i| lines[i % 3]).collect();
    assert!(refused(&lane).to_string().contains("second"), "{}", refused(&lane));
    // A wall seen face on: nothing converges.
    let face_on =
        Pose::new(Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0), Point::new(0.0, 0.0, 0.0));
    let mut wall: Vec<(Axis, [Point; 2])> = Vec::new();
    for i in -2..=2 {
        let at = f64::from(i);
        wall.push((Axis::Across, [Point::new(-4.0, 10.0, at), Point::new(4.0, 10.0, at)]));
        wall.push((Axis::Up, [Point::new(2.0 * at, 10.0, -2.5), Point::new(2.0 * at, 10.0, 2.5)]));
    }
    let wall = marked(&mut rng, &ideal(), &face_on, &wall, SIGMA_PX);
    assert!(matches!(refused(&wall), Error::UndeterminedFocal { .. }), "{}", refused(&wall));
    assert!(
        scene_view(&wall, LineCamera::Known(&ideal(), None)).is_ok(),
        "a known camera needs no convergence"
    );
    let above = with_length(lines.clone(), 7, 5.0);
    let mut above = above;
    above[7].ends_px = above[7].ends_px.map(|end| end - Vector2::new(0.0, 300.0));
    assert!(
        refused(&above).to_string().contains("horizon")
            || scene_view(&above, LineCamera::Unknown(&prior())).is_err()
    );
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let mut hostile = lines.clone();
        hostile[2].ends_px[1].x = bad;
        assert!(matches!(refused(&hostile), Error::NotFinite { index: 2, .. }));
        let mut hostile = lines.clone();
        hostile[1].length = Some(Length { metres: bad, sigma_m: 0.1 });
        assert!(matches!(refused(&hostile), Error::NotPositive { index: 1, .. }));
    }
    let mut one = lines.clone();
    one[0].ends_px[1] = one[0].ends_px[0];
    assert!(matches!(refused(&one), Error::Coincident { .. }));
}

/// A line of another direction than is said, or a length in another unit beside a right one, contradicts the others and is named.
#[test]
fn a_wrong_line_is_named() {
    let (mut rng, pose) = (Rng::new(5), cam_from_scene(ANGLES_DEG));
    let mut noticed = 0;
    for wrong in 0..road().len() {
        let mut lines = marked(&mut rng, &ideal(), &pose, &road(), SIGMA_PX);
        lines[wrong].axis = match lines[wrong].axis {
            Axis::Across => Axis::Up,
            Axis::Along => Axis::Across,
            Axis::Up | Axis::Horizon => Axis::Along,
        };
        match scene_view(&lines, LineCamera::Unknown(&prior())) {
            Ok(found) => {
                assert!(found.is_inconsistent, "line {wrong} is labelled wrongly: {found:?}");
                noticed += usize::from(found.worst.0 == wrong);
            }
            Err(_) => noticed += 1,
        }
    }
    assert!(6 <= noticed, "{noticed} of 8 named");
    let lines = marked(&mut rng, &ideal(), &pose, &road(), SIGMA_PX);
    let feet = with_length(with_length(lines, 3, 7.0), 6, 4.0 * 3.28);
    let found = scene_view(&feet, LineCamera::Unknown(&prior())).expect("an answer");
    assert!(found.is_inconsistent && [3, 6].contains(&found.worst.0), "{found:?}");
}
