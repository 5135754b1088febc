//! Which of several cameras and targets moved, from what is seen between them.

use crate::common::Rng;
use crate::common::sentry::{SIGMA, covariance, errors};
use nalgebra::{Matrix6, Vector6};
use resight_core::Pose;
use resight_core::temporal::monitor::attribute::{Attribution, Edge, attribute};

/// Two cameras (0, 1) and two targets (2, 3), every pair seen.
const ALL: [(usize, usize); 4] = [(0, 2), (0, 3), (1, 2), (1, 3)];

/// `old_from_new` of those that moved, and noise of `scale` on every edge; it is always stated as half a reading's.
fn edges(moved: &[(usize, Vector6<f64>)], pairs: &[(usize, usize)], scale: f64, seed: u64) -> Vec<Edge> {
    let mut chance = Rng::new(seed);
    let of = |node: usize| {
        let motion = moved.iter().find(|(n, _)| *n == node);
        motion.map_or(Pose::identity(), |(_, motion)| Pose::exp(motion))
    };
    let edge = |&(a, b): &(usize, usize)| {
        let a_from_b =
            Pose::exp(&Vector6::new(0.3 * a as f64, 0.2, -0.1 * b as f64, 0.5, 0.1 * a as f64, 2.0));
        // a_from_b now = (a's old_from_new)⁻¹ · a_from_b · b's old_from_new
        let now = of(a).inverse() * a_from_b * of(b);
        let seen = (a_from_b * now.inverse()).log() + errors(&mut chance, scale);
        Edge { a, b, a_from_b, motion: seen, covariance: covariance(0.5) }
    };
    pairs.iter().map(edge).collect()
}

fn motion() -> Vector6<f64> {
    Vector6::new(0.01, -0.02, 0.005, 0.03, -0.01, 0.02)
}

fn names(answer: &Attribution) -> Vec<usize> {
    answer.moved.iter().map(|moved| moved.node).collect()
}

#[test]
fn a_moved_camera_and_a_moved_target_are_reported_apart() {
    for node in 0..4 {
        let edges = edges(&[(node, motion())], &ALL, 0.5, 0x1000 + node as u64);
        let answer = attribute(4, &edges);
        assert!(answer.is_explained && answer.alternatives.is_empty(), "{answer:?}");
        let [moved] = &answer.moved[..] else { panic!("{answer:?}") };
        assert_eq!(moved.node, node);
        let error = moved.old_from_new - motion();
        assert!(error.norm() < 10.0 * 0.002, "{error}");
    }
    assert!(attribute(4, &edges(&[], &ALL, 0.5, 5)).moved.is_empty());
}

#[test]
fn one_camera_and_one_target_leave_it_open_which_moved() {
    let answer = attribute(2, &edges(&[(0, motion())], &[(0, 1)], 0.5, 7));
    assert_eq!(answer.moved.len() + answer.alternatives.len(), 2);
}

/// Carried half a metre away and turned round by 30°.
fn carried() -> Vector6<f64> {
    Vector6::new(0.1, 0.5, -0.1, 0.4, -0.3, 0.1)
}

/// A camera moved suddenly beside a target that was carried off: by as much as that target hardly hides, and by a tenth of it, which is less than
/// one in a hundred of all that is to be explained.
#[test]
fn a_camera_knocked_beside_a_target_carried_away_is_named() {
    for (i, knocked_deg) in [10.0_f64, 3.0, 0.3].into_iter().enumerate() {
        for camera in 0..2 {
            let knocked = Vector6::new(0.3, 0.9, -0.3, 0.0, 0.0, 0.0) * knocked_deg.to_radians();
            let edges = edges(&[(2, carried()), (camera, knocked)], &ALL, 0.5, 0x2000 + i as u64);
            let answer = attribute(4, &edges);
            assert!(answer.is_explained && answer.alternatives.is_empty(), "{knocked_deg}°: {answer:?}");
            assert_eq!(names(&answer), [camera, 2], "{knocked_deg}°");
            for (moved, truth) in answer.moved.iter().zip([knocked, carried()]) {
                let error = moved.old_from_new - truth;
                let off = (0..6).map(|i| (error[i] / SIGMA[i]).powi(2)).sum::<f64>();
                assert!(off < 22.5, "{knocked_deg}°, {}: χ² {off}", moved.node);
            }
        }
    }
}

/// Without noise nothing is left, however large the motions: (13) as a whole, not its first order.
#[test]
fn two_large_motions_are_found_exactly() {
    let knocked = Vector6::new(-0.05, 0.15, 0.1, 0.02, -0.05, 0.03);
    let answer = attribute(4, &edges(&[(1, knocked), (3, carried())], &ALL, 0.0, 0));
    assert_eq!(names(&answer), [1, 3]);
    assert!(answer.chi2 < 1e-3, "{}", answer.chi2);
    for (moved, truth) in answer.moved.iter().zip([knocked, carried()]) {
        assert!((moved.old_from_new - truth).norm() < 1e-5, "{}", moved.old_from_new - truth);
    }
}

/// Any two of two cameras and one target explain two edges: the camera that moved suddenly is not acquitted because the target moved more.
#[test]
fn with_one_target_it_stays_open_which_two_moved() {
    let knocked = Vector6::new(0.0, 3.0_f64.to_radians(), 0.0, 0.0, 0.0, 0.0);
    let away = Vector6::new(0.0, 0.0, 0.0, 0.5, 0.0, 0.0);
    let answer = attribute(3, &edges(&[(2, away), (0, knocked)], &[(0, 2), (1, 2)], 0.5, 0x3000));
    assert_eq!((answer.moved.len(), answer.alternatives.len()), (2, 2), "{answer:?}");
}

/// A lens or a target's size that is wrong by one in a hundred makes no second mover.
#[test]
fn what_grows_with_the_motion_accuses_nobody_else() {
    let away = Vector6::new(0.0, 0.0, 0.0, 0.4, 0.0, 0.3);
    let mut edges = edges(&[(2, away)], &ALL, 0.5, 0x4000);
    edges.iter_mut().filter(|edge| edge.a == 1).for_each(|edge| edge.motion *= 1.01);
    let answer = attribute(4, &edges);
    assert!(answer.is_explained && answer.alternatives.is_empty(), "{answer:?}");
    assert_eq!(names(&answer), [2]);
}

#[test]
fn edges_that_say_nothing_are_left_out() {
    let mut edges = edges(&[(0, motion())], &ALL, 0.5, 0x5000);
    let none = Edge { covariance: Matrix6::zeros(), ..edges[0] };
    let of_nobody = Edge { b: 9, ..edges[0] };
    let broken = Edge { motion: Vector6::repeat(f64::NAN), ..edges[0] };
    edges.extend([none, of_nobody, broken]);
    let answer = attribute(4, &edges);
    assert!(answer.is_explained && names(&answer) == [0], "{answer:?}");
}
