//! The poses of cameras in a rig: exact and noisy pixels, the paper's own pair, the order of the input.

use crate::common::rooms::Room;
use crate::common::{Rng, rooms};
use nalgebra::{Matrix3, Vector3};
use resight_core::camera::{Photogrammetric, PhotogrammetricParameters};
use resight_core::multiview::rig::{BodyInView, Observation, RigConfig, RigSolution};
use resight_core::{Camera, Correspondence, Lens, Point, Pose, Vector6};

/// Largest difference of any body's place from the truth.
fn worst_body(room: &Room, solution: &RigSolution) -> f64 {
    let of = |b: &BodyInView| {
        let (_, _, truth) = room.bodies.iter().find(|t| (t.0, t.1) == (b.view, b.body)).expect("a body");
        (b.rig_from_body * truth.inverse()).log().norm()
    };
    solution.bodies.iter().map(of).fold(0.0, f64::max)
}

#[test]
fn exact_pixels_give_the_exact_rig() {
    let mut rng = Rng::new(1);
    let cameras =
        (0..5).map(|i| if i % 2 == 0 { rooms::pinhole(900.0) } else { rooms::barrel(900.0) }).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(6, 5, 0.08), 20, 0.3);
    for reference in [0, 3] {
        let config = RigConfig { reference, ..RigConfig::default() };
        let solution = room.solve(&room.observations, &config).expect("a rig");
        let rig_from_first = room.cam_from_rig[reference];
        for c in 0..5 {
            let truth = room.cam_from_rig[c] * rig_from_first.inverse();
            let motion = (solution.cameras[c].cam_from_rig * truth.inverse()).log();
            assert!(motion.norm() < 1e-12, "camera {c}: {motion}");
        }
        assert_eq!(solution.cameras[reference].cam_from_rig, Pose::identity());
        assert_eq!(solution.n_used, solution.n_seen);
    }
    let solution = room.solve(&room.observations, &RigConfig::default()).expect("a rig");
    assert!(worst_body(&room, &solution) < 1e-12);
}

/// Several targets on one body in unknown places, another body that moves on its own, and a camera that sees only the second target.
#[test]
fn targets_of_a_body_are_placed_with_the_cameras() {
    let mut rng = Rng::new(4);
    let cameras: Vec<Camera> = (0..4).map(|_| rooms::pinhole(900.0)).collect();
    let mut poses = rooms::ring(4, 3.0);
    poses[2] = rooms::pair()[1] * poses[0];
    let turn = |x: f64, y: f64, z: f64| Pose::exp(&Vector6::new(0.2, x, 0.3, x, y, z));
    let mut room = Room::new(cameras, poses)
        .with_target(rooms::board(4, 4, 0.06), 7, Pose::identity())
        .with_target(rooms::board(3, 5, 0.07), 7, turn(1.4, 0.2, 0.1))
        .with_target(rooms::board(3, 3, 0.09), 2, Pose::identity())
        .with_target(rooms::board(3, 4, 0.09), 7, turn(0.7, -0.2, 0.1));
    for view in 0..40 {
        for body in [2, 7] {
            let around = Point::new(0.2 * body as f64 - 0.9, 0.0, 3.0);
            let facing = rng.unit_vector();
            room.see(view, body, rooms::somewhere(&mut rng, around, 0.3, facing, 0.4), 0.3);
        }
    }
    let solution = room.solve(&room.observations, &RigConfig::default()).expect("a rig");
    for c in 1..4 {
        assert!((solution.cameras[c].cam_from_rig * room.cam_from_rig[c].inverse()).log().norm() < 1e-10);
    }
    for (found, truth) in solution.targets.iter().zip(&room.body_from_target) {
        assert!((found.body_from_target * truth.inverse()).log().norm() < 1e-10, "{found:?}");
    }
    assert!(worst_body(&room, &solution) < 1e-10);
    let is_fixed = |t: usize| solution.targets[t].covariance.norm() == 0.0;
    assert!(is_fixed(0) && is_fixed(2) && !is_fixed(1) && !is_fixed(3));
}

/// Table II of the paper, its geometry at full precision (cm): R = R_Z R_Y R_X of the printed angles.
fn table_two() -> Room {
    let camera = |f: f64| {
        let parameters =
            PhotogrammetricParameters { f, xp: 0.0, yp: 0.0, k: [0.0; 3], p: [0.0; 2], a: [0.0; 2] };
        Camera { lens: Lens::Photogrammetric(Photogrammetric::new(parameters).expect("a lens")), size: None }
    };
    let about = |axis: Vector3<f64>, degrees: f64| {
        let w = axis * degrees.to_radians();
        Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation
    };
    let pose = |[x, y, z]: [f64; 3], p: [f64; 3]| {
        let rotation = about(Vector3::z(), z) * about(Vector3::y(), y) * about(Vector3::x(), x);
        Pose::new(rotation, Point::from(p))
    };
    let points = [
        [0.0, 0.0, 0.0],
        [10.00328485, 0.0, 0.0],
        [15.01261553, 0.0, 0.0],
        [0.04118167, 14.92639496, -0.07460399],
    ];
    let cam1_from_target = pose([45.0, 30.0, 60.0], [20.0, 10.0, 300.0]);
    let cam2_from_target = pose([53.0, 37.0, 81.0], [25.0, 15.0, 250.0]);
    let cameras = vec![camera(3.54144878), camera(2.01646963)];
    let cam_from_rig = vec![Pose::identity(), cam2_from_target * cam1_from_target.inverse()];
    let points = points.map(Point::from).to_vec();
    let mut room = Room::new(cameras, cam_from_rig).with_target(points.clone(), 0, Pose::identity());
    for (camera, cam_from_target) in [cam1_from_target, cam2_from_target].iter().enumerate() {
        let lens = &room.cameras[camera];
        let point = |x: &Point| {
            let pixel = lens.project(&(cam_from_target * x)).expect("in the field");
            Correspondence::new(lens, *x, pixel, 2.9e-5).expect("in the field")
        };
        let seen = points.iter().map(point).collect();
        room.observations.push(Observation { camera, view: 0, target: 0, seen });
    }
    room.n_views = 1;
    room
}

/// The paper's (13), (14) with its own example; the R12 it prints is R1 R1.
#[test]
fn table_two_gives_the_papers_relative_pose() {
    let room = table_two();
    let solution = room.solve(&room.observations, &RigConfig::default()).expect("a rig");
    let found = solution.cameras[1].cam_from_rig.inverse();
    let truth = room.cam_from_rig[1].inverse();
    assert!((found.rotation - truth.rotation).amax() < 1e-9, "{found:?}");
    assert!((found.translation - truth.translation).amax() < 1e-9 * truth.translation.norm(), "{found:?}");
    let r12 = Matrix3::new(
        0.947462, 0.277474, -0.159135, -0.288895, 0.955874, -0.053333, 0.137315, 0.096505, 0.985815,
    );
    let p12 = Vector3::new(31.935148, 16.217564, 48.665772);
    // Six decimals.
    assert!((found.rotation - r12).amax() < 6e-7 && (found.translation - p12).amax() < 6e-7, "{found:?}");
    assert_eq!(solution.degrees_of_freedom, 4);
}

/// Median over rigs of the angle, degrees, and of the distance of the centres, m.
fn median_errors(points: &[Point], n_views: usize, sigma_px: f64, n_rigs: u64) -> (f64, f64) {
    let mut errors: Vec<(f64, f64)> = (0..n_rigs)
        .map(|seed| {
            let mut rng = Rng::new(100 + seed);
            let room = rooms::pair_with(&mut rng, points.to_vec(), n_views, sigma_px);
            let solution = room.solve(&room.disturbed(&mut rng), &RigConfig::default()).expect("a rig");
            let (found, truth) = (&solution.cameras[1].cam_from_rig, &room.cam_from_rig[1]);
            (found.angle_to_rad(truth).to_degrees(), (found.origin() - truth.origin()).norm())
        })
        .collect();
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let angle = errors[errors.len() / 2].0;
    errors.sort_by(|a, b| a.1.total_cmp(&b.1));
    (angle, errors[errors.len() / 2].1)
}

/// 50 views at 0.5 px: with the paper's own four points stereo calibration elsewhere is 13° and 1 m off.
#[test]
fn two_cameras_and_fifty_views() {
    let (angle, place) = median_errors(&rooms::line_plus_one(), 50, 0.5, 20);
    assert!(angle < 0.05 && place < 3e-3, "four points: {angle}° {place} m");
    let (angle, place) = median_errors(&rooms::board(8, 6, 0.1), 50, 0.5, 20);
    assert!(angle < 0.0125 && place < 0.6e-3, "board: {angle}° {place} m");
}

/// Every bit of the answer is the same whatever the order of the observations.
#[test]
fn the_order_of_observations_changes_nothing() {
    let mut rng = Rng::new(7);
    let cameras = (0..4).map(|_| rooms::pinhole(900.0)).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(5, 4, 0.1), 30, 0.3);
    let observations = room.disturbed(&mut rng);
    let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
    let first = room.solve(&observations, &config).expect("a rig");
    for _ in 0..5 {
        let mut order: Vec<usize> = (0..observations.len()).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, rng.index(i + 1));
        }
        let shuffled: Vec<Observation> = order.iter().map(|i| observations[*i].clone()).collect();
        let mut again = room.solve(&shuffled, &config).expect("a rig");
        let mut back = again.observations.clone();
        order.iter().zip(&again.observations).for_each(|(i, s)| back[*i] = s.clone());
        again.observations = back;
        // Debug prints every digit that f64 has, and −0 apart from 0.
        assert_eq!(format!("{first:?}"), format!("{again:?}"));
    }
}
