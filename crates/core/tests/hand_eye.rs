//! Hand–eye: exactness, statistics against a bound with derivatives of its own, wrong views, motions that say too little.

use crate::common::hands::{
    Vector12, World, all_stated, best_linear, block, covariance, drawn, exact, information, linearised,
    measured, part, squared,
};
use crate::common::{Rng, views};
use nalgebra::{Matrix6, Vector3, Vector6};
use resight_core::multiview::hand_eye::{
    Candidate, HandEyeConfig, HandEyeView, Height, Mounting, RejectedView, solve_hand_eye,
};
use resight_core::multiview::rig_pose::RigView;
use resight_core::{Correspondence, Error, Point, Pose};

const MOUNTS: [Mounting; 2] = [Mounting::CameraOnGripper, Mounting::TargetOnGripper];

/// Rounding of a lever arm of a metre, some operations deep.
#[test]
fn exact_motions_give_the_exact_answer() {
    let mut rng = Rng::new(101);
    for mounting in MOUNTS {
        for n in [3, 4, 10, 40] {
            let world = World::cell(&mut rng, mounting, n);
            let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
            assert!(world.motion_error(&found).amax() < 1e-12 && found.n_used == n, "{mounting:?} {n}");
            assert!(!found.is_inconsistent && found.noise_scale == 1.0);
        }
    }
}

/// A vehicle on a map: coordinates of 5·10⁶ m have steps of 1e-9 m, and a rotation of 1e-12 rad there is 5e-6 m.
#[test]
fn a_base_far_away_costs_no_digits_but_its_own() {
    let mut rng = Rng::new(102);
    for mounting in MOUNTS {
        let near = World::cell(&mut rng, mounting, 8);
        let far = Pose::new(rng.rotation(), Vector3::new(4e5, 5e6, 300.0));
        let base_from_gripper = near.base_from_gripper.iter().map(|pose| far * *pose).collect();
        let mut world = World { base_from_gripper, ..near.clone() };
        match mounting {
            Mounting::CameraOnGripper => world.holder_from_target = far * near.holder_from_target,
            Mounting::TargetOnGripper => world.cam_from_carrier = near.cam_from_carrier * far.inverse(),
        }
        let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
        let off = |a: &Pose, b: &Pose| (a.translation - b.translation).norm();
        let (x, z) = (&found.cam_from_carrier, &found.holder_from_target);
        let near_side = if mounting == Mounting::CameraOnGripper {
            off(x, &world.cam_from_carrier)
        } else {
            off(z, &world.holder_from_target)
        };
        assert!(near_side < 1e-8, "{mounting:?} {near_side}");
        assert!(
            x.angle_to_rad(&world.cam_from_carrier) < 1e-8
                && z.angle_to_rad(&world.holder_from_target) < 1e-8
        );
    }
}

/// NEES of both poses, and the mean squared error against the Cramér–Rao bound, beside what the best linear estimator has on the same
/// measurements, whose means are known: 1000 runs leave ± 0.05 and ± 0.006.
#[test]
fn covariance_and_efficiency_are_those_of_the_bound() {
    for (mounting, with_hand, seed) in [
        (Mounting::CameraOnGripper, true, 103),
        (Mounting::TargetOnGripper, true, 104),
        (Mounting::CameraOnGripper, false, 105),
    ] {
        let mut rng = Rng::new(seed);
        let (mut nees, mut in_bounds, mut rejected, runs) = ([6.0; 2], [6.0; 2], 0, 1000);
        let world = World::cell(&mut rng, mounting, 8);
        let stated = all_stated(&mut rng, 8, with_hand);
        let bound = information(&world, &stated).try_inverse().unwrap();
        let lines = linearised(&world, &stated);
        for _ in 0..runs {
            let views = measured(&mut rng, &world, &stated);
            let found = solve_hand_eye(&views, &world.config()).unwrap();
            let (error, linear) = (world.motion_error(&found), best_linear(&world, &lines, &views));
            for (k, covariance) in [found.carrier_covariance, found.holder_covariance].iter().enumerate() {
                let least = squared(&part(&linear, 6 * k), &block(&bound, 6 * k));
                nees[k] += (squared(&part(&error, 6 * k), covariance) - least) / f64::from(runs);
                in_bounds[k] +=
                    (squared(&part(&error, 6 * k), &block(&bound, 6 * k)) - least) / f64::from(runs);
            }
            rejected += 8 - found.n_used;
        }
        println!(
            "{mounting:?} hand noise {with_hand}: NEES {nees:.3?}, efficiency {:.3?}, rejected {rejected}",
            in_bounds.map(|x| 6.0 / x)
        );
        for k in 0..2 {
            assert!(5.7 < nees[k] && nees[k] < 6.3, "{mounting:?} {nees:?}");
            assert!(0.97 < 6.0 / in_bounds[k], "{mounting:?} {in_bounds:?}");
        }
        // 1e-4 for each of 8,000 good views, and ten times that for views first left out by the trimming.
        assert!(rejected < 17, "{rejected}");
    }
}

/// The same with pixels, two cameras on the gripper whose places are known and a hand that is not exact.
#[test]
fn pixels_give_an_honest_covariance() {
    let mut rng = Rng::new(106);
    let (runs, n) = (500, 6);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, n);
    let hand = covariance(&mut rng, 5e-4, 5e-4);
    let points: Vec<Point> = views::planar().iter().map(|p| (p - Point::new(0.5, 0.5, 0.0)) * 0.3).collect();
    let camera = views::camera();
    let second = Pose::exp(&Vector6::new(0.02, -0.1, 0.05, -0.1, 0.01, 0.0));
    let (mut nees, mut chi2, mut degrees) = ([0.0; 2], 0.0, 0);
    for _ in 0..runs {
        let pixels: Vec<[Vec<Correspondence>; 2]> = (0..n)
            .map(|i| {
                let t = world.cam_from_target(i);
                [t, second * t].map(|t| views::disturbed(&mut rng, &views::seen_from(&t, &points, 0.3)))
            })
            .collect();
        let rigs: Vec<[RigView; 2]> = pixels
            .iter()
            .map(|seen| {
                [(Pose::identity(), &seen[0]), (second, &seen[1])].map(|(cam_from_rig, seen)| RigView {
                    camera: &camera,
                    cam_from_rig,
                    cam_from_rig_covariance: None,
                    intrinsics_covariance: None,
                    seen,
                })
            })
            .collect();
        let views: Vec<HandEyeView> = (0..n)
            .map(|i| HandEyeView {
                base_from_gripper: Pose::exp(&drawn(&mut rng, &hand)) * world.base_from_gripper[i],
                gripper_covariance: Some(hand),
                written: None,
                candidates: Vec::new(),
                seen: &rigs[i],
            })
            .collect();
        let found = solve_hand_eye(&views, &world.config()).unwrap();
        let error = world.motion_error(&found);
        nees[0] += squared(&part(&error, 0), &found.carrier_covariance) / f64::from(runs);
        nees[1] += squared(&part(&error, 6), &found.holder_covariance) / f64::from(runs);
        chi2 += found.chi2;
        degrees += found.degrees_of_freedom;
    }
    println!("pixels: NEES {nees:.3?}, χ² per degree of freedom {:.4}", chi2 / degrees as f64);
    // 6 ± 0.155 for 500 runs.
    assert!(nees.iter().all(|x| 5.6 < *x && *x < 6.4), "{nees:?}");
    // One in a hundred: 500 runs of 180 numbers, ± 0.005.
    assert!((chi2 / degrees as f64 - 1.0).abs() < 0.02);
}

/// No motion of X and Z lowers the plain sum of squares, written out here once more.
#[test]
fn the_answer_is_the_minimum() {
    let mut rng = Rng::new(107);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, 6);
    let stated = all_stated(&mut rng, 6, false);
    let mut views = measured(&mut rng, &world, &stated);
    // The sum below knows of no noise of the gripper.
    views.iter_mut().for_each(|view| view.gripper_covariance = Some(Matrix6::zeros()));
    let found = solve_hand_eye(&views, &world.config()).unwrap();
    let cost = |by: &Vector12| -> f64 {
        let x = Pose::exp(&part(by, 0)) * found.cam_from_carrier;
        let z = Pose::exp(&part(by, 6)) * found.holder_from_target;
        let one = |view: &HandEyeView| {
            let r = (view.candidates[0].cam_from_target
                * (x * view.base_from_gripper.inverse() * z).inverse())
            .log();
            r.dot(&(view.candidates[0].covariance.try_inverse().unwrap() * r))
        };
        views.iter().map(one).sum()
    };
    let least = cost(&Vector12::zeros());
    assert!((least - found.chi2).abs() < 1e-6 * least, "{least} {}", found.chi2);
    for i in 0..12 {
        for step in [-1e-4, 1e-4] {
            assert!(least < cost(&Vector12::ith(i, step)), "{i} {step}");
        }
    }
}

/// A view whose pose is the mirror image, one whose gripper pose belongs to the next, one whose target was moved: named, and no others.
#[test]
fn wrong_views_are_named_and_do_no_harm() {
    let mut rng = Rng::new(108);
    for (run, mounting) in (0..30).map(|run| (run, MOUNTS[run % 2])) {
        let (n, with_hand) = (12, run % 3 == 0);
        let world = World::cell(&mut rng, mounting, n);
        let stated = all_stated(&mut rng, n, with_hand);
        let mut views = measured(&mut rng, &world, &stated);
        let flip = Pose::exp(&Vector6::new(0.9, 0.3, 0.0, 0.0, 0.0, 0.0));
        let turned = views[2].candidates[0].cam_from_target;
        views[2].candidates[0].cam_from_target = turned * flip;
        views[5].base_from_gripper = views[6].base_from_gripper;
        let shifted = views[9].candidates[0].cam_from_target;
        views[9].candidates[0].cam_from_target =
            shifted * Pose::new(nalgebra::Matrix3::identity(), Vector3::new(0.05, 0.0, 0.0));
        let found = solve_hand_eye(&views, &world.config()).unwrap();
        let rejected: Vec<usize> = (0..n).filter(|i| found.views[*i].rejected.is_some()).collect();
        assert_eq!(rejected, [2, 5, 9], "run {run}");
        assert_eq!(found.views[2].rejected, Some(RejectedView::Contradicts));
        let error = world.motion_error(&found);
        // χ² with six degrees of freedom: 35 is exceeded four times in a million.
        assert!(squared(&part(&error, 0), &found.carrier_covariance) < 35.0, "run {run}");
    }
}

/// Where every view has a mirror image beside its pose, and half of them have it first, the right ones are picked.
#[test]
fn of_two_poses_the_one_that_agrees_is_taken() {
    let mut rng = Rng::new(109);
    for run in 0..10 {
        let world = World::cell(&mut rng, Mounting::CameraOnGripper, 10);
        let stated = all_stated(&mut rng, 10, true);
        let mut views = measured(&mut rng, &world, &stated);
        for (i, view) in views.iter_mut().enumerate() {
            let right = view.candidates[0];
            let turn = rng.unit_vector() * 0.7;
            let flip = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0));
            let wrong = Candidate { cam_from_target: right.cam_from_target * flip, delta_chi2: 0.0, ..right };
            view.candidates = if i % 2 == 0 { vec![right, wrong] } else { vec![wrong, right] };
        }
        let found = solve_hand_eye(&views, &world.config()).unwrap();
        let picked: Vec<_> = found.views.iter().map(|view| view.candidate.unwrap()).collect();
        assert_eq!(picked, (0..10).map(|i| i % 2).collect::<Vec<_>>(), "run {run}");
        assert_eq!(found.n_used, 10);
    }
}

/// Half turns about two axes, with turns that end within 1e-9 of π on either side.
#[test]
fn half_turns_are_no_special_case() {
    let mut rng = Rng::new(110);
    for run in 0..20 {
        let x = Pose::new(rng.rotation(), rng.unit_vector() * 0.2);
        let z = Pose::new(rng.rotation(), rng.unit_vector());
        let start = Pose::new(rng.rotation(), rng.unit_vector());
        let axes = [rng.unit_vector(), rng.unit_vector(), rng.unit_vector()];
        let angle = std::f64::consts::PI + 1e-9 * rng.normal();
        let mut stations = vec![start];
        for axis in axes {
            let w = axis * angle;
            let t = rng.unit_vector() * 0.4;
            stations.push(Pose::exp(&Vector6::new(w.x, w.y, w.z, t.x, t.y, t.z)) * start);
        }
        let world = World::standing(Mounting::CameraOnGripper, x, z, &stations);
        let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
        assert!(world.motion_error(&found).amax() < 1e-9, "run {run}: {}", world.motion_error(&found).amax());
    }
}

/// A vehicle: turns about the vertical only.
fn vehicle(rng: &mut Rng, n: usize) -> World {
    let x = Pose::new(rng.rotation(), rng.unit_vector() * 0.5);
    let z = Pose::new(rng.rotation(), Vector3::new(3.0, 1.0, 0.5));
    let station = |rng: &mut Rng| {
        let mut base_from_gripper = Pose::exp(&Vector6::new(0.0, 0.0, rng.uniform(-1.0, 1.0), 0.0, 0.0, 0.0));
        base_from_gripper.translation = Vector3::new(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.0);
        base_from_gripper
    };
    let base_from_gripper = (0..n).map(|_| station(rng)).collect();
    World {
        mounting: Mounting::CameraOnGripper,
        cam_from_carrier: x,
        holder_from_target: z,
        base_from_gripper,
    }
}

/// The camera's position in the gripper's frame along z.
fn height(world: &World, sigma_m: f64) -> Height {
    let height_m = world.cam_from_carrier.origin().z;
    Height { direction_in_carrier: Vector3::new(0.0, 0.0, 2.0), height_m, sigma_m }
}

#[test]
fn motions_that_say_too_little_are_refused_by_name() {
    let mut rng = Rng::new(111);
    let refused = |world: &World, height: Option<Height>| {
        let config = HandEyeConfig { mounting: world.mounting, height, ..HandEyeConfig::default() };
        solve_hand_eye(&exact(world), &config).unwrap_err()
    };
    let planar = vehicle(&mut rng, 8);
    let parallel = refused(&planar, None);
    assert!(matches!(parallel, Error::DegenerateMotion { metric, .. } if metric < 1e-6), "{parallel}");
    assert!(parallel.to_string().contains("second axis") && parallel.to_string().contains("height_known"));
    let across = Height { direction_in_carrier: Vector3::x(), height_m: 0.0, sigma_m: 0.01 };
    assert!(refused(&planar, Some(across)).to_string().contains("across"));
    let mut shifted = planar.clone();
    for pose in &mut shifted.base_from_gripper {
        pose.rotation = nalgebra::Matrix3::identity();
    }
    assert!(refused(&shifted, None).to_string().contains("shifts alone"));
    assert!(refused(&shifted, Some(height(&shifted, 0.01))).to_string().contains("shifts alone"));
    let two = World::cell(&mut rng, Mounting::CameraOnGripper, 2);
    assert_eq!(refused(&two, None), Error::TooFewMotions { seen: 2, needed: 3 });
    assert_eq!(
        refused(&World::cell(&mut rng, Mounting::TargetOnGripper, 0), None),
        Error::TooFewMotions { seen: 0, needed: 3 }
    );
}

/// A wrong gripper pose that looks like a second axis does not make a vehicle's turns sufficient.
#[test]
fn a_wrong_view_is_no_second_axis() {
    let mut rng = Rng::new(112);
    let world = vehicle(&mut rng, 10);
    let mut views = exact(&world);
    views[4].base_from_gripper =
        views[4].base_from_gripper * Pose::exp(&Vector6::new(0.6, 0.2, 0.0, 0.0, 0.0, 0.0));
    let found = solve_hand_eye(&views, &world.config());
    assert!(matches!(found, Err(Error::DegenerateMotion { .. } | Error::ViewsDisagree { .. })), "{found:?}");
}

/// With the height known, a vehicle's turns say everything: exact, and honest within noise.
#[test]
fn a_known_height_completes_a_vehicle() {
    let mut rng = Rng::new(113);
    let world = vehicle(&mut rng, 8);
    let config = HandEyeConfig {
        mounting: Mounting::CameraOnGripper,
        height: Some(height(&world, 1e-3)),
        ..HandEyeConfig::default()
    };
    let found = solve_hand_eye(&exact(&world), &config).unwrap();
    assert!(world.motion_error(&found).amax() < 1e-10, "{}", world.motion_error(&found));
    let stated = all_stated(&mut rng, 8, true);
    let (mut nees, runs) = (0.0, 500);
    for _ in 0..runs {
        let views = measured(&mut rng, &world, &stated);
        let mut height = height(&world, 1e-3);
        height.height_m += 1e-3 * rng.normal();
        let found = solve_hand_eye(
            &views,
            &HandEyeConfig {
                mounting: Mounting::CameraOnGripper,
                height: Some(height),
                ..HandEyeConfig::default()
            },
        );
        let found = found.unwrap();
        nees += squared(&part(&world.motion_error(&found), 0), &found.carrier_covariance) / f64::from(runs);
    }
    println!("vehicle with a known height: NEES {nees:.3}");
    // 6 ± 0.155 for 500 runs.
    assert!(5.6 < nees && nees < 6.4, "{nees}");
}

/// A target said to be a tenth larger than it is: no view is to blame, the answer says that the residuals are too large.
#[test]
fn a_wrong_size_is_inconsistent() {
    let mut rng = Rng::new(114);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, 12);
    let stated = all_stated(&mut rng, 12, true);
    let mut views = measured(&mut rng, &world, &stated);
    for view in &mut views {
        view.candidates[0].cam_from_target.translation *= 1.1;
    }
    let found = solve_hand_eye(&views, &world.config()).unwrap();
    assert!(found.is_inconsistent && 4.0 < found.noise_scale, "{}", found.noise_scale);
}

/// The order of the views has no say.
#[test]
fn order_does_not_matter() {
    let mut rng = Rng::new(115);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, 9);
    let stated = all_stated(&mut rng, 9, true);
    let mut views = measured(&mut rng, &world, &stated);
    let first = solve_hand_eye(&views, &world.config()).unwrap();
    views.reverse();
    let second = solve_hand_eye(&views, &world.config()).unwrap();
    let off = (first.cam_from_carrier * second.cam_from_carrier.inverse()).log();
    // The loop ends 3·10⁻⁴ standard deviations or nearer to the minimum.
    assert!(squared(&off, &first.carrier_covariance).sqrt() < 1e-3);
}

#[test]
fn bad_numbers_are_refused() {
    let mut rng = Rng::new(116);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, 5);
    let spoil: [fn(&mut HandEyeView); 6] = [
        |view| view.base_from_gripper.translation.x = f64::NAN,
        |view| view.base_from_gripper.rotation *= -1.0,
        |view| view.base_from_gripper.rotation *= 1.1,
        |view| view.gripper_covariance = Some(-Matrix6::identity()),
        |view| view.candidates[0].covariance = Matrix6::zeros(),
        |view| view.candidates[0].delta_chi2 = -1.0,
    ];
    for (i, spoil) in spoil.iter().enumerate() {
        let mut views = exact(&world);
        spoil(&mut views[3]);
        let error = solve_hand_eye(&views, &world.config()).unwrap_err();
        assert!(matches!(error, Error::InvalidPose { item: "view", index: 3, .. }), "{i}: {error}");
    }
    let height = Height { direction_in_carrier: Vector3::zeros(), height_m: 0.0, sigma_m: 1.0 };
    let config = HandEyeConfig {
        mounting: Mounting::CameraOnGripper,
        height: Some(height),
        ..HandEyeConfig::default()
    };
    assert!(matches!(solve_hand_eye(&exact(&world), &config), Err(Error::InvalidSetting { .. })));
}
