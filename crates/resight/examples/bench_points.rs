//! Time of `locate_points` on four points, three of them on a line, and of `batch::locate_each` on a thousand such views whose answers are
//! kept: what the Python door is compared with. Prints nanoseconds a call, and a view.

use resight::core::batch::{Given, Views, locate_each};
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
    println!("{least_ns:.0} {:.0}", many_ns(&camera, &seen)?);
    Ok(())
}

/// A view of a thousand, of which each pixel is moved by up to half of one.
fn many_ns(camera: &Camera, seen: &[([f64; 3], [f64; 2]); 4]) -> Result<f64, resight::core::Error> {
    let points = seen.map(|(x, _)| Point::from(x));
    let moved = |i: usize, [u, v]: [f64; 2]| {
        let phase = i as f64;
        Pixel::new(u + 0.5 * (3.1 * phase + v).sin(), v + 0.5 * (1.7 * phase + u).cos())
    };
    let pixels: Vec<[Pixel; 4]> = (0..1000).map(|i| seen.map(|(_, pixel)| moved(i, pixel))).collect();
    let views = Views {
        camera: Given::Shared(camera),
        points_in_target: Given::Shared(&points),
        pixels: &pixels,
        sigma_px: Given::Shared(&[0.3; 4]),
    };
    let mut least_ns = f64::INFINITY;
    for _ in 0..150 {
        let start = Instant::now();
        let mut answers = Vec::new();
        locate_each(black_box(&views), &mut answers)?;
        black_box(&answers);
        least_ns = least_ns.min(start.elapsed().as_nanos() as f64 / 1000.0);
    }
    Ok(least_ns)
}
