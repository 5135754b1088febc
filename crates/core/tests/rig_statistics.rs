//! Covariances of a rig against Monte Carlo and against a Fisher information that shares no derivative with the product.

use crate::common::rooms::Room;
use crate::common::{Rng, rooms};
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use resight_core::camera::{DoubleSphere, KannalaBrandt};
use resight_core::correspondence::PixelCovariance;
use resight_core::multiview::rig::{Observation, RigConfig};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Matrix6, Pose, Vector6};

/// The Cramér–Rao bound of all cameras but the first, by central differences of exact pixels over every unknown.
fn bound(room: &Room) -> DMatrix<f64> {
    // Central differences err by h² and ε/h.
    const STEP: f64 = 6e-6;
    let (n_cameras, n_bodies) = (room.cameras.len(), room.bodies.len());
    let n = 6 * (n_cameras - 1 + n_bodies);
    let mut information = DMatrix::zeros(n, n);
    for s in &room.observations {
        let body = room.bodies.iter().position(|b| b.0 == s.view).expect("a body");
        for c in &s.seen {
            let mut rows = [DVector::zeros(n), DVector::zeros(n)];
            let mut by = |column: usize, i: usize, is_camera: bool| {
                let pixel = |h: f64| {
                    let motion = Pose::exp(&Vector6::ith(i, h));
                    let (camera, place) = (room.cam_from_rig[s.camera], room.bodies[body].2);
                    let (camera, place) =
                        if is_camera { (motion * camera, place) } else { (camera, motion * place) };
                    room.cameras[s.camera].project(&(camera * place * c.x_in_target)).expect("in the field")
                };
                let slope = (pixel(STEP) - pixel(-STEP)) / (2.0 * STEP * c.sigma_px);
                (rows[0][column], rows[1][column]) = (slope.x, slope.y);
            };
            for i in 0..6 {
                if 0 < s.camera {
                    by(6 * (s.camera - 1) + i, i, true);
                }
                by(6 * (n_cameras - 1 + body) + i, i, false);
            }
            rows.iter().for_each(|row| information += row * row.transpose());
        }
    }
    information.cholesky().expect("determined").inverse()
}

#[test]
fn covariances_are_the_cramer_rao_bound() {
    let mut rng = Rng::new(11);
    let cameras = (0..4).map(|i| if i == 1 { rooms::barrel(900.0) } else { rooms::pinhole(900.0) }).collect();
    let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(4, 3, 0.12), 25, 0.3);
    let mut seen = room.clone();
    seen.bodies.retain(|b| room.observations.iter().any(|s| s.view == b.0));
    let bound = bound(&seen);
    let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
    let solution = room.solve(&room.observations, &config).expect("a rig");
    let joint = solution.joint_covariance.as_ref().expect("asked for");
    let n = 6 * 3;
    let (truth, found) = (bound.view((0, 0), (n, n)).into_owned(), joint.view((6, 6), (n, n)).into_owned());
    // What leaving out one good point in ten thousand costs is in the answer, not in the bound: 1.0009. The rest is the differences'.
    assert!(
        (&found / 1.0009 - &truth).norm() < 1e-4 * truth.norm(),
        "{}",
        (&found - &truth).norm() / truth.norm()
    );
    for (i, body) in solution.bodies.iter().enumerate() {
        let at = n + 6 * i;
        let truth: Matrix6 = bound.fixed_view::<6, 6>(at, at).into();
        assert!((body.covariance / 1.0009 - truth).norm() < 1e-4 * truth.norm(), "body {i}");
    }
    let relative = solution.cam_b_from_cam_a(2, 1).expect("joint").1;
    let (a, b) = (&solution.cameras[1], &solution.cameras[2]);
    assert!(relative.trace() < a.covariance.trace() + b.covariance.trace() + 1.0);
}

/// Eight cameras, 300 views, 0.3 px: squared errors in units of the stated covariance, and over the bound.
#[test]
fn errors_are_what_the_covariance_says() {
    const RIGS: u64 = 12;
    const DRAWS: usize = 12;
    let (mut nees, mut ratio, mut n) = ([0.0; 8], 0.0, 0.0);
    for seed in 0..RIGS {
        let mut rng = Rng::new(300 + seed);
        let cameras = (0..8).map(|_| rooms::pinhole(900.0)).collect();
        let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(3, 3, 0.2), 300, 0.3);
        let bound = room.solve(&room.observations, &RigConfig::default()).expect("a rig");
        for _ in 0..DRAWS {
            let solution = room.solve(&room.disturbed(&mut rng), &RigConfig::default()).expect("a rig");
            for c in 1..8 {
                let (motion, squared) = room.error(&solution, c);
                nees[c] += squared / (RIGS as f64 * DRAWS as f64);
                ratio += rooms::nees(&motion, &bound.cameras[c].covariance) / 6.0;
                n += 1.0;
            }
        }
    }
    println!("NEES {nees:?} over the bound {}", ratio / n);
    let mean = nees.iter().sum::<f64>() / 7.0;
    // The mean over seven cameras of 144 draws: a standard deviation of 0.15, for the cameras share the reference's.
    assert!((5.7..6.3).contains(&mean), "{mean}");
    assert!(nees[1..].iter().all(|c| (5.1..6.9).contains(c)), "{nees:?}");
    assert!(ratio / n < 1.05, "{}", ratio / n);
}

/// Pixels sharper in one direction than in the other, points known to half a millimetre, a fisheye and a wide lens: the covariance holds all.
#[test]
fn uneven_noise_and_uncertain_points_are_in_the_covariance() {
    const TRIALS: u64 = 40;
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 705.0, cx_px: 639.5, cy_px: 479.5 };
    let fisheye = KannalaBrandt::new(matrix, &[0.02, -0.01, 0.004, -0.001]).expect("a lens");
    let wide = DoubleSphere::new(matrix, -0.2, 0.6).expect("a lens");
    let lenses = [Lens::KannalaBrandt(fisheye), Lens::DoubleSphere(wide)];
    let mut mean = 0.0;
    for seed in 0..TRIALS {
        let mut rng = Rng::new(700 + seed);
        let mut cameras: Vec<Camera> =
            lenses.iter().map(|l| Camera { lens: l.clone(), size: None }).collect();
        cameras.extend([rooms::barrel(900.0), rooms::pinhole(900.0)]);
        let room = rooms::ring_with_board(&mut rng, cameras, rooms::board(4, 3, 0.12), 30, 0.5);
        let disturbed = |s: &Observation, rng: &mut Rng| {
            let body = room.bodies.iter().find(|b| b.0 == s.view).expect("a body").2;
            let point = |c: &Correspondence, rng: &mut Rng| {
                // u = 0.2 a + 0.6 b, v = 0.5 b − 0.1 a: C = [0.40, 0.28; 0.28, 0.26].
                let (a, b) = (rng.normal(), rng.normal());
                let covariance = PixelCovariance { uu_px2: 0.40, uv_px2: 0.28, vv_px2: 0.26 };
                let off = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * 0.5e-3;
                let x_in_cam = room.cam_from_rig[s.camera] * body * (c.x_in_target + off);
                let pixel = room.cameras[s.camera].project(&x_in_cam).expect("in the field");
                let pixel = pixel + Vector2::new(0.2 * a + 0.6 * b, 0.5 * b - 0.1 * a);
                let seen = Correspondence::new(&room.cameras[s.camera], c.x_in_target, pixel, 1.0)
                    .expect("in the field");
                Correspondence { sigma_m: 0.5e-3, ..seen.with_covariance(covariance) }
            };
            Observation { seen: s.seen.iter().map(|c| point(c, rng)).collect(), ..s.clone() }
        };
        let observations: Vec<Observation> =
            room.observations.iter().map(|s| disturbed(s, &mut rng)).collect();
        let solution = room.solve(&observations, &RigConfig::default()).expect("a rig");
        assert_eq!(solution.noise_scale, 1.0);
        mean += (1..4).map(|c| room.error(&solution, c).1).sum::<f64>() / (3.0 * TRIALS as f64);
    }
    // 120 values, three of a trial in common with the reference: a standard deviation of 0.45.
    assert!((4.6..7.4).contains(&mean), "{mean}");
}

/// Lenses drawn from the covariance of their intrinsics, four cameras, 60 views: errors are far larger than pixels make them, and as the
/// answer says.
#[test]
fn uncertain_lenses_are_in_the_covariance() {
    const TRIALS: u64 = 60;
    // A common error of the focal lengths, a small difference of them, and the principal point; correlated as calibrations are.
    let factor = DMatrix::from_row_slice(
        4,
        4,
        &[1.2, 0.0, 0.0, 0.0, 1.2, 0.2, 0.0, 0.0, 0.3, 0.0, 0.8, 0.0, 0.0, 0.0, 0.2, 0.8],
    );
    let covariance = &factor * factor.transpose();
    let stated = vec![Some(covariance); 4];
    let (mut mean, mut exact, mut n) = (0.0, 0.0, 0.0);
    for seed in 0..TRIALS {
        let mut rng = Rng::new(9000 + seed);
        let cameras = (0..4).map(|_| rooms::pinhole(900.0)).collect();
        let mut room = rooms::ring_with_board(&mut rng, cameras, rooms::board(3, 3, 0.2), 60, 0.3);
        let seen = room.disturbed(&mut rng);
        // What is solved with differs from what the pixels were made with.
        for camera in &mut room.cameras {
            let error = &factor * DVector::from_fn(4, |_, _| rng.normal());
            let values: Vec<f64> =
                camera.parameters().iter().zip(error.iter()).map(|((_, value), e)| value + e).collect();
            *camera = camera.with_parameters(&values).expect("a lens");
        }
        let rebased: Vec<Observation> = seen
            .into_iter()
            .map(|s| {
                let lens = &room.cameras[s.camera];
                let again = |c: &Correspondence| Correspondence {
                    bearing: lens.bearing(&c.pixel).expect("in the field"),
                    ..*c
                };
                Observation { seen: s.seen.iter().map(again).collect(), ..s }
            })
            .collect();
        let config = RigConfig { intrinsics: &stated, ..RigConfig::default() };
        let solution = room.solve(&rebased, &config).expect("a rig");
        let without = room.solve(&rebased, &RigConfig::default()).expect("a rig");
        for c in 1..4 {
            mean += room.error(&solution, c).1;
            exact += room.error(&without, c).1;
            n += 1.0;
        }
    }
    let (mean, exact) = (mean / n, exact / n);
    println!("NEES {mean} with the covariance of the intrinsics, {exact} without");
    // 180 draws of six numbers that share the reference's: a standard deviation of 0.35.
    assert!((5.0..7.0).contains(&mean) && 3.0 * mean < exact, "{mean} {exact}");
}
