//! Cost of consensus on 1,000 points, 1 px noise, threshold 4 px, depths of 4–20 m; beside it the pose of the right ones alone, which
//! is part of the cost. `cargo bench -p resight-core --bench robust`.
//!
//! Each scene is solved five times and the fastest counts: on a machine shared with others the rest is theirs. The median over
//! scenes is the figure; what a single scene costs depends on the luck of its samples.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use common::outliers::{Scene, camera, scene};
use resight_core::locate::{self, locate};
use resight_core::robust::{Config, consensus};
use std::hint::black_box;
use std::time::Instant;

const SCENES: usize = 200;
const REPEATS: usize = 5;

/// Median and 95th percentile over scenes of the fastest of a few runs, µs.
fn microseconds(scenes: &[Scene], mut work: impl FnMut(&Scene)) -> [f64; 2] {
    let fastest = |scene: &Scene, work: &mut dyn FnMut(&Scene)| {
        let once = |work: &mut dyn FnMut(&Scene)| {
            let start = Instant::now();
            work(scene);
            start.elapsed().as_secs_f64() * 1e6
        };
        (0..REPEATS).map(|_| once(work)).fold(f64::INFINITY, f64::min)
    };
    let mut times: Vec<f64> = scenes.iter().map(|scene| fastest(scene, &mut work)).collect();
    times.sort_by(f64::total_cmp);
    [times[SCENES / 2], times[SCENES * 95 / 100]]
}

fn main() {
    let (camera, config) = (camera(), Config::with_threshold_px(4.0));
    println!("| wrong | consensus, µs: median | 95 % | samples | locate on the right ones, µs |");
    println!("| ---: | ---: | ---: | ---: | ---: |");
    for percent in [0, 50, 80, 90] {
        let mut rng = Rng::new(percent as u64);
        let scenes: Vec<Scene> = (0..SCENES).map(|_| scene(&mut rng, 1000, 10 * percent, 1.0)).collect();
        let [median, high] = microseconds(&scenes, |scene| {
            black_box(consensus(&scene.seen, &camera, &config)).ok();
        });
        let drawn =
            |scene: &Scene| consensus(&scene.seen, &camera, &config).map_or(0, |found| found.n_samples);
        let samples = scenes.iter().map(drawn).sum::<usize>() / SCENES;
        let good: Vec<Scene> = scenes.into_iter().map(|s| Scene { seen: s.good(), ..s }).collect();
        let [alone, _] = microseconds(&good, |scene| {
            black_box(locate(&scene.seen, &camera, &locate::Config::default())).ok();
        });
        println!("| {percent} % | {median:.0} | {high:.0} | {samples} | {alone:.0} |");
    }
}
