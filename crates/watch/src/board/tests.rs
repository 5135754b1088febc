//! Tests of the state built from events.

use super::*;
use crate::live::{CheckingReason, Observation};
use resight::core::temporal::monitor::{Drift, DriftNoise, MotionKind, Reading};
use resight::core::{Matrix6, Pose, Vector6};

const NOW: Instants = Instants { up_s: 10.0, unix_s: 1e9 };

fn names(targets: &[&str]) -> Names {
    Names {
        cameras: vec!["gate".into(), "yard".into()],
        targets: targets.iter().map(|name| name.to_string()).collect(),
    }
}

fn spread(sigma: f64) -> Matrix6 {
    Matrix6::identity() * sigma * sigma
}

fn reference() -> Reference {
    let noise = DriftNoise {
        reference: spread(1e-5),
        reading: spread(1e-4),
        bias: spread(1e-6),
        bias_time_s: 60.0,
        diurnal: Matrix6::zeros(),
    };
    Reference { a_from_b: Pose::exp(&Vector6::new(0.2, 0.1, 0.0, 0.3, 0.1, 2.0)), noise }
}

/// A reading of a camera that is rotated to the right by this angle.
fn reading(t_s: f64, right_rad: f64) -> Event {
    let old_from_new = Pose::exp(&Vector6::new(0.0, right_rad, 0.0, 0.0, 0.0, 0.0));
    let a_from_b = old_from_new.inverse() * reference().a_from_b;
    let reading = Reading { t_s, a_from_b, covariance: spread(1e-4), is_consistent: true };
    let observation = Observation { capture_s: t_s, reading: Some(reading), ..Observation::default() };
    Event::Observed { camera: 0, target: 0, observation: Box::new(observation) }
}

fn state(camera: usize, target: usize, state: State) -> Event {
    Event::StateChanged { camera, target, t_s: 5.0, state }
}

fn drifted() -> State {
    State::Drifted(Box::new(Drift {
        old_from_new: Vector6::new(0.0, 0.01, 0.0, 0.0, 0.0, 0.0),
        covariance: spread(1e-5),
        began_s: 4.0,
        began_sigma_s: 0.1,
        course: MotionKind::Step,
        course_probability: 1.0,
        rate: None,
        again: None,
    }))
}

/// The alarm comes once; the way back follows every reading.
#[test]
fn the_way_back_follows_the_readings_after_the_alarm() {
    let mut board = Board::new(&names(&["tag"]), &[Some(reference()), None], 100);
    board.take(&reading(4.0, 0.01), NOW);
    assert_eq!(board.pairs[0].way_back(), None, "nothing moved yet");
    board.take(&state(0, 0, drifted()), NOW);
    let right = |board: &Board| -board.pairs[0].way_back().expect("it moved").motion[1];
    assert!((right(&board) - 0.01).abs() < 1e-9);
    let mut before = right(&board);
    for (i, rad) in [0.008, 0.005, 0.002].into_iter().enumerate() {
        board.take(&reading(6.0 + i as f64, rad), NOW);
        assert!((right(&board) - rad).abs() < 1e-9 && right(&board) < before, "{rad}");
        before = right(&board);
    }
    board.take(&state(0, 0, State::Steady), NOW);
    assert_eq!(board.pairs[0].way_back(), None);
}

#[test]
fn an_alarm_stays_until_it_is_acknowledged() {
    let mut board = Board::new(&names(&["tag"]), &[None, None], 100);
    board.take(&state(1, 0, State::Checking(CheckingReason::Different)), NOW);
    assert!(!board.acknowledge(1), "no alarm yet");
    board.take(&state(1, 0, drifted()), NOW);
    board.take(&state(1, 0, State::Steady), NOW);
    assert!(board.cameras[1].alarm.as_ref().is_some_and(|alarm| alarm.words.contains("moved in a step")));
    assert!(board.cameras[0].alarm.is_none());
    assert!(board.acknowledge(1) && !board.acknowledge(1) && !board.acknowledge(7));
}

#[test]
fn a_camera_is_as_its_gravest_pair() {
    let mut board = Board::new(&names(&["door", "wall"]), &[], 100);
    board.take(&state(0, 0, State::Steady), NOW);
    board.take(&state(0, 1, State::Stale { for_s: 3.0, reason: None }), NOW);
    assert_eq!((board.gravest(0), board.pairs_of(1)), (Some(1), 2..4));
    board.take(&state(0, 0, drifted()), NOW);
    assert_eq!(board.gravest(0), Some(0));
}

#[test]
fn the_reference_before_is_kept_beside_the_new_one() {
    let mut board = Board::new(&names(&["tag"]), &[Some(reference()), None], 100);
    let new = Reference { a_from_b: Pose::identity(), ..reference() };
    board.take(&Event::Learned { camera: 0, target: 0, reference: Box::new(new), promise: None }, NOW);
    let pair = &board.pairs[0];
    assert_eq!(pair.reference.map(|learnt| (learnt.reference, learnt.unix_s)), Some((new, Some(1e9))));
    assert_eq!(pair.earlier.map(|learnt| (learnt.reference, learnt.unix_s)), Some((reference(), None)));
}

#[test]
fn a_camera_without_frames_is_not_fresh() {
    let mut board = Board::new(&names(&["tag"]), &[], 100);
    assert!(!board.is_fresh(0, NOW), "no frame yet");
    board.take(&reading(1.0, 0.0), NOW);
    let later = |s: f64| Instants { up_s: NOW.up_s + s, ..NOW };
    assert!(board.is_fresh(0, later(1.0)) && !board.is_fresh(0, later(5.0)));
    board.take(&Event::Source { camera: 0, connected: false, reason: None }, NOW);
    assert!(!board.is_fresh(0, later(1.0)));
}
