//! Poses through time: consistent covariances, outliers, jumps, and two poses distinguished by time.

use crate::common::Rng;
use nalgebra::{Matrix6, Vector6};
use resight_core::temporal::track::{Candidate, Motion, TrackConfig, Tracked, Tracker};
use resight_core::{Error, Pose};

fn motion(chance: &mut Rng, sigma: &[f64; 6]) -> Vector6<f64> {
    Vector6::from_fn(|i, _| sigma[i] * chance.normal())
}

const READING: [f64; 6] = [1e-3, 1e-3, 5e-4, 3e-3, 3e-3, 8e-3];
const PERIOD_S: f64 = 1.0 / 30.0;

fn start() -> Pose {
    Pose::exp(&Vector6::new(0.2, -0.7, 0.1, 0.3, -0.2, 2.5))
}

fn covariance() -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::from(READING.map(|s| s * s)))
}

fn seen(truth: &Pose, chance: &mut Rng) -> Candidate {
    Candidate {
        cam_from_target: Pose::exp(&motion(chance, &READING)) * *truth,
        covariance: covariance(),
        probability: 1.0,
    }
}

fn nees(tracked: &Tracked, truth: &Pose) -> f64 {
    let error = (tracked.cam_from_target * truth.inverse()).log();
    error.dot(&(tracked.covariance.try_inverse().expect("a covariance") * error))
}

fn moving() -> TrackConfig {
    let motion = Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s: 0.2, translation_m_per_s_sqrt_s: 0.3 };
    TrackConfig { motion, ..TrackConfig::default() }
}

/// NEES of runs of 60 readings, judged at their last: 400 draws of χ²₆, whose mean lies within 6 ± 0.52 (3 σ).
fn mean_nees(config: &TrackConfig, walk: impl Fn(&mut Rng, &mut Pose, &mut Vector6<f64>)) -> f64 {
    let mut chance = Rng::new(0x7ac4);
    let (mut sum, runs) = (0.0, 400);
    for _ in 0..runs {
        let mut tracker = Tracker::new(config).expect("a tracker");
        let (mut truth, mut velocity) = (start(), Vector6::zeros());
        let mut last = None;
        for i in 0..60 {
            walk(&mut chance, &mut truth, &mut velocity);
            last = tracker.push(f64::from(i) * PERIOD_S, &[seen(&truth, &mut chance)]);
        }
        sum += nees(&last.expect("tracked"), &truth);
    }
    sum / f64::from(runs)
}

#[test]
fn covariance_of_a_static_camera_matches_monte_carlo() {
    let sway = 1e-4 * PERIOD_S.sqrt();
    let mean = mean_nees(&TrackConfig::default(), |chance, truth, _| {
        *truth = Pose::exp(&motion(chance, &[sway; 6])) * *truth;
    });
    println!("NEES {mean:.2}");
    assert!((5.48..6.52).contains(&mean), "{mean}");
}

#[test]
fn covariance_of_a_moving_camera_matches_monte_carlo() {
    let (turn, shift) = (0.2 * PERIOD_S.sqrt(), 0.3 * PERIOD_S.sqrt());
    let mean = mean_nees(&moving(), |chance, truth, velocity| {
        // The velocity's change acts from the middle of the step on average: half of it before, half after.
        let change = motion(chance, &[turn, turn, turn, shift, shift, shift]);
        *truth = Pose::exp(&((*velocity + 0.5 * change) * PERIOD_S)) * *truth;
        *velocity += change;
    });
    println!("NEES {mean:.2}");
    assert!((5.48..6.52).contains(&mean), "{mean}");
}

#[test]
fn a_static_camera_is_known_better_with_every_reading() {
    let (mut tracker, mut chance) = (Tracker::new(&TrackConfig::default()).expect("a tracker"), Rng::new(5));
    let mut last = None;
    for i in 0..100 {
        last = tracker.push(f64::from(i) * PERIOD_S, &[seen(&start(), &mut chance)]);
    }
    let sigma = last.expect("tracked").covariance[(5, 5)].sqrt();
    assert!(sigma < 0.15 * READING[5], "{sigma}");
}

/// A camera that walks around a target: the mirror pose fits each image as well, but walks as no camera does.
#[test]
fn time_tells_a_pose_from_its_mirror() {
    let (mut tracker, mut chance) = (Tracker::new(&moving()).expect("a tracker"), Rng::new(0x11));
    let (mut truth, mut last) = (start(), None);
    for i in 0..90 {
        truth = Pose::exp(&(Vector6::new(0.0, 0.3, 0.0, -0.75, 0.0, 0.0) * PERIOD_S)) * truth;
        let right = seen(&truth, &mut chance);
        // Rotated about the line of sight by an angle that depends on the view, as mirror poses do.
        let mirror =
            Pose::exp(&Vector6::new(0.0, 0.0, 0.6 + 1.5 * (f64::from(i) * 0.35).sin(), 0.0, 0.0, 0.0));
        let wrong = Candidate { cam_from_target: mirror * right.cam_from_target, ..right };
        let half = |candidate: Candidate| Candidate { probability: 0.5, ..candidate };
        last = tracker.push(f64::from(i) * PERIOD_S, &[half(wrong), half(right)]);
    }
    let last = last.expect("tracked");
    assert!(0.99 < last.probability, "{}", last.probability);
    assert_eq!(last.candidate, Some(1));
    assert!(nees(&last, &truth) < 30.0);
}

/// Where nothing moves, the mirror stays as good as the pose: then it is not decided, and the probability says so.
#[test]
fn a_mirror_that_stays_is_not_decided() {
    let (mut tracker, mut chance) =
        (Tracker::new(&TrackConfig::default()).expect("a tracker"), Rng::new(0x12));
    let mirror = Pose::exp(&Vector6::new(0.0, 0.0, 0.6, 0.0, 0.0, 0.0));
    let mut last = None;
    for i in 0..50 {
        let right = Candidate { probability: 0.5, ..seen(&start(), &mut chance) };
        let wrong = Candidate { cam_from_target: mirror * right.cam_from_target, ..right };
        last = tracker.push(f64::from(i) * PERIOD_S, &[right, wrong]);
    }
    let probability = last.expect("tracked").probability;
    assert!((0.4..0.6).contains(&probability), "{probability}");
}

#[test]
fn an_outlier_leaves_the_track_where_it_is() {
    let (mut tracker, mut chance) =
        (Tracker::new(&TrackConfig::default()).expect("a tracker"), Rng::new(0x13));
    for i in 0..30 {
        tracker.push(f64::from(i), &[seen(&start(), &mut chance)]);
    }
    let mut flipped = seen(&start(), &mut chance);
    flipped.cam_from_target =
        Pose::exp(&Vector6::new(0.5, 0.0, 0.0, 0.2, 0.0, 0.0)) * flipped.cam_from_target;
    let tracked = tracker.push(30.0, &[flipped]).expect("tracked");
    assert_eq!(tracked.candidate, None);
    assert!(nees(&tracked, &start()) < 30.0);
}

#[test]
fn a_camera_put_elsewhere_is_followed_after_a_few_readings() {
    let (mut tracker, mut chance) =
        (Tracker::new(&TrackConfig::default()).expect("a tracker"), Rng::new(0x14));
    for i in 0..30 {
        tracker.push(f64::from(i), &[seen(&start(), &mut chance)]);
    }
    let elsewhere = Pose::exp(&Vector6::new(0.0, 0.09, 0.0, 0.0, 0.0, 0.0)) * start();
    let mut needed = 0;
    for i in 30..40 {
        let tracked = tracker.push(f64::from(i), &[seen(&elsewhere, &mut chance)]).expect("tracked");
        needed += usize::from(30.0 < nees(&tracked, &elsewhere));
    }
    assert!((1..=3).contains(&needed), "{needed}");
}

#[test]
fn late_readings_and_numbers_that_are_none_are_left_out() {
    let (mut tracker, mut chance) =
        (Tracker::new(&TrackConfig::default()).expect("a tracker"), Rng::new(0x15));
    assert!(tracker.push(0.0, &[]).is_none());
    tracker.push(5.0, &[seen(&start(), &mut chance)]);
    let before = tracker.clone();
    tracker.push(4.0, &[seen(&start(), &mut chance)]);
    tracker.push(6.0, &[Candidate { probability: f64::NAN, ..seen(&start(), &mut chance) }]);
    tracker.push(f64::NAN, &[seen(&start(), &mut chance)]);
    assert_eq!(tracker, before);
    let config = TrackConfig { outlier_probability: 0.0, ..TrackConfig::default() };
    assert!(matches!(Tracker::new(&config), Err(Error::InvalidSetting { .. })));
}
