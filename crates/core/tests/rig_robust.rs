//! Wrong points, wrong labels, flipped tags, a moved target: none of them moves the answer beyond its covariance.

use crate::common::rooms::Room;
use crate::common::{Rng, outliers, rooms};
use nalgebra::Vector2;
use resight_core::multiview::rig::{GATE_SIGMAS, Observation, RejectedObservation, RigConfig};
use resight_core::{Correspondence, Point, Pose};

/// A board and a tag of 8 cm in a ring of six cameras.
fn room(rng: &mut Rng, n_views: usize) -> Room {
    let cameras = (0..6).map(|_| rooms::pinhole(900.0)).collect();
    let room = rooms::ring_with_board(rng, cameras, rooms::board(6, 4, 0.1), n_views, 0.3);
    let mut room = room.with_target(rooms::board(2, 2, 0.08), 1, Pose::identity());
    for view in 0..n_views {
        let facing = rng.unit_vector();
        room.see(view, 1, rooms::somewhere(rng, Point::new(0.0, 0.0, 3.0), 0.6, facing, 0.3), 0.3);
    }
    room
}

/// One point in twenty anywhere in the image.
fn with_outliers(rng: &mut Rng, room: &Room, observations: &mut [Observation]) -> usize {
    let mut n = 0;
    for s in observations {
        for c in &mut s.seen {
            if rng.uniform(0.0, 1.0) < 0.05 {
                let pixel = outliers::any_pixel(rng);
                *c = Correspondence::new(&room.cameras[s.camera], c.x_in_target, pixel, c.sigma_px)
                    .expect("in the field");
                n += 1;
            }
        }
    }
    n
}

/// Labels of a board rotated by half: a perfect pose, and wrong.
fn turn_labels(s: &mut Observation) {
    let pixels: Vec<_> = s.seen.iter().rev().map(|c| (c.pixel, c.bearing)).collect();
    s.seen.iter_mut().zip(pixels).for_each(|(c, (pixel, bearing))| (c.pixel, c.bearing) = (pixel, bearing));
}

#[test]
fn what_is_wrong_does_not_move_the_answer() {
    const TRIALS: usize = 30;
    let (mut mean, mut worst) = (0.0, 0.0f64);
    for trial in 0..TRIALS {
        let mut rng = Rng::new(500 + trial as u64);
        let room = room(&mut rng, 40);
        let mut observations = room.disturbed(&mut rng);
        let n_wrong = with_outliers(&mut rng, &room, &mut observations);
        let boards: Vec<usize> = (0..observations.len()).filter(|i| observations[*i].target == 0).collect();
        let turned = boards[rng.index(boards.len())];
        turn_labels(&mut observations[turned]);
        let solution = room.solve(&observations, &RigConfig::default()).expect("a rig");
        let of_view = |i: usize| {
            observations.iter().filter(|s| s.target == 0 && s.view == observations[i].view).count()
        };
        let contradicts = |i: usize| {
            matches!(solution.observations[i].rejected, Some(RejectedObservation::Contradicts { .. }))
        };
        if 2 < of_view(turned) {
            assert!(contradicts(turned), "trial {trial}: {:?}", solution.observations[turned].rejected);
        }
        assert!(solution.n_used + n_wrong / 2 < solution.n_seen);
        for c in 1..6 {
            let (_, nees) = room.error(&solution, c);
            mean += nees / (5.0 * TRIALS as f64);
            worst = worst.max(nees);
        }
    }
    println!("NEES {mean} worst {worst}");
    // 150 values of χ² with 6 degrees of freedom, five of a trial in common with the reference: a standard deviation of 0.4.
    assert!((4.8..7.2).contains(&mean), "{mean}");
    // One in 10⁵ exceeds 33.
    assert!(worst < 33.0, "{worst}");
}

/// Inliers are those of the pose returned, by the threshold stated.
#[test]
fn points_used_are_those_within_the_gate() {
    let mut rng = Rng::new(600);
    let room = room(&mut rng, 20);
    let mut observations = room.disturbed(&mut rng);
    with_outliers(&mut rng, &room, &mut observations);
    let solution = room.solve(&observations, &RigConfig::default()).expect("a rig");
    let mut n_used = 0;
    for (s, result) in observations.iter().zip(&solution.observations) {
        let body = solution.bodies.iter().find(|b| (b.view, b.body) == (s.view, s.target)).expect("a body");
        for (c, residual) in s.seen.iter().zip(&result.residuals_px) {
            let cam_from_target = solution.cameras[s.camera].cam_from_rig * body.rig_from_body;
            let expected = c.pixel
                - room.cameras[s.camera].project(&(cam_from_target * c.x_in_target)).expect("in front");
            let (found, used) = residual.expect("in front");
            assert!((found - expected).norm() < 1e-9, "{found}");
            let fits = found.norm() <= GATE_SIGMAS * c.sigma_px;
            // The median of good residuals with one in twenty wrong widens the gate by a tenth at most.
            if used {
                assert!(result.rejected.is_none() && found.norm() <= 1.1 * GATE_SIGMAS * c.sigma_px);
            } else {
                assert!(result.rejected.is_some() || !fits);
            }
            n_used += usize::from(used);
        }
    }
    assert_eq!(n_used, solution.n_used);
    assert_eq!(n_used, solution.cameras.iter().map(|c| c.n_used).sum::<usize>());
    assert_eq!(n_used, solution.bodies.iter().map(|b| b.n_used).sum::<usize>());
}

/// A board that one camera photographed after it was moved.
#[test]
fn a_moved_target_is_said() {
    let mut rng = Rng::new(700);
    let cameras = (0..4).map(|_| rooms::pinhole(900.0)).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(6, 4, 0.1), 40, 0.3);
    let mut observations = room.disturbed(&mut rng);
    let in_view = |v: usize| observations.iter().filter(|s| s.view == v).count();
    let view = (0..40).find(|v| in_view(*v) == 2).expect("a view of two cameras");
    let moved = observations.iter().position(|s| s.view == view).expect("an observation");
    let camera = observations[moved].camera;
    for c in &mut observations[moved].seen {
        let pixel = c.pixel + Vector2::new(25.0, -10.0);
        *c = Correspondence::new(&room.cameras[camera], c.x_in_target, pixel, c.sigma_px)
            .expect("in the field");
    }
    let solution = room.solve(&observations, &RigConfig::default()).expect("a rig");
    let rejected: Vec<usize> =
        (0..observations.len()).filter(|i| solution.observations[*i].rejected.is_some()).collect();
    assert!(rejected.len() == 1 && observations[rejected[0]].view == view, "{rejected:?}");
    for c in 1..4 {
        assert!(room.error(&solution, c).1 < 33.0);
    }
}

/// The most precise estimate is that of the square where nothing is wrong; the others cost what they are known to.
#[test]
fn losses_cost_what_they_are_known_to() {
    use resight_core::locate::loss::Loss;
    let losses = [
        Loss::Squared,
        Loss::Huber { sigmas: 1.5 },
        Loss::Cauchy { sigmas: 3.0 },
        Loss::Truncated { sigmas: 3.0 },
    ];
    for loss in losses {
        let mut mean = 0.0;
        const TRIALS: usize = 30;
        for trial in 0..TRIALS {
            let mut rng = Rng::new(800 + trial as u64);
            let cameras = (0..4).map(|_| rooms::pinhole(900.0)).collect();
            let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(5, 4, 0.1), 30, 0.3);
            let config = RigConfig { loss, ..RigConfig::default() };
            let solution = room.solve(&room.disturbed(&mut rng), &config).expect("a rig");
            assert_eq!(solution.noise_scale, 1.0, "{loss:?}");
            mean += (1..4).map(|c| room.error(&solution, c).1).sum::<f64>() / (3.0 * TRIALS as f64);
        }
        println!("{loss:?} {mean}");
        // 90 values, three of a trial in common with the reference: a standard deviation of 0.5.
        assert!((4.5..7.5).contains(&mean), "{loss:?}: {mean}");
    }
}
