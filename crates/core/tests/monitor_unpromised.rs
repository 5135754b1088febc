//! For which errors no rate of false alarms is promised: those that no reading has shown yet, and disturbances that the readings show.

use crate::common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Monitor, MonitorConfig, Unpromised};

const HOUR_S: f64 = 3600.0;

/// What is not promised after a time of a camera that stays, a reading every ten seconds from noon on.
fn after(condition: Condition, hours: f64, seed: u64) -> (Monitor, Vec<&'static str>) {
    let mut scene = Scene::of(View::near(), condition, 10.0, seed);
    let mut monitor = scene.learned(50, &MonitorConfig::default());
    while scene.t_s < hours * HOUR_S {
        monitor.push(&scene.next(&Vector6::zeros()));
    }
    let words = words(&monitor);
    (monitor, words)
}

fn words(monitor: &Monitor) -> Vec<&'static str> {
    let word = |of: Unpromised| match of {
        Unpromised::UnwatchedHours { .. } => "hours",
        Unpromised::Returning { .. } => "returning",
        Unpromised::Contradictions { .. } => "contradictions",
        Unpromised::ChangedErrors => "changed",
    };
    monitor.unpromised().into_iter().map(word).collect()
}

/// A night that was not watched is none; after a day all is promised, for noise of each kind that is known.
#[test]
fn after_a_day_all_noise_that_does_not_change_is_promised() {
    for (i, condition) in [
        Condition::White,
        Condition::Understated(3.0),
        Condition::Correlated { share: 0.7, time_s: 60.0 },
        Condition::Correlated { share: 0.3, time_s: 600.0 },
        Condition::HeavyTails(4.0),
    ]
    .into_iter()
    .enumerate()
    {
        let (_, early) = after(condition, 1.0, 0x0a1 + i as u64);
        assert_eq!(early, ["hours"], "{condition:?}");
        let (_, later) = after(condition, 24.5, 0x0a1 + i as u64);
        assert!(later.is_empty(), "{condition:?}: {later:?}");
    }
}

#[test]
fn errors_that_change_at_night_are_not_promised() {
    let night = Condition::CorrelatedAtNight { share: 0.7, time_s: 60.0 };
    for seed in 0..3 {
        assert_eq!(after(night, 6.0, 0x0b1 + seed).1, ["hours"], "before it");
        let (_, words) = after(night, 9.0, 0x0b1 + seed);
        assert!(words.contains(&"changed"), "{seed}: {words:?}");
    }
}

#[test]
fn rain_is_not_promised() {
    for seed in 0..3 {
        let (_, words) = after(Condition::Rain(0.3), 6.0, 0x0c1 + seed);
        let is_found = words.contains(&"returning") || words.contains(&"contradictions");
        assert!(is_found, "{seed}: {words:?}");
    }
}

/// A camera that moved, in a step or slowly, is no disturbance.
#[test]
fn a_motion_is_no_disturbance() {
    for (seed, deg_per_h) in [(1, 0.1), (2, 1.0)] {
        let mut scene = Scene::of(View::near(), Condition::White, 10.0, 0x0d1 + seed);
        let mut monitor = scene.learned(50, &MonitorConfig::default());
        for i in 0..3000 {
            let degrees = (deg_per_h * (f64::from(i) - 1000.0) / 360.0).clamp(0.0, 0.3);
            monitor.push(&scene.next(&(Vector6::y() * degrees.to_radians())));
        }
        assert!(monitor.drift().is_some(), "{deg_per_h}° an hour");
        assert_eq!(words(&monitor), ["hours"], "{deg_per_h}° an hour");
    }
}
