//! From a pose that many points agree with to the answer: least squares on those points, until the set no longer changes.

use super::search::{Found, what};
use super::{Config, Consensus};
use crate::locate::choose::Ambiguity;
use crate::locate::consistency::Consistency;
use crate::locate::loss::Loss;
use crate::locate::refine::residual_px;
use crate::locate::{PoseEstimate, locate};
use crate::{Camera, Correspondence, Error, Pose};

/// Largest number of rounds of locating and selecting the points that agree. Each lowers the truncated cost; two are usual.
const MAX_ROUNDS: usize = 30;

/// The estimate on the correspondences that agree with it.
pub(super) fn settle(
    found: Found,
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
) -> Result<Consensus, Error> {
    let mut inliers = agreeing(&found.cam_from_target, seen, camera, config);
    for _ in 0..MAX_ROUNDS {
        let n_units = n_units(&inliers, config);
        if n_units < found.needed {
            let (n, samples) = (found.evidence.n_units, found.n_samples);
            return Err(Error::NoConsensus {
                best: n_units,
                n,
                needed: found.needed,
                what: what(config),
                samples,
            });
        }
        let chosen: Vec<Correspondence> = inliers.iter().map(|row| seen[*row]).collect();
        let estimate = locate(&chosen, camera, &config.locate).map_err(|e| in_rows(e, &inliers))?;
        let next = agreeing(&estimate.cam_from_target, seen, camera, config);
        if next == inliers {
            let truncation = match config.locate.loss {
                Loss::Squared => truncation(&chosen, config.threshold_px),
                _ => 1.0, // Its sandwich measures the residuals that are there.
            };
            return Ok(Consensus {
                estimate: widened(estimate, truncation, &inliers),
                n_samples: found.n_samples,
                confidence: found.confidence,
                log10_false_alarms: found.evidence.ln_false_alarms(n_units) / core::f64::consts::LN_10,
                truncation,
                inliers,
            });
        }
        inliers = next;
    }
    Err(Error::NotConverged { steps: MAX_ROUNDS })
}

/// Rows within the threshold of a pose, through the lens itself; groups as a whole.
fn agreeing(cam_from_target: &Pose, seen: &[Correspondence], camera: &Camera, config: &Config) -> Vec<usize> {
    let limit = config.threshold_px * config.threshold_px;
    let agrees = |c: &Correspondence| {
        residual_px(cam_from_target, c, camera).is_some_and(|e| e.norm_squared() < limit)
    };
    let is_in: Vec<bool> = seen.iter().map(agrees).collect();
    let Some(groups) = config.groups else {
        return (0..seen.len()).filter(|row| is_in[*row]).collect();
    };
    let mut broken: Vec<u32> = (0..seen.len()).filter(|row| !is_in[*row]).map(|row| groups[row]).collect();
    broken.sort_unstable();
    (0..seen.len()).filter(|row| broken.binary_search(&groups[*row]).is_err()).collect()
}

fn n_units(inliers: &[usize], config: &Config) -> usize {
    let Some(groups) = config.groups else { return inliers.len() };
    let mut labels: Vec<u32> = inliers.iter().map(|row| groups[*row]).collect();
    labels.sort_unstable();
    labels.dedup();
    labels.len()
}

/// Share of a good point's squared residual that lies below the threshold, averaged with the points' weights, eq. (14).
fn truncation(chosen: &[Correspondence], threshold_px: f64) -> f64 {
    let of = |c: &Correspondence| {
        let t = 0.5 * (threshold_px / c.sigma_px).powi(2);
        // t e⁻ᵗ/(1 − e⁻ᵗ) = t/(eᵗ − 1); it vanishes for a wide threshold and is 1 − t/2 for a narrow one.
        if t < 1e-8 { 0.5 * t } else { 1.0 - t / t.exp_m1() }
    };
    let weight = |c: &Correspondence| 1.0 / (c.sigma_px * c.sigma_px);
    let sums = chosen.iter().fold((0.0, 0.0), |(a, b), c| (a + weight(c) * of(c), b + weight(c)));
    sums.0 / sums.1
}

/// The covariance of least squares on what lies below a threshold, eq. (15), and the worst point by its row.
fn widened(mut estimate: PoseEstimate, truncation: f64, inliers: &[usize]) -> PoseEstimate {
    estimate.covariance /= truncation;
    if let Ambiguity::Ambiguous { other, .. } = &mut estimate.ambiguity {
        other.covariance /= truncation;
    }
    estimate.others.iter_mut().flatten().for_each(|other| other.minimum.covariance /= truncation);
    if let Consistency::Inconsistent { worst_point, .. } = &mut estimate.consistency {
        *worst_point = inliers[*worst_point];
    }
    estimate
}

/// An error that names points of the chosen ones, in rows of the input.
fn in_rows(error: Error, inliers: &[usize]) -> Error {
    match error {
        Error::Coincident { first, second, where_ } => {
            Error::Coincident { first: inliers[first], second: inliers[second], where_ }
        }
        other => other,
    }
}
