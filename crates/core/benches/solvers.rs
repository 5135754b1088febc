//! Cost of the four-point path on the bars' own problems (line-plus-one, 2–6 m, 0.3 px), each figure a mean over 1,000
//! problems so that branches are as unpredictable as in use. `cargo bench -p resight-core --bench solvers`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, Method, locate};
use resight_core::solve::{configuration::classify, line_plus_one::line_plus_one, wang2004::wang2004};
use resight_core::{Bearing, Camera, CameraMatrix, Correspondence, Lens, Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;
const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// True poses and what is seen from them.
fn problems<const N: usize>(points: &[[f64; 3]; N]) -> Vec<(Pose, [Correspondence; N])> {
    let (camera, mut rng) = (camera(), Rng::new(6));
    let mut found = Vec::with_capacity(PROBLEMS);
    while found.len() < PROBLEMS {
        let z = rng.uniform(2.0, 6.0);
        let centre_in_cam = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let rotation = rng.rotation();
        let cam_from_target = Pose::new(rotation, centre_in_cam - rotation * Vector3::new(0.75, 0.25, 0.0));
        let seen: Option<Vec<_>> = points
            .iter()
            .map(|x| {
                let pixel = camera.project(&(cam_from_target * Point::from(*x)))?;
                let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * 0.3;
                Correspondence::new(&camera, Point::from(*x), pixel, 0.3).ok()
            })
            .collect();
        if let Some(seen) = seen.and_then(|s| <[Correspondence; N]>::try_from(s).ok()) {
            found.push((cam_from_target, seen));
        }
    }
    found
}

fn rays(seen: &[Correspondence; 4]) -> ([Bearing; 4], [Point; 4]) {
    (seen.map(|c| c.bearing), seen.map(|c| c.x_in_target))
}

fn four_points(c: &mut Criterion) {
    let (camera, problems) = (camera(), problems(&POINTS));
    let rays: Vec<_> = problems.iter().map(|(_, seen)| rays(seen)).collect();
    let mut group = c.benchmark_group("four points");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    group.bench_function("line_plus_one closed form", |b| {
        b.iter(|| rays.iter().map(|(b, x)| black_box(line_plus_one(b, x)).len()).sum::<usize>())
    });
    group.bench_function("wang2004", |b| {
        b.iter(|| rays.iter().map(|(b, x)| black_box(wang2004(b, x)).map_or(0, |s| s.len())).sum::<usize>())
    });
    group.bench_function("classify", |b| {
        b.iter(|| problems.iter().filter(|(_, seen)| black_box(classify(seen)).is_ok()).count())
    });
    group.bench_function("refine from the truth, with covariance", |b| {
        b.iter(|| {
            problems.iter().filter(|(pose, seen)| black_box(refine(pose, seen, &camera)).is_ok()).count()
        })
    });
    for (name, method) in
        [("locate: auto, everything", Method::Auto), ("locate: wang2004, with covariance", Method::Wang2004)]
    {
        let config = Config { method, ..Config::default() };
        group.bench_function(name, |b| {
            b.iter(|| {
                problems.iter().filter(|(_, seen)| black_box(locate(seen, &camera, &config)).is_ok()).count()
            })
        });
    }
    group.finish();
}

/// Three points, a square and ten points in space, each to the whole answer.
fn other_layouts(c: &mut Criterion) {
    whole_answer(c, "three points", &[[0.0, 0.0, 0.0], [2.0, 0.0, 0.3], [0.0, 1.0, 0.0]]);
    whole_answer(c, "square", &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let mut rng = Rng::new(10);
    whole_answer(c, "ten points", &[(); 10].map(|()| [0.0, 0.5, -0.5].map(|x| x + rng.uniform(0.0, 1.0))));
}

fn whole_answer<const N: usize>(c: &mut Criterion, name: &str, points: &[[f64; 3]; N]) {
    let (camera, problems, config) = (camera(), problems(points), Config::default());
    let mut group = c.benchmark_group(name);
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    group.bench_function("locate: auto, everything", |b| {
        b.iter(|| {
            problems.iter().filter(|(_, seen)| black_box(locate(seen, &camera, &config)).is_ok()).count()
        })
    });
    group.finish();
}

criterion_group! { name = benches; config = Criterion::default().sample_size(40); targets = four_points, other_layouts }
criterion_main!(benches);
