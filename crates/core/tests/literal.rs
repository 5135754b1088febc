//! What noise does to the paper of Wang (2004)'s printed procedure, beside the maximum-likelihood pose from the same four pixels.
//! The table of docs/math/wang2004.md is what this prints.

use crate::common::Rng;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::{Config, Method, locate};
use resight_core::solve::wang2004::wang2004;
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

const N: usize = 5000;
const POINTS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// f = 1000 px, the target 4–15 m away, attitude uniform on SO(3).
fn problem(rng: &mut Rng, camera: &Camera, noise_px: f64) -> (Pose, Vec<Correspondence>) {
    loop {
        let z = rng.uniform(4.0, 15.0);
        let centre_in_cam = Vector3::new(rng.uniform(-0.5, 0.5) * z, rng.uniform(-0.4, 0.4) * z, z);
        let rotation = rng.rotation();
        let truth = Pose::new(rotation, centre_in_cam - rotation * Vector3::new(0.75, 0.25, 0.0));
        let seen: Option<Vec<_>> = POINTS
            .iter()
            .map(|x| {
                let x = Point::from(*x);
                let noise = Vector2::new(rng.normal(), rng.normal()) * noise_px;
                let pixel = camera.project(&(truth * x))? + noise;
                Correspondence::new(camera, x, pixel, noise_px.max(1e-6)).ok()
            })
            .collect();
        if let Some(seen) = seen {
            return (truth, seen);
        }
    }
}

fn quantile(errors: &mut [f64], q: f64) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[(q * errors.len() as f64) as usize]
}

#[test]
fn noise_costs_the_printed_procedure_a_factor_of_ten() {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    for noise_px in [0.0, 0.01, 0.1, 0.5, 1.0] {
        let mut rng = Rng::new(2004);
        let (mut literal, mut likely, mut refused) = (Vec::new(), Vec::new(), 0);
        for _ in 0..N {
            let (truth, seen) = problem(&mut rng, &camera, noise_px);
            let error_deg = |method| {
                let e = locate(&seen, &camera, &Config { method, ..Config::default() }).ok()?;
                Some(e.cam_from_target.angle_to_rad(&truth).to_degrees())
            };
            // Known to a radian only: refused by name.
            likely.extend(error_deg(Method::Auto));
            match error_deg(Method::Wang2004) {
                Some(error) => literal.push(error),
                None => refused += 1,
            }
        }
        let [a, b] = [0.5, 0.9].map(|q| quantile(&mut literal, q));
        assert!(N - likely.len() <= N / 500, "{noise_px} px: {} of {N} refused", N - likely.len());
        let [c, d] = [0.5, 0.9].map(|q| quantile(&mut likely, q));
        println!(
            "{noise_px} px: printed procedure median {a:.2e}°, 90 % {b:.2e}°, no pose in {refused} of {N}; maximum likelihood {c:.2e}°, {d:.2e}°"
        );
        if noise_px == 0.0 {
            assert!(
                a < 1e-9 && refused < N / 1000,
                "exact data give the exact pose: {a}°, {refused} refused"
            );
        } else {
            assert!(10.0 * c < a, "{noise_px} px: {a}° against {c}°");
        }
    }
}

/// One pose in two Euler triples, and its mirror image behind the camera in two: (3) and (11) are the same for all four, with
/// noise too, and cannot select among them; the sign of Z does.
#[test]
fn the_four_solutions_are_one_pose_and_its_mirror() {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let mut rng = Rng::new(2005);
    let mut checked = 0;
    for _ in 0..1000 {
        let (_, seen) = problem(&mut rng, &camera, 0.5);
        let bearings = [0, 1, 2, 3].map(|i| seen[i].bearing);
        let Ok(solutions) = wang2004(&bearings, &POINTS.map(Point::from)) else { continue };
        let first = solutions[0];
        // Near (10)'s singularity everything is amplified rounding.
        if 1.0 < first.constraint_11.abs() {
            continue;
        }
        for s in &solutions {
            assert!((s.constraint_11 - first.constraint_11).abs() < 1e-6);
            assert!((s.residual_3 - first.residual_3).abs() < 1e-6 * (1e-6 + first.residual_3));
            let side = if s.in_front == first.in_front { 1.0 } else { -1.0 };
            for x in POINTS.map(Point::from) {
                let [w, v] = [first, *s].map(|s| s.cam_from_target * x);
                assert!((w - v * side).norm() < 1e-5 * w.norm(), "{w} {v}");
            }
        }
        assert!(solutions.iter().filter(|s| s.in_front).count() <= 2);
        checked += 1;
    }
    assert!(500 < checked, "{checked}");
}
