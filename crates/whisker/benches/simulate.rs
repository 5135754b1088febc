//! What a simulated reading costs: cargo bench -p resight-whisker --bench simulate
//!
//! Three standard sweeps with touch and slip-off located, throughput per sample; the noise of the same samples.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector2;
use resight_whisker::rod::Stiffness;
use resight_whisker::simulate::{Spacing, add_noise, standard_sweeps, sweep};
use resight_whisker::{Cell, Rod, Sample, Shape};
use std::hint::black_box;

fn swept(rod: &Rod, object: &Shape, mu: f64) -> Vec<Sample> {
    let motions = standard_sweeps();
    let record =
        |(i, motion)| sweep(rod, object, mu, i as u32, motion, &Spacing::default()).expect("a sweep");
    motions.iter().enumerate().flat_map(|one| record(one).samples).map(|row| row.sample).collect()
}

fn bench(c: &mut Criterion) {
    let uniform = Rod::uniform(0.25, 9.817e-3).expect("a rod");
    let taper =
        Rod { stiffness: Stiffness::Taper { ei_base_n_m2: 0.02, taper: 2.0 / 3.0 }, ..uniform.clone() };
    let centre_m = Vector2::new(0.0, 0.165);
    let square = Shape::square(centre_m, 0.06, 0.5);
    let circle = Shape::Circle { centre_m, radius_m: 0.025 };
    let cases = [
        ("square_uniform", &uniform, &square, 0.0),
        ("circle_uniform", &uniform, &circle, 0.0),
        ("circle_uniform_mu03", &uniform, &circle, 0.3),
        ("circle_taper", &taper, &circle, 0.0),
    ];
    let mut group = c.benchmark_group("simulate");
    for (name, rod, object, mu) in cases {
        let count = swept(rod, object, mu).len() as u64;
        group.throughput(Throughput::Elements(count));
        group.bench_function(name, |b| b.iter(|| swept(black_box(rod), object, mu)));
    }
    let samples = swept(&uniform, &circle, 0.0);
    let cell =
        Cell { force_sigma_n: 3e-3, torque_sigma_n_m: 1.6e-5, hub_xy_sigma_m: 1e-5, ..Cell::default() };
    group.throughput(Throughput::Elements(samples.len() as u64));
    group.bench_function("noise", |b| b.iter(|| add_noise(black_box(&samples), &cell, 1)));
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
