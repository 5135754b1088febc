//! `solve_rig` from nothing, covariances included: two cameras, eight cameras with 70,000 points, and how it grows to 10,000 views.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use common::rooms::{Room, arc, board, line_plus_one, pair_with, row};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use resight_core::multiview::rig::{Observation, RigConfig};
use std::hint::black_box;

fn solve(c: &mut Criterion, name: &str, room: &Room, observations: &[Observation]) {
    let n_points: usize = observations.iter().map(|s| s.seen.len()).sum();
    let mut group = c.benchmark_group("solve_rig");
    group.sample_size(10).throughput(Throughput::Elements(n_points as u64));
    let name = format!("{name}: {} observations, {n_points} points", observations.len());
    group.bench_function(name, |b| b.iter(|| room.solve(black_box(observations), &RigConfig::default())));
    group.finish();
}

fn rigs(c: &mut Criterion) {
    let mut rng = Rng::new(1);
    for (name, points) in [("pair, four points", line_plus_one()), ("pair, board of 48", board(8, 6, 0.1))] {
        let room = pair_with(&mut rng, points, 50, 0.5);
        let observations = room.disturbed(&mut rng);
        solve(c, name, &room, &observations);
    }
    let room = arc(&mut rng, 100, 0.3);
    let observations = room.disturbed(&mut rng);
    solve(c, "8 cameras, 100 views", &room, &observations);
    for n_views in [100, 1_000, 10_000] {
        let room = row(&mut rng, n_views / 100, n_views, 0.2);
        let observations = room.disturbed(&mut rng);
        solve(c, &format!("{} cameras, {n_views} views", n_views / 100), &room, &observations);
    }
    let room = row(&mut rng, 100, 2_000, 0.2);
    let observations = room.disturbed(&mut rng);
    solve(c, "100 cameras, 2000 views", &room, &observations);
}

criterion_group!(benches, rigs);
criterion_main!(benches);
