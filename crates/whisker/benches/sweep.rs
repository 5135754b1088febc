//! What smoothing costs: cargo bench -p resight-whisker --bench sweep

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use resight_whisker::simulate::record;
use resight_whisker::sweep::fixed_lag::FixedLag;
use resight_whisker::sweep::{Options, smooth};
use resight_whisker::{Cell, PlanarPose, Rod, Sample, Shape};
use std::hint::black_box;

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 0.009_817;

/// A whisker turned over a disc, read with noise: uniform, of the load cell's own deviation.
fn sweep(rod: &Rod, cell: &Cell) -> Vec<Sample> {
    let disc = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let path: Vec<PlanarPose> = (0..120)
        .map(|k| PlanarPose { x_m: -0.06, y_m: 0.0, angle_rad: (85.0 - 0.6 * f64::from(k)).to_radians() })
        .collect();
    let record = record(rod, &disc, 0.3, 0, &path).expect("a record");
    let mut state = 7u64;
    let mut noise = |sigma: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sigma * 12.0_f64.sqrt() * ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5)
    };
    let mut read = |sample: &Sample| {
        let mut s = *sample;
        s.load.fx_n += noise(cell.force_sigma_n);
        s.load.fy_n += noise(cell.force_sigma_n);
        s.load.mz_n_m += noise(cell.torque_sigma_n_m);
        s
    };
    record.samples.iter().map(|simulated| read(&simulated.sample)).collect()
}

fn bench(c: &mut Criterion) {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let cell = Cell {
        force_sigma_n: 3e-3,
        torque_sigma_n_m: 1.5e-5,
        hub_xy_sigma_m: 1e-5,
        hub_angle_sigma_rad: 1e-4,
        ..Cell::default()
    };
    let samples = sweep(&rod, &cell);
    for lag_samples in [10, 20] {
        let options = Options { lag_samples, ..Options::default() };
        let mut warm = FixedLag::new(&rod, &cell, &options).expect("instruments");
        for sample in &samples[..80] {
            warm.push(*sample);
        }
        // Forty updates, so that those that need a second round count by their share.
        c.bench_function(&format!("fixed lag, forty updates, lag {lag_samples}"), |b| {
            b.iter_batched_ref(
                || warm.clone(),
                |smoother| {
                    for sample in &samples[80..] {
                        black_box(smoother.push(*sample));
                    }
                },
                BatchSize::SmallInput,
            );
        });
    }
    c.bench_function("batch, 120 samples", |b| {
        b.iter(|| smooth(&rod, &cell, black_box(&samples), &Options::default()).expect("a sweep"));
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
