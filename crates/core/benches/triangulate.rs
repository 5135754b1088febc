//! Cost of a point from several views, and of a whole survey with its intervals.

#[path = "../tests/common/mod.rs"]
mod common;

use common::accident::{Scene, intrinsics, photos};
use common::{Rng, views};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector2;
use resight_core::Point;
use resight_core::multiview::network::{Query, adjust};
use resight_core::multiview::triangulate::{PointView, isotropic, triangulate};
use std::hint::black_box;

const POINTS: usize = 1_000;

fn bench_triangulate(c: &mut Criterion) {
    let mut group = c.benchmark_group("triangulate");
    let camera = views::camera();
    for n in [2, 3, 6] {
        let mut rng = Rng::new(1);
        let scenes: Vec<Vec<PointView>> = (0..POINTS)
            .map(|_| {
                let x = Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), rng.uniform(-0.5, 0.5));
                let view = |i: usize| {
                    let angle = 0.4 * i as f64;
                    let centre = Point::new(5.0 * angle.sin(), 0.3, -5.0 * angle.cos());
                    let cam_from_world = views::looking_at(centre, Point::zeros());
                    let noise = Vector2::new(rng.normal(), rng.normal()) * 0.5;
                    PointView {
                        camera: &camera,
                        cam_from_world,
                        covariance: None,
                        intrinsics_covariance: None,
                        pixel: views::pixel_of(&(cam_from_world * x)) + noise,
                        covariance_px2: isotropic(0.5),
                    }
                };
                (0..n).map(view).collect()
            })
            .collect();
        group.throughput(Throughput::Elements(POINTS as u64));
        group.bench_function(format!("{n} views"), |b| {
            b.iter(|| scenes.iter().filter(|s| black_box(triangulate(s)).is_ok()).count())
        });
    }
}

fn bench_survey(c: &mut Criterion) {
    let mut scene = Scene::new(photos());
    scene.intrinsics = Some(intrinsics([6.0, 6.0, 4.0, 4.0]));
    scene.image_point_all(&[0, 1, 2, 3, 4, 5, 6, 7, 8], 1.0);
    [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)].iter().for_each(|(a, b)| scene.distance(*a, *b, 0.01));
    scene.on_plane(&[0, 1, 2, 3, 4, 5, 6], 0.01);
    let drawn = scene.drawn(&mut Rng::new(2));
    let cameras = scene.cameras();
    let network = scene.network(&cameras, &drawn.constraints);
    c.bench_function("survey: 2 photographs, 9 points", |b| b.iter(|| black_box(adjust(&network)).is_ok()));
    if let Ok(adjusted) = adjust(&network) {
        let query = Query::Distance { a: 6, b: 7 };
        c.bench_function("survey: one interval", |b| b.iter(|| black_box(adjusted.measure(&query)).is_ok()));
    }
}

criterion_group!(benches, bench_triangulate, bench_survey);
criterion_main!(benches);
