//! Cost of the solvers of a rig; each figure is the mean over 1,000 problems, so that branches are as unpredictable as in use.

#[path = "../tests/common/mod.rs"]
mod common;

use common::rigs::{FAMILIES, views_of};
use common::{Rng, views};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Unit, Vector3};
use resight_core::multiview::rig_pose::locate_rig;
use resight_core::solve::gp3p::{Ray, gp3p};
use resight_core::solve::upright_gp2p::upright_gp2p;
use resight_core::{Point, Pose};
use std::hint::black_box;

const PROBLEMS: usize = 1_000;

/// Rays of three cameras, the points on them, and where the rig is.
struct Scene {
    rays: [Ray; 3],
    places: [Point; 3],
    rig_from_target: Pose,
}

impl Scene {
    fn new(origins: [Point; 3], places: [Point; 3], rig_from_target: Pose) -> Self {
        let ray = |i: usize| Ray {
            origin_in_rig: origins[i],
            bearing_in_rig: Unit::new_normalize(rig_from_target * places[i] - origins[i]),
        };
        Scene { rays: [0, 1, 2].map(ray), places, rig_from_target }
    }
}

fn in_box(rng: &mut Rng, half: f64) -> Point {
    Point::new(rng.uniform(-half, half), rng.uniform(-half, half), rng.uniform(-half, half))
}

/// As PoseLib's generator: rays in a field of 75°, depths 0.1 to 10, origins in a box of 2 m.
fn random(rng: &mut Rng) -> Scene {
    let rig_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let target_from_rig = rig_from_target.inverse();
    let edge = 37.5f64.to_radians().tan();
    let origins = [(); 3].map(|()| in_box(rng, 1.0));
    let places = origins.map(|origin| {
        let ray = Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0).normalize();
        target_from_rig * (origin + ray * rng.uniform(0.1, 10.0))
    });
    Scene::new(origins, places, rig_from_target)
}

/// A 1 m target 5 to 20 m away from a rig of 1 m.
fn far(rng: &mut Rng) -> Scene {
    let rig_from_target = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(5.0, 20.0));
    let (origins, places) = ([(); 3].map(|()| in_box(rng, 0.5)), [(); 3].map(|()| in_box(rng, 0.5)));
    Scene::new(origins, places, rig_from_target)
}

type Family = fn(&mut Rng) -> Scene;
const SCENES: [(&str, Family); 2] = [("random", random), ("1 m target at 5-20 m", far)];

fn bench_gp3p(c: &mut Criterion) {
    let mut group = c.benchmark_group("gp3p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    for (name, scene) in SCENES {
        let mut rng = Rng::new(1);
        let scenes: Vec<_> = (0..PROBLEMS).map(|_| scene(&mut rng)).collect();
        let solve = |s: &Scene| black_box(gp3p(&s.rays, &s.places)).len();
        group.bench_function(name, |b| b.iter(|| scenes.iter().map(solve).sum::<usize>()));
    }
}

/// Two rays, their points, and the vertical in both frames.
type Upright = ([Ray; 2], [Point; 2], [Unit<Vector3<f64>>; 2]);

fn bench_upright_gp2p(c: &mut Criterion) {
    let mut group = c.benchmark_group("upright_gp2p");
    group.throughput(Throughput::Elements(PROBLEMS as u64));
    for (name, scene) in SCENES {
        let mut rng = Rng::new(2);
        let scenes: Vec<_> = (0..PROBLEMS)
            .map(|_| {
                let (s, up) = (scene(&mut rng), rng.unit_vector());
                let ups = [s.rig_from_target.rotation * up, up].map(Unit::new_normalize);
                ([s.rays[0], s.rays[1]], [s.places[0], s.places[1]], ups)
            })
            .collect();
        let solve = |(rays, places, [in_rig, in_target]): &Upright| {
            black_box(upright_gp2p(rays, places, in_target, in_rig)).len()
        };
        group.bench_function(name, |b| b.iter(|| scenes.iter().map(solve).sum::<usize>()));
    }
}

fn bench_locate_rig(c: &mut Criterion) {
    let mut group = c.benchmark_group("locate_rig");
    let camera = views::camera();
    for (name, family) in FAMILIES {
        for (n_cameras, n_points) in [(3, 3), (2, 4), (4, 12), (4, 100)] {
            let mut rng = Rng::new(3);
            let scenes: Vec<_> = (0..PROBLEMS / 10)
                .map(|_| family(&mut rng, n_cameras, n_points).disturbed(&mut rng))
                .collect();
            group.throughput(Throughput::Elements(scenes.len() as u64));
            group.bench_function(format!("{name}, {n_cameras} cameras, {n_points} points"), |b| {
                b.iter(|| {
                    let solve =
                        |rig| usize::from(black_box(locate_rig(&views_of(rig, &camera, None))).is_ok());
                    scenes.iter().map(|rig| solve(rig)).sum::<usize>()
                })
            });
        }
    }
}

criterion_group!(benches, bench_gp3p, bench_upright_gp2p, bench_locate_rig);
criterion_main!(benches);
