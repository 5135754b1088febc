//! A printed target whose scale is known to a standard deviation only: its points lie where the print has them, the covariance of a pose is
//! the true one, and what the scale explains of a residual is not taken for a wrong answer.

use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3};
use resight_core::correspondence::{Detection, correspond};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, Method, PoseEstimate, locate};
use resight_core::multiview::tag_map::locate_target;
use resight_core::target::{Chessboard, Feature, MapTag, NamedPoint, PrintedScale, Tag, TagMap};
use resight_core::{Error, Point, Pose, Target, Vector6};

const SIGMA_PX: f64 = 0.1;

fn board() -> Target {
    Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.06 })
}

fn scale(ratio: [f64; 2], sigma: [f64; 2]) -> PrintedScale {
    PrintedScale { ratio, sigma }
}

/// The board 1–3 m away, tilted by up to a radian.
fn any_pose(rng: &mut Rng) -> Pose {
    let z = rng.uniform(1.0, 3.0);
    let mut w = Vector3::new(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0));
    w *= rng.uniform(0.2, 1.0) / w.norm();
    let turn = Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
    let centre = Vector3::new(rng.uniform(-0.1, 0.1) * z, rng.uniform(-0.1, 0.1) * z, z);
    Pose::new(turn, centre - turn * Vector3::new(0.24, 0.15, 0.0))
}

/// What the camera sees of the target as it truly was printed.
fn seen(rng: &mut Rng, cam_from_target: &Pose, printed: &Target) -> Option<Vec<Detection>> {
    let one = |feature: Feature| {
        let x = printed.point(feature)?.position;
        let pixel = views::camera().project(&(*cam_from_target * x))?;
        let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
        Some(Detection { feature, pixel, sigma_px: SIGMA_PX, lens_sigma_px: 0.0, covariance_px2: None })
    };
    printed.features().into_iter().map(one).collect()
}

struct Tally {
    n: usize,
    nees: f64,
    inconsistent: usize,
    chi2_per_degree: f64,
}

/// Views of prints drawn around the stated scale, solved with what is stated.
fn tally(stated: &Target, sigma: [f64; 2], drawn: [f64; 2], n: usize) -> Tally {
    let mut rng = Rng::new(11);
    let mut tally = Tally { n: 0, nees: 0.0, inconsistent: 0, chi2_per_degree: 0.0 };
    let known = stated.printed_at(scale(drawn, sigma));
    for _ in 0..n {
        let ratio = [0, 1].map(|i| drawn[i] + sigma[i] * rng.normal());
        let truth = stated.printed_at(scale(ratio, [0.0; 2]));
        let pose = any_pose(&mut rng);
        let Some(detections) = seen(&mut rng, &pose, &truth) else { continue };
        let Ok(e) = locate_target(&detections, &known, &views::camera(), &Config::default()).estimate else {
            continue;
        };
        if let Ambiguity::Ambiguous { .. } = e.ambiguity {
            continue;
        }
        let error = (e.cam_from_target * pose.inverse()).log();
        tally.n += 1;
        tally.nees += error.dot(&e.covariance.cholesky().expect("a covariance").solve(&error));
        tally.inconsistent += usize::from(e.consistency != Consistency::Consistent);
        tally.chi2_per_degree += e.chi2 / e.degrees_of_freedom as f64;
    }
    tally.nees /= tally.n as f64;
    tally.chi2_per_degree /= tally.n as f64;
    tally
}

/// docs/math/printed_scale.md eq. (4): 0.15 %, 0.15 mm over a ruler of 100 mm, is many times the pixels' share of a pose.
#[test]
fn covariance_is_true_for_an_uncertain_scale() {
    let sigma = [0.0015, 0.0015];
    let stated = tally(&board(), sigma, [0.996, 1.002], 400);
    println!(
        "NEES {:.2} of 6 over {} views, χ² per degree {:.3}, {} inconsistent",
        stated.nees, stated.n, stated.chi2_per_degree, stated.inconsistent
    );
    assert!(
        350 < stated.n && (5.0..7.0).contains(&stated.nees),
        "NEES {:.2} of 6 over {}",
        stated.nees,
        stated.n
    );
    assert!(stated.inconsistent <= stated.n / 50, "{} of {} are inconsistent", stated.inconsistent, stated.n);
    assert!(
        (0.9..1.1).contains(&stated.chi2_per_degree),
        "χ² per degree of freedom {:.3}",
        stated.chi2_per_degree
    );
}

/// The other side of it: the scale that the rulers measured, left out, is not within the covariance.
#[test]
fn a_scale_left_out_is_not_in_the_covariance() {
    let mut rng = Rng::new(12);
    let truth = board().printed_at(scale([1.004, 1.004], [0.0; 2]));
    let (mut n, mut nees) = (0, 0.0);
    for _ in 0..40 {
        let pose = any_pose(&mut rng);
        let Some(detections) = seen(&mut rng, &pose, &truth) else { continue };
        let Ok(e) = locate_target(&detections, &board(), &views::camera(), &Config::default()).estimate
        else {
            continue;
        };
        let error = (e.cam_from_target * pose.inverse()).log();
        n += 1;
        nees += error.dot(&e.covariance.cholesky().expect("a covariance").solve(&error));
    }
    assert!(60.0 < nees / f64::from(n), "NEES {:.1}", nees / f64::from(n));
}

fn pose_of(detections: &[Detection], target: &Target) -> PoseEstimate {
    locate_target(detections, target, &views::camera(), &Config::default()).estimate.expect("a pose")
}

/// eq. (5): a print that is longer by ε along both axes and not known to be gives the same rotation and a position ε nearer.
#[test]
fn a_scale_moves_the_camera_along_its_distance() {
    let mut rng = Rng::new(13);
    let pose = any_pose(&mut rng);
    let design = board();
    let detections: Vec<Detection> = design
        .features()
        .into_iter()
        .map(|feature| {
            let pixel = views::camera().project(&(pose * design.point(feature).unwrap().position)).unwrap();
            Detection { feature, pixel, sigma_px: SIGMA_PX, lens_sigma_px: 0.0, covariance_px2: None }
        })
        .collect();
    let exact = pose_of(&detections, &design);
    let longer = pose_of(&detections, &design.printed_at(scale([1.01, 1.01], [0.0; 2])));
    let expected = Pose::new(exact.cam_from_target.rotation, exact.cam_from_target.translation * 1.01);
    assert!((longer.cam_from_target * expected.inverse()).log().norm() < 1e-7);
    // And the share of the standard deviation is that motion's: both axes off alike move the camera by σ |t|.
    let alike = Config { target_scale_sigma: [0.01, 0.01], shared_errors: false, ..Config::default() };
    let points: Vec<_> =
        correspond(&detections, &design, &views::camera()).0.into_iter().map(|(_, c)| c).collect();
    let wide = locate(&points, &views::camera(), &alike).unwrap().covariance;
    let narrow = locate(&points, &views::camera(), &Config { shared_errors: false, ..Config::default() })
        .unwrap()
        .covariance;
    let t = exact.cam_from_target.translation;
    let along = t / t.norm();
    let share = (along.transpose() * (wide - narrow).fixed_view::<3, 3>(3, 3) * along)[(0, 0)].sqrt();
    // The isotropic half of two independent errors alone: σ |t| / √2; the other half adds to it.
    assert!(0.707 * 0.01 * t.norm() < share && share < 0.03 * t.norm(), "{share} at {} m", t.norm());
}

#[test]
fn scales_that_no_print_has_are_refused() {
    let tag = Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m: 0.1 });
    let refused = |target: &Target| match target.check() {
        Err(Error::InvalidTarget { parameter, .. }) => parameter.starts_with("printed_scale"),
        _ => false,
    };
    for (ratio, sigma) in [
        ([0.94, 1.0], [0.0, 0.0]),
        ([1.0, 1.06], [0.0, 0.0]),
        ([f64::NAN, 1.0], [0.0, 0.0]),
        ([1.0, 1.0], [f64::NAN, 0.0]),
        ([1.0, 1.0], [0.0, -0.1]),
        ([1.0, 1.0], [f64::INFINITY, 0.0]),
    ] {
        assert!(refused(&tag.printed_at(scale(ratio, sigma))), "{ratio:?} {sigma:?}");
    }
    assert!(tag.printed_at(scale([0.951, 1.049], [0.01, 0.0])).check().is_ok());
    let points =
        Target::Points(vec![NamedPoint { name: "a".into(), position: Point::zeros(), sigma_m: 0.0 }]);
    assert!(refused(&points.printed_at(scale([1.0, 1.0], [0.0; 2]))));
    let lifted = |z: f64| {
        let world_from_tag = Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.0, 0.0, z));
        let tags = vec![MapTag { id: 0, size_m: 0.1, world_from_tag, sigma_m: 0.0, sigma_rad: 0.0 }];
        Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None })
            .printed_at(scale([1.0, 1.0], [0.0; 2]))
    };
    assert!(lifted(0.0).check().is_ok() && refused(&lifted(0.1)));
    let literal = Config { method: Method::Wang2004, target_scale_sigma: [1e-3; 2], ..Config::default() };
    let line =
        Target::LinePlusOne(resight_core::target::LinePlusOne { line_m: [0.0, 0.2, 0.5], off_m: [0.1, 0.4] });
    let detections =
        seen(&mut Rng::new(1), &Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.0, 0.0, 2.0)), &line)
            .unwrap();
    let points: Vec<_> =
        correspond(&detections, &line, &views::camera()).0.into_iter().map(|(_, c)| c).collect();
    assert!(matches!(
        locate(&points, &views::camera(), &literal),
        Err(Error::WrongLayout { method: "wang2004", .. })
    ));
    let hostile = Config { target_scale_sigma: [f64::NAN, 0.0], ..Config::default() };
    assert!(matches!(locate(&points, &views::camera(), &hostile), Err(Error::InvalidTarget { .. })));
}

/// Two cameras whose rig comes from a print of uncertain scale: where the second is belongs to its covariance only with the scale's share.
#[test]
fn a_rig_from_a_print_is_as_uncertain_as_its_scale() {
    use crate::common::rooms::{board, pair_with};
    use resight_core::multiview::rig::RigConfig;
    let (mut rng, sigma, n) = (Rng::new(97), 2e-3, 40);
    let (mut with, mut without) = (0.0, 0.0);
    for _ in 0..n {
        let axes = [rng.normal() * sigma, rng.normal() * sigma];
        let design = board(8, 6, 0.1);
        let printed =
            design.iter().map(|x| Point::new(x.x * (1.0 + axes[0]), x.y * (1.0 + axes[1]), x.z)).collect();
        let room = pair_with(&mut rng, printed, 8, 0.1);
        let mut observations = room.disturbed(&mut rng);
        for seen in observations.iter_mut().flat_map(|o| &mut o.seen) {
            seen.x_in_target.x /= 1.0 + axes[0];
            seen.x_in_target.y /= 1.0 + axes[1];
        }
        // Of the mean of both axes: eq. (6).
        let config = RigConfig { scale_sigma: sigma / 2f64.sqrt(), ..RigConfig::default() };
        with += room.error(&room.solve(&observations, &config).expect("a rig"), 1).1 / f64::from(n);
        without +=
            room.error(&room.solve(&observations, &RigConfig::default()).expect("a rig"), 1).1 / f64::from(n);
    }
    println!("squared errors over the covariance, of 6: {with:.1} with the scale, {without:.1} without");
    assert!((2.0..10.0).contains(&with) && 20.0 < without, "{with} {without}");
}
