//! Any number of points: the answer is as good as the Cramér–Rao bound allows, and says how good it is.
//!
//! Random points of a target 1 m wide, 2–5 m away, any attitude, f = 800 px, 0.5 and 1 px. The starts differ: the planar and the
//! n-point closed form inside `locate`, P3P on three of the points for `method p3p`. Left out: lenses with distortion
//! (`camera_models`), uncertain intrinsics (`statistics`), line-plus-one (`line_plus_one`).

use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, Method, locate};
use resight_core::{Correspondence, Matrix6, Point, Pose};

/// Which points.
#[derive(Debug, Clone, Copy)]
enum Layout {
    /// In a cube, new ones for each problem.
    Space(usize),
    /// In a square, new ones for each problem.
    Plane(usize),
    /// The corners of a square.
    Square,
}

impl Layout {
    fn points(self, rng: &mut Rng) -> Vec<Point> {
        let mut any = |depth: f64| {
            Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), depth * rng.uniform(-0.5, 0.5))
        };
        match self {
            Layout::Space(n) => (0..n).map(|_| any(1.0)).collect(),
            Layout::Plane(n) => (0..n).map(|_| any(0.0)).collect(),
            Layout::Square => {
                let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
                corners.iter().map(|[x, y]| Point::new(*x, *y, 0.0)).collect()
            }
        }
    }
}

/// Noise of the pixels and of the points' places.
#[derive(Debug, Clone, Copy)]
struct Noise {
    sigma_px: f64,
    sigma_m: f64,
}

fn random_pose(rng: &mut Rng) -> Pose {
    let z = rng.uniform(2.0, 5.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.2, 0.2) * z, rng.uniform(-0.15, 0.15) * z, z))
}

/// What is seen with `factor` times the stated noise: 1 an image, 0 the exact projection of the exact points.
fn observe(
    rng: &mut Rng,
    truth: &Pose,
    points: &[Point],
    noise: Noise,
    factor: f64,
) -> Option<Vec<Correspondence>> {
    let camera = views::camera();
    let see = |x: &Point| {
        let mut any = |sigma: f64| rng.normal() * sigma * factor;
        let place = x + Vector3::new(any(noise.sigma_m), any(noise.sigma_m), any(noise.sigma_m));
        let pixel =
            camera.project(&(truth * &place))? + Vector2::new(any(noise.sigma_px), any(noise.sigma_px));
        let c = Correspondence::new(&camera, *x, pixel, noise.sigma_px).ok()?;
        Some(Correspondence { sigma_m: noise.sigma_m, ..c })
    };
    points.iter().map(see).collect()
}

/// What a suite of problems came to.
struct Measured {
    unique: usize,
    refused: usize,
    flips: usize,
    /// Variance over the bound.
    rotation: f64,
    place: f64,
    nees: f64,
    coverage: f64,
}

fn measure(layout: Layout, method: Method, noise: Noise, n: usize, seed: u64) -> Measured {
    let mut rng = Rng::new(seed);
    let mut sums =
        Measured { unique: 0, refused: 0, flips: 0, rotation: 0.0, place: 0.0, nees: 0.0, coverage: 0.0 };
    for _ in 0..n {
        let (truth, points) = (random_pose(&mut rng), layout.points(&mut rng));
        let Some(seen) = observe(&mut rng, &truth, &points, noise, 1.0) else { continue };
        // Points that nearly lie on a line, or a plane seen edge on: refused or unbounded, nothing to compare with.
        let Some(bound) = bound(&mut rng, &truth, &points, noise) else { continue };
        if 0.05 < bound.fixed_view::<3, 3>(0, 0).trace().sqrt() {
            continue;
        }
        let Ok(e) = locate(&seen, &views::camera(), &Config { method, ..Config::default() }) else {
            sums.refused += 1;
            continue;
        };
        if let Ambiguity::Ambiguous { .. } = e.ambiguity {
            continue;
        }
        let error = (e.cam_from_target * truth.inverse()).log();
        sums.unique += 1;
        if 0.3 < error.fixed_rows::<3>(0).norm() {
            sums.flips += 1;
            continue;
        }
        sums.rotation += error.fixed_rows::<3>(0).norm_squared() / bound.fixed_view::<3, 3>(0, 0).trace();
        sums.place += error.fixed_rows::<3>(3).norm_squared() / bound.fixed_view::<3, 3>(3, 3).trace();
        let squared = error.dot(&(e.covariance.try_inverse().expect("positive definite") * error));
        sums.nees += squared;
        sums.coverage += f64::from(squared < 12.592); // χ²₆ at 95 %
    }
    let per = 1.0 / (sums.unique - sums.flips) as f64;
    let (rotation, place) = (sums.rotation * per, sums.place * per);
    Measured { rotation, place, nees: sums.nees * per, coverage: sums.coverage * per, ..sums }
}

/// The covariance at the truth from exact pixels.
fn bound(rng: &mut Rng, truth: &Pose, points: &[Point], noise: Noise) -> Option<Matrix6> {
    let exact = observe(rng, truth, points, noise, 0.0)?;
    Some(refine(truth, &exact, &views::camera()).ok()?.covariance)
}

/// A mean over n problems of a ratio of squares of three numbers, one of which may dominate, is known to √(2/n): efficiency
/// 0.99 within three of that.
fn is_efficient_and_honest(layout: Layout, method: Method, noise: Noise, n: usize, seed: u64) {
    let m = measure(layout, method, noise, n, seed);
    let chance = (2.0 / m.unique as f64).sqrt();
    println!(
        "{layout:?}, {method:?}, {noise:?}: {} unique of {n}, {} flips, variance/CRB {:.3} {:.3} (± {chance:.3}), NEES {:.3}, 95 % covers {:.4}",
        m.unique, m.flips, m.rotation, m.place, m.nees, m.coverage
    );
    assert!(
        n / 2 < m.unique && m.refused == 0 && m.flips <= n / 1000,
        "{} {} {}",
        m.unique,
        m.refused,
        m.flips
    );
    let limit = 1.0 / 0.99 + 3.0 * chance;
    assert!(m.rotation < limit && m.place < limit, "{} {}", m.rotation, m.place);
    // √12 is the standard deviation of χ²₆.
    let nees_chance = 3.0 * (12.0 / m.unique as f64).sqrt();
    assert!((m.nees - 6.0).abs() < 0.15 + nees_chance, "NEES {}", m.nees);
    assert!((m.coverage - 0.95).abs() < 0.005 + 3.0 * (0.05 / m.unique as f64).sqrt(), "{}", m.coverage);
}

const HALF_PX: Noise = Noise { sigma_px: 0.5, sigma_m: 0.0 };
const ONE_PX: Noise = Noise { sigma_px: 1.0, sigma_m: 0.0 };

#[test]
fn four_points_reach_the_bound() {
    for noise in [HALF_PX, ONE_PX] {
        is_efficient_and_honest(Layout::Space(4), Method::Auto, noise, 20_000, 101);
        is_efficient_and_honest(Layout::Square, Method::Auto, noise, 20_000, 102);
        is_efficient_and_honest(Layout::Square, Method::P3p, noise, 20_000, 103);
    }
}

#[test]
fn ten_points_reach_the_bound() {
    for noise in [HALF_PX, ONE_PX] {
        is_efficient_and_honest(Layout::Space(10), Method::Auto, noise, 10_000, 111);
        is_efficient_and_honest(Layout::Plane(10), Method::Auto, noise, 10_000, 112);
        is_efficient_and_honest(Layout::Space(10), Method::P3p, noise, 10_000, 113);
    }
}

#[test]
fn a_hundred_points_reach_the_bound() {
    for noise in [HALF_PX, ONE_PX] {
        is_efficient_and_honest(Layout::Space(100), Method::Auto, noise, 5_000, 121);
        is_efficient_and_honest(Layout::Plane(100), Method::Auto, noise, 5_000, 122);
        is_efficient_and_honest(Layout::Space(100), Method::P3p, noise, 5_000, 123);
    }
}

/// Points surveyed to 5 mm, pixels to 0.2 px: at 2–5 m the points' own error is 4 to 10 times that of the pixels. The bound is
/// that of the weights of docs/math/refine.md eq. (8).
#[test]
fn uncertain_points_are_honest_where_they_dominate() {
    let noise = Noise { sigma_px: 0.2, sigma_m: 5e-3 };
    is_efficient_and_honest(Layout::Space(10), Method::Auto, noise, 10_000, 131);
    is_efficient_and_honest(Layout::Plane(10), Method::Auto, noise, 10_000, 132);
}
