//! What a frame costs: `cargo run --release -p resight --example bench_landmarks`.

#[allow(dead_code)] // The tests use the rest.
#[path = "../tests/landmarks_support/mod.rs"]
mod landmarks_support;

use landmarks_support::{camera, exposed, picture, turned};
use nalgebra::Matrix3;
use resight::landmarks::Landmarks;
use resight::render::Pcg;
use std::time::Instant;

/// Nanoseconds of processor time so far where the system tells (Linux): other programs do not count.
fn processor_ns() -> Option<u64> {
    std::fs::read_to_string("/proc/thread-self/schedstat").ok()?.split_whitespace().next()?.parse().ok()
}

const ROUNDS: usize = 40;

/// Milliseconds (of the processor, where the system tells) of the mean and the median round.
fn timed(mut work: impl FnMut(usize)) -> [f64; 2] {
    let mut all: Vec<f64> = (0..ROUNDS)
        .map(|round| {
            let (started, before) = (Instant::now(), processor_ns());
            work(round);
            match (before, processor_ns()) {
                (Some(before), Some(after)) => (after - before) as f64 * 1e-6,
                _ => started.elapsed().as_secs_f64() * 1e3,
            }
        })
        .collect();
    all.sort_by(f64::total_cmp);
    [all.iter().sum::<f64>() / ROUNDS as f64, all[ROUNDS / 2]]
}

fn main() {
    let camera = camera(1280, 960, 1100.0);
    let mut chance = Pcg::new(1);
    let still = picture(&camera, &Matrix3::identity(), 7);
    let frames: Vec<_> = (0..4).map(|_| exposed(&camera, &still, 1.0, 2.0, &mut chance)).collect();
    let Ok(landmarks) = Landmarks::new(&frames[0], &camera) else { return };
    let near = turned([0.0, 0.05, 0.0]);
    let show = |what: &str, [mean, median]: [f64; 2]| {
        println!("{what:<44} {mean:7.2} ms mean {median:7.2} ms median")
    };
    println!("1280×960, {} landmarks", landmarks.count());
    show("reference", timed(|round| drop(Landmarks::new(&frames[round % 4], &camera))));
    show(
        "frame, last rotation known (off by 1 px)",
        timed(|round| {
            std::hint::black_box(landmarks.observe(&frames[round % 4], Some(&near))).ok();
        }),
    );
    show(
        "frame, looked for everywhere",
        timed(|round| {
            std::hint::black_box(landmarks.observe(&frames[round % 4], None)).ok();
        }),
    );
}
