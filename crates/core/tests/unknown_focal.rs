//! Pose and focal length of one view: right within what is said, and refused where the points leave it open.
//!
//! Lenses are drawn from what is said of lenses in general: principal point ± 2 % of the width, pixels square to 0.4 %, a corner displaced by
//! 15 % at 70° of field of view.

use crate::common::Rng;
use nalgebra::{SVector, Vector2, Vector3};
use resight_core::camera::{BrownConrady, ImageSize};
use resight_core::error::FocalRemedy;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::unknown_focal::{FocalEstimate, LensPrior, MAX_RELATIVE_SIGMA, estimate_focal};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Pixel, Point, Pose};

const SIZE: ImageSize = ImageSize { width_px: 1280, height_px: 960 };

fn prior() -> LensPrior {
    LensPrior {
        size: SIZE,
        principal_point_sigma_px: 25.6,
        aspect_sigma: 0.004,
        bend_sigma_per_rad: 0.15 / 70f64.to_radians(),
    }
}

/// A lens as one meets them.
fn lens(rng: &mut Rng, focal_px: f64) -> Camera {
    let aspect = 0.004 * rng.normal();
    let matrix = CameraMatrix {
        fx_px: focal_px * (-0.5 * aspect).exp(),
        fy_px: focal_px * (0.5 * aspect).exp(),
        cx_px: 639.5 + 25.6 * rng.normal(),
        cy_px: 479.5 + 25.6 * rng.normal(),
    };
    let field = 2.0 * 640f64.atan2(focal_px);
    let bend = 0.15 / 70f64.to_radians() * field * rng.normal();
    let k1 = bend * (focal_px / 800.0).powi(2);
    Camera::new(BrownConrady::new(matrix, &[k1, 0.0, 0.0, 0.0]).expect("a lens"), Some(SIZE))
        .expect("a camera")
}

struct View {
    seen: Vec<Correspondence>,
    cam_from_target: Pose,
    focal_px: f64,
}

/// The points of a target somewhere in the image; none where one is outside.
fn view(rng: &mut Rng, points: &[Point], tilt_rad: [f64; 2], depth: [f64; 2], sigma_px: f64) -> Option<View> {
    let focal_px = (rng.uniform(640f64.ln(), 2000f64.ln())).exp();
    let camera = lens(rng, focal_px);
    let (direction, spin, tilt) =
        (rng.uniform(0.0, 6.28), rng.uniform(0.0, 6.28), rng.uniform(tilt_rad[0], tilt_rad[1]));
    let turn =
        |x: f64, y: f64, z: f64| Pose::exp(&resight_core::Vector6::new(x, y, z, 0.0, 0.0, 0.0)).rotation;
    let rotation = turn(tilt * direction.cos(), tilt * direction.sin(), 0.0) * turn(0.0, 0.0, spin);
    // So near that the target, a metre wide, fills this part of the image's width.
    let z = focal_px / 1280.0 / rng.uniform(depth[0], depth[1]);
    let aside = Vector2::new(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)) * z * 1280.0 / focal_px;
    let cam_from_target = Pose::new(rotation, Vector3::new(aside.x, aside.y, z));
    let seen = points.iter().map(|x| {
        let pixel = camera.project(&(cam_from_target * *x))?;
        let noise = Pixel::new(rng.normal(), rng.normal()) * sigma_px;
        camera.contains(&pixel).then(|| correspondence(*x, pixel + noise, sigma_px))
    });
    Some(View { seen: seen.collect::<Option<_>>()?, cam_from_target, focal_px })
}

fn correspondence(x: Point, pixel: Pixel, sigma_px: f64) -> Correspondence {
    let bearing = Camera::normalized().bearing(&Vector2::zeros()).expect("a bearing");
    let _ = bearing;
    Correspondence { x_in_target: x, pixel, bearing, sigma_px, covariance_px2: None, sigma_m: 0.0 }
}

fn board(columns: usize, rows: usize, step_m: f64) -> Vec<Point> {
    let at = |i: usize, n: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * step_m;
    (0..rows).flat_map(|r| (0..columns).map(move |c| Point::new(at(c, columns), at(r, rows), 0.0))).collect()
}

fn in_space(rng: &mut Rng, n: usize) -> Vec<Point> {
    (0..n)
        .map(|_| Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), rng.uniform(-0.4, 0.4)))
        .collect()
}

/// Squared Mahalanobis distance of [pose; log f], seven numbers, and how many standard deviations f is off.
fn miss(found: &FocalEstimate, view: &View) -> (f64, f64) {
    let motion = (view.cam_from_target * found.pose.cam_from_target.inverse()).log();
    let focal = (view.focal_px / found.focal_px).ln();
    let d = SVector::<f64, 7>::from_fn(|i, _| if i < 6 { motion[i] } else { focal });
    let inverse = found.covariance.try_inverse().expect("an inverse");
    (d.dot(&(inverse * d)), focal / found.covariance[(6, 6)].sqrt())
}

#[derive(Debug, Default)]
struct Tally {
    views: usize,
    unique: usize,
    ambiguous: usize,
    open: usize,
    inconsistent: usize,
    other: usize,
    nees: f64,
    within: usize,
    beyond_5: usize,
    sigma: f64,
    focal_2: f64,
}

fn tally(seed: u64, n: usize, mut next: impl FnMut(&mut Rng) -> Option<View>) -> Tally {
    let (mut rng, mut tally) = (Rng::new(seed), Tally::default());
    while tally.views < n {
        let Some(view) = next(&mut rng) else { continue };
        tally.views += 1;
        match estimate_focal(&view.seen, &prior()) {
            Ok(found) if matches!(found.pose.ambiguity, Ambiguity::Ambiguous { .. }) => tally.ambiguous += 1,
            Ok(found) if found.pose.consistency != Consistency::Consistent => tally.inconsistent += 1,
            Ok(found) => {
                let (nees, focal) = miss(&found, &view);
                tally.unique += 1;
                tally.nees += nees;
                tally.focal_2 += focal * focal;
                tally.within += usize::from(focal.abs() < 1.96);
                tally.beyond_5 += usize::from(5.0 < focal.abs());
                tally.sigma += found.covariance[(6, 6)].sqrt();
            }
            Err(Error::UndeterminedFocal { .. }) => tally.open += 1,
            Err(reason) => {
                println!("{reason}");
                tally.other += 1;
            }
        }
    }
    let m = tally.unique.max(1) as f64;
    (tally.nees, tally.sigma, tally.focal_2) = (tally.nees / m, tally.sigma / m, tally.focal_2 / m);
    tally
}

fn views(few: usize) -> usize {
    std::env::var("RESIGHT_FOCAL_VIEWS").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

fn deg(x: [f64; 2]) -> [f64; 2] {
    x.map(f64::to_radians)
}

#[test]
fn explore() {
    for (name, n) in [("5 in space", 5), ("6 in space", 6), ("12 in space", 12), ("4 in space", 4)] {
        let t = tally(1, views(200), |rng| {
            let points = in_space(rng, n);
            view(rng, &points, deg([0.0, 60.0]), [0.3, 0.6], 0.3)
        });
        println!("{name}: {t:?}");
    }
    for (name, points, tilts) in [
        ("square 30-60", board(2, 2, 0.7), [30.0, 60.0]),
        ("board 30-60", board(9, 6, 0.1), [30.0, 60.0]),
        ("board 10-30", board(9, 6, 0.1), [10.0, 30.0]),
        ("board 0-10", board(9, 6, 0.1), [0.0, 10.0]),
        ("board 0-3", board(9, 6, 0.1), [0.0, 3.0]),
        ("square 0-30", board(2, 2, 0.7), [0.0, 30.0]),
    ] {
        let t = tally(2, views(200), |rng| view(rng, &points, deg(tilts), [0.3, 0.6], 0.3));
        println!("{name}: {t:?}");
    }
}
