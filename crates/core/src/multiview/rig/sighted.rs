//! The poses of each observation by itself: every minimum, also with a few wrong points.

use super::layout::Layout;
use crate::locate::consistency::is_unlikely;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
use crate::locate::refine::{refine_problem, whitened_residual};
use crate::locate::{Config, PoseEstimate, locate};
use crate::robust::{self, consensus};
use crate::{Camera, Correspondence, Error, Matrix6, Pose};
use std::borrow::Cow;

/// A pose that an observation may have.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hypothesis {
    pub(super) cam_from_target: Pose,
    /// Covariance of its small left motion, widened to the residuals.
    pub(super) covariance: Matrix6,
    /// Probability among the minima of the observation.
    pub(super) probability: f64,
    /// |Σ|^(1/6), larger for a less probable pose: a measure of its uncertainty.
    pub(super) size: f64,
}

/// The poses that each observation, in canonical order, may have, the most probable first; or why it has none.
pub(super) type LocatedViews = Vec<Result<Vec<Hypothesis>, Error>>;

/// Minima less probable than this are not followed.
const LEAST_WEIGHT: f64 = 1e-4;
/// The threshold of the loss that finds wrong points, in robust standard deviations: its estimates are 98 % as efficient as least squares.
pub(super) const CAUCHY_SIGMAS: f64 = 3.0;
/// Median of χ² with two degrees of freedom.
pub(super) const MEDIAN_CHI2: f64 = 2.0 * core::f64::consts::LN_2;
/// Smallest number of points among which a wrong one can be found; smaller observations are tested by the other cameras.
const ENOUGH_POINTS: usize = 6;
/// Largest number of samples for a consensus, which serves only as an initial value.
const MAX_SAMPLES: usize = 2000;

pub(super) fn poses_of_observations(layout: &Layout) -> LocatedViews {
    (0..layout.observations.len()).map(|i| poses(&layout.observations[i].seen, layout.camera(i))).collect()
}

fn poses(seen: &[Correspondence], camera: &Camera) -> Result<Vec<Hypothesis>, Error> {
    if MANY_POINTS < seen.len() {
        let some = spread(seen);
        if let Some(found) = locate(&some, camera, &Config::default()).ok().filter(is_clean) {
            return Ok(minima(&found));
        }
    }
    let found = locate(seen, camera, &Config::default());
    let plain = found.as_ref().map(minima).unwrap_or_default();
    let poses = match &found {
        Ok(f) if is_clean(f) => plain,
        _ if seen.len() < ENOUGH_POINTS => plain,
        _ => Some(without_wrong_points(&plain, seen, camera)).filter(|p| !p.is_empty()).unwrap_or(plain),
    };
    match found {
        Err(reason) if poses.is_empty() => Err(reason),
        _ if poses.is_empty() => Err(crate::locate::refine::UNDETERMINED),
        _ => Ok(poses),
    }
}

/// Largest number of points for an initial pose; the joint adjustment uses all.
const MANY_POINTS: usize = 30;

/// Returns all points of a small observation, some of a large one.
pub(super) fn enough(seen: &[Correspondence]) -> Cow<'_, [Correspondence]> {
    if MANY_POINTS < seen.len() { Cow::Owned(spread(seen)) } else { Cow::Borrowed(seen) }
}

/// Returns at most `MANY_POINTS` points, selected by the golden section so that they are not all in one row of a board.
fn spread(seen: &[Correspondence]) -> Vec<Correspondence> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let mut places: Vec<usize> =
        (0..MANY_POINTS).map(|i| ((i as f64 * GOLDEN).fract() * seen.len() as f64) as usize).collect();
    places.sort_unstable();
    places.dedup();
    places.into_iter().map(|i| seen[i]).collect()
}

/// Returns whether the residuals are as small as stated.
fn is_clean(found: &PoseEstimate) -> bool {
    !is_unlikely(found.chi2, found.degrees_of_freedom)
}

fn minima(found: &PoseEstimate) -> Vec<Hypothesis> {
    let likely = found.minima().filter(|h| LEAST_WEIGHT < h.probability);
    likely
        .filter_map(|h| hypothesis(h.minimum.cam_from_target, h.minimum.covariance, h.probability))
        .collect()
}

fn hypothesis(cam_from_target: Pose, covariance: Matrix6, probability: f64) -> Option<Hypothesis> {
    let size = (-(sharpness(&covariance)? + probability.ln()) / 3.0).exp();
    Some(Hypothesis { cam_from_target, covariance, probability, size })
}

/// Returns −½ ln |Σ|; none where Σ is no covariance.
pub(super) fn sharpness(covariance: &Matrix6) -> Option<f64> {
    let factor = covariance.cholesky()?;
    let sum: f64 = (0..6).map(|i| factor.l_dirty()[(i, i)].ln()).sum();
    sum.is_finite().then_some(-sum)
}

/// Refines each minimum of the squared loss under a loss on which wrong points have little influence; adds a consensus where none of the results
/// is near the points.
fn without_wrong_points(plain: &[Hypothesis], seen: &[Correspondence], camera: &Camera) -> Vec<Hypothesis> {
    let mut found: Vec<(f64, Hypothesis)> = Vec::new();
    for start in plain {
        found.extend(settled(start.cam_from_target, seen, camera));
    }
    let spread = |f: &(f64, Hypothesis)| f.0;
    if found.iter().map(spread).fold(f64::INFINITY, f64::min) > FAR_SPREAD {
        found.extend(by_consensus(seen, camera).and_then(|pose| settled(pose, seen, camera)));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Of duplicates the first remains; a pose whose points are twice as far off is no alternative.
    let best = found.first().map_or(0.0, spread);
    let mut kept: Vec<Hypothesis> = Vec::new();
    for (spread, h) in found {
        let is_duplicate = |k: &Hypothesis| k.cam_from_target.angle_to_rad(&h.cam_from_target) < 1e-4;
        if spread <= 4.0 * best && !kept.iter().any(is_duplicate) {
            kept.push(h);
        }
    }
    let probability = 1.0 / kept.len().max(1) as f64;
    kept.iter_mut().for_each(|h| h.probability = probability);
    kept
}

/// Variance of the inner half of the points, ten standard deviations squared, above which the squared loss has failed.
const FAR_SPREAD: f64 = 100.0;

/// Returns the minimum under Cauchy's loss, its threshold narrowed with the residuals, and the variance of its inner half.
fn settled(start: Pose, seen: &[Correspondence], camera: &Camera) -> Option<(f64, Hypothesis)> {
    let mut pose = start;
    for _ in 0..4 {
        let sigmas = CAUCHY_SIGMAS * variance(&pose, seen, camera)?.max(1.0).sqrt();
        let problem = Problem { loss: Loss::Cauchy { sigmas }, ..Problem::new(seen, camera) };
        pose = refine_problem(&pose, &problem).ok()?.cam_from_target;
    }
    let spread = variance(&pose, seen, camera)?;
    let sigmas = CAUCHY_SIGMAS * spread.max(1.0).sqrt();
    let found =
        refine_problem(&pose, &Problem { loss: Loss::Cauchy { sigmas }, ..Problem::new(seen, camera) })
            .ok()?;
    Some((spread, hypothesis(found.cam_from_target, found.covariance * spread.max(1.0), 1.0)?))
}

/// Returns the variance in units of the stated one, from the median of the squared residuals, corrected for the six unknowns of the pose.
fn variance(cam_from_target: &Pose, seen: &[Correspondence], camera: &Camera) -> Option<f64> {
    let squared =
        |c: &Correspondence| whitened_residual(cam_from_target, c, camera).map_or(f64::INFINITY, |r| r.2);
    let mut all: Vec<f64> = seen.iter().map(squared).collect();
    let n = all.len() as f64;
    let free = n / (n - 3.0).max(1.0);
    Some(median(&mut all)? / MEDIAN_CHI2 * free).filter(|v| v.is_finite())
}

/// Returns whether the points fit one pose by their own camera: the inner half of them, at the best of its poses, has at most twice the stated
/// noise. True for an observation without a pose.
pub(super) fn fits_alone(
    poses: &Result<Vec<Hypothesis>, Error>,
    seen: &[Correspondence],
    camera: &Camera,
) -> bool {
    let Ok(poses) = poses else { return true };
    let spread = |h: &Hypothesis| variance(&h.cam_from_target, seen, camera);
    poses.iter().filter_map(spread).fold(f64::INFINITY, f64::min) < LARGEST_ALONE
}

/// Largest variance of an observation that fits by itself, in units of the stated one.
const LARGEST_ALONE: f64 = 4.0;

/// Returns the median, the upper of two; none for an empty list.
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn by_consensus(seen: &[Correspondence], camera: &Camera) -> Option<Pose> {
    let sigma_px = seen.iter().map(|c| c.sigma_px).fold(0.0, f64::max);
    let config = robust::Config {
        max_samples: MAX_SAMPLES,
        ..robust::Config::with_threshold_px(super::GATE_SIGMAS * sigma_px)
    };
    consensus(seen, camera, &config).ok().map(|found| found.estimate.cam_from_target)
}
