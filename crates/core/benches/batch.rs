//! Cost per view of many views at once beside one at a time: line-plus-one on the problems of `benches/solvers.rs` (2–6 m, 0.3 px),
//! and three of their points. `cargo bench -p resight-core --bench batch`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Vector2, Vector3};
use resight_core::batch::{Given, Views, locate_each, locate_each_of_three};
use resight_core::camera::Pinhole;
use resight_core::locate::{Config, locate};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Pixel, Point, Pose};
use std::hint::black_box;

const VIEWS: usize = 1_000;
const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

fn pixels(camera: &Camera) -> Vec<[Pixel; 4]> {
    let mut rng = Rng::new(6);
    let mut views = Vec::with_capacity(VIEWS);
    while views.len() < VIEWS {
        let z = rng.uniform(2.0, 6.0);
        let centre_in_cam = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let rotation = rng.rotation();
        let cam_from_target = Pose::new(rotation, centre_in_cam - rotation * Vector3::new(0.75, 0.25, 0.0));
        let mut noise = || Vector2::new(rng.normal(), rng.normal()) * 0.3;
        let seen = POINTS.map(|x| Some(camera.project(&(cam_from_target * Point::from(x)))? + noise()));
        if let [Some(a), Some(b), Some(c), Some(d)] = seen {
            views.push([a, b, c, d]);
        }
    }
    views
}

fn line_plus_one(c: &mut Criterion) {
    let (camera, points, sigma_px) = (camera(), POINTS.map(Point::from), [0.3; 4]);
    let pixels = pixels(&camera);
    let (points_in_target, sigmas) = (Given::Shared(&points), Given::Shared(&sigma_px));
    let views = Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px: sigmas };
    let mut group = c.benchmark_group("batch: line_plus_one");
    group.throughput(Throughput::Elements(VIEWS as u64));
    group.bench_function("together, everything", |b| {
        let mut answers = Vec::new();
        b.iter(|| locate_each(black_box(&views), &mut answers))
    });
    group.bench_function("one at a time, everything", |b| {
        b.iter(|| pixels.iter().filter(|p| is_solved(&camera, &points, p)).count())
    });
    group.finish();
}

fn three(c: &mut Criterion) {
    let (camera, four, sigma_px) = (camera(), POINTS.map(Point::from), [0.3; 3]);
    let points = [four[0], four[2], four[3]];
    let pixels: Vec<[Pixel; 3]> = pixels(&camera).iter().map(|[a, _, c, d]| [*a, *c, *d]).collect();
    let (points_in_target, sigmas) = (Given::Shared(&points), Given::Shared(&sigma_px));
    let views = Views { camera: Given::Shared(&camera), points_in_target, pixels: &pixels, sigma_px: sigmas };
    let mut group = c.benchmark_group("batch: three");
    group.throughput(Throughput::Elements(VIEWS as u64));
    group.bench_function("together, everything", |b| {
        let mut answers = Vec::new();
        b.iter(|| locate_each_of_three(black_box(&views), &mut answers))
    });
    group.bench_function("one at a time, everything", |b| {
        b.iter(|| pixels.iter().filter(|p| is_solved(&camera, &points, p)).count())
    });
    group.finish();
}

fn is_solved<const N: usize>(camera: &Camera, points: &[Point; N], pixels: &[Pixel; N]) -> bool {
    let one = |k: usize| Correspondence::new(camera, points[k], pixels[k], 0.3).expect("in the field");
    let seen: [Correspondence; N] = std::array::from_fn(one);
    black_box(locate(&seen, camera, &Config::default())).is_ok()
}

criterion_group! { name = benches; config = Criterion::default().sample_size(40); targets = line_plus_one, three }
criterion_main!(benches);
