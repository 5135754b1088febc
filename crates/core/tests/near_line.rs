//! Points near one line, and few points anywhere: an `ok` pose is wrong by no more than it states.
//!
//! f = 1000 px, 1.5–6 m away, any attitude. `ok` promises 99 of 100 errors below 16.81 (χ² of six numbers). The table of docs/math/refine.md
//! section 9 is what this prints; `RESIGHT_SCENES` says how many views a row has. What it leaves out: uncertain points and intrinsics, which
//! `uncertain.rs` has.

use crate::common::Rng;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

/// Views of a row, unless stated otherwise.
const SCENES: usize = 10_000;
/// χ² of six numbers at 99 %.
const BOUND: f64 = 16.81;
/// Beyond this nothing but another pose explains the error.
const FAR: f64 = 100.0;

#[derive(Debug, Clone, Copy)]
enum Layout {
    /// So many points of a line of 1 m, each 2 cm off it along both axes, one standard deviation.
    NearLine(usize),
    /// In a cube of 1 m.
    Space(usize),
    /// In a square of 0.6 m.
    Plane(usize),
}

fn points(rng: &mut Rng, layout: Layout) -> Vec<Point> {
    let any = |rng: &mut Rng| rng.uniform(-0.5, 0.5);
    let point = |rng: &mut Rng| match layout {
        Layout::NearLine(_) => Point::new(any(rng), 0.02 * rng.normal(), 0.02 * rng.normal()),
        Layout::Space(_) => Point::new(any(rng), any(rng), any(rng)),
        Layout::Plane(_) => Point::new(any(rng), any(rng), 0.0) * 0.6,
    };
    let (Layout::NearLine(n) | Layout::Space(n) | Layout::Plane(n)) = layout;
    (0..n).map(|_| point(rng)).collect()
}

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

fn view(rng: &mut Rng) -> Pose {
    let z = rng.uniform(1.5, 6.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), 1.0) * z)
}

fn observe(
    rng: &mut Rng,
    camera: &Camera,
    truth: &Pose,
    known: &[Point],
    px: f64,
) -> Option<Vec<Correspondence>> {
    let observed = |x: &Point| {
        let pixel = camera.project(&(truth * x))? + Vector2::new(rng.normal(), rng.normal()) * px;
        Correspondence::new(camera, *x, pixel, px).ok()
    };
    known.iter().map(observed).collect()
}

fn is_ok(e: &PoseEstimate) -> bool {
    matches!(e.ambiguity, Ambiguity::Unique { .. }) && e.consistency == Consistency::Consistent
}

/// Shares of a row, and how many `ok` poses are far off.
struct Tally {
    ok: f64,
    beyond_percent: f64,
    far: usize,
}

fn tally(layout: Layout, px: f64, seed: u64) -> Tally {
    let scenes = std::env::var("RESIGHT_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(SCENES);
    let (camera, mut rng) = (camera(), Rng::new(seed));
    let (mut n, mut ok, mut ambiguous, mut mean, mut beyond, mut far) = (0, 0usize, 0usize, 0.0, 0usize, 0);
    while n < scenes {
        let (known, truth) = (points(&mut rng, layout), view(&mut rng));
        let Some(seen) = observe(&mut rng, &camera, &truth, &known, px) else { continue };
        n += 1;
        let Ok(e) = locate(&seen, &camera, &Config::default()) else { continue };
        if !is_ok(&e) {
            ambiguous += 1;
            continue;
        }
        let error = (e.cam_from_target * truth.inverse()).log();
        let nees = e.covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)));
        ok += 1;
        mean += (nees.min(FAR) - mean) / ok as f64;
        beyond += usize::from(BOUND < nees);
        far += usize::from(FAR < nees);
    }
    let percent = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    let tally = Tally { ok: percent(ok, n), beyond_percent: percent(beyond, ok), far };
    println!(
        "{layout:?} | {px} | {:.1} | {:.1} | {mean:.2} | {:.2} | {far}",
        tally.ok,
        percent(ambiguous, n),
        tally.beyond_percent
    );
    tally
}

/// 10,000 views hold 100 beyond the bound by chance, 10 either way.
#[test]
fn near_a_line_ok_means_ok() {
    println!(
        "points | px | ok % | ambiguous, inconsistent % | mean NEES | beyond 16.81, % of ok | beyond 100"
    );
    for (i, layout) in [4, 5, 6, 7].map(Layout::NearLine).into_iter().enumerate() {
        for (j, px) in [0.3, 1.0].into_iter().enumerate() {
            let found = tally(layout, px, 900 + (2 * i + j) as u64);
            assert!(found.beyond_percent <= 1.2, "{layout:?} {px} px: {} %", found.beyond_percent);
            assert!(found.far <= 2, "{layout:?} {px} px: {} far off", found.far);
            assert!(if px < 1.0 { 90.0 } else { 60.0 } < found.ok, "{layout:?} {px} px: {} %", found.ok);
        }
    }
}

/// The far ones of a plane are the gate's: at most Φ(−3) = 0.135 % of views of two poses are taken for the wrong one.
#[test]
fn few_points_anywhere_ok_means_ok() {
    println!(
        "points | px | ok % | ambiguous, inconsistent % | mean NEES | beyond 16.81, % of ok | beyond 100"
    );
    for (i, layout) in
        [Layout::Space(4), Layout::Space(5), Layout::Plane(4), Layout::Plane(6), Layout::Plane(7)]
            .into_iter()
            .enumerate()
    {
        for (j, px) in [0.3, 1.0].into_iter().enumerate() {
            let found = tally(layout, px, 950 + (2 * i + j) as u64);
            assert!(found.beyond_percent <= 1.4, "{layout:?} {px} px: {} %", found.beyond_percent);
            assert!(found.far as f64 <= 1.35e-3 * SCENES as f64, "{layout:?} {px} px: {} far off", found.far);
        }
    }
}
