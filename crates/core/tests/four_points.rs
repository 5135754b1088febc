//! Four points, every layout: how often the answer is wrong where the best pose of those pixels is not.
//!
//! Camera 1280×960, f = 1000 px; a target of 1 m, tilted up to 75°, seen from either face, its points in random order. *Fails*: off by
//! more than 5° or 10 % of the distance. *Beyond its covariance*: fails, and by more than the stated covariance admits once in 10,000. *Avoidable*: the answer fails and the lowest pose of every start known here does not. What it
//! leaves out: poses that none of those starts leads to.

use crate::common::Rng;
use nalgebra::{Matrix3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::locate::choose::{Ambiguity, Hypothesis};
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::solve::{p3p::p3p, planar::planar, sqpnp::sqpnp};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

/// Scenes of a cell: one avoidable failure among them is 0.01 %, the bar is 0.05 %.
const N: usize = 10_000;
/// Stated where the pixels are exact: what is tested there is the search, not the noise.
const EXACT_SIGMA_PX: f64 = 0.1;
const FAILS_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;
const FAILS_OF_DISTANCE: f64 = 0.1;
/// Turns of the truth that the search for the best pose starts from, besides the solvers' candidates.
const TURNED_STARTS: usize = 24;

#[derive(Debug, Clone, Copy)]
enum Layout {
    General,
    Square,
    LinePlusOne,
}

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// The four points about their middle, in random order.
fn points(rng: &mut Rng, layout: Layout) -> [Point; 4] {
    let mut any = || Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
    let mut points = match layout {
        Layout::General => [any(), any(), any(), any()],
        Layout::Square => {
            [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]].map(Point::from)
        }
        Layout::LinePlusOne => {
            [[-0.5, -0.3, 0.0], [0.1, -0.3, 0.0], [0.5, -0.3, 0.0], [-0.5, 0.5, 0.0]].map(Point::from)
        }
    };
    for i in (1..4).rev() {
        points.swap(i, rng.index(i + 1));
    }
    points
}

/// The target's middle anywhere in the image, its normal up to 75° from the line of sight, towards the camera or away from it.
fn view(rng: &mut Rng, [near_m, far_m]: [f64; 2]) -> Pose {
    let z = rng.uniform(near_m, far_m);
    let middle = Vector3::new(rng.uniform(-0.55, 0.55) * z, rng.uniform(-0.4, 0.4) * z, z);
    let (tilt, face) = (rng.uniform(0.0, 75f64.to_radians()), if rng.index(2) == 0 { 1.0 } else { -1.0 });
    let sight = middle.normalize();
    let across = rng.unit_vector().cross(&sight).normalize();
    let normal = (sight * tilt.cos() + across * tilt.sin()) * face;
    let x = rng.unit_vector().cross(&normal).normalize();
    Pose::new(Matrix3::from_columns(&[x, normal.cross(&x), normal]), middle)
}

fn observe(
    rng: &mut Rng,
    truth: &Pose,
    points: &[Point; 4],
    noise_px: f64,
    camera: &Camera,
) -> Option<Vec<Correspondence>> {
    let sigma_px = if noise_px == 0.0 { EXACT_SIGMA_PX } else { noise_px };
    let observed = |x: &Point| {
        let pixel = camera.project(&(truth * x))?;
        let inside = (0.0..1280.0).contains(&pixel.x) && (0.0..960.0).contains(&pixel.y);
        let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * noise_px;
        Correspondence::new(camera, *x, pixel, sigma_px).ok().filter(|_| inside)
    };
    points.iter().map(observed).collect()
}

fn fails(pose: &Pose, truth: &Pose) -> bool {
    let distance = truth.translation.norm();
    FAILS_RAD < pose.angle_to_rad(truth)
        || FAILS_OF_DISTANCE * distance < (pose.translation - truth.translation).norm()
}

/// Beyond the ellipsoid that holds the truth in 9,999 of 10,000 cases (χ² with 6 degrees of freedom): more than its covariance admits.
fn is_beyond(e: &PoseEstimate, truth: &Pose) -> bool {
    let error = (e.cam_from_target * truth.inverse()).log();
    let squared = e.covariance.cholesky().map(|c| error.dot(&c.solve(&error)));
    squared.is_none_or(|squared| 27.86 < squared)
}

/// The lowest χ² reached from the truth, turns of it about its own place, and every solver's candidates.
fn best_of_every_start(
    rng: &mut Rng,
    truth: &Pose,
    seen: &[Correspondence],
    camera: &Camera,
) -> Option<(Pose, f64)> {
    let mut starts = vec![*truth];
    starts.extend(sqpnp(seen));
    starts.extend(planar(seen));
    for skipped in 0..4 {
        let three: Vec<&Correspondence> = (0..4).filter(|i| *i != skipped).map(|i| &seen[i]).collect();
        let of = |i: usize| three[i];
        starts.extend(p3p(&[0, 1, 2].map(|i| of(i).bearing), &[0, 1, 2].map(|i| of(i).x_in_target)));
    }
    starts.extend((0..TURNED_STARTS).map(|_| Pose::new(rng.rotation(), truth.translation)));
    let refined = starts.iter().filter_map(|start| refine(start, seen, camera).ok());
    refined.min_by(|a, b| a.chi2.total_cmp(&b.chi2)).map(|m| (m.cam_from_target, m.chi2))
}

#[derive(Debug, Default)]
struct Cell {
    scenes: usize,
    refused: usize,
    failed: usize,
    avoidable: usize,
    ok: usize,
    ok_failed: usize,
    ok_and_false: usize,
    ambiguous: usize,
    neither_right: usize,
}

impl Cell {
    fn count(&mut self, answer: Option<&PoseEstimate>, truth: &Pose, best: impl FnOnce() -> Option<Pose>) {
        self.scenes += 1;
        let failed = answer.is_none_or(|e| fails(&e.cam_from_target, truth));
        self.refused += usize::from(answer.is_none());
        self.failed += usize::from(failed);
        // The more probable pose leads. What no optimiser need miss is the pose of least residual.
        let by_chi2 = |a: &Hypothesis, b: &Hypothesis| a.minimum.chi2.total_cmp(&b.minimum.chi2);
        let lowest = answer.and_then(|e| e.minima().min_by(by_chi2)).map(|h| h.minimum.cam_from_target);
        let missed = lowest.is_none_or(|pose| fails(&pose, truth));
        self.avoidable += usize::from(missed && best().is_some_and(|pose| !fails(&pose, truth)));
        match answer.map(|e| &e.ambiguity) {
            Some(Ambiguity::Unique { .. }) => {
                self.ok += 1;
                self.ok_failed += usize::from(failed);
                self.ok_and_false += usize::from(failed && answer.is_some_and(|e| is_beyond(e, truth)));
            }
            Some(Ambiguity::Ambiguous { other, .. }) => {
                self.ambiguous += 1;
                self.neither_right += usize::from(failed && fails(&other.cam_from_target, truth));
            }
            None => {}
        }
    }
}

fn percent(part: usize, of: usize) -> f64 {
    100.0 * part as f64 / of.max(1) as f64
}

fn cell(layout: Layout, range_m: [f64; 2], noise_px: f64, seed: u64) -> Cell {
    let (camera, mut rng, mut other) = (camera(), Rng::new(seed), Rng::new(seed + 1000));
    let mut cell = Cell::default();
    while cell.scenes < N {
        let (points, truth) = (points(&mut rng, layout), view(&mut rng, range_m));
        let Some(seen) = observe(&mut rng, &truth, &points, noise_px, &camera) else { continue };
        let answer = locate(&seen, &camera, &Config::default()).ok();
        let best = || best_of_every_start(&mut other, &truth, &seen, &camera).map(|(pose, _)| pose);
        cell.count(answer.as_ref(), &truth, best);
    }
    println!(
        "{layout:?} | {}–{} m | {noise_px} px | {:.2} | {:.2} | {:.3} | {:.2} | {:.3} | {:.3} | {:.2} | {:.2}",
        range_m[0],
        range_m[1],
        percent(cell.refused, cell.scenes),
        percent(cell.failed, cell.scenes),
        percent(cell.avoidable, cell.scenes),
        percent(cell.ok, cell.scenes),
        percent(cell.ok_failed, cell.ok),
        percent(cell.ok_and_false, cell.ok),
        percent(cell.ambiguous, cell.scenes),
        percent(cell.neither_right, cell.ambiguous),
    );
    cell
}

fn failures_are_unavoidable(layout: Layout, seed: u64) {
    println!(
        "layout | range | noise | refused | fails | avoidable | ok | of ok, fail | beyond their covariance | ambiguous | of these, neither right, %"
    );
    for (i, range_m) in [[1.0, 3.0], [5.0, 20.0]].into_iter().enumerate() {
        for (j, noise_px) in [0.0, 0.1, 0.5, 1.0].into_iter().enumerate() {
            let cell = cell(layout, range_m, noise_px, seed + (4 * i + j) as u64);
            let avoidable = percent(cell.avoidable, cell.scenes);
            assert!(avoidable <= 0.05, "{layout:?} {range_m:?} m {noise_px} px: {avoidable} %");
        }
    }
}

#[test]
fn no_failure_in_space_is_avoidable() {
    failures_are_unavoidable(Layout::General, 100);
}

#[test]
fn no_failure_of_a_square_is_avoidable() {
    failures_are_unavoidable(Layout::Square, 200);
}

#[test]
fn no_failure_of_line_plus_one_is_avoidable() {
    failures_are_unavoidable(Layout::LinePlusOne, 300);
}
