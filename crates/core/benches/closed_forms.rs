//! Cost of the closed forms on problems like those of the peers' published benchmarks; each figure is the mean over 1,000 problems, so
//! that branches are as unpredictable as in use.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Unit, Vector3};
use resight_core::solve::{Candidates, configuration::classify, p3p::p3p, planar::planar, sqpnp::sqpnp};
use resight_core::{Camera, Correspondence, Pixel, Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

/// `n` points of a 1 m box, flat or not, seen from 5 to 20 m.
fn problem(rng: &mut Rng, n: usize, thickness: f64) -> Vec<Correspondence> {
    let z = rng.uniform(5.0, 20.0);
    let offset = Vector3::new(rng.uniform(-0.4, 0.4) * z, rng.uniform(-0.3, 0.3) * z, z);
    let cam_from_target = Pose::new(rng.rotation(), offset);
    let camera = Camera::normalized();
    let mut point = || {
        let h = 0.5 * thickness;
        let x = Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-h, h));
        let seen = cam_from_target * x;
        let pixel = camera.project(&seen).unwrap_or_else(Pixel::zeros);
        Correspondence {
            x_in_target: x,
            pixel,
            bearing: Unit::new_normalize(seen),
            sigma_px: 1e-3,
            sigma_m: 0.0,
            covariance_px2: None,
        }
    };
    (0..n).map(|_| point()).collect()
}

fn bench_p3p(c: &mut Criterion) {
    let mut rng = Rng::new(1);
    let problems: Vec<_> = (0..PROBLEMS).map(|_| problem(&mut rng, 3, 1.0)).collect();
    let triples: Vec<_> = problems
        .iter()
        .map(|p| ([0, 1, 2].map(|i| p[i].bearing), [0, 1, 2].map(|i| p[i].x_in_target)))
        .collect();
    let mut group = c.benchmark_group("p3p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    group.bench_function("1 m target at 5-20 m", |b| {
        b.iter(|| triples.iter().map(|(rays, places)| black_box(p3p(rays, places)).len()).sum::<usize>())
    });
}

fn bench_n_points(c: &mut Criterion) {
    type Solver = fn(&[Correspondence]) -> Candidates;
    let solvers: [(&str, Solver, f64); 2] = [("sqpnp", sqpnp, 1.0), ("planar", planar, 0.0)];
    for (name, solve, thickness) in solvers {
        let mut group = c.benchmark_group(name);
        group.sample_size(20);
        for n in [4, 10, 100, 1000] {
            let mut rng = Rng::new(n as u64);
            let count = PROBLEMS / 10;
            let problems: Vec<_> = (0..count).map(|_| problem(&mut rng, n, thickness)).collect();
            group.throughput(Throughput::Elements(count as u64));
            group.bench_function(format!("{n} points"), |b| {
                b.iter(|| problems.iter().map(|points| black_box(solve(points)).len()).sum::<usize>())
            });
        }
    }
}

fn bench_classify(c: &mut Criterion) {
    for n in [4, 30, 1000] {
        let points = problem(&mut Rng::new(n as u64), n, 0.0);
        c.bench_function(&format!("classify/{n} points"), |b| b.iter(|| classify(black_box(&points))));
    }
}

criterion_group!(benches, bench_p3p, bench_n_points, bench_classify);
criterion_main!(benches);
