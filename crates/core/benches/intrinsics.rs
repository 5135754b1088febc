//! `solve_intrinsics` from nothing, evidence for the lens model and covariance included: 100 views of a board of 54 corners.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Vector2, Vector3};
use resight_core::camera::{BrownConrady, ImageSize};
use resight_core::multiview::intrinsics::{IntrinsicsConfig, Models, solve_intrinsics};
use resight_core::{Camera, CameraMatrix, Correspondence, Pixel, Point, Pose, Vector6};
use std::f64::consts::TAU;
use std::hint::black_box;

const SIZE: ImageSize = ImageSize { width_px: 640, height_px: 480 };
const SIGMA_PX: f64 = 0.2;

/// A view of the board, tilted by up to 50°, at least nine tenths of it in the image.
fn view(rng: &mut Rng, camera: &Camera) -> Vec<Correspondence> {
    let points: Vec<Point> = (0..54)
        .map(|i| Point::new(0.03 * f64::from(i % 9) - 0.12, 0.03 * f64::from(i / 9) - 0.075, 0.0))
        .collect();
    loop {
        let (tilt, about) = (rng.uniform(0.1, 0.85), rng.uniform(0.0, TAU));
        let w = Vector3::new(about.cos(), about.sin(), 0.0) * tilt;
        let rotation = Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
        let to = Pixel::new(rng.uniform(100.0, 540.0), rng.uniform(80.0, 400.0));
        let towards = camera.bearing(&to).expect("in the field").into_inner();
        let cam_from_target = Pose::new(rotation, towards * rng.uniform(0.3, 0.9));
        let seen = |x: &Point| {
            let pixel = camera.project(&(cam_from_target * *x)).filter(|pixel| camera.contains(pixel))?;
            let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            let bearing = Vector3::z_axis();
            Some(Correspondence {
                x_in_target: *x,
                pixel,
                bearing,
                sigma_px: SIGMA_PX,
                covariance_px2: None,
                sigma_m: 0.0,
            })
        };
        let seen: Vec<Correspondence> = points.iter().filter_map(seen).collect();
        if 49 <= seen.len() {
            return seen;
        }
    }
}

fn intrinsics(c: &mut Criterion) {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 798.0, cx_px: 325.0, cy_px: 233.0 };
    let lens = BrownConrady::new(matrix, &[-0.3, 0.15, 5e-4, 4e-4, -0.05]).expect("a lens");
    let camera = Camera { lens: lens.into(), size: Some(SIZE) };
    let mut rng = Rng::new(12);
    let views: Vec<Vec<Correspondence>> = (0..100).map(|_| view(&mut rng, &camera)).collect();
    let mut group = c.benchmark_group("solve_intrinsics, 100 views of 54 corners");
    group.sample_size(10);
    for (name, models) in [("brown_conrady", Models::Named("brown_conrady")), ("auto", Models::ByEvidence)] {
        let config = IntrinsicsConfig { models, ..IntrinsicsConfig::default() };
        group.bench_function(name, |b| b.iter(|| solve_intrinsics(black_box(&views), SIZE, &config)));
    }
    group.finish();
}

criterion_group!(benches, intrinsics);
criterion_main!(benches);
