//! Cost by number of points, general points in space, 0.5 px: refinement from a start 2° and 2 % off with its covariance, and
//! the whole answer. `cargo bench -p resight-core --bench n_points`; believe the minimum of several runs on a loaded machine.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Rotation3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, locate};
use resight_core::solve::{configuration::classify, sqpnp::sqpnp};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};
use std::hint::black_box;

/// So few that their points stay in the cache: what is measured is arithmetic.
const PROBLEMS: usize = 5;
const SIGMA_PX: f64 = 0.5;

/// A start, and what is seen.
type View = (Pose, Vec<Correspondence>);

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// A start 2° and 2 % off, and what is seen of `n` points of a 2 m cube 4–8 m away.
fn problems(n: usize) -> Vec<View> {
    let (camera, mut rng) = (camera(), Rng::new(8));
    let mut problem = || {
        let z = rng.uniform(4.0, 8.0);
        let centre = Vector3::new(rng.uniform(-0.2, 0.2) * z, rng.uniform(-0.15, 0.15) * z, z);
        let cam_from_target = Pose::new(rng.rotation(), centre);
        let mut any = || rng.uniform(-1.0, 1.0);
        let points: Vec<Point> = (0..n).map(|_| Point::new(any(), any(), any())).collect();
        let mut observe = |x: &Point| {
            let noise = Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            let pixel = camera.project(&(cam_from_target * *x)).expect("in front") + noise;
            Correspondence::new(&camera, *x, pixel, SIGMA_PX).expect("in the field")
        };
        let seen = points.iter().map(&mut observe).collect();
        let turn = Rotation3::new(rng.unit_vector() * 2f64.to_radians()).into_inner();
        let start = Pose::new(turn * cam_from_target.rotation, centre + rng.unit_vector() * (0.02 * z));
        (start, seen)
    };
    (0..PROBLEMS).map(|_| problem()).collect()
}

fn n_points(c: &mut Criterion) {
    let camera = camera();
    for n in [10, 100, 1000] {
        let problems = problems(n);
        let mut group = c.benchmark_group(format!("{n} points"));
        group.throughput(Throughput::Elements(PROBLEMS as u64));
        let mut each = |name, solve: &dyn Fn(&View) -> bool| {
            group
                .bench_function(name, |b| b.iter(|| problems.iter().filter(|p| black_box(solve(p))).count()));
        };
        each("refine", &|(start, seen)| refine(start, seen, &camera).is_ok());
        each("classify", &|(_, seen)| classify(seen).is_ok());
        each("sqpnp", &|(_, seen)| !sqpnp(seen).is_empty());
        each("locate", &|(_, seen)| locate(seen, &camera, &Config::default()).is_ok());
        group.finish();
    }
}

/// A flat board of 9 × 6 or 24 × 24 corners, with errors that all of them share looked for and not.
fn boards(c: &mut Criterion) {
    let camera = camera();
    for (columns, rows) in [(9, 6), (24, 24)] {
        let mut rng = Rng::new(9);
        let at = |i: usize, n: usize| (i as f64 / (n - 1) as f64 - 0.5) * 2.0;
        let points =
            (0..columns * rows).map(|i| Point::new(at(i % columns, columns), at(i / columns, rows), 0.0));
        let truth = Pose::new(
            Rotation3::new(Vector3::new(0.4, -0.3, 0.1)).into_inner(),
            Vector3::new(0.1, -0.1, 5.0),
        );
        for (name, shared_px) in [("independent", 0.0), ("shared", 2.0)] {
            let seen: Vec<Correspondence> = points
                .clone()
                .map(|x| {
                    let noise = Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
                    let bent = Vector2::new(x.x * x.x, x.x * x.y) * shared_px;
                    let pixel = camera.project(&(truth * x)).expect("in front") + noise + bent;
                    Correspondence::new(&camera, x, pixel, SIGMA_PX).expect("in the field")
                })
                .collect();
            let mut group = c.benchmark_group(format!("board {columns} x {rows}, {name} errors"));
            for shared_errors in [true, false] {
                let config = Config { shared_errors, ..Config::default() };
                group.bench_function(format!("shared_errors {shared_errors}"), |b| {
                    b.iter(|| black_box(locate(black_box(&seen), &camera, &config)).is_ok())
                });
            }
            group.finish();
        }
    }
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = n_points, boards }
criterion_main!(benches);
