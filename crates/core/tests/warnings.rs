//! What the program says against an answer is in the answer's numbers: its part of the covariance is there, or the status is not `ok`.
//!
//! Each kind of sentence is a variant with its place in the numbers by an exhaustive match, and the matches below are exhaustive too: a new
//! sentence needs a scenario here that gives it.

use crate::common::accident::{Scene, photos};
use crate::common::held::{assert_all_held, assert_hand_eye, assert_network};
use crate::common::rooms::{self, Room};
use crate::common::sessions::{Robot, Session};
use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3};
use resight_core::locate::warnings::PoseWarning;
use resight_core::locate::{Config, locate};
use resight_core::multiview::hand_eye::{HandEyeWarning, Mounting};
use resight_core::multiview::intrinsics::Finding;
use resight_core::multiview::network::{Constraint, NetworkWarning, Plane, Query, adjust};
use resight_core::multiview::pose_graph::GraphWarning;
use resight_core::multiview::rig::{KnownDistance, RigConfig, RigSolution, RigWarning};

/// The kinds of a job's warnings that answers gave, by number.
fn kinds<D>(warnings: &[D], number: fn(&D) -> usize, seen: &mut Vec<usize>) {
    seen.extend(warnings.iter().map(number));
    seen.sort_unstable();
    seen.dedup();
}

fn of_rig(warning: &RigWarning) -> usize {
    match warning {
        RigWarning::Camera(..) => 0,
        RigWarning::Target(..) => 1,
        RigWarning::Residuals(_) => 2,
        RigWarning::ViewsApart(_) => 3,
        RigWarning::Lenses(_) => 4,
        RigWarning::Size(_) => 5,
        // With neighbours of one view `rig_neighbours` has them, and views without a camera or target at fault `rig_verdict`.
        RigWarning::Neighbours(_) | RigWarning::Views | RigWarning::LeftOut(_) => 6,
    }
}

/// Two cameras and a board that both see, in noise `times` the stated one; `change` changes what they see, and the distance of the cameras is
/// known, `longer` times as long as it is.
fn rig(seed: u64, times: f64, longer: f64, change: impl Fn(&mut Room, &mut Rng)) -> (RigSolution, usize) {
    let mut rng = Rng::new(seed);
    let mut room = rooms::pair_with(&mut rng, rooms::board(7, 5, 0.08), 20, 0.1);
    change(&mut room, &mut rng);
    let mut observations = room.disturbed(&mut rng);
    observations.iter_mut().flat_map(|s| &mut s.seen).for_each(|c| c.sigma_px /= times);
    let apart = (room.cam_from_rig[0].origin() - room.cam_from_rig[1].origin()).norm();
    let known = [KnownDistance { a: 0, b: 1, distance_m: longer * apart, sigma_m: 1e-4 }];
    let known_distances = if longer == 1.0 { &[][..] } else { &known };
    let config = RigConfig { lens_errors: true, known_distances, ..RigConfig::default() };
    let found = room.solve(&observations, &config).expect("a rig");
    (found, room.n_views)
}

#[test]
fn what_is_said_against_a_rig_is_in_its_numbers() {
    let mut seen = Vec::new();
    let mut take =
        |(found, n_views): (RigSolution, usize)| kinds(&found.warnings(n_views), of_rig, &mut seen);
    // Noise above the stated one, little and much.
    for times in [1.15, 6.0] {
        take(rig(1, times, 1.0, |_, _| {}));
    }
    // Images whose points are all displaced together, a different way in each.
    take(rig(2, 1.0, 1.0, |room, rng| {
        for s in &mut room.observations {
            let by = Vector2::new(rng.normal(), rng.normal()) * 0.3;
            s.seen.iter_mut().for_each(|c| *c = views::moved_pixel(c, by));
        }
    }));
    // Another focal length, a little off and far off.
    for off_px in [8.0, 60.0] {
        take(rig(3, 1.0, 1.0, |room, _| {
            let values: Vec<f64> = room.cameras[1]
                .parameters()
                .iter()
                .zip([off_px, off_px, 0.0, 0.0])
                .map(|(p, by)| p.1 + by)
                .collect();
            room.cameras[1] = room.cameras[1].with_parameters(&values).expect("a camera");
        }));
    }
    // A print a little too small, and one far too small.
    for longer in [1.003, 1.05] {
        take(rig(4, 1.0, longer, |_, _| {}));
    }
    println!("{seen:?}");
    for kind in 0..6 {
        assert!(seen.contains(&kind), "no scenario gives kind {kind}: {seen:?}");
    }
}

fn of_hand_eye(warning: &HandEyeWarning) -> usize {
    match warning {
        HandEyeWarning::Cause(_) => 0,
        HandEyeWarning::Residuals(_) => 1,
        HandEyeWarning::Size(_) => 2,
        HandEyeWarning::LeftOut(_) => 3,
        HandEyeWarning::Lens(_) | HandEyeWarning::OtherLens(..) => 4,
        HandEyeWarning::SharedInBlock(_) => 5,
    }
}

#[test]
fn what_is_said_against_a_hand_eye_calibration_is_in_its_numbers() {
    let (mut rng, mut seen) = (Rng::new(5), Vec::new());
    for (size, bent_m) in [(1.0, 0.0), (1.002, 0.0), (1.05, 0.0), (1.0, 0.004)] {
        let robot = Robot::AtHand(2e-4, 1e-4);
        let mut session =
            Session::new(&mut rng, Mounting::CameraOnGripper, 25, robot, &views::camera(), 0.1, bent_m);
        session.seen.iter_mut().flatten().for_each(|c| c.x_in_target /= size);
        let found = session.solved();
        assert_hand_eye(&found, &format!("size {size}, bent {bent_m}"));
        kinds(&found.warnings(), of_hand_eye, &mut seen);
    }
    // Another focal length, little off and far off.
    for off_px in [3.0, 60.0] {
        let robot = Robot::AtHand(2e-4, 1e-4);
        let mut session =
            Session::new(&mut rng, Mounting::CameraOnGripper, 25, robot, &views::camera(), 0.1, 0.0);
        let values: Vec<f64> = session
            .camera
            .parameters()
            .iter()
            .enumerate()
            .map(|(i, p)| p.1 + if i < 2 { off_px } else { 0.0 })
            .collect();
        session.camera = session.camera.with_parameters(&values).expect("a camera");
        for c in session.seen.iter_mut().flatten() {
            c.bearing = session.camera.bearing(&c.pixel).expect("in the field");
        }
        kinds(&session.solved().warnings(), of_hand_eye, &mut seen);
    }
    let robot = Robot::AtHand(1e-3, 1e-3);
    let session = Session::new(&mut rng, Mounting::CameraOnGripper, 48, robot, &views::camera(), 0.1, 0.0);
    let found = session.with_shared_errors(&mut rng, robot, 8).solved();
    kinds(&found.warnings(), of_hand_eye, &mut seen);
    println!("{seen:?}");
    for kind in [0, 2, 4, 5] {
        assert!(seen.contains(&kind), "no scenario gives kind {kind}: {seen:?}");
    }
}

/// Numbers of the kinds, so that a new one needs a scenario in the tests of pose graphs.
pub fn of_graph(warning: &GraphWarning) -> usize {
    match warning {
        GraphWarning::Fault(_) => 0,
        GraphWarning::LeftOut(_) => 1,
        GraphWarning::Undecided(_) => 2,
    }
}

/// Numbers of the kinds, so that a new one needs a scenario in the tests of intrinsics; refusals have no answer.
pub fn of_finding(finding: &Finding) -> Option<usize> {
    match finding {
        Finding::FewViews { .. }
        | Finding::NotTilted { .. }
        | Finding::Undetermined { .. }
        | Finding::NoCamera { .. } => None,
        Finding::OneOrientation { .. } => Some(0),
        Finding::RoughFocal { .. } => Some(1),
        Finding::Copies { .. } => Some(2),
        Finding::SmallCoverage { .. } => Some(3),
        Finding::ManyBadViews { .. } => Some(4),
        Finding::TwoCameras { .. } => Some(5),
        Finding::Stretched { .. } => Some(6),
        Finding::Bent { .. } => Some(7),
        Finding::Noisy { .. } => Some(8),
        Finding::ViewsContradict { .. } => Some(9),
        Finding::OtherLens { .. } => Some(10),
        Finding::UsualFault { .. } => Some(11),
    }
}

fn of_network(warning: &NetworkWarning) -> usize {
    match warning {
        NetworkWarning::OnLine | NetworkWarning::SecondSolution(_) | NetworkWarning::LostControlPoints => 0,
        NetworkWarning::Exchanged | NetworkWarning::Suspects | NetworkWarning::Contradiction => 1,
        NetworkWarning::Residuals(_) => 2,
        NetworkWarning::NothingChecks => 3,
        NetworkWarning::Held => 4,
        NetworkWarning::LeftOut(_) => 5,
    }
}

#[test]
fn what_is_said_against_measurements_is_in_their_numbers() {
    let (mut rng, mut seen) = (Rng::new(6), Vec::new());
    let query = Query::Distance { a: 4, b: 5 };
    for (times, is_held) in [(1.0, false), (1.6, false), (8.0, false), (1.0, true)] {
        let mut scene = Scene::new(photos());
        if is_held {
            scene.planes = vec![Plane::Known { normal_in_world: Vector3::z(), offset_m: 0.0 }];
        }
        scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 7, 8], 1.0);
        for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)] {
            scene.distance(a, b, 0.01);
        }
        scene.on_plane(&[0, 1, 2, 3, 4, 5, 6], 0.01);
        // A point that one photograph alone shows has no place.
        scene.image_point(0, 9, 1.0);
        let mut drawn = scene.drawn(&mut rng).constraints;
        for constraint in &mut drawn {
            if let Constraint::ImagePoint { pixel, .. } = constraint {
                *pixel += Vector2::new(rng.normal(), rng.normal()) * (times - 1.0);
            }
        }
        let Ok(found) = adjust(&scene.network(&scene.cameras(), &drawn)) else { continue };
        assert_network(&found, &query, &format!("noise {times}"));
        kinds(&found.warnings(), of_network, &mut seen);
    }
    println!("{seen:?}");
    for kind in [1, 2, 4, 5] {
        assert!(seen.contains(&kind), "no scenario gives kind {kind}: {seen:?}");
    }
}

fn of_pose(warning: &PoseWarning) -> usize {
    match warning {
        PoseWarning::Contradiction => 0,
        PoseWarning::SecondSolution => 1,
        PoseWarning::SharedError(_) => 2,
        PoseWarning::NothingChecks => 3,
        PoseWarning::Unrefined => 4,
    }
}

/// A board of many corners, exact, noisier than stated, bent, and its first corners alone.
#[test]
fn what_is_said_against_a_pose_is_in_its_numbers() {
    let (mut rng, mut seen, camera) = (Rng::new(7), Vec::new(), views::camera());
    let board: Vec<_> =
        rooms::board(9, 7, 0.05).iter().map(|point| point - Vector3::new(0.2, 0.15, 0.0)).collect();
    for trial in 0..40 {
        let (times, bent_m, n) = [(1.0, 0.0, 63), (9.0, 0.0, 63), (1.0, 0.004, 63), (1.0, 0.0, 4)][trial % 4];
        let pose =
            views::looking_at(Vector3::new(0.3 * rng.normal(), 0.3 * rng.normal(), -1.2), Vector3::zeros());
        let real: Vec<_> =
            board.iter().take(n).map(|x| x + Vector3::z() * (bent_m * (1.0 - (x.x / 0.2).powi(2)))).collect();
        let seen_points: Vec<_> = views::seen_from(&pose, &real, 0.2)
            .iter()
            .zip(&board)
            .map(|(c, x)| resight_core::Correspondence {
                x_in_target: *x,
                ..views::moved_pixel(c, Vector2::new(rng.normal(), rng.normal()) * (0.2 * times))
            })
            .collect();
        let Ok(found) = locate(&seen_points, &camera, &Config::default()) else { continue };
        let budget = found.budget(&seen_points, &camera, &Config::default()).expect("its parts");
        let warnings = found.warnings();
        let is_ok =
            !warnings.iter().any(|d| matches!(d, PoseWarning::Contradiction | PoseWarning::SecondSolution));
        assert_all_held(&warnings, &[&budget], is_ok, &format!("trial {trial}"));
        kinds(&warnings, of_pose, &mut seen);
    }
    println!("{seen:?}");
    for kind in [0, 2] {
        assert!(seen.contains(&kind), "no scenario gives kind {kind}: {seen:?}");
    }
}
