//! Cost of consensus on 1,000 points, 1 px noise, threshold 4 px, 4–20 m: `cargo bench -p resight-core --bench robust`. Beside it the
//! pose of the right ones alone, which is part of the cost.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use common::outliers::{Scene, camera, scene};
use criterion::{Criterion, criterion_group, criterion_main};
use resight_core::locate::{self, locate};
use resight_core::robust::{Config, consensus};
use std::hint::black_box;

fn wrong_in_a_thousand(c: &mut Criterion) {
    let camera = camera();
    let mut group = c.benchmark_group("1000 points");
    for percent in [0, 50, 80, 90] {
        let mut rng = Rng::new(percent as u64);
        let scenes: Vec<Scene> = (0..50).map(|_| scene(&mut rng, 1000, 10 * percent, 1.0)).collect();
        let config = Config::with_threshold_px(4.0);
        let mut next = 0..;
        group.bench_function(format!("consensus, {percent} % wrong"), |b| {
            b.iter(|| {
                let scene = &scenes[next.next().unwrap_or(0) % scenes.len()];
                black_box(consensus(&scene.seen, &camera, &config)).is_ok()
            })
        });
        let good: Vec<_> = scenes.iter().map(Scene::good).collect();
        let mut next = 0..;
        group.bench_function(format!("locate on the right ones of {percent} % wrong"), |b| {
            b.iter(|| {
                let seen = &good[next.next().unwrap_or(0) % good.len()];
                black_box(locate(seen, &camera, &locate::Config::default())).is_ok()
            })
        });
    }
    group.finish();
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = wrong_in_a_thousand }
criterion_main!(benches);
