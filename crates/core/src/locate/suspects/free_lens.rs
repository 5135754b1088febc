//! Poses and a few parameters of the lens together, from the points of views of one camera: docs/math/suspects.md eq. (3).
//!
//!   ξ  motion of a view about its points' centroid  ·  θ = [log f, c_u, c_v, k1, k2], those of them that are free

use super::fault::{Free, Trial, View};
use crate::least_squares::PivotedPose;
use crate::least_squares::dense::{DenseEquations, minimize_dense_within};
use crate::locate::choose::Hypothesis;
use crate::locate::consistency::is_inconsistent;
use crate::locate::refine::{centroid, whitening};
use crate::locate::{Config, locate};
use crate::{Camera, Correspondence, Point, Pose, Vector6};
use core::array;
use nalgebra::{DVector, Unit, Vector2, Vector3};

/// Views solved with a lens.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) camera: Camera,
    /// One for each view.
    pub(super) poses: Vec<Pose>,
    pub(super) chi2: f64,
    /// Less the parameters of the lens that were estimated.
    pub(super) degrees_of_freedom: usize,
}

/// Factors of the focal length from which a free one begins; the descent reaches about half as far again.
const FOCAL_STARTS: [f64; 3] = [1.0, 0.45, 2.2];
/// A free focal length is within this factor of the stated one.
const FOCAL_RANGE: f64 = 4.5;
/// Evaluations after which a descent is given up where χ² is still so many times its degrees of freedom, …
const FIRST_STEPS: usize = 8;
const HOPELESS: f64 = 1e3;
/// … and evaluations that follow elsewhere.
const MOST_STEPS: usize = 20;
/// Two poses that a plane allows are starts of each view.
const MOST_POSES: usize = 2;
/// … of which the second is not a start where its χ² is so many times larger.
const MUCH_WORSE: f64 = 4.0;
/// Row and column of a parameter of the lens: its derivatives, of which there are at most five.
const MOST_PARAMETERS: usize = 5;
const UNKNOWNS: usize = 6 + MOST_PARAMETERS;

/// Solves with the free parameters of the trial's lens, from several starts; χ² is that of the points alone where some are free.
pub(super) fn fit(views: &[View], trial: &Trial, config: &Config) -> Option<Fit> {
    if trial.free == Free::default() {
        return located(views, &trial.camera, trial, config);
    }
    let starts = if trial.free.focal { &FOCAL_STARTS[..] } else { &FOCAL_STARTS[..1] };
    let fits = starts.iter().flat_map(|factor| descents(views, trial, *factor));
    fits.filter(|fit| is_plausible(fit, trial)).min_by(|a, b| a.chi2.total_cmp(&b.chi2))
}

/// Returns whether an estimated focal length is that of another lens, and an estimated principal point that of a crop: no farther from the stated
/// one than the image is wide and high.
fn is_plausible(fit: &Fit, trial: &Trial) -> bool {
    let (Some(stated), Some(found)) = (trial.camera.matrix(), fit.camera.matrix()) else { return false };
    let sides_px = trial.camera.size.map_or([f64::INFINITY; 2], |s| [s.width_px, s.height_px].map(f64::from));
    let off_px = [found.cx_px - stated.cx_px, found.cy_px - stated.cy_px];
    (found.fx_px / stated.fx_px).ln().abs() < FOCAL_RANGE.ln()
        && (0..2).all(|i| off_px[i].abs() <= sides_px[i])
}

/// Continues a fit with more points.
pub(super) fn refined(views: &[View], trial: &Trial, fit: Fit) -> Option<Fit> {
    if trial.free == Free::default() {
        return Some(fit);
    }
    Descent::new(views, trial).run(&fit.poses, &fit.camera).filter(|fit| is_plausible(fit, trial))
}

/// Solves for the poses alone, with all that is known of them; the parameters of the lens that the trial estimated count. It gives up among the
/// views where the first of them are beyond what noise explains in all.
pub(super) fn located(views: &[View], camera: &Camera, trial: &Trial, config: &Config) -> Option<Fit> {
    let through = |c: &Correspondence| Some(Correspondence { bearing: camera.bearing(&c.pixel).ok()?, ..*c });
    let n = camera.parameters().len();
    let intrinsics_covariance = config.intrinsics_covariance.filter(|covariance| covariance.len() == n * n);
    let config = Config { intrinsics_covariance, shared_errors: false, ..*config };
    let n_residuals = 2 * views.iter().map(Vec::len).sum::<usize>();
    let mut fit = Fit { camera: camera.clone(), poses: Vec::new(), chi2: 0.0, degrees_of_freedom: 0 };
    for seen in views {
        let seen: View = seen.iter().map(through).collect::<Option<_>>()?;
        let e = locate(&seen, camera, &config).ok().filter(|_| !is_inconsistent(fit.chi2, n_residuals))?;
        fit.poses.push(e.cam_from_target);
        fit.chi2 += e.chi2;
        fit.degrees_of_freedom += e.degrees_of_freedom;
    }
    fit.degrees_of_freedom = fit.degrees_of_freedom.saturating_sub(trial.free.n_parameters());
    Some(fit)
}

fn descents(views: &[View], trial: &Trial, factor: f64) -> Vec<Fit> {
    let descent = Descent::new(views, trial);
    let Some(camera) = changed(&trial.camera, |values| values[..2].iter_mut().for_each(|f| *f *= factor))
    else {
        return Vec::new();
    };
    // Distortion that begins before the principal point is found leads astray.
    let matrix = Descent { free: Free { n_coefficients: 0, ..trial.free }, ..descent.clone() };
    let staged = |start: Vec<Pose>| match matrix.free == Free::default() || matrix.free == trial.free {
        true => descent.run(&start, &camera),
        false => {
            let first = matrix.run(&start, &camera)?;
            descent.run(&first.poses, &first.camera)
        }
    };
    let of_views: Vec<Vec<Pose>> = views.iter().map(|seen| poses(seen, &camera)).collect();
    let nth = |n: usize| of_views.iter().map(|poses| poses.get(n).or(poses.last()).copied()).collect();
    let n_starts = of_views.iter().map(Vec::len).max().unwrap_or(0);
    (0..n_starts).filter_map(nth).filter_map(staged).collect()
}

/// Returns poses from which to begin. The lens is not known yet, so that a pixel outside its field begins without distortion.
fn poses(seen: &[Correspondence], camera: &Camera) -> Vec<Pose> {
    let straight = |c: &Correspondence| {
        let k = camera.matrix()?;
        let q = Vector3::new((c.pixel.x - k.cx_px) / k.fx_px, (c.pixel.y - k.cy_px) / k.fy_px, 1.0);
        Some(Unit::new_normalize(q))
    };
    let through = |c: &Correspondence| {
        let bearing = camera.bearing(&c.pixel).ok().or_else(|| straight(c))?;
        Some(Correspondence { bearing, ..*c })
    };
    let seen: Option<Vec<Correspondence>> = seen.iter().map(through).collect();
    let config = Config { shared_errors: false, ..Config::default() };
    let Some(found) = seen.and_then(|seen| locate(&seen, camera, &config).ok()) else { return Vec::new() };
    let is_near = |h: &Hypothesis| h.minimum.chi2 < MUCH_WORSE * found.chi2;
    found.minima().take(MOST_POSES).filter(is_near).map(|h| h.minimum.cam_from_target).collect()
}

/// Returns the camera with other parameters.
fn changed(camera: &Camera, change: impl FnOnce(&mut [f64])) -> Option<Camera> {
    let mut values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
    change(&mut values);
    camera.with_parameters(&values).ok()
}

/// What is minimised.
#[derive(Clone)]
struct Descent<'a> {
    views: &'a [View],
    free: Free,
    degrees_of_freedom: usize,
    /// One for each view.
    pivots: Vec<Point>,
}

type LensState = (Vec<PivotedPose>, Camera);
type Weights = Vec<Vec<(f64, f64, f64)>>;

impl<'a> Descent<'a> {
    fn new(views: &'a [View], trial: &Trial) -> Self {
        let n_residuals: usize = views.iter().map(|seen| 2 * seen.len()).sum();
        let degrees_of_freedom = n_residuals.saturating_sub(6 * views.len() + trial.free.n_parameters());
        let pivots = views.iter().map(|seen| centroid(seen)).collect();
        Descent { views, free: trial.free, degrees_of_freedom, pivots }
    }

    fn run(&self, poses: &[Pose], camera: &Camera) -> Option<Fit> {
        // Weights of uncertain points remain those of the start; the poses alone are solved for again with their own.
        let weight = |pose: &Pose, c: &Correspondence| {
            let at = camera.project_with_jacobian(&(*pose * c.x_in_target));
            at.map(|(_, jacobian)| whitening(c, &jacobian))
        };
        let of_view = |(pose, seen): (&Pose, &View)| seen.iter().map(|c| weight(pose, c)).collect();
        let weights: Weights = poses.iter().zip(self.views).map(of_view).collect::<Option<_>>()?;
        let pivoted = poses.iter().zip(&self.pivots).map(|(pose, pivot)| PivotedPose::new(pose, pivot));
        let start = (pivoted.collect(), camera.clone());
        let descend = |steps: usize, start: LensState| {
            let evaluate = |state: &LensState| self.equations(state, &weights);
            minimize_dense_within(steps, start, evaluate, |state, step| self.moved(state, step))
        };
        let degrees_of_freedom = self.degrees_of_freedom;
        let mut found = descend(FIRST_STEPS, start)?;
        if !found.is_minimum() && found.equations.chi2 < HOPELESS * degrees_of_freedom as f64 {
            found = descend(MOST_STEPS, found.state)?;
        }
        let ((poses, camera), chi2) = (found.state, found.equations.chi2);
        let poses = poses.iter().zip(&self.pivots).map(|(pose, pivot)| pose.pose(pivot)).collect();
        Some(Fit { camera, poses, chi2, degrees_of_freedom })
    }

    fn equations(&self, (poses, camera): &LensState, weights: &Weights) -> Option<DenseEquations> {
        let (n_of_poses, n_of_lens) = (6 * poses.len(), self.free.n_parameters());
        let mut equations = DenseEquations::new(n_of_poses + n_of_lens);
        for (view, (pose, pivot)) in poses.iter().zip(&self.pivots).enumerate() {
            for (c, (a, b, d)) in self.views[view].iter().zip(&weights[view]) {
                let y = pose.rotation * (c.x_in_target - pivot);
                let x = y + pose.pivot_in_cam;
                let (pixel, jacobian) = camera.project_with_jacobian(&x)?;
                let by_lens = self.by_lens(camera, &x)?;
                let e = c.pixel - pixel;
                for (residual, wu, wv) in [(a * e.x + b * e.y, *a, *b), (d * e.y, 0.0, *d)] {
                    let j = (jacobian.row(0) * wu + jacobian.row(1) * wv).transpose();
                    let by_rotation = y.cross(&j);
                    let by: [(usize, f64); UNKNOWNS] = array::from_fn(|i| match i {
                        0..3 => (6 * view + i, by_rotation[i]),
                        3..6 => (6 * view + i, j[i - 3]),
                        _ => (n_of_poses + i - 6, by_lens[i - 6].x * wu + by_lens[i - 6].y * wv),
                    });
                    equations.add(residual, &by[..6 + n_of_lens]);
                }
            }
        }
        equations.chi2.is_finite().then_some(equations)
    }

    /// Returns the derivatives by the free parameters; zeros behind them.
    fn by_lens(&self, camera: &Camera, x: &Point) -> Option<[Vector2<f64>; MOST_PARAMETERS]> {
        let by = camera.intrinsics_jacobian(x)?;
        let k = camera.matrix()?;
        let log_focal = by[0] * k.fx_px + by[1] * k.fy_px;
        let focal = self.free.focal.then_some(log_focal);
        let centre = self.free.centre.then_some([by[2], by[3]]);
        let coefficients = by.get(4..4 + self.free.n_coefficients)?;
        let mut all =
            focal.into_iter().chain(centre.into_iter().flatten()).chain(coefficients.iter().copied());
        Some(array::from_fn(|_| all.next().unwrap_or_default()))
    }

    fn moved(&self, (poses, camera): &LensState, step: &DVector<f64>) -> Option<LensState> {
        let (of_poses, of_lens) = step.as_slice().split_at_checked(6 * poses.len())?;
        let moved = |(pose, step): (&PivotedPose, &[f64])| pose.moved(&Vector6::from_column_slice(step));
        let poses = poses.iter().zip(of_poses.chunks_exact(6)).map(moved).collect();
        let mut by = of_lens.iter();
        let mut next = || by.next().copied().unwrap_or_default();
        let camera = changed(camera, |values| {
            let factor = if self.free.focal { next().exp() } else { 1.0 };
            values[..2].iter_mut().for_each(|f| *f *= factor);
            let n_centre = if self.free.centre { 2 } else { 0 };
            values[2..2 + n_centre].iter_mut().for_each(|c| *c += next());
            values[4..4 + self.free.n_coefficients].iter_mut().for_each(|k| *k += next());
        })?;
        Some((poses, camera))
    }
}
