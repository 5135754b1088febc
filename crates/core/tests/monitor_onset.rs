//! When it moved: the stated standard deviation of a beginning covers the truth, also between readings and in gaps.

use crate::common::Rng;
use crate::common::sentry::{Scene, Stream, WHITE, cam_from_target, covariance, errors, monitor, pan};
use nalgebra::{Matrix6, Vector6};
use resight_core::Pose;
use resight_core::temporal::monitor::learn::{LearnConfig, unsettled};
use resight_core::temporal::monitor::{Drift, Reading, Watch};

/// The first alarm of a camera that rotates by `degrees` at `step_s`, which lies between readings.
fn alarm(scene: Scene, seed: u64, degrees: f64, step_s: f64) -> Drift {
    let (mut stream, mut monitor) = (Stream::new(scene, seed), monitor(&scene, 1.0 / 30.0));
    if 0.1 < degrees {
        monitor.measure_noise(&[]); // Else errors that nothing excludes yet explain a step of two standard deviations.
    }
    for _ in 0..5000 {
        let is_after = step_s < stream.t_s + scene.period_s;
        let motion = if is_after { pan(degrees) } else { Vector6::zeros() };
        if let Watch::Drifted(drift) = monitor.push(&stream.next(&motion)) {
            return drift;
        }
    }
    panic!("{degrees}° at {step_s} s is not found")
}

/// Steps of 2, 4 and 20 standard deviations of a reading, a reading each 1 s, 10 s and 60 s, at times of the step that lie anywhere between
/// two readings. Of 60 of each the stated ± holds the truth in at least as many as one standard deviation of a normal error holds (68.3 % of 60 is 41,
/// less three of its own standard deviations: 30), and twice it in nearly all. No ± is below the interval of the readings.
#[test]
fn a_beginning_is_as_uncertain_as_stated() {
    for (degrees, period_s) in [(0.1, 1.0), (0.2, 1.0), (1.0, 1.0), (0.2, 10.0), (1.0, 60.0)] {
        let scene = Scene { period_s, ..WHITE };
        let mut chance = Rng::new(0x0b5e_0000);
        let (mut within, mut within_twice, mut mean_sigma) = (0, 0, 0.0);
        for run in 0..60 {
            let step_s = period_s * (400.0 + chance.uniform(0.0, 20.0));
            let drift = alarm(scene, 0x0b5e_1000 + run, degrees, step_s);
            let away = (drift.began_s - step_s).abs() / drift.began_sigma_s;
            assert!(period_s <= drift.began_sigma_s * (1.0 + 1e-12), "{} s", drift.began_sigma_s);
            (within, within_twice) = (within + u32::from(away <= 1.0), within_twice + u32::from(away <= 2.0));
            mean_sigma += drift.began_sigma_s / 60.0;
        }
        println!(
            "{degrees}° each {period_s} s: ± {mean_sigma:.1} s holds {within}, twice that {within_twice} of 60"
        );
        assert!(30 <= within && 55 <= within_twice, "{degrees}°, {period_s} s: {within}, {within_twice}");
    }
}

/// Eight hours without a reading, in which it moved: the beginning is known to all of them.
#[test]
fn a_motion_in_a_gap_began_somewhere_in_it() {
    let (mut stream, gap_s) = (Stream::new(WHITE, 0x0b5e_2000), 8.0 * 3600.0);
    let mut monitor = monitor(&WHITE, 1.0 / 30.0);
    monitor.measure_noise(&[]);
    for _ in 0..600 {
        monitor.push(&stream.next(&Vector6::zeros()));
    }
    stream.t_s += gap_s;
    let alarm = (0..600).find_map(|_| match monitor.push(&stream.next(&pan(3.0))) {
        Watch::Drifted(drift) => Some(drift),
        _ => None,
    });
    let drift = alarm.expect("an alarm");
    println!("began {} s ± {} s, alarm at {} s", drift.began_s, drift.began_sigma_s, stream.t_s);
    assert!((gap_s..2.0 * gap_s).contains(&drift.began_sigma_s), "± {} s", drift.began_sigma_s);
    for moved_s in [600.0, 601.0 + gap_s] {
        assert!((drift.began_s - moved_s).abs() <= 1.1 * drift.began_sigma_s, "{} s", drift.began_s);
    }
}

/// The same while a reference is learned: the step lies between readings 24 and 25, or in a gap of some seconds there.
#[test]
fn a_motion_while_learning_began_between_two_readings() {
    let mut chance = Rng::new(0x0b5e_3000);
    let known = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
    for gap_s in [1.0, 10.0] {
        let reading = |i: u32| {
            let moved = if i < 25 { Vector6::zeros() } else { pan(2.0) };
            let old_from_new = Pose::exp(&(moved + errors(&mut chance, 1.0)));
            Reading {
                t_s: f64::from(i) + if i < 25 { 0.0 } else { gap_s - 1.0 },
                a_from_b: old_from_new.inverse() * cam_from_target(),
                covariance: covariance(1.0),
                is_consistent: true,
            }
        };
        let readings: Vec<Reading> = (0..50).map(reading).collect();
        let drift = unsettled(&readings, &known).expect("a motion").drift;
        assert_eq!(drift.began_s, readings[25].t_s);
        assert!((gap_s..2.0 * gap_s).contains(&drift.began_sigma_s), "± {} s", drift.began_sigma_s);
    }
}
