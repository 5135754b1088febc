//! Cost of the solvers that know something about the rotation, on problems like those of PoseLib's benchmark; each figure is the
//! mean over 1,000 problems, so that branches are as unpredictable as in use.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Unit, Vector3};
use resight_core::solve::upright_p2p::upright_p2p;
use resight_core::{Bearing, Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

/// Rays in a field of 75°, depths 0.1 to 10, any vertical.
fn upright_problem(rng: &mut Rng) -> ([Bearing; 2], [Point; 2], [Bearing; 2]) {
    let cam_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let target_from_cam = cam_from_target.inverse();
    let mut ray =
        || Unit::new_normalize(Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0));
    let rays = [ray(), ray()];
    let points = rays.map(|b| target_from_cam * (b.into_inner() * rng.uniform(0.1, 10.0)));
    let up = Unit::new_normalize(rng.unit_vector());
    let up_in_cam = Unit::new_normalize(cam_from_target.rotation * up.into_inner());
    (rays, points, [up, up_in_cam])
}

fn bench_upright(c: &mut Criterion) {
    let mut rng = Rng::new(1);
    let problems: Vec<_> = (0..PROBLEMS).map(|_| upright_problem(&mut rng)).collect();
    let mut group = c.benchmark_group("upright_p2p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    group.bench_function("any two points", |b| {
        b.iter(|| {
            let poses = |(rays, x, [up, up_in_cam]): &([Bearing; 2], [Point; 2], [Bearing; 2])| {
                black_box(upright_p2p(rays, x, up, up_in_cam)).map_or(0, |poses| poses.len())
            };
            problems.iter().map(poses).sum::<usize>()
        })
    });
}

criterion_group!(benches, bench_upright);
criterion_main!(benches);
