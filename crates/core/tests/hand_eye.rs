//! Hand–eye: exactness, statistics against a bound with derivatives of its own, wrong views, motions that say too little, OpenCV's answers.

mod common;

use common::{Rng, views};
use nalgebra::{Matrix6, SMatrix, Vector3, Vector6};
use resight_core::hand_eye::{
    Candidate, HandEye, HandEyeConfig, HandView, Height, Mount, RejectedView, solve_hand_eye,
};
use resight_core::rig_pose::RigView;
use resight_core::{Correspondence, Error, Point, Pose};

type Vector12 = SMatrix<f64, 12, 1>;
type Matrix12 = SMatrix<f64, 12, 12>;

/// X, Z and stations, all exact.
#[derive(Clone)]
struct World {
    mount: Mount,
    cam_from_carrier: Pose,
    holder_from_target: Pose,
    base_from_hand: Vec<Pose>,
}

impl World {
    fn carrier_from_holder(&self, base_from_hand: &Pose) -> Pose {
        match self.mount {
            Mount::CameraOnHand => base_from_hand.inverse(),
            Mount::TargetOnHand => *base_from_hand,
        }
    }

    fn cam_from_target(&self, view: usize) -> Pose {
        let h = self.carrier_from_holder(&self.base_from_hand[view]);
        self.cam_from_carrier * h * self.holder_from_target
    }

    /// Stations from which the camera sees the target as `cam_from_target` says.
    fn standing(mount: Mount, x: Pose, z: Pose, cam_from_target: &[Pose]) -> World {
        let station = |t: &Pose| {
            let h = x.inverse() * *t * z.inverse();
            if mount == Mount::CameraOnHand { h.inverse() } else { h }
        };
        let base_from_hand = cam_from_target.iter().map(station).collect();
        World { mount, cam_from_carrier: x, holder_from_target: z, base_from_hand }
    }

    /// A robot cell: the target seen from all over a cap of 45°, 0.6 to 1.2 m away.
    fn cell(rng: &mut Rng, mount: Mount, n: usize) -> World {
        let x = Pose::new(rng.rotation(), rng.unit_vector() * 0.15);
        let z = Pose::new(rng.rotation(), Vector3::new(0.8, -0.3, 0.2));
        let seen = |rng: &mut Rng| {
            let (tilt, turn) = (rng.uniform(0.0, 0.8), rng.uniform(0.0, std::f64::consts::TAU));
            let away = Vector3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), -tilt.cos());
            let centre = away * rng.uniform(0.6, 1.2);
            let roll = Vector6::new(0.0, 0.0, rng.uniform(-1.0, 1.0), 0.0, 0.0, 0.0);
            Pose::exp(&roll) * views::looking_at(centre, Vector3::zeros())
        };
        let seen: Vec<Pose> = (0..n).map(|_| seen(rng)).collect();
        World::standing(mount, x, z, &seen)
    }

    fn motion_error(&self, found: &HandEye) -> Vector12 {
        let x = (found.cam_from_carrier * self.cam_from_carrier.inverse()).log();
        let z = (found.holder_from_target * self.holder_from_target.inverse()).log();
        Vector12::from_fn(|i, _| if i < 6 { x[i] } else { z[i - 6] })
    }

    fn config(&self) -> HandEyeConfig {
        HandEyeConfig { mount: self.mount, height: None }
    }
}

/// A random covariance with standard deviations around the two given, strongly correlated.
fn covariance(rng: &mut Rng, sigma_rad: f64, sigma_m: f64) -> Matrix6<f64> {
    let root = Matrix6::from_fn(|i, j| if i == j { 1.0 } else { 0.4 * rng.normal() });
    let scale = Matrix6::from_fn(|i, j| match (i == j, i < 3) {
        (true, true) => sigma_rad,
        (true, false) => sigma_m,
        _ => 0.0,
    });
    scale * root * root.transpose() * scale
}

fn drawn(rng: &mut Rng, covariance: &Matrix6<f64>) -> Vector6<f64> {
    covariance.cholesky().unwrap().l() * Vector6::from_fn(|_, _| rng.normal())
}

/// What a simulated view states.
#[derive(Clone)]
struct Stated {
    seen: Matrix6<f64>,
    hand: Option<Matrix6<f64>>,
}

/// Every pose disturbed by its own covariance.
fn measured(rng: &mut Rng, world: &World, stated: &[Stated]) -> Vec<HandView<'static>> {
    let view = |(i, stated): (usize, &Stated)| {
        let exact = world.base_from_hand[i];
        let base_from_hand = match &stated.hand {
            Some(covariance) => Pose::exp(&drawn(rng, covariance)) * exact,
            None => exact,
        };
        let cam_from_target = Pose::exp(&drawn(rng, &stated.seen)) * world.cam_from_target(i);
        HandView {
            base_from_hand,
            hand_covariance: stated.hand,
            candidates: vec![Candidate { cam_from_target, covariance: stated.seen, delta_chi2: 0.0 }],
            seen: &[],
        }
    };
    stated.iter().enumerate().map(view).collect()
}

fn all_stated(rng: &mut Rng, n: usize, with_hand: bool) -> Vec<Stated> {
    let one = |rng: &mut Rng| Stated {
        seen: covariance(rng, 1e-3, 1e-3),
        hand: with_hand.then(|| covariance(rng, 5e-4, 5e-4)),
    };
    (0..n).map(|_| one(rng)).collect()
}

fn exact(world: &World) -> Vec<HandView<'static>> {
    let covariance = Matrix6::from_diagonal_element(1e-6);
    let view = |i: usize| HandView {
        base_from_hand: world.base_from_hand[i],
        hand_covariance: None,
        candidates: vec![Candidate {
            cam_from_target: world.cam_from_target(i),
            covariance,
            delta_chi2: 0.0,
        }],
        seen: &[],
    };
    (0..world.base_from_hand.len()).map(view).collect()
}

/// Fisher information of both motions at the truth: derivatives by central differences of the predicted poses, the hand's noise by
/// differences too. Shares nothing with the product but Exp and Log.
fn information(world: &World, stated: &[Stated]) -> Matrix12 {
    const STEP: f64 = 1e-5;
    let mut sum = Matrix12::zeros();
    for (i, stated) in stated.iter().enumerate() {
        let truth = world.cam_from_target(i);
        let seen = |by: &Vector12, hand: &Vector6<f64>| {
            let x = Pose::exp(&by.fixed_rows::<6>(0).into_owned()) * world.cam_from_carrier;
            let z = Pose::exp(&by.fixed_rows::<6>(6).into_owned()) * world.holder_from_target;
            let h = world.carrier_from_holder(&(Pose::exp(hand) * world.base_from_hand[i]));
            (x * h * z * truth.inverse()).log()
        };
        let still = Vector6::zeros();
        let by_both = SMatrix::<f64, 6, 12>::from_fn(|row, column| {
            let h = Vector12::ith(column, STEP);
            (seen(&h, &still) - seen(&-h, &still))[row] / (2.0 * STEP)
        });
        let by_hand = Matrix6::from_fn(|row, column| {
            let h = Vector6::ith(column, STEP);
            (seen(&Vector12::zeros(), &h) - seen(&Vector12::zeros(), &-h))[row] / (2.0 * STEP)
        });
        let hand = stated.hand.map_or(Matrix6::zeros(), |c| by_hand * c * by_hand.transpose());
        sum += by_both.transpose() * (stated.seen + hand).try_inverse().unwrap() * by_both;
    }
    sum
}

fn block(m: &Matrix12, at: usize) -> Matrix6<f64> {
    m.fixed_view::<6, 6>(at, at).into()
}

fn part(v: &Vector12, at: usize) -> Vector6<f64> {
    v.fixed_rows::<6>(at).into()
}

fn squared(error: &Vector6<f64>, covariance: &Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().unwrap().solve(error))
}

const MOUNTS: [Mount; 2] = [Mount::CameraOnHand, Mount::TargetOnHand];

/// Rounding of a lever arm of a metre, some operations deep.
#[test]
fn exact_motions_give_the_exact_answer() {
    let mut rng = Rng::new(101);
    for mount in MOUNTS {
        for n in [3, 4, 10, 40] {
            let world = World::cell(&mut rng, mount, n);
            let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
            assert!(world.motion_error(&found).amax() < 1e-12 && found.n_used == n, "{mount:?} {n}");
            assert!(!found.is_inconsistent && found.noise_scale == 1.0);
        }
    }
}

/// A vehicle on a map: coordinates of 5·10⁶ m have steps of 1e-9 m, and a turn of 1e-12 rad there is 5e-6 m.
#[test]
fn a_base_far_away_costs_no_digits_but_its_own() {
    let mut rng = Rng::new(102);
    for mount in MOUNTS {
        let near = World::cell(&mut rng, mount, 8);
        let far = Pose::new(rng.rotation(), Vector3::new(4e5, 5e6, 300.0));
        let base_from_hand = near.base_from_hand.iter().map(|pose| far * *pose).collect();
        let mut world = World { base_from_hand, ..near.clone() };
        match mount {
            Mount::CameraOnHand => world.holder_from_target = far * near.holder_from_target,
            Mount::TargetOnHand => world.cam_from_carrier = near.cam_from_carrier * far.inverse(),
        }
        let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
        let off = |a: &Pose, b: &Pose| (a.translation - b.translation).norm();
        let (x, z) = (&found.cam_from_carrier, &found.holder_from_target);
        let near_side = if mount == Mount::CameraOnHand {
            off(x, &world.cam_from_carrier)
        } else {
            off(z, &world.holder_from_target)
        };
        assert!(near_side < 1e-8, "{mount:?} {near_side}");
        assert!(
            x.angle_to_rad(&world.cam_from_carrier) < 1e-8
                && z.angle_to_rad(&world.holder_from_target) < 1e-8
        );
    }
}

/// NEES of both poses, and the mean squared error against the Cramér–Rao bound. 1500 runs: 6 ± 0.09.
#[test]
fn covariance_and_efficiency_are_those_of_the_bound() {
    for (mount, with_hand, seed) in [
        (Mount::CameraOnHand, true, 103),
        (Mount::TargetOnHand, true, 104),
        (Mount::CameraOnHand, false, 105),
    ] {
        let mut rng = Rng::new(seed);
        let (mut nees, mut in_bounds, mut rejected, runs) = ([0.0; 2], [0.0; 2], 0, 1500);
        let world = World::cell(&mut rng, mount, 8);
        let stated = all_stated(&mut rng, 8, with_hand);
        let bound = information(&world, &stated).try_inverse().unwrap();
        for _ in 0..runs {
            let found = solve_hand_eye(&measured(&mut rng, &world, &stated), &world.config()).unwrap();
            let error = world.motion_error(&found);
            for (k, covariance) in [found.carrier_covariance, found.holder_covariance].iter().enumerate() {
                nees[k] += squared(&part(&error, 6 * k), covariance) / f64::from(runs);
                in_bounds[k] += squared(&part(&error, 6 * k), &block(&bound, 6 * k)) / f64::from(runs);
            }
            rejected += 8 - found.n_used;
        }
        println!(
            "{mount:?} hand noise {with_hand}: NEES {nees:.3?}, efficiency {:.3?}, rejected {rejected}",
            in_bounds.map(|x| 6.0 / x)
        );
        for k in 0..2 {
            assert!(5.7 < nees[k] && nees[k] < 6.3, "{mount:?} {nees:?}");
            assert!(0.95 < 6.0 / in_bounds[k], "{mount:?} {in_bounds:?}");
        }
        // 1e-4 for each of 12,000 good views, and ten times that for views first left out by the trimming.
        assert!(rejected < 24, "{rejected}");
    }
}

/// The same with pixels, two cameras on the hand whose places are known and a hand that is not exact.
#[test]
fn pixels_give_an_honest_covariance() {
    let mut rng = Rng::new(106);
    let (runs, n) = (500, 6);
    let world = World::cell(&mut rng, Mount::CameraOnHand, n);
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
                    seen,
                })
            })
            .collect();
        let views: Vec<HandView> = (0..n)
            .map(|i| HandView {
                base_from_hand: Pose::exp(&drawn(&mut rng, &hand)) * world.base_from_hand[i],
                hand_covariance: Some(hand),
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
    let world = World::cell(&mut rng, Mount::CameraOnHand, 6);
    let stated = all_stated(&mut rng, 6, false);
    let views = measured(&mut rng, &world, &stated);
    let found = solve_hand_eye(&views, &world.config()).unwrap();
    let cost = |by: &Vector12| -> f64 {
        let x = Pose::exp(&part(by, 0)) * found.cam_from_carrier;
        let z = Pose::exp(&part(by, 6)) * found.holder_from_target;
        let one = |view: &HandView| {
            let r = (view.candidates[0].cam_from_target * (x * view.base_from_hand.inverse() * z).inverse())
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

/// A view whose pose is the mirror image, one whose hand pose belongs to the next, one whose target was moved: named, and no others.
#[test]
fn wrong_views_are_named_and_do_no_harm() {
    let mut rng = Rng::new(108);
    for (run, mount) in (0..30).map(|run| (run, MOUNTS[run % 2])) {
        let (n, with_hand) = (12, run % 3 == 0);
        let world = World::cell(&mut rng, mount, n);
        let stated = all_stated(&mut rng, n, with_hand);
        let mut views = measured(&mut rng, &world, &stated);
        let flip = Pose::exp(&Vector6::new(0.9, 0.3, 0.0, 0.0, 0.0, 0.0));
        let turned = views[2].candidates[0].cam_from_target;
        views[2].candidates[0].cam_from_target = turned * flip;
        views[5].base_from_hand = views[6].base_from_hand;
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
        let world = World::cell(&mut rng, Mount::CameraOnHand, 10);
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
        let world = World::standing(Mount::CameraOnHand, x, z, &stations);
        let found = solve_hand_eye(&exact(&world), &world.config()).unwrap();
        assert!(world.motion_error(&found).amax() < 1e-9, "run {run}: {}", world.motion_error(&found).amax());
    }
}

/// A vehicle: turns about the vertical only.
fn vehicle(rng: &mut Rng, n: usize) -> World {
    let x = Pose::new(rng.rotation(), rng.unit_vector() * 0.5);
    let z = Pose::new(rng.rotation(), Vector3::new(3.0, 1.0, 0.5));
    let station = |rng: &mut Rng| {
        let mut base_from_hand = Pose::exp(&Vector6::new(0.0, 0.0, rng.uniform(-1.0, 1.0), 0.0, 0.0, 0.0));
        base_from_hand.translation = Vector3::new(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.0);
        base_from_hand
    };
    let base_from_hand = (0..n).map(|_| station(rng)).collect();
    World { mount: Mount::CameraOnHand, cam_from_carrier: x, holder_from_target: z, base_from_hand }
}

/// The camera's place in the hand's frame along z.
fn height(world: &World, sigma_m: f64) -> Height {
    let height_m = world.cam_from_carrier.origin().z;
    Height { direction_in_carrier: Vector3::new(0.0, 0.0, 2.0), height_m, sigma_m }
}

#[test]
fn motions_that_say_too_little_are_refused_by_name() {
    let mut rng = Rng::new(111);
    let refused = |world: &World, height: Option<Height>| {
        let config = HandEyeConfig { mount: world.mount, height };
        solve_hand_eye(&exact(world), &config).unwrap_err()
    };
    let planar = vehicle(&mut rng, 8);
    let parallel = refused(&planar, None);
    assert!(matches!(parallel, Error::DegenerateMotion { metric, .. } if metric < 1e-6), "{parallel}");
    assert!(parallel.to_string().contains("second axis") && parallel.to_string().contains("height_known"));
    let across = Height { direction_in_carrier: Vector3::x(), height_m: 0.0, sigma_m: 0.01 };
    assert!(refused(&planar, Some(across)).to_string().contains("across"));
    let mut shifted = planar.clone();
    for pose in &mut shifted.base_from_hand {
        pose.rotation = nalgebra::Matrix3::identity();
    }
    assert!(refused(&shifted, None).to_string().contains("shifts alone"));
    assert!(refused(&shifted, Some(height(&shifted, 0.01))).to_string().contains("shifts alone"));
    let two = World::cell(&mut rng, Mount::CameraOnHand, 2);
    assert_eq!(refused(&two, None), Error::TooFewMotions { seen: 2, needed: 3 });
    assert_eq!(
        refused(&World::cell(&mut rng, Mount::TargetOnHand, 0), None),
        Error::TooFewMotions { seen: 0, needed: 3 }
    );
}

/// A wrong hand pose that looks like a second axis does not make a vehicle's turns sufficient.
#[test]
fn a_wrong_view_is_no_second_axis() {
    let mut rng = Rng::new(112);
    let world = vehicle(&mut rng, 10);
    let mut views = exact(&world);
    views[4].base_from_hand =
        views[4].base_from_hand * Pose::exp(&Vector6::new(0.6, 0.2, 0.0, 0.0, 0.0, 0.0));
    let found = solve_hand_eye(&views, &world.config());
    assert!(matches!(found, Err(Error::DegenerateMotion { .. } | Error::NotConverged { .. })), "{found:?}");
}

/// With the height known, a vehicle's turns say everything: exact, and honest within noise.
#[test]
fn a_known_height_completes_a_vehicle() {
    let mut rng = Rng::new(113);
    let world = vehicle(&mut rng, 8);
    let config = HandEyeConfig { mount: Mount::CameraOnHand, height: Some(height(&world, 1e-3)) };
    let found = solve_hand_eye(&exact(&world), &config).unwrap();
    assert!(world.motion_error(&found).amax() < 1e-10, "{}", world.motion_error(&found));
    let stated = all_stated(&mut rng, 8, true);
    let (mut nees, runs) = (0.0, 500);
    for _ in 0..runs {
        let views = measured(&mut rng, &world, &stated);
        let mut height = height(&world, 1e-3);
        height.height_m += 1e-3 * rng.normal();
        let found =
            solve_hand_eye(&views, &HandEyeConfig { mount: Mount::CameraOnHand, height: Some(height) });
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
    let world = World::cell(&mut rng, Mount::CameraOnHand, 12);
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
    let world = World::cell(&mut rng, Mount::CameraOnHand, 9);
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
    let world = World::cell(&mut rng, Mount::CameraOnHand, 5);
    let spoil: [fn(&mut HandView); 6] = [
        |view| view.base_from_hand.translation.x = f64::NAN,
        |view| view.base_from_hand.rotation *= -1.0,
        |view| view.base_from_hand.rotation *= 1.1,
        |view| view.hand_covariance = Some(-Matrix6::identity()),
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
    let config = HandEyeConfig { mount: Mount::CameraOnHand, height: Some(height) };
    assert!(matches!(solve_hand_eye(&exact(&world), &config), Err(Error::InvalidSetting { .. })));
}

/// A row of the table: what, of which problem, 3×4.
fn table_rows() -> Vec<(&'static str, usize, Pose)> {
    let row = |line: &'static str| {
        let mut words = line.split(' ');
        let (name, number) = (words.next().unwrap(), words.next().unwrap().parse().unwrap());
        let v: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
        let rotation = nalgebra::Matrix3::from_fn(|i, j| v[4 * i + j]);
        (name, number, Pose::new(rotation, Vector3::new(v[3], v[7], v[11])))
    };
    include_str!("hand_eye_tables/opencv.txt").lines().filter(|l| !l.starts_with('#')).map(row).collect()
}

/// Root mean square angle and distance of `hand_from_cam` from the truth over all problems.
fn rms_off(found: &[Pose], truth: &[Pose]) -> (f64, f64) {
    let n = truth.len() as f64;
    let turn = found.iter().zip(truth).map(|(f, t)| f.angle_to_rad(t).powi(2)).sum::<f64>() / n;
    let shift =
        found.iter().zip(truth).map(|(f, t)| (f.origin() - t.origin()).norm_squared()).sum::<f64>() / n;
    (turn.sqrt(), shift.sqrt())
}

/// Sixty noisy problems and the seven methods of OpenCV 4.12: in units of the stated covariance (6 is what it promises) none is as near to
/// the truth. Turn and place alone differ by chance from problem to problem, so there a method may be ahead by 5 %: over 1000 problems we have
/// 0.147° and 2.67 mm, the best of theirs 0.154° and 2.79 mm. How the table was made: docs/math/check/hand_eye.py.
#[test]
fn no_method_of_opencv_is_better() {
    let rows = table_rows();
    let of = |name: &str, number: usize| -> Vec<Pose> {
        rows.iter().filter(|r| r.0 == name && r.1 == number).map(|r| r.2).collect()
    };
    let all = |name: &str| -> Vec<Pose> { rows.iter().filter(|r| r.0 == name).map(|r| r.2).collect() };
    let isotropic = |rad: f64, m: f64| {
        Matrix6::from_diagonal(&Vector6::new(rad, rad, rad, m, m, m).map(|sigma| sigma * sigma))
    };
    let solve = |number: usize| {
        let view = |(base_from_hand, cam_from_target): (Pose, Pose)| HandView {
            base_from_hand,
            hand_covariance: Some(isotropic(5e-4, 5e-4)),
            candidates: vec![Candidate {
                cam_from_target,
                covariance: isotropic(2e-3, 1.5e-3),
                delta_chi2: 0.0,
            }],
            seen: &[],
        };
        let views: Vec<HandView> = of("hand", number).into_iter().zip(of("seen", number)).map(view).collect();
        solve_hand_eye(&views, &HandEyeConfig::default()).unwrap()
    };
    let truth = all("truth_x");
    assert_eq!(truth.len(), 60);
    let found: Vec<HandEye> = (0..truth.len()).map(solve).collect();
    let normalised = |poses: &[Pose]| {
        let one = |i: usize| squared(&(poses[i] * truth[i].inverse()).log(), &found[i].carrier_covariance);
        (0..truth.len()).map(one).sum::<f64>() / truth.len() as f64
    };
    let ours: Vec<Pose> = found.iter().map(|f| f.cam_from_carrier).collect();
    let (own, own_off) = (normalised(&ours), rms_off(&ours, &truth));
    println!("ours: {own:.2}, {:.4}° {:.3} mm", own_off.0.to_degrees(), 1e3 * own_off.1);
    for method in ["Tsai", "Park", "Horaud", "Andreff", "Daniilidis", "Shah", "Li"] {
        let theirs = all(method);
        let (other, off) = (normalised(&theirs), rms_off(&theirs, &truth));
        println!("{method}: {other:.2}, {:.4}° {:.3} mm", off.0.to_degrees(), 1e3 * off.1);
        assert!(own < other, "{method}: {other}, ours {own}");
        assert!(own_off.0 < 1.05 * off.0 && own_off.1 < 1.05 * off.1, "{method} {own_off:?} {off:?}");
    }
    // 6 ± 0.45 for 60 problems.
    assert!((4.6..7.4).contains(&own), "{own}");
}
