//! What a reading costs from its pose to the decision: the filter that chooses among minima, and the drift test.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix6, Vector6};
use resight_core::Pose;
use resight_core::temporal::monitor::{DriftNoise, Monitor, MonitorConfig, Reading, Reference};
use resight_core::temporal::track::{Candidate, TrackConfig, Tracker};
use std::hint::black_box;
use std::time::Instant;

const SIGMA: f64 = 1e-3;

fn spread(scale: f64) -> Matrix6<f64> {
    Matrix6::identity() * (scale * SIGMA).powi(2)
}

fn cam_from_target() -> Pose {
    Pose::exp(&Vector6::new(0.2, -0.7, 0.1, 0.3, -0.2, 2.5))
}

/// Readings of a camera that stays, thirty a second.
fn readings(n: usize) -> Vec<Reading> {
    let mut rng = Rng::new(1);
    let reading = |i: usize| {
        let error = Vector6::from_fn(|_, _| SIGMA * rng.normal());
        let a_from_b = Pose::exp(&error) * cam_from_target();
        Reading { t_s: i as f64 / 30.0, a_from_b, covariance: spread(1.0), is_consistent: true }
    };
    (0..n).map(reading).collect()
}

/// Each reading a decision: the most that one can cost; by default six readings share one.
fn decisions(c: &mut Criterion) {
    let noise = DriftNoise {
        reference: spread(0.3),
        reading: spread(1.0),
        bias: spread(0.5),
        bias_time_s: 60.0,
        diurnal: spread(0.3),
    };
    let reference = Reference { a_from_b: cam_from_target(), noise };
    let readings = readings(3000);
    for (name, decision_period_s, is_measured) in [
        ("every reading decided", 1e-3, false),
        ("six readings a decision", 0.2, false),
        ("noise measured, every reading decided", 1e-3, true),
        ("noise measured, six readings a decision", 0.2, true),
    ] {
        let config = MonitorConfig { decision_period_s, ..MonitorConfig::default() };
        let mut monitor = Monitor::new(&reference, &config, 0.0).expect("a monitor");
        if is_measured {
            monitor.measure_noise(&[]);
        }
        let mut next = 0;
        c.bench_function(&format!("monitor, {name}"), |b| {
            b.iter(|| {
                let lap_s = (next / readings.len()) as f64 * 100.0;
                let reading = readings[next % readings.len()];
                next += 1;
                black_box(monitor.push(&Reading { t_s: reading.t_s + lap_s, ..reading }));
            });
        });
    }
}

/// The slowest hundredth of single decisions, which a mean does not show; a machine that does something else besides is slower by its share.
fn slowest(_: &mut Criterion) {
    let noise = DriftNoise {
        reference: spread(0.3),
        reading: spread(1.0),
        bias: spread(0.0),
        bias_time_s: 60.0,
        diurnal: spread(0.0),
    };
    let reference = Reference { a_from_b: cam_from_target(), noise };
    let config = MonitorConfig { decision_period_s: 1e-3, ..MonitorConfig::default() };
    let mut monitor = Monitor::new(&reference, &config, 0.0).expect("a monitor");
    let readings = readings(30_000);
    monitor.measure_noise(&readings[..50]);
    let mut took_us: Vec<f64> = Vec::with_capacity(readings.len());
    for reading in &readings[50..] {
        let began = Instant::now();
        black_box(monitor.push(reading));
        took_us.push(1e6 * began.elapsed().as_secs_f64());
    }
    took_us.sort_by(f64::total_cmp);
    let at = |share: f64| took_us[(share * (took_us.len() - 1) as f64) as usize];
    println!("noise measured, single decisions: half {:.1} µs, 99 of 100 {:.1} µs", at(0.5), at(0.99));
}

fn tracks(c: &mut Criterion) {
    let readings = readings(3000);
    let mut tracker = Tracker::new(&TrackConfig::default()).expect("a tracker");
    let mut next = 0;
    c.bench_function("track, one minimum", |b| {
        b.iter(|| {
            let lap_s = (next / readings.len()) as f64 * 100.0;
            let reading = &readings[next % readings.len()];
            next += 1;
            let candidate = Candidate {
                cam_from_target: reading.a_from_b,
                covariance: reading.covariance,
                probability: 1.0,
            };
            black_box(tracker.push(reading.t_s + lap_s, &[candidate]));
        });
    });
}

criterion_group!(benches, decisions, slowest, tracks);
criterion_main!(benches);
