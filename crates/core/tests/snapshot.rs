//! A tracker and a monitor put into numbers and restored go on bit for bit as if nothing had been.

use crate::common::Rng;
use nalgebra::{Matrix6, Vector6};
use resight_core::temporal::monitor::{DriftNoise, Monitor, MonitorConfig, Reading, Reference, Watch};
use resight_core::temporal::snapshot::Snapshot;
use resight_core::temporal::track::{Candidate, Motion, TrackConfig, Tracker};
use resight_core::{Error, Pose};

const SIGMA: f64 = 1e-3;

fn spread(scale: f64) -> Matrix6<f64> {
    Matrix6::identity() * (scale * SIGMA).powi(2)
}

fn cam_from_target() -> Pose {
    Pose::exp(&Vector6::new(0.2, -0.7, 0.1, 0.3, -0.2, 2.5))
}

/// Ten readings a second with flips, contradictions, a step at 200 s and the way back at 300 s.
fn readings(n: usize, seed: u64) -> Vec<Reading> {
    let mut chance = Rng::new(seed);
    let reading = |i: usize| {
        let step = if (2000..3000).contains(&i) { 0.02 } else { 0.0 };
        let flipped = if chance.uniform(0.0, 1.0) < 0.03 { 0.5 } else { 0.0 };
        let error = Vector6::from_fn(|_, _| SIGMA * chance.normal());
        let moved = Vector6::new(0.0, step + flipped, 0.0, 0.0, 0.0, 0.0);
        Reading {
            t_s: i as f64 * 0.1,
            a_from_b: Pose::exp(&(error + moved)) * cam_from_target(),
            covariance: spread(1.0),
            is_consistent: 0.02 < chance.uniform(0.0, 1.0),
        }
    };
    (0..n).map(reading).collect()
}

fn monitor() -> Monitor {
    let noise = DriftNoise {
        reference: spread(0.3),
        reading: spread(1.0),
        bias: spread(0.5),
        bias_time_s: 60.0,
        diurnal: spread(0.3),
    };
    let reference = Reference { a_from_b: cam_from_target(), noise };
    Monitor::new(&reference, &MonitorConfig::default(), 0.0).expect("a monitor")
}

fn candidates(reading: &Reading) -> [Candidate; 2] {
    let mirrored = Pose::exp(&Vector6::new(0.4, 0.0, 0.0, 0.0, 0.0, 0.0)) * reading.a_from_b;
    [(reading.a_from_b, 0.6), (mirrored, 0.4)].map(|(cam_from_target, probability)| Candidate {
        cam_from_target,
        covariance: reading.covariance,
        probability,
    })
}

fn moving() -> TrackConfig {
    let motion = Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s: 0.2, translation_m_per_s_sqrt_s: 0.3 };
    TrackConfig { motion, ..TrackConfig::default() }
}

/// Put into numbers and back before every 7th reading; equal to the one that was left alone, in state and word, to the last bit.
#[test]
fn a_restored_monitor_goes_on_as_if_nothing_had_been() {
    goes_on_as_if_nothing_had_been(monitor());
}

/// With all models of its noise, and what each onset remembers of them.
#[test]
fn a_restored_monitor_that_measures_its_noise_goes_on_as_if_nothing_had_been() {
    let mut measuring = monitor();
    measuring.measure_noise(&readings(60, 0x5a2));
    goes_on_as_if_nothing_had_been(measuring);
}

fn later(reading: Reading) -> Reading {
    Reading { t_s: reading.t_s + 6.0, ..reading }
}

fn goes_on_as_if_nothing_had_been(monitor: Monitor) {
    let (mut left_alone, mut restored) = (monitor.clone(), monitor);
    let mut drifts = 0;
    for (i, reading) in readings(4000, 0x5a1).into_iter().map(later).enumerate() {
        if i % 7 == 0 {
            restored = Monitor::restore(&restored.snapshot()).expect("its own snapshot");
        }
        let (said, wanted) = (restored.push(&reading), left_alone.push(&reading));
        assert_eq!(said, wanted, "reading {i}");
        drifts += usize::from(matches!(said, Watch::Drifted(_)));
    }
    assert_eq!(restored, left_alone);
    assert!((500..2000).contains(&drifts) && 0 < restored.outliers, "{drifts} of the readings in a drift");
}

#[test]
fn a_restored_tracker_goes_on_as_if_nothing_had_been() {
    for config in [TrackConfig::default(), moving()] {
        let mut left_alone = Tracker::new(&config).expect("a tracker");
        let mut restored = left_alone.clone();
        for (i, reading) in readings(2500, 0x5a2).iter().enumerate() {
            restored = Tracker::restore(&restored.snapshot()).expect("its own snapshot");
            let (said, wanted) =
                [&mut restored, &mut left_alone].map(|t| t.push(reading.t_s, &candidates(reading))).into();
            assert_eq!(said, wanted, "reading {i}");
        }
        assert_eq!(restored, left_alone);
    }
}

/// A night without the program is a night without sight, and a tracker knows less after it.
#[test]
fn the_time_between_counts() {
    let mut before = monitor();
    let mut tracker = Tracker::new(&TrackConfig::default()).expect("a tracker");
    for reading in &readings(300, 0x5a3) {
        before.push(reading);
        tracker.push(reading.t_s, &candidates(reading)[..1]);
    }
    let after = Monitor::restore(&before.snapshot()).expect("its own snapshot");
    let night_s = before.last_s() + 30_000.0;
    assert!(matches!(after.watch(night_s), Watch::Stale { for_s } if 29_990.0 < for_s));
    let restored = Tracker::restore(&tracker.snapshot()).expect("its own snapshot");
    let [dusk, dawn] = [before.last_s(), night_s].map(|t_s| restored.predicted(t_s).expect("tracked"));
    let walked = 1e-4_f64.powi(2) * 30_000.0;
    let widened = dawn.covariance[(0, 0)] - dusk.covariance[(0, 0)];
    assert!((widened - walked).abs() < 1e-3 * walked, "{widened}");
}

/// Fields that come or go change what the numbers mean: then `SNAPSHOT_VERSION` must be raised, and these counts with it.
#[test]
fn a_changed_layout_needs_another_version() {
    let (mut detector, mut tracker) = (monitor(), Tracker::new(&moving()).expect("a tracker"));
    let first = &readings(1, 0x5a4)[0];
    detector.push(first);
    tracker.push(first.t_s, &candidates(first));
    let (of_monitor, of_tracker) = (detector.snapshot(), tracker.snapshot());
    assert_eq!((of_monitor.version, of_monitor.numbers.len()), (8, 1039));
    assert_eq!((of_tracker.version, of_tracker.numbers.len()), (1, 274));
}

#[test]
fn numbers_of_something_else_are_refused() {
    let mut detector = monitor();
    readings(50, 0x5a5).iter().for_each(|reading| {
        detector.push(reading);
    });
    let good = detector.snapshot();
    let with = |numbers: Vec<f64>| Snapshot { numbers, ..good.clone() };
    let later = Snapshot { version: 9, ..good.clone() };
    assert_eq!(Monitor::restore(&later), Err(Error::SnapshotVersion { seen: 9, needed: 8 }));
    for length in 0..good.numbers.len() {
        let torn = with(good.numbers[..length].to_vec());
        assert!(matches!(Monitor::restore(&torn), Err(Error::SnapshotNumbers { .. })), "{length}");
    }
    let longer = with(good.numbers.iter().copied().chain([0.0]).collect());
    assert!(matches!(Monitor::restore(&longer), Err(Error::SnapshotNumbers { unread: 1, .. })));
    assert!(Tracker::restore(&good).is_err());
}

/// A correlated error that is forgotten in no time is none, wherever in the state it stands: the reference and six coordinates.
#[test]
fn noise_that_is_none_is_refused() {
    let good = monitor().snapshot();
    let places: Vec<usize> = (0..good.numbers.len()).filter(|i| good.numbers[*i] == 60.0).collect();
    assert_eq!(places.len(), 7);
    for place in places {
        for spoilt in [0.0, -60.0] {
            let mut numbers = good.numbers.clone();
            numbers[place] = spoilt;
            assert!(Monitor::restore(&Snapshot { numbers, ..good.clone() }).is_err(), "{place}: {spoilt}");
        }
    }
}

/// Any number changed to anything: refused, or a monitor that still answers; never a panic.
#[test]
fn spoilt_numbers_never_panic() {
    let mut detector = monitor();
    let stream = readings(60, 0x5a6);
    stream[..50].iter().for_each(|reading| {
        detector.push(reading);
    });
    let good = detector.snapshot();
    for place in 0..good.numbers.len() {
        for spoilt in [f64::NAN, f64::INFINITY, -1.0, 0.0, 0.5, 1e300, -1e300] {
            let mut numbers = good.numbers.clone();
            numbers[place] = spoilt;
            if let Ok(mut restored) = Monitor::restore(&Snapshot { numbers, ..good.clone() }) {
                assert!(spoilt.is_finite());
                stream[50..].iter().for_each(|reading| {
                    restored.push(reading);
                });
            }
        }
    }
}
