//! After a gap: a camera that stayed is soon known to be where it was, and one that did not is never called steady.
//!
//! A tag of 0.16 m at 1.2 m, 0.2 px, white noise, a reading a second, nothing declared. What it leaves out: more runs and other gaps, of which
//! `cargo run --release -p resight-core --example watch_motions -- restarts` makes tables.

use crate::common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Monitor, MonitorConfig, Watch};

const HOUR_S: f64 = 3600.0;

fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::y() * degrees.to_radians()
}

/// Watched for ten minutes, switched off, and restored.
fn restored(off_s: f64, seed: u64) -> (Monitor, Scene) {
    let mut scene = Scene::of(View::near(), Condition::White, 1.0, seed);
    let mut monitor = scene.learned(50, &MonitorConfig::default());
    while scene.t_s < 600.0 {
        monitor.push(&scene.next(&pan(0.0)));
    }
    let monitor = Monitor::restore(&monitor.snapshot()).expect("its own state");
    scene.t_s += off_s;
    (monitor, scene)
}

/// A reference from a file, compared with readings of another night.
fn nightly(seed: u64) -> (Monitor, Scene) {
    let mut scene = Scene::of(View::near(), Condition::White, 1.0, seed);
    let reference = *scene.learned(50, &MonitorConfig::default()).reference();
    scene.t_s += 80_000.0;
    let mut monitor = Monitor::new(&reference, &MonitorConfig::default(), scene.t_s).expect("a monitor");
    monitor.measure_noise(&[]);
    (monitor, scene)
}

/// What is said of each of the next readings.
fn said((monitor, scene): &mut (Monitor, Scene), degrees: f64, readings: usize) -> Vec<Watch> {
    (0..readings).map(|_| monitor.push(&scene.next(&pan(degrees)))).collect()
}

fn chi2(error: &Vector6<f64>, covariance: &nalgebra::Matrix6<f64>) -> f64 {
    error.dot(&covariance.cholesky().expect("a covariance").solve(error))
}

/// And what is said of where it is agrees with its covariance: six numbers.
#[test]
fn a_camera_that_stayed_is_steady_within_a_minute() {
    let (mut sum, mut runs) = (0.0, 0.0);
    for seed in 0..4 {
        for mut watched in [600.0, 8.0 * HOUR_S, 72.0 * HOUR_S]
            .map(|off_s| restored(off_s, 0x57e + seed))
            .into_iter()
            .chain([nightly(0x57f + seed)])
        {
            let said = said(&mut watched, 0.0, 120);
            assert!(!said.iter().any(|word| matches!(word, Watch::Drifted(_))), "{seed}: {said:?}");
            assert!(said[60..].iter().all(|word| *word == Watch::Steady), "{seed}: {:?}", said.last());
            let now = watched.0.deviation().expect("readings");
            sum += chi2(&now.old_from_new, &now.covariance);
            runs += 1.0;
        }
    }
    assert!((3.0..10.0).contains(&(sum / runs)), "NEES {}", sum / runs);
}

/// Several times what a session promises to find: found at the third reading, with its size, however long the gap.
#[test]
fn a_motion_in_the_gap_is_told_with_its_size() {
    for (row, degrees) in [0.1, 0.3, 1.0, 3.0].into_iter().enumerate() {
        for off_s in [600.0, 8.0 * HOUR_S, 72.0 * HOUR_S] {
            let mut watched = restored(off_s, 0x9a0 + row as u64);
            let said = said(&mut watched, degrees, 60);
            let name = format!("{degrees}° in {off_s} s");
            assert!(said[2..].iter().all(|word| matches!(word, Watch::Drifted(_))), "{name}: {said:?}");
            let drift = watched.0.drift().expect("a drift");
            assert!(drift.began_sigma_s >= 0.99 * off_s, "{name}: {drift:?}");
            let chi2 = chi2(&(drift.old_from_new - pan(degrees)), &drift.covariance);
            assert!(chi2 < 27.9, "{name}: χ² {chi2}");
        }
    }
}

/// Errors that are not excluded would explain it: the cause is unknown, and the state says how large the motion is.
#[test]
fn a_small_motion_in_the_gap_is_never_steady() {
    for seed in 0..4 {
        for (degrees, off_s) in [(0.05, 600.0), (0.05, 8.0 * HOUR_S), (0.03, 72.0 * HOUR_S)] {
            let mut watched = restored(off_s, 0x5a1 + seed);
            let said = said(&mut watched, degrees, 90);
            let name = format!("{degrees}° in {off_s} s, {seed}");
            let is_clear = |word: &Watch| matches!(word, Watch::Away(_) | Watch::Drifted(_));
            assert!(said[60..].iter().all(is_clear), "{name}: {:?}", said.last());
            let (turn, shift) = watched.0.deviation().expect("readings").sizes();
            assert!(shift.is_none() || matches!(said.last(), Some(Watch::Drifted(_))), "{name}");
            let off = (turn.value - degrees.to_radians()).abs() / turn.sigma;
            assert!(off < 4.0, "{name}: {turn:?}");
        }
    }
}

/// A reference from a file, of which it is not known how long ago it was made.
#[test]
fn a_nightly_check_is_steady_only_where_the_camera_was() {
    for seed in 0..4 {
        for (degrees, readings) in [(0.3, 10), (0.5, 10), (1.0, 30), (3.0, 100)] {
            let said = said(&mut nightly(0x619 + seed), degrees, readings);
            assert!(matches!(said.last(), Some(Watch::Drifted(_))), "{degrees}°, {seed}: {:?}", said.last());
        }
        for (degrees, readings) in [(0.1, 10), (0.1, 30), (0.07, 100)] {
            let said = said(&mut nightly(0x61a + seed), degrees, readings);
            let Some(Watch::Away(now)) = said.last() else {
                panic!("{degrees}°, {seed}: {:?}", said.last())
            };
            assert!(chi2(&(now.old_from_new - pan(degrees)), &now.covariance) < 27.9, "{now:?}");
        }
    }
}

/// Nothing was read yet: that is not steady.
#[test]
fn a_reference_alone_says_nothing_of_now() {
    let (monitor, scene) = nightly(1);
    assert_eq!(monitor.watch(scene.t_s), Watch::Checking);
    assert!(monitor.deviation().is_none());
}
