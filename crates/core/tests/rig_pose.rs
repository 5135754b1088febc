//! The pose of a rig: exact points give the exact pose, the stated covariance is the true one, no estimator could do better,
//! one camera is `locate`,
//! and what cannot be answered is refused by name. Rigs of two to four cameras, each point seen by one of them; 0.5 px
//! (`common::rigs`).

use crate::budget::{assert_adds_up, part};
use crate::common::rigs::{FAMILIES, Family, Made, SIGMA_PX, chi2, head, solve, vehicle, views_of};
use crate::common::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use resight_core::budget::ErrorSource;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, locate};
use resight_core::multiview::rig_pose::{RigAmbiguity, RigConsistency, locate_rig, rig_consensus};
use resight_core::{Correspondence, Error, Point, Pose};

/// Also with three points in three cameras, where up to eight poses fit exactly: then one of the two returned need not be
/// the true one, but must reproject.
#[test]
fn exact_points_give_the_exact_pose() {
    let mut rng = Rng::new(1);
    for (name, family) in FAMILIES {
        for (n_cameras, n_points) in [(2, 4), (2, 6), (3, 3), (3, 4), (3, 9), (4, 4), (4, 20)] {
            for _ in 0..300 {
                let scene = family(&mut rng, n_cameras, n_points);
                let e = solve(&scene.cameras).expect("a pose");
                assert!(e.rms_px < 1e-7, "{name} {n_cameras} {n_points}: {} px", e.rms_px);
                assert_eq!(e.consistency, RigConsistency::Consistent);
                if 4 <= n_points {
                    let other = match e.ambiguity {
                        RigAmbiguity::Ambiguous { other, .. } => scene.error(&other.rig_from_target).norm(),
                        RigAmbiguity::Unique { .. } => f64::INFINITY,
                    };
                    let error = scene.error(&e.rig_from_target).norm().min(other);
                    assert!(error < 1e-9, "{name} {n_cameras} {n_points}: {error:e}");
                }
            }
        }
    }
}

/// What came of many noisy views of random problems.
struct Statistics {
    unique: usize,
    ambiguous: usize,
    wrong: usize,
    /// Means over the unique ones: error in units of the stated covariance, share within its 95 % ellipsoid, error in units
    /// of the Cramér–Rao bound.
    nees: f64,
    coverage: f64,
    by_bound: f64,
}

fn statistics(family: Family, n_cameras: usize, n_points: usize, problems: usize, seed: u64) -> Statistics {
    let mut rng = Rng::new(seed);
    let mut s = Statistics { unique: 0, ambiguous: 0, wrong: 0, nees: 0.0, coverage: 0.0, by_bound: 0.0 };
    for _ in 0..problems {
        let scene = family(&mut rng, n_cameras, n_points);
        let Ok(e) = solve(&scene.disturbed(&mut rng)) else { continue };
        let error = scene.error(&e.rig_from_target);
        if matches!(e.ambiguity, RigAmbiguity::Ambiguous { .. }) {
            s.ambiguous += 1;
            continue;
        }
        if 0.5 < error.fixed_rows::<3>(0).norm() {
            s.wrong += 1;
            continue;
        }
        let squared = error.dot(&(e.covariance.try_inverse().expect("positive definite") * error));
        s.nees += squared;
        s.coverage += f64::from(u8::from(squared < 12.592)); // χ²₆ at 95 %
        s.by_bound += error.dot(&(scene.information() * error));
        s.unique += 1;
    }
    let n = s.unique as f64;
    Statistics { nees: s.nees / n, coverage: s.coverage / n, by_bound: s.by_bound / n, ..s }
}

/// NEES 5.7–6.3 and 94–96 % within the 95 % ellipsoid; 6 over the error in units of the Cramér–Rao bound at least 0.99. With
/// 20,000 problems the mean of a χ²₆ is
/// known to √(12/20000)/6 = 0.4 %, one standard deviation.
#[test]
fn covariance_is_true_and_no_estimator_does_better() {
    const PROBLEMS: usize = 20_000;
    for (name, family) in FAMILIES {
        for n_cameras in [2, 3, 4] {
            let s = statistics(family, n_cameras, 12, PROBLEMS, 100 + n_cameras as u64);
            let efficiency = 6.0 / s.by_bound;
            let Statistics { unique, ambiguous, wrong, nees, coverage, .. } = s;
            println!(
                "{name}, {n_cameras} cameras: {unique} unique, {ambiguous} ambiguous, {wrong} wrong, NEES {nees:.3}, 95 % covers {coverage:.4}, efficiency {efficiency:.4}"
            );
            assert!(wrong <= PROBLEMS / 10_000, "{name} {n_cameras}: {wrong}");
            assert!((5.7..6.3).contains(&nees), "{name} {n_cameras}: NEES {nees}");
            assert!((0.94..0.96).contains(&coverage), "{name} {n_cameras}: {coverage}");
            assert!(0.99 <= efficiency, "{name} {n_cameras}: {efficiency}");
        }
    }
}

/// Four points are enough: nothing is lost (the answer, or the other one it names, fits at least as well as the truth), and
/// few remain ambiguous.
#[test]
fn four_points_lose_no_minimum() {
    const PROBLEMS: usize = 5_000;
    for (name, family) in FAMILIES {
        for n_cameras in [2, 3, 4] {
            let mut rng = Rng::new(200 + n_cameras as u64);
            let mut ambiguous = 0;
            for _ in 0..PROBLEMS {
                let scene = family(&mut rng, n_cameras, 4);
                let cameras = scene.disturbed(&mut rng);
                let e = solve(&cameras).expect("a pose");
                let at_truth = chi2(&cameras, &scene.rig_from_target);
                assert!(e.chi2 < at_truth + 1e-6, "{name} {n_cameras}: {} at the truth {at_truth}", e.chi2);
                ambiguous += usize::from(matches!(e.ambiguity, RigAmbiguity::Ambiguous { .. }));
            }
            println!("{name}, {n_cameras} cameras, 4 points: {ambiguous} of {PROBLEMS} ambiguous");
            assert!(ambiguous < PROBLEMS / 50, "{ambiguous}"); // 1.0 to 1.3 % for the head, none for the vehicle
        }
    }
}

/// Three points in three cameras of a small head have two or more poses: both that are returned reproject, and the true one
/// is nearly always among them or another of up to eight. An only pose whose rotation is open to a radian is refused.
#[test]
fn three_points_of_a_head_are_ambiguous() {
    let mut rng = Rng::new(300);
    let (mut ambiguous, mut unknown) = (0, 0);
    for _ in 0..1_000 {
        let scene = head(&mut rng, 3, 3);
        let e = match solve(&scene.cameras) {
            Ok(e) => e,
            Err(Error::DegenerateView { .. }) => {
                unknown += 1;
                continue;
            }
            Err(error) => panic!("{error}"),
        };
        if let RigAmbiguity::Ambiguous { other, .. } = e.ambiguity {
            ambiguous += 1;
            assert!(chi2(&scene.cameras, &other.rig_from_target) < 9.0 + 1e-6);
        }
        assert!(chi2(&scene.cameras, &e.rig_from_target) < 1e-9);
        assert_eq!((e.degrees_of_freedom, e.n_points, e.n_cameras), (0, 3, 3));
    }
    assert!(900 < ambiguous && unknown <= 5, "{ambiguous} {unknown}");
}

/// The inverse of the stated covariance is the Fisher information by central differences: no derivative through a camera's
/// place in the rig is off.
/// Small sigmas, so that no bend of the likelihood adds to it.
#[test]
fn covariance_is_the_inverse_of_the_numerical_information() {
    let mut rng = Rng::new(400);
    for (name, family) in FAMILIES {
        for _ in 0..200 {
            let mut scene = family(&mut rng, 3, 12);
            scene.cameras.iter_mut().flat_map(|m| &mut m.seen).for_each(|c| c.sigma_px = 0.01);
            let e = solve(&scene.cameras).expect("a pose");
            let information = scene.information() * (SIGMA_PX / 0.01).powi(2);
            let product = information * e.covariance - Matrix6::identity();
            // Central differences are good to 1e-9; the worst of these problems has condition 1e4.
            assert!(product.amax() < 1e-4, "{name}: {}", product.amax());
        }
    }
}

/// `locate`'s answer for a camera at the origin of the rig; elsewhere in the rig the same, carried there.
#[test]
fn one_camera_is_locate() {
    let (mut rng, camera) = (Rng::new(500), views::camera());
    for (name, points) in views::all() {
        let seen = views::disturbed(&mut rng, &views::seen_from(&views::oblique(), &points, SIGMA_PX));
        let alone = locate(&seen, &camera, &Config::default()).expect("a pose");
        for cam_from_rig in [Pose::identity(), views::looking_at(Point::new(0.3, 0.1, -0.2), Point::zeros())]
        {
            let own = Made { cam_from_rig, seen: seen.clone() };
            let blind = Made { cam_from_rig: Pose::identity(), seen: Vec::new() };
            let e = solve(&[blind, own]).expect("a pose");
            let rig_from_target = cam_from_rig.inverse() * alone.cam_from_target;
            assert!((e.rig_from_target * rig_from_target.inverse()).log().norm() < 1e-9, "{name}");
            let ad = cam_from_rig.inverse().adjoint();
            let carried = ad * alone.covariance * ad.transpose();
            assert!((e.covariance - carried).amax() < 1e-9 * carried.amax(), "{name}");
            assert_eq!((e.chi2, e.rms_px, e.n_cameras), (alone.chi2, alone.rms_px, 1));
            assert_eq!(
                matches!(e.ambiguity, RigAmbiguity::Ambiguous { .. }),
                matches!(alone.ambiguity, Ambiguity::Ambiguous { .. })
            );
        }
    }
}

/// The same camera listed twice, each time with half of its points, goes the way of a rig and comes to `locate`'s minimum:
/// pose, χ² and covariance. Also for a flat
/// target seen nearly face on, where the likelihood's bend has a share in the covariance.
#[test]
fn a_camera_in_two_halves_is_locate() {
    let mut rng = Rng::new(600);
    let face_on = views::looking_at(Point::new(0.6, 0.4, -4.0), Point::new(0.55, 0.45, 0.0));
    let mut compared = 0;
    for (name, cam_from_target, points) in
        [("oblique", views::oblique(), views::general()), ("face on", face_on, views::planar())]
    {
        for _ in 0..200 {
            let seen = views::disturbed(&mut rng, &views::seen_from(&cam_from_target, &points, SIGMA_PX));
            compared += usize::from(compare_with_halves(name, &seen));
        }
    }
    assert!(350 < compared, "{compared}");
}

/// False where one of the two ways ended on the other of two minima that fit alike, or on none.
fn compare_with_halves(name: &str, seen: &[Correspondence]) -> bool {
    let half = |seen: &[Correspondence]| Made { cam_from_rig: Pose::identity(), seen: seen.to_vec() };
    let e = solve(&[half(&seen[..3]), half(&seen[3..])]).expect("a pose");
    let Ok(alone) = locate(seen, &views::camera(), &Config::default()) else { return false };
    if 1e-6 < (e.chi2 - alone.chi2).abs() {
        return false;
    }
    // Two ends of the loop, whose last step is up to 3e-4 standard deviations long.
    let apart = (e.rig_from_target * alone.cam_from_target.inverse()).log();
    let inverse = alone.covariance.try_inverse().expect("positive definite");
    let sigmas = apart.dot(&(inverse * apart)).sqrt();
    assert!(sigmas < 3e-4, "{name}: {sigmas:e}");
    // The bend is probed from that end.
    let off = (e.covariance - alone.covariance).amax() / alone.covariance.amax();
    assert!(off < 1e-2, "{name}: {off:e}");
    true
}

/// 3 mrad and 3 mm: at 2–8 m five times what the pixels say.
fn position_covariance() -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::new(9e-6, 9e-6, 9e-6, 9e-6, 9e-6, 9e-6))
}

/// What an estimate is after every camera was moved by a draw from its stated covariance: NEES, coverage, share called inconsistent.
fn with_moved_cameras(stated: Option<Matrix6<f64>>, problems: usize) -> (f64, f64, f64) {
    let (mut rng, camera) = (Rng::new(700), views::camera());
    let (mut nees, mut covered, mut inconsistent) = (0.0, 0, 0);
    for _ in 0..problems {
        let scene = vehicle(&mut rng, 4, 16);
        let mut cameras = scene.disturbed(&mut rng);
        for made in &mut cameras {
            // The image was taken from `cam_from_rig`; what is known of it differs.
            let motion = Vector6::from_fn(|_, _| 3e-3 * rng.normal());
            made.cam_from_rig = Pose::exp(&motion) * made.cam_from_rig;
        }
        let e = locate_rig(&views_of(&cameras, &camera, stated)).expect("a pose");
        let error = scene.error(&e.rig_from_target);
        let squared = error.dot(&(e.covariance.try_inverse().expect("positive definite") * error));
        nees += squared / problems as f64;
        covered += usize::from(squared < 12.592);
        inconsistent += usize::from(e.consistency != RigConsistency::Consistent);
    }
    (nees, covered as f64 / problems as f64, inconsistent as f64 / problems as f64)
}

/// The cameras' uncertain places are in the covariance and in the verdict: NEES and coverage are right, and no rig is called
/// inconsistent for what was stated. Unstated, the
/// same errors are: the χ² test sees them.
#[test]
fn uncertain_places_of_cameras_are_accounted_for() {
    let (nees, coverage, inconsistent) = with_moved_cameras(Some(position_covariance()), 10_000);
    println!("stated: NEES {nees:.3}, 95 % covers {coverage:.4}, inconsistent {inconsistent:.4}");
    assert!((5.7..6.3).contains(&nees), "{nees}");
    assert!((0.94..0.96).contains(&coverage), "{coverage}");
    assert!(inconsistent < 1e-3, "{inconsistent}");
    let (_, _, inconsistent) = with_moved_cameras(None, 1_000);
    println!("unstated: inconsistent {inconsistent:.4}");
    assert!(0.8 < inconsistent, "{inconsistent}"); // the rest stays below four times the stated variance
}

/// Nothing uncertain is the same as nothing stated, and a camera whose place is unknown says nothing.
#[test]
fn covariance_of_a_place_runs_from_exact_to_useless() {
    let (mut rng, camera) = (Rng::new(800), views::camera());
    for _ in 0..50 {
        let scene = vehicle(&mut rng, 3, 15);
        let cameras = scene.disturbed(&mut rng);
        let exact = solve(&cameras).expect("a pose");
        let zero = locate_rig(&views_of(&cameras, &camera, Some(Matrix6::zeros()))).expect("a pose");
        assert!((exact.rig_from_target * zero.rig_from_target.inverse()).log().norm() < 1e-9);
        assert!((exact.covariance - zero.covariance).amax() < 1e-6 * exact.covariance.amax());
        let mut views = views_of(&cameras, &camera, None);
        views[2].cam_from_rig_covariance = Some(Matrix6::identity() * 1e8);
        let without = locate_rig(&views).expect("a pose");
        let two = solve(&cameras[..2]).expect("a pose");
        assert!((two.rig_from_target * without.rig_from_target.inverse()).log().norm() < 1e-5);
        assert!((two.covariance - without.covariance).amax() < 1e-3 * two.covariance.amax());
    }
}

/// A camera that moved by far more than its place is uncertain hides from χ² among many points; its own pose differs from that of the others.
#[test]
fn a_camera_that_moved_beyond_its_covariance_is_named() {
    let (mut rng, camera) = (Rng::new(950), views::camera());
    let (mut hidden, mut named, mut shared) = (0, 0, 0);
    for _ in 0..500 {
        let scene = head(&mut rng, 4, 160);
        let mut cameras = scene.disturbed(&mut rng);
        let moved = rng.index(4);
        let motion = Vector6::from_fn(|_, _| 0.0136 * rng.normal().signum());
        cameras[moved].cam_from_rig = Pose::exp(&motion) * cameras[moved].cam_from_rig;
        let views = views_of(&cameras, &camera, Some(position_covariance()));
        let e = locate_rig(&views).expect("a pose");
        let budget = e.budget(&views).expect("parts");
        assert_adds_up(&budget, &e.covariance, "a camera that moved");
        shared += usize::from(budget.has(ErrorSource::SharedInView));
        hidden += usize::from(e.chi2 < 4.0 * e.degrees_of_freedom as f64);
        named += usize::from(
            matches!(e.consistency, RigConsistency::CameraApart { camera, .. } if camera == moved),
        );
    }
    println!("χ² is small in {hidden}, named in {named}, in the budget in {shared} of 500");
    // In the others the residuals' factor holds it.
    assert!(490 <= hidden.min(named) && 400 <= shared, "{hidden} {named} {shared}");
}

/// A camera that was pushed by 20 mrad, or one wrong label, is named.
#[test]
fn the_camera_and_the_point_that_do_not_fit_are_named() {
    let mut rng = Rng::new(900);
    let (mut camera_named, mut point_named) = (0, 0);
    for _ in 0..500 {
        let scene = head(&mut rng, 4, 24);
        let mut cameras = scene.disturbed(&mut rng);
        let pushed = rng.index(4);
        let motion = Vector6::new(0.0, 0.02, 0.0, 0.0, 0.0, 0.0);
        cameras[pushed].cam_from_rig = Pose::exp(&motion) * cameras[pushed].cam_from_rig;
        let e = solve(&cameras).expect("a pose");
        let RigConsistency::Inconsistent { worst_camera, chi2_per_degree_of_freedom, .. } = e.consistency
        else {
            panic!("{:?}", e.consistency)
        };
        assert!(4.0 < chi2_per_degree_of_freedom);
        camera_named += usize::from(worst_camera == pushed);

        let mut cameras = scene.disturbed(&mut rng);
        let (camera, point) = (rng.index(4), rng.index(6));
        let c = &mut cameras[camera].seen[point];
        *c = views::moved_pixel(c, Vector2::new(25.0, -15.0));
        let e = solve(&cameras).expect("a pose");
        if let RigConsistency::Inconsistent { worst_camera, worst_point, .. } = e.consistency {
            point_named += usize::from((worst_camera, worst_point) == (camera, point));
        }
    }
    println!("named: camera {camera_named}, point {point_named} of 500");
    assert!(490 <= camera_named && 490 <= point_named);
}

#[test]
fn what_cannot_be_answered_is_refused_by_name() {
    let mut rng = Rng::new(1000);
    let (camera, scene) = (views::camera(), vehicle(&mut rng, 3, 12));
    let refused = |change: &dyn Fn(&mut Vec<Made>)| {
        let mut cameras = scene.cameras.clone();
        change(&mut cameras);
        solve(&cameras).expect_err("an error")
    };
    assert_eq!(locate_rig(&[]), Err(Error::EmptyRig));
    let none_seen = refused(&|c| c.iter_mut().for_each(|m| m.seen.clear()));
    assert_eq!(none_seen, Error::TooFewPoints { seen: 0, needed: 3 });
    let two_seen = refused(&|c| {
        c[0].seen.truncate(1);
        c[1].seen.truncate(1);
        c[2].seen.clear();
    });
    assert_eq!(two_seen, Error::TooFewPoints { seen: 2, needed: 3 });
    let nan_point = refused(&|c| c[1].seen[2].x_in_target.y = f64::NAN);
    assert!(
        matches!(nan_point, Error::InvalidRigPoint { camera: 1, point: 2, what: "the position", .. }),
        "{nan_point}"
    );
    let nan_pixel = refused(&|c| c[2].seen[0].pixel.x = f64::INFINITY);
    assert!(matches!(nan_pixel, Error::InvalidRigPoint { camera: 2, point: 0, what: "the pixel", .. }));
    let no_sigma = refused(&|c| c[0].seen[3].sigma_px = 0.0);
    assert!(matches!(no_sigma, Error::InvalidRigPoint { camera: 0, point: 3, what: "sigma", .. }));
    let nan_place = refused(&|c| c[1].cam_from_rig.translation.z = f64::NAN);
    assert!(matches!(nan_place, Error::InvalidRig { camera: 1, .. }), "{nan_place}");
    let scaled = refused(&|c| c[2].cam_from_rig.rotation *= 1.01);
    assert!(
        matches!(scaled, Error::InvalidRig { camera: 2, seen, .. } if (seen - 0.0201).abs() < 1e-9),
        "{scaled}"
    );
    let mirrored = refused(&|c| c[0].cam_from_rig.rotation *= -1.0);
    assert!(
        matches!(mirrored, Error::InvalidRig { camera: 0, seen, .. } if (seen + 1.0).abs() < 1e-9),
        "{mirrored}"
    );
    for (entry, value) in [((0, 0), -1.0), ((2, 2), f64::NAN), ((0, 1), 5.0)] {
        let mut covariance = Matrix6::identity();
        covariance[entry] = value;
        let error = locate_rig(&views_of(&scene.cameras, &camera, Some(covariance))).expect_err("an error");
        assert!(matches!(error, Error::InvalidRig { camera: 0, .. }), "{error}");
    }
    let on_a_line = refused(&|c| {
        let all = c.iter_mut().flat_map(|m| &mut m.seen).enumerate();
        all.for_each(|(i, c)| {
            c.x_in_target = Point::new(1.0, 2.0, 3.0) + Vector3::new(0.1, 0.2, 0.0) * i as f64
        });
    });
    assert!(matches!(on_a_line, Error::Collinear { .. }), "{on_a_line}");
    let in_one_place = refused(&|c| {
        c.iter_mut().flat_map(|m| &mut m.seen).for_each(|c| c.x_in_target = Point::new(1.0, 2.0, 3.0));
    });
    assert!(matches!(in_one_place, Error::Collinear { .. }), "{in_one_place}");
}

/// Any numbers at all give an error or finite ones: coordinates, places, sigmas and covariances over 600 orders of magnitude.
#[test]
fn hostile_numbers_give_no_nan() {
    let mut rng = Rng::new(1050);
    let (camera, mut answered) = (views::camera(), 0);
    for _ in 0..4_000 {
        let n_points = 3 + rng.index(6);
        let mut scene = head(&mut rng, 2, n_points);
        for _ in 0..1 + rng.index(3) {
            let value = 10f64.powf(rng.uniform(-300.0, 300.0)) * if rng.index(2) == 0 { 1.0 } else { -1.0 };
            let made = &mut scene.cameras[rng.index(2)];
            let point = rng.index(made.seen.len());
            let axis = rng.index(3);
            match rng.index(5) {
                0 => made.seen[point].x_in_target[axis] = value,
                1 => made.seen[point].sigma_px = value.abs(),
                2 => made.seen[point].sigma_m = value.abs(),
                3 => made.cam_from_rig.translation[axis] = value,
                _ => made.seen[point].pixel[axis % 2] = value,
            }
        }
        let size = 10f64.powf(rng.uniform(-300.0, 300.0));
        let stated = (rng.index(3) == 0).then(|| Matrix6::identity() * size);
        if let Ok(e) = locate_rig(&views_of(&scene.cameras, &camera, stated)) {
            answered += 1;
            let pose = e.rig_from_target;
            let sum = pose.rotation.sum() + pose.translation.sum() + e.covariance.sum() + e.chi2 + e.rms_px;
            assert!(sum.is_finite(), "{e:?}");
            assert!(e.covariance.diagonal().iter().all(|v| 0.0 <= *v), "{e:?}");
        }
    }
    assert!(200 < answered, "{answered}");
}

/// Cameras with one common centre, in one place and looking different ways, are a rig like any other.
#[test]
fn cameras_with_one_centre_are_fine() {
    let mut rng = Rng::new(1100);
    for _ in 0..200 {
        let mut scene = vehicle(&mut rng, 4, 0);
        for made in &mut scene.cameras {
            made.cam_from_rig.translation = Vector3::zeros();
        }
        for i in 0..8 {
            let z = rng.uniform(2.0, 8.0);
            let x_in_cam = Point::new(rng.uniform(-0.35, 0.35) * z, rng.uniform(-0.25, 0.25) * z, z);
            let target_from_cam = (scene.cameras[i % 4].cam_from_rig * scene.rig_from_target).inverse();
            scene.see(i % 4, target_from_cam * x_in_cam);
        }
        let e = solve(&scene.cameras).expect("a pose");
        assert!(scene.error(&e.rig_from_target).norm() < 1e-9);
    }
}

/// One target point seen by every camera at once is no repetition.
#[test]
fn a_point_seen_by_all_cameras_is_fine() {
    let mut rng = Rng::new(1200);
    for _ in 0..200 {
        let mut scene = head(&mut rng, 3, 0);
        for x in [[-0.4, -0.3, 0.1], [0.4, -0.3, 0.0], [0.0, 0.4, -0.2]] {
            (0..3).for_each(|camera| scene.see(camera, Point::from(x)));
        }
        let e = solve(&scene.cameras).expect("a pose");
        assert!(scene.error(&e.rig_from_target).norm() < 1e-9);
    }
}

/// Pixels, uncertain points, places of the cameras and lenses have their parts, which add up, in rigs, in one camera and after a consensus.
#[test]
fn the_parts_of_a_rig_pose_add_up() {
    let (mut rng, camera) = (Rng::new(900), views::camera());
    let mut lens = vec![0.0; 16];
    (lens[0], lens[5], lens[10], lens[15]) = (9.0, 9.0, 4.0, 4.0);
    for trial in 0..60 {
        let (n_cameras, n_points) = [(1, 8), (2, 4), (3, 9), (4, 20)][trial % 4];
        let family = FAMILIES[trial % FAMILIES.len()].1;
        let mut cameras = family(&mut rng, n_cameras, n_points).disturbed(&mut rng);
        cameras.iter_mut().flat_map(|made| &mut made.seen).for_each(|c| c.sigma_m = 2e-3);
        if trial % 5 == 0 {
            // Noise beyond what is stated.
            cameras.iter_mut().flat_map(|made| &mut made.seen).for_each(|c| c.sigma_px /= 20.0);
        }
        let mut rig = views_of(&cameras, &camera, Some(position_covariance()));
        rig.iter_mut().for_each(|view| view.intrinsics_covariance = Some(&lens));
        let Ok(found) = locate_rig(&rig) else { continue };
        let budget = found.budget(&rig).expect("its parts");
        assert_adds_up(&budget, &found.covariance, &format!("{n_cameras} cameras, {n_points} points"));
        for source in [ErrorSource::Pixels, ErrorSource::Target, ErrorSource::Lens, ErrorSource::CameraPoses]
        {
            assert!(0.0 < part(&budget, source).trace(), "{source:?}");
        }
        if 9 <= n_points
            && let Ok(consensus) = rig_consensus(&rig, 5.0)
        {
            let mut kept: Vec<Vec<Correspondence>> = vec![Vec::new(); n_cameras];
            consensus.inliers.iter().for_each(|(view, at)| kept[*view].push(rig[*view].seen[*at]));
            let agreeing: Vec<_> = rig
                .iter()
                .zip(&kept)
                .map(|(view, seen)| resight_core::multiview::rig_pose::RigView { seen, ..*view })
                .collect();
            let budget = consensus.estimate.budget(&agreeing).expect("its parts");
            assert_adds_up(&budget, &consensus.estimate.covariance, "consensus");
        }
    }
}

/// Errors of one source alone scatter the pose as its part says.
#[test]
fn each_source_of_a_rig_pose_scatters_as_its_part() {
    const N: usize = 1500;
    let (mut rng, camera) = (Rng::new(901), views::camera());
    let scene = vehicle(&mut rng, 3, 18);
    let mut lens = vec![0.0; 16];
    (lens[0], lens[5], lens[10], lens[15]) = (9.0, 9.0, 4.0, 4.0);
    let with = |cameras: &[Made], camera: &resight_core::Camera| {
        let mut rig = views_of(cameras, camera, Some(position_covariance()));
        rig.iter_mut().for_each(|view| view.intrinsics_covariance = Some(&lens));
        let found = locate_rig(&rig).expect("a pose");
        let budget = found.budget(&rig).expect("its parts");
        (found, budget)
    };
    let (exact, budget) = with(&scene.cameras, &camera);
    let whitening = exact.covariance.cholesky().expect("positive").l().try_inverse().expect("regular");
    for source in [ErrorSource::Pixels, ErrorSource::CameraPoses] {
        let (mut scatter, expected) =
            (0.0, (whitening * part(&budget, source) * whitening.transpose()).trace());
        for _ in 0..N {
            let mut cameras = scene.cameras.clone();
            match source {
                ErrorSource::Pixels => cameras = scene.disturbed(&mut rng),
                _ => cameras.iter_mut().for_each(|made| {
                    let motion = Vector6::from_fn(|_, _| 3e-3 * rng.normal());
                    made.cam_from_rig = Pose::exp(&motion) * made.cam_from_rig;
                }),
            }
            let error = whitening * scene.error(&with(&cameras, &camera).0.rig_from_target);
            scatter += error.norm_squared() / N as f64;
        }
        println!("{source:?}: {:.3} of its part, share {:.3}", scatter / expected, expected / 6.0);
        assert!((scatter / expected - 1.0).abs() < 0.1, "{source:?}: {scatter} {expected}");
    }
}
