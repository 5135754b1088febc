//! Cost of advice: a map of 10,000 places for a further point, 10,000 views of a target, boards of a rig.

#[path = "../tests/common/mod.rs"]
mod common;

use common::views;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use resight_core::advise::board::{Criterion as What, RigCamera, RigInformation, RigPlan};
use resight_core::advise::expect::{View, expect};
use resight_core::advise::point::{Aim, NextPoint};
use resight_core::advise::volume::{Shape, Volume, poses};
use resight_core::camera::ImageSize;
use resight_core::target::{Chessboard, KnownPoint, Tag, Target};
use resight_core::{Camera, Point, Pose};
use std::hint::black_box;

const CELLS: usize = 10_000;

fn camera() -> Camera {
    Camera { size: Some(ImageSize { width_px: 640, height_px: 480 }), ..views::camera() }
}

fn exact(x: f64, y: f64) -> KnownPoint {
    KnownPoint { position: Point::new(x, y, 0.0), sigma_m: 0.0 }
}

fn bench_map(c: &mut Criterion) {
    let camera = camera();
    let control_points = [exact(-2.0, 10.0), exact(2.5, 11.0), exact(-1.0, 16.0)];
    let cam_from_target = views::looking_at_upright(Point::new(0.0, 0.0, 8.0), Point::new(0.5, 12.0, 0.0));
    let next = NextPoint::new(View {
        camera: &camera,
        cam_from_target,
        points: &control_points,
        sigma_px: 0.5,
        intrinsics_covariance: None,
    })
    .expect("a view");
    let cells: Vec<KnownPoint> =
        (0..CELLS).map(|k| exact(-3.0 + 0.06 * (k % 100) as f64, 9.0 + 0.08 * (k / 100) as f64)).collect();
    let mut group = c.benchmark_group("advise");
    group.throughput(Throughput::Elements(CELLS as u64));
    group.bench_function("map of a further point, 10,000 places", |b| {
        b.iter(|| {
            cells
                .iter()
                .filter_map(|x| next.with(black_box(x)))
                .map(|g| Aim::Place.sigma(&g.covariance))
                .sum::<f64>()
        })
    });
    let tag = Shape::of(&Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m: 0.15 }));
    let volume = Volume { distance_m: [0.5, 2.0], tilt_rad: [0.0, 1.0], direction_rad: [-3.1, 3.1] };
    let views = poses(&tag, &camera, &volume, CELLS);
    group.bench_function("views of a tag, 10,000", |b| {
        b.iter(|| {
            let worth = |pose: &Pose| {
                let view = View {
                    camera: &camera,
                    cam_from_target: *pose,
                    points: &tag.points,
                    sigma_px: 0.4,
                    intrinsics_covariance: None,
                };
                expect(&view).map_or(0.0, |e| e.bend_ratio)
            };
            views.iter().flatten().map(worth).sum::<f64>()
        })
    });
    group.finish();
}

fn bench_board(c: &mut Criterion) {
    let camera = camera();
    let board = Shape::of(&Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.05 }));
    let place = |x: f64| RigCamera {
        camera: &camera,
        cam_from_rig: Pose::new(Pose::identity().rotation, Vector3::new(-x, 0.0, 0.0)),
        intrinsics_covariance: None,
    };
    let cameras: Vec<RigCamera> = [0.0, 0.3, 0.6, 0.9].map(place).into();
    let plan = RigPlan { cameras: &cameras, reference: 0, board: &board, sigma_px: 0.3 };
    let candidates = plan.candidates([1.0, 3.0], 2000);
    let nothing = RigInformation::nothing(&plan);
    let mut group = c.benchmark_group("advise");
    group.throughput(Throughput::Elements(candidates.len() as u64));
    group.bench_function("next board of four cameras, 54 points", |b| {
        b.iter(|| plan.next(&nothing, black_box(&candidates), What::Worst, 1).map(|s| s.len()))
    });
    group.finish();
}

criterion_group!(benches, bench_map, bench_board);
criterion_main!(benches);
