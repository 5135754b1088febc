//! How well the size of a motion is known from rendered images, docs/math/monitor.md section 12:
//! `watch_images RUNS READINGS_AFTER [NOISE_GREY BLUR_PX]`. NEES (six degrees of freedom) at the alarm and at the end, and what motions are called.

#[path = "../tests/film_support/mod.rs"]
mod film_support;

use film_support::{Film, Told, axis, board, kind, map, nees, tag, watch};
use nalgebra::Vector6;

/// Degrees and millimetres, both along the axis of the run.
const MOTIONS: [(f64, f64); 8] =
    [(0.05, 0.0), (0.1, 0.0), (0.3, 0.0), (1.0, 0.0), (3.0, 0.0), (0.0, 2.0), (0.0, 20.0), (0.3, 20.0)];

fn main() {
    let mut numbers = std::env::args().skip(1).filter_map(|argument| argument.parse::<f64>().ok());
    let mut next = |usual: f64| numbers.next().unwrap_or(usual);
    let (runs, readings_after) = (next(10.0) as u64, next(50.0) as usize);
    let (noise_grey, blur_px) = (next(2.0), next(0.7));
    println!(
        "noise {noise_grey}, blur {blur_px} px\n\n| target | images | motion | found (readings) | NEES at the alarm | at the end | called, at the alarm | at the end |"
    );
    println!("| --- | --- | --- | ---: | ---: | ---: | --- | --- |");
    for (name, target) in [("tag", tag()), ("board", board()), ("map", map())] {
        for jpeg in [Some(50), Some(75), Some(95), None] {
            let old_from_new = Vector6::zeros();
            let film = Film {
                target: target.clone(),
                jpeg,
                noise_grey,
                blur_px,
                old_from_new,
                readings_before: 100,
                readings_after,
                seed: 0,
            };
            for motion in MOTIONS {
                row(name, &film, motion, runs);
            }
        }
    }
}

fn row(name: &str, film: &Film, (degrees, mm): (f64, f64), runs: u64) {
    let run = |seed: u64| {
        // The first three about or along the camera's own axes.
        let axis = if seed < 3 { nalgebra::Vector3::ith(seed as usize, 1.0) } else { axis(seed) };
        let mut old_from_new = Vector6::zeros();
        old_from_new.fixed_rows_mut::<3>(0).copy_from(&(axis * degrees.to_radians()));
        old_from_new.fixed_rows_mut::<3>(3).copy_from(&(axis * 1e-3 * mm));
        (watch(&Film { old_from_new, seed, ..film.clone() }), old_from_new)
    };
    let all: Vec<(Told, Vector6<f64>)> = (0..runs).map(run).collect();
    let found: Vec<_> =
        all.iter().filter_map(|(told, truth)| Some((told.drifts?, told.delay, truth))).collect();
    let nees_of = |i: usize| {
        let each: Vec<f64> = found.iter().map(|(drifts, _, truth)| nees(&drifts[i], truth)).collect();
        let largest = each.iter().copied().fold(0.0, f64::max);
        format!("{:.1} ({largest:.1})", each.iter().sum::<f64>() / each.len() as f64)
    };
    let called = |i: usize| {
        let count = |word: &str| found.iter().filter(|(drifts, ..)| kind(&drifts[i]) == word).count();
        format!("{} rotated, {} shifted, {} both", count("rotated"), count("shifted"), count("both"))
    };
    let delay = found.iter().map(|(_, delay, _)| *delay as f64).sum::<f64>() / found.len() as f64;
    let false_alarms: usize = all.iter().map(|(told, _)| told.false_alarms).sum();
    println!(
        "| {name} | {} | {degrees}°, {mm} mm | {} of {} ({delay:.1}){} | {} | {} | {} | {} |",
        film.jpeg.map_or("raw".to_string(), |quality| format!("JPEG {quality}")),
        found.len(),
        all.len(),
        if 0 < false_alarms { format!(", {false_alarms} false") } else { String::new() },
        nees_of(0),
        nees_of(1),
        called(0),
        called(1),
    );
}
