//! What smoothing costs: cargo bench -p resight-whisker --bench sweep

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use resight_whisker::sweep::fixed_lag::FixedLag;
use resight_whisker::sweep::{Options, smooth};
use resight_whisker::{Cell, HubLoad, PlanarPose, Rod, Sample};
use std::hint::black_box;

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 0.009_817;

/// Ten samples without contact, then frictionless contacts of growing bend up to 0.4 N: fx = −M²/2EI is what no friction means,
/// fy = M/s that of a slightly bent whisker touched at 0.15 m.
fn sweep() -> Vec<Sample> {
    (0..120u32)
        .map(|sample| {
            let pushed_m = (f64::from(sample) - 10.0).max(0.0) * 4e-4;
            let moment = 3.0 * EI_N_M2 * pushed_m / (0.15_f64 * 0.15);
            let load =
                HubLoad { fx_n: -moment * moment / (2.0 * EI_N_M2), fy_n: moment / 0.15, mz_n_m: moment };
            let world_from_hub =
                PlanarPose { x_m: pushed_m, y_m: 0.0, angle_rad: std::f64::consts::FRAC_PI_2 };
            Sample { sweep: 0, sample, t_s: None, world_from_hub, load }
        })
        .collect()
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
    let samples = sweep();
    for lag_samples in [10, 20] {
        let options = Options { lag_samples, ..Options::default() };
        let mut warm = FixedLag::new(&rod, &cell, &options).expect("instruments");
        for sample in &samples[..80] {
            warm.push(*sample);
        }
        c.bench_function(&format!("fixed lag, one update, lag {lag_samples}"), |b| {
            b.iter_batched_ref(
                || warm.clone(),
                |smoother| black_box(smoother.push(samples[80])),
                BatchSize::SmallInput,
            );
        });
    }
    c.bench_function("batch, 110 contacts", |b| {
        b.iter(|| smooth(&rod, &cell, black_box(&samples), &Options::default()).expect("a sweep"));
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
