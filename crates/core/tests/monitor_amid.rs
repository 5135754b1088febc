//! The stated size of a motion holds the errors that came and went before it: key frames of a video, an infrared filter.

use crate::common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Drift, MonitorConfig, Watch};

const RUNS: u64 = 6;

/// What is reported of a rotation by a degree at its alarm and `for_s` later.
fn reported((condition, period_s): (Condition, f64), at_s: f64, for_s: f64, seed: u64) -> [Drift; 2] {
    let mut scene = Scene::of(View::near(), condition, period_s, 0xa31d + seed);
    let mut monitor = scene.learned(50, &MonitorConfig::default());
    let (mut at_alarm, degree) = (None, Vector6::y() * 1_f64.to_radians());
    while scene.t_s < at_s + for_s {
        let moved = if scene.t_s < at_s { Vector6::zeros() } else { degree };
        if let Watch::Drifted(drift) = monitor.push(&scene.next(&moved))
            && at_s < scene.t_s
            && 0.5 * degree[1] < drift.old_from_new[1]
        {
            at_alarm.get_or_insert(drift);
        }
    }
    [at_alarm.expect("an alarm"), monitor.drift().expect("a motion")]
}

fn nees(drift: &Drift) -> f64 {
    let error = drift.old_from_new - Vector6::y() * 1_f64.to_radians();
    error.dot(&drift.covariance.cholesky().expect("a covariance").solve(&error))
}

/// Mean NEES, six where the covariance is right, at the alarm and at the end.
fn mean_nees(of: (Condition, f64), at_s: f64, for_s: f64) -> [f64; 2] {
    let all: Vec<_> =
        (0..RUNS).map(|seed| reported(of, at_s, for_s, seed).map(|drift| nees(&drift))).collect();
    let mean = |i: usize| all.iter().map(|of_run| of_run[i]).sum::<f64>() / RUNS as f64;
    println!("{of:?}: {:.1} at the alarm, {:.1} at the end; {all:.1?}", mean(0), mean(1));
    [mean(0), mean(1)]
}

#[test]
fn key_frames_are_in_the_size_of_a_motion() {
    let video = (Condition::KeyFrames { px: 0.15, every_s: 4.0 }, 0.04);
    assert!(mean_nees(video, 864.0, 48.0).iter().all(|nees| *nees < 9.0));
}

#[test]
fn a_filter_that_may_be_on_is_in_the_size_of_a_motion() {
    assert!(mean_nees((Condition::Infrared(0.3), 10.0), 114_200.0, 1200.0).iter().all(|nees| *nees < 9.0));
}
