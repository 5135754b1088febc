//! Times `locate` in one process, for `benches/peers`: `bench_four_points SCENES.csv SIGMA_PX`.
//!
//! The file is that of `resight solve` (columns `view,x_m,y_m,z_m,u_px,v_px`, four rows a view), the camera that of
//! `four_points.py`. Every scene is timed once a round, so that branches are as unpredictable as in use; of its rounds the
//! fastest counts, the one nothing interrupted. Prints one JSON object: median and mean over scenes, the clock's own cost
//! taken off, in nanoseconds.

use nalgebra::Vector2;
use resight_core::camera::{CameraMatrix, Pinhole};
use resight_core::locate::{Config, locate};
use resight_core::{Camera, Correspondence, Lens, Point};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// As many as `four_points.py` gives the others.
const ROUNDS: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, sigma_px] = arguments.as_slice() else {
        return Err("usage: bench_four_points SCENES.csv SIGMA_PX".into());
    };
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole::new(matrix)?), size: None };
    let scenes = read(&std::fs::read_to_string(path)?, &camera, sigma_px.parse()?)?;
    let config = Config::default();
    let clock_ns = fastest(&scenes, |seen| _ = black_box(seen)).into_iter().min().unwrap_or(0);
    let mut times_ns = fastest(&scenes, |seen| _ = black_box(locate(black_box(seen), &camera, &config)));
    times_ns.iter_mut().for_each(|t| *t = t.saturating_sub(clock_ns));
    times_ns.sort_unstable();
    let median_ns = times_ns[times_ns.len() / 2];
    let mean_ns = times_ns.iter().sum::<u128>() / times_ns.len() as u128;
    println!("{{\"median_ns\": {median_ns}, \"mean_ns\": {mean_ns}, \"clock_ns\": {clock_ns}}}");
    Ok(())
}

/// Nanoseconds of the fastest call on each scene.
fn fastest(scenes: &[Vec<Correspondence>], call: impl Fn(&[Correspondence])) -> Vec<u128> {
    let mut times_ns = vec![u128::MAX; scenes.len()];
    for _ in 0..ROUNDS {
        for (seen, best) in scenes.iter().zip(&mut times_ns) {
            let start = Instant::now();
            call(seen);
            *best = start.elapsed().as_nanos().min(*best);
        }
    }
    times_ns
}

/// The scenes of a file, four rows each.
fn read(text: &str, camera: &Camera, sigma_px: f64) -> Result<Vec<Vec<Correspondence>>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for line in text.lines().skip(1) {
        let numbers = line.split(',').skip(1).map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        let &[x, y, z, u, v] = numbers.as_slice() else {
            return Err(format!("six columns are needed: {line}").into());
        };
        rows.push(Correspondence::new(camera, Point::new(x, y, z), Vector2::new(u, v), sigma_px)?);
    }
    match rows.len() {
        0 => Err("the file has no rows".into()),
        _ => Ok(rows.chunks_exact(4).map(<[Correspondence]>::to_vec).collect()),
    }
}
