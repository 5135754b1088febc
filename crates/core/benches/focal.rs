//! Cost of the solvers for an unknown focal length, each figure a mean over 1,000 problems: points scattered over the field of view, or
//! in a plane 1 m wide; exact pixels, and pixels disturbed by 0.5 px. `cargo bench -p resight-core --bench focal`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Rng;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Vector2, Vector3};
use resight_core::solve::p3p::p3p;
use resight_core::solve::p4pf::p4pf;
use resight_core::solve::p5pf::p5pf;
use resight_core::solve::p35pf::p35pf;
use resight_core::{Bearing, Pixel, Point};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

fn problems<const N: usize>(is_flat: bool, sigma_px: f64) -> Vec<([Pixel; N], [Point; N])> {
    let mut rng = Rng::new(9);
    let problem = |_| {
        let (rotation, focal_px) = (rng.rotation(), rng.uniform(300.0, 3000.0));
        let z = rng.uniform(2.0, 5.0);
        let centre = Vector3::new(rng.uniform(-0.4, 0.4) * z, rng.uniform(-0.4, 0.4) * z, z);
        let points = std::array::from_fn(|_| {
            let depth = rng.uniform(1.0, 10.0);
            let scattered =
                Vector3::new(rng.uniform(-0.75, 0.75) * depth, rng.uniform(-0.75, 0.75) * depth, depth);
            if is_flat {
                Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), 0.0)
            } else {
                rotation.tr_mul(&(scattered - centre))
            }
        });
        let pixels = points.map(|x| {
            let x = rotation * x + centre;
            Vector2::new(x.x, x.y) * (focal_px / x.z) + Vector2::new(rng.normal(), rng.normal()) * sigma_px
        });
        (pixels, points)
    };
    (0..PROBLEMS).map(problem).collect()
}

fn unknown_focal_length(c: &mut Criterion) {
    let mut group = c.benchmark_group("unknown focal length");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    // The yardstick: with the focal length known.
    let three: Vec<_> = problems::<3>(false, 0.0)
        .into_iter()
        .map(|(u, x)| (u.map(|u| Bearing::new_normalize(u.push(1000.0))), x))
        .collect();
    group.bench_function("p3p at f = 1000 px, scattered", |b| {
        b.iter(|| three.iter().map(|(u, x)| black_box(p3p(u, x)).len()).sum::<usize>())
    });
    for (layout, is_flat) in [("scattered", false), ("in a plane", true)] {
        for (noise, sigma_px) in [("exact", 0.0), ("0.5 px", 0.5)] {
            let four = problems(is_flat, sigma_px);
            let five = problems(is_flat, sigma_px);
            group.bench_function(format!("p4pf, {layout}, {noise}"), |b| {
                b.iter(|| four.iter().map(|(u, x)| black_box(p4pf(u, x)).len()).sum::<usize>())
            });
            let three = |u: &[Pixel; 4]| [u[0], u[1], u[2]];
            group.bench_function(format!("p35pf, {layout}, {noise}"), |b| {
                b.iter(|| {
                    four.iter().map(|(u, x)| black_box(p35pf(&three(u), u[3].x, x)).len()).sum::<usize>()
                })
            });
            group.bench_function(format!("p5pf, {layout}, {noise}"), |b| {
                b.iter(|| five.iter().map(|(u, x)| black_box(p5pf(u, x)).len()).sum::<usize>())
            });
        }
    }
    group.finish();
}

criterion_group!(benches, unknown_focal_length);
criterion_main!(benches);
