//! Cost of the solvers that know something about the rotation, on problems like those of PoseLib's benchmark; each figure is the
//! mean over 1,000 problems, so that branches are as unpredictable as in use.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use common::views;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Unit, Vector3};
use resight_core::line::{ImageLine, LineCorrespondence};
use resight_core::locate::known_rotation::{KnownRotation, position_with_rotation};
use resight_core::locate::lines::locate_lines;
use resight_core::locate::problem::Problem;
use resight_core::solve::line_rotation::line_rotation;
use resight_core::solve::pure_rotation::{DirectionPair, pure_rotation};
use resight_core::solve::upright_p2p::upright_p2p;
use resight_core::{Bearing, Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

/// Rays in a field of 75°, depths 0.1 to 10, any vertical.
fn upright_problem(rng: &mut Rng) -> ([Bearing; 2], [Point; 2], [Bearing; 2]) {
    let cam_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let target_from_cam = cam_from_target.inverse();
    let mut ray =
        || Unit::new_normalize(Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0));
    let rays = [ray(), ray()];
    let points = rays.map(|b| target_from_cam * (b.into_inner() * rng.uniform(0.1, 10.0)));
    let up = Unit::new_normalize(rng.unit_vector());
    let up_in_cam = Unit::new_normalize(cam_from_target.rotation * up.into_inner());
    (rays, points, [up, up_in_cam])
}

fn bench_upright(c: &mut Criterion) {
    let mut rng = Rng::new(1);
    let problems: Vec<_> = (0..PROBLEMS).map(|_| upright_problem(&mut rng)).collect();
    let mut group = c.benchmark_group("upright_p2p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    group.bench_function("any two points", |b| {
        b.iter(|| {
            let poses = |(rays, x, [up, up_in_cam]): &([Bearing; 2], [Point; 2], [Bearing; 2])| {
                black_box(upright_p2p(rays, x, up, up_in_cam)).map_or(0, |poses| poses.len())
            };
            problems.iter().map(poses).sum::<usize>()
        })
    });
}

fn bench_rotation(c: &mut Criterion) {
    let mut rng = Rng::new(2);
    for n in [2, 10, 100] {
        let rotation = rng.rotation();
        let pairs: Vec<_> = (0..n)
            .map(|_| {
                let a = rng.unit_vector();
                let b = rotation * a + rng.unit_vector() * 1e-3;
                DirectionPair {
                    in_first: Unit::new_normalize(a),
                    in_second: Unit::new_normalize(b),
                    sigma_rad: 1e-3,
                }
            })
            .collect();
        c.bench_function(&format!("pure_rotation/{n} directions"), |b| {
            b.iter(|| pure_rotation(black_box(&pairs)))
        });
    }
}

fn bench_known_rotation(c: &mut Criterion) {
    let pose = views::oblique();
    let rotation = KnownRotation { cam_from_target: pose.rotation, covariance: Matrix3::zeros() };
    let seen = views::seen_from(&pose, &views::general(), 0.5);
    let camera = views::camera();
    for n in [2, 8] {
        c.bench_function(&format!("known_rotation/{n} points, with covariance"), |b| {
            b.iter(|| position_with_rotation(black_box(&rotation), &seen[..n], &[], &camera, &[]))
        });
    }
}

/// Three edges of a triangle of the suite's points in space.
fn lines(pose: &Pose) -> [LineCorrespondence; 3] {
    let x = views::general();
    [[0, 2], [1, 3], [5, 7]].map(|[i, j]| {
        let ends_px = [x[i], x[j]].map(|x| views::pixel_of(&(pose * &x)));
        let seen = ImageLine::new(&views::camera(), ends_px, 0.5).expect("a line");
        LineCorrespondence {
            point_in_target: Some(x[i]),
            direction_in_target: Unit::new_normalize(x[j] - x[i]),
            seen,
        }
    })
}

fn bench_lines(c: &mut Criterion) {
    let lines = lines(&views::oblique());
    let (normals, directions) = (lines.map(|l| l.seen.normal()), lines.map(|l| l.direction_in_target));
    c.bench_function("line_rotation/3 lines in space", |b| {
        b.iter(|| line_rotation(black_box(&normals), &directions))
    });
    let camera = views::camera();
    let problem = Problem::new(&[], &camera);
    c.bench_function("locate_lines/3 lines in space, all poses", |b| {
        b.iter(|| locate_lines(black_box(&lines), &problem))
    });
}

criterion_group!(benches, bench_upright, bench_rotation, bench_known_rotation, bench_lines);
criterion_main!(benches);
