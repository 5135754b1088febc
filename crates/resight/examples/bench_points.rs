//! Time of `locate_points` on four points, three of them on a line: what the Python door is compared with. Prints nanoseconds a call.

use resight::core::camera::{ImageSize, Pinhole};
use resight::core::{Camera, CameraMatrix, Correspondence, Pixel, Point};
use resight::locate::{NamedPoint, PointsOptions, locate_points};
use std::hint::black_box;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let size = ImageSize { width_px: 1280, height_px: 960 };
    let camera = Camera { lens: Pinhole { matrix }.into(), size: Some(size) };
    let seen = [
        ([0.0, 0.0, 0.0], [656.17, 504.50]),
        ([0.1, 0.0, 0.0], [725.50, 505.24]),
        ([0.15, 0.0, 0.0], [758.18, 505.59]),
        ([0.0, 0.15, 0.0], [635.41, 618.92]),
    ];
    let options = PointsOptions::default();
    let solve = || -> Result<f64, resight::core::Error> {
        let point = |(k, (x, [u, v])): (usize, &([f64; 3], [f64; 2]))| {
            let seen = Correspondence::new(&camera, Point::from(*x), Pixel::new(*u, *v), 0.3)?;
            Ok(NamedPoint { name: k.to_string(), line: None, seen })
        };
        let points = black_box(&seen).iter().enumerate().map(point).collect::<Result<Vec<_>, _>>()?;
        let answer = locate_points("", &points, &camera, &options);
        Ok(black_box(&answer).estimate.as_ref().map_or(0.0, |e| e.chi2))
    };
    let mut least_ns = f64::INFINITY;
    for _ in 0..50 {
        let start = Instant::now();
        for _ in 0..2000 {
            black_box(solve()?);
        }
        least_ns = least_ns.min(start.elapsed().as_nanos() as f64 / 2000.0);
    }
    println!("{least_ns:.0}");
    Ok(())
}
