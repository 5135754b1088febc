//! The stated covariance is the true one: normalised error squared (NEES) and coverage over random problems, for points in space and
//! in a plane, with noise of the pixels, of the surveyed points and of the intrinsics.
//!
//! Eight points of 1 m, 2–6 m away, f = 800 px, 0.5 px. Line-plus-one has its own bars: `line_plus_one.rs`.

use crate::common::{Rng, views};
use nalgebra::{Vector2, Vector3};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::{Config, Method, locate};
use resight_core::{Camera, Correspondence, Point, Pose};

const N: usize = 6000;
const SIGMA_PX: f64 = 0.5;

/// What is uncertain beside the pixels.
#[derive(Debug, Clone, Copy)]
struct Noise {
    sigma_m: f64,
    /// Of f (both alike) and of the principal point, px.
    sigma_f_px: f64,
    sigma_c_px: f64,
}

/// Eight random points of a box 1 m wide and 2 · `thickness` m deep.
fn points(rng: &mut Rng, thickness: f64) -> Vec<Point> {
    let any = |rng: &mut Rng| {
        Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-thickness, thickness))
    };
    (0..8).map(|_| any(rng)).collect()
}

fn random_pose(rng: &mut Rng) -> Pose {
    let z = rng.uniform(2.0, 6.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.3, 0.3) * z, rng.uniform(-0.2, 0.2) * z, z))
}

/// fx and fy share one error here, so the covariance has entries off its diagonal.
fn intrinsics_covariance(noise: Noise) -> [f64; 16] {
    let (f, c) = (noise.sigma_f_px.powi(2), noise.sigma_c_px.powi(2));
    [f, f, 0.0, 0.0, f, f, 0.0, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, c]
}

/// The camera that took the image, drawn around the one the user knows.
fn true_camera(rng: &mut Rng, noise: Noise) -> Camera {
    let known = views::camera();
    let (df, du, dv) = (rng.normal() * noise.sigma_f_px, rng.normal(), rng.normal());
    let by = [df, df, du * noise.sigma_c_px, dv * noise.sigma_c_px];
    let values: Vec<f64> = known.parameters().iter().zip(by).map(|((_, value), by)| value + by).collect();
    known.with_parameters(&values).expect("a camera")
}

/// One view by the true camera of the true points, labelled with the known points and sigmas; solved by the known camera.
fn observe(rng: &mut Rng, pose: &Pose, known: &[Point], noise: Noise) -> Option<Vec<Correspondence>> {
    let (took, solves) = (true_camera(rng, noise), views::camera());
    let observed = |x: &Point| {
        let true_x = x + Vector3::new(rng.normal(), rng.normal(), rng.normal()) * noise.sigma_m;
        let pixel = took.project(&(pose * &true_x))? + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
        let c = Correspondence::new(&solves, *x, pixel, SIGMA_PX).ok()?;
        Some(Correspondence { sigma_m: noise.sigma_m, ..c })
    };
    known.iter().map(observed).collect()
}

fn covariance_is_true(name: &str, thickness: f64, method: Method, noise: Noise, seed: u64) {
    let mut rng = Rng::new(seed);
    let (mut n, mut ambiguous, mut flips, mut nees, mut covered) = (0, 0, 0, 0.0, 0);
    let intrinsics = intrinsics_covariance(noise);
    let intrinsics_covariance = (0.0 < noise.sigma_f_px).then_some(intrinsics.as_slice());
    let config = Config { intrinsics_covariance, ..Config::default() };
    for _ in 0..N {
        let (pose, known) = (random_pose(&mut rng), points(&mut rng, thickness));
        let Some(seen) = observe(&mut rng, &pose, &known, noise) else { continue };
        let e = locate(&seen, &views::camera(), &config).expect("a pose");
        assert_eq!(e.method, method);
        let error = (e.cam_from_target * pose.inverse()).log();
        if let Ambiguity::Ambiguous { .. } = e.ambiguity {
            ambiguous += 1;
            continue;
        }
        if 0.5 < error.fixed_rows::<3>(0).norm() {
            flips += 1;
            continue;
        }
        let squared = error.dot(&(e.covariance.try_inverse().expect("positive definite") * error));
        nees += squared;
        covered += usize::from(squared < 12.592); // χ²₆ at 95 %
        n += 1;
    }
    let (nees, coverage) = (nees / n as f64, covered as f64 / n as f64);
    println!(
        "{name}, {noise:?}: {n} unique, {ambiguous} ambiguous, {flips} flips, NEES {nees:.3}, 95 % covers {coverage:.4}"
    );
    assert!(flips <= N / 1000, "{name}: {flips} flips");
    assert!((5.7..6.3).contains(&nees), "{name}, {noise:?}: NEES {nees}");
    assert!((0.94..0.96).contains(&coverage), "{name}, {noise:?}: {coverage}");
}

const PIXELS: Noise = Noise { sigma_m: 0.0, sigma_f_px: 0.0, sigma_c_px: 0.0 };
/// 3 mm at 2–6 m is 0.4–1.2 px: as much as the pixels' own.
const POINTS: Noise = Noise { sigma_m: 3e-3, ..PIXELS };
const INTRINSICS: Noise = Noise { sigma_f_px: 4.0, sigma_c_px: 2.0, ..PIXELS };

#[test]
fn covariance_is_true_for_points_in_space() {
    covariance_is_true("general", 0.5, Method::Sqpnp, PIXELS, 21);
}

#[test]
fn covariance_is_true_for_points_in_a_plane() {
    covariance_is_true("planar", 0.0, Method::Planar, PIXELS, 22);
}

#[test]
fn covariance_is_true_for_uncertain_points() {
    covariance_is_true("general", 0.5, Method::Sqpnp, POINTS, 23);
    covariance_is_true("planar", 0.0, Method::Planar, POINTS, 24);
}

#[test]
fn covariance_is_true_for_uncertain_intrinsics() {
    covariance_is_true("general", 0.5, Method::Sqpnp, INTRINSICS, 25);
    covariance_is_true("planar", 0.0, Method::Planar, INTRINSICS, 26);
}
