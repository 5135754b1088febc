//! Cost of the solvers of a rig; each figure is the mean over 1,000 problems, so that branches are as unpredictable as in use.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Unit, Vector3};
use resight_core::solve::gp3p::{Ray, gp3p};
use resight_core::{Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

fn in_box(rng: &mut Rng, half: f64) -> Point {
    Point::new(rng.uniform(-half, half), rng.uniform(-half, half), rng.uniform(-half, half))
}

/// As PoseLib's generator: rays in a field of 75°, depths 0.1 to 10, origins in a box of 2 m.
fn random(rng: &mut Rng) -> ([Ray; 3], [Point; 3]) {
    let rig_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let rays = core::array::from_fn(|_| Ray {
        origin_in_rig: in_box(rng, 1.0),
        bearing_in_rig: Unit::new_normalize(Vector3::new(
            rng.uniform(-edge, edge),
            rng.uniform(-edge, edge),
            1.0,
        )),
    });
    let target_from_rig = rig_from_target.inverse();
    let place = |ray: Ray| {
        target_from_rig * (ray.origin_in_rig + ray.bearing_in_rig.into_inner() * rng.uniform(0.1, 10.0))
    };
    (rays, rays.map(place))
}

/// A 1 m target 5 to 20 m away from a rig of 1 m.
fn far(rng: &mut Rng) -> ([Ray; 3], [Point; 3]) {
    let rig_from_target = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(5.0, 20.0));
    let places: [Point; 3] = core::array::from_fn(|_| in_box(rng, 0.5));
    let rays = places.map(|place| {
        let origin_in_rig = in_box(rng, 0.5);
        Ray { origin_in_rig, bearing_in_rig: Unit::new_normalize(rig_from_target * place - origin_in_rig) }
    });
    (rays, places)
}

type Problem = fn(&mut Rng) -> ([Ray; 3], [Point; 3]);

fn bench_gp3p(c: &mut Criterion) {
    let mut group = c.benchmark_group("gp3p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    for (name, problem) in [("random", random as Problem), ("1 m target at 5-20 m", far)] {
        let mut rng = Rng::new(1);
        let problems: Vec<_> = (0..PROBLEMS).map(|_| problem(&mut rng)).collect();
        group.bench_function(name, |b| {
            b.iter(|| {
                problems.iter().map(|(rays, places)| black_box(gp3p(rays, places)).len()).sum::<usize>()
            })
        });
    }
}

criterion_group!(benches, bench_gp3p);
criterion_main!(benches);
