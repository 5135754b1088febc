//! Does the residual agree with the stated sigmas? The only place that answers.

use crate::locate::choose::Minimum;
use crate::locate::prior::Prior;
use crate::locate::problem::Problem;
use crate::locate::refine::{refine_problem, whitened_residual};
use crate::locate::sandwich::evidence;
use crate::statistics::chi_square::quick_quantile;
use arrayvec::ArrayVec;

/// Does the residual agree with the stated sigmas?
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Consistency {
    /// As large as the sigmas say, or no redundancy to tell.
    Consistent,
    /// Far larger: wrong intrinsics, target or labels. The covariance is widened by `chi2_per_degree_of_freedom`.
    Inconsistent {
        /// χ² over degrees of freedom.
        chi2_per_degree_of_freedom: f64,
        /// Index of the point with the largest normalised residual.
        worst_point: usize,
        /// Its residual, px.
        worst_px: f64,
        /// Index of a prior without which the rest agrees with its sigmas: what is wrong is that prior, not a point.
        worst_prior: Option<usize>,
    },
}

impl Consistency {
    /// Every number in it is one.
    pub(crate) fn is_finite(&self) -> bool {
        match self {
            Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_px, .. } => {
                chi2_per_degree_of_freedom.is_finite() && worst_px.is_finite()
            }
            Consistency::Consistent => true,
        }
    }
}

/// One in ten thousand: the chance of calling a good answer inconsistent. Standard normal quantile.
const QUANTILE: f64 = 3.719;
/// "Far above": residuals twice as large as stated. Below it the covariance widens but nothing is called wrong.
pub(crate) const FAR_ABOVE: f64 = 4.0;

/// χ² that good data exceed once in ten thousand, docs/math/refine.md eq. (17).
pub(crate) fn unlikely_above(degrees_of_freedom: usize) -> f64 {
    quick_quantile(degrees_of_freedom as f64, QUANTILE)
}

/// Whether data as good as stated would hardly give such a χ²: once in ten thousand.
pub fn is_unlikely(chi2: f64, degrees_of_freedom: usize) -> bool {
    0 < degrees_of_freedom && unlikely_above(degrees_of_freedom) < chi2
}

/// Residuals of corners and lenses that are as good as calibrations leave them are smaller than this over the focal length.
pub(crate) const NOISY_FOCAL: f64 = 0.002;

/// The rule by which the residual of any job (a pose, a rig, a pose graph, a hand–eye calibration, a network, a touch) is inconsistent: data as
/// good as stated would hardly give it, and it is at least twice as large as stated.
pub fn is_inconsistent(chi2: f64, degrees_of_freedom: usize) -> bool {
    is_unlikely(chi2, degrees_of_freedom) && FAR_ABOVE * degrees_of_freedom as f64 <= chi2
}

/// Spoilt data leave out at most so many of a camera's observations, of an observation's points, of a graph's pairs: on recordings with right
/// files cameras lose up to 4 of 47 observations and 2 % of their points (chessboard pairs: none of 13, 1 to 14 of 702 points; four
/// webcams, not synchronised: 0 to 4 of 23 to 47, 2 % of points), halves and thirds of them up to 2 of 15; with a wrong file, swapped
/// detections or labels of another view 17 % and more.
const SPOILT_SHARE: f64 = 0.15;
/// Up to so many may be spoilt whatever the share: a flipped tag and a blurred image.
const FEW: usize = 2;

/// The other half of the rule: whether a camera, a target, a view or a graph loses more of what was seen than a few spoilt images
/// explain, most of it in any case. What is counted (observations, points, pairs, stations) is for the caller to say, one kind at a time.
pub fn loses_too_many(n_lost: usize, n_seen: usize) -> bool {
    n_seen < 2 * n_lost || (FEW < n_lost && SPOILT_SHARE * (n_seen as f64) < n_lost as f64)
}

/// The χ² above which [`is_inconsistent`] says so.
#[cfg(feature = "std")]
pub(crate) fn inconsistent_above(degrees_of_freedom: usize) -> f64 {
    unlikely_above(degrees_of_freedom).max(FAR_ABOVE * degrees_of_freedom as f64)
}

/// The factor by which variances exceed the stated ones: 1 unless the residual proves it.
pub(crate) fn noise_scale(chi2: f64, degrees_of_freedom: usize) -> f64 {
    if is_unlikely(chi2, degrees_of_freedom) { chi2 / degrees_of_freedom as f64 } else { 1.0 }
}

/// The variance by which the residuals of a minimum exceed the stated sigmas.
pub(crate) fn noise_of(m: &Minimum, problem: &Problem) -> f64 {
    let (chi2, degrees_of_freedom) = evidence(m, problem);
    noise_scale(chi2, degrees_of_freedom)
}

/// Smaller residuals, a hundredth of the stated sigmas, are those of exact data, which show nothing but rounding.
#[cfg(feature = "std")]
const LEAST_SCALE: f64 = 1e-4;

/// The factor of `noise_scale`, below 1 where the residual proves the stated variances too large: then the largest that it leaves likely. It is for
/// tests of an effect against the noise, which overstated sigmas would hide.
#[cfg(feature = "std")]
pub(crate) fn measured_scale(chi2: f64, degrees_of_freedom: usize) -> f64 {
    let scale = noise_scale(chi2, degrees_of_freedom);
    let least = quick_quantile(degrees_of_freedom as f64, -QUANTILE);
    if 1.0 < scale || !(0.0 < least) { scale } else { (chi2 / least).clamp(LEAST_SCALE, 1.0) }
}

/// The verdict, with the worst point.
pub(crate) fn consistency(best: &Minimum, problem: &Problem) -> Consistency {
    let (chi2, degrees_of_freedom) = evidence(best, problem);
    judged(best, problem, chi2, degrees_of_freedom)
}

/// The same where more than the pose was estimated: `best.chi2` has so many degrees of freedom.
#[cfg(feature = "std")]
pub(crate) fn consistency_of(best: &Minimum, problem: &Problem, degrees_of_freedom: usize) -> Consistency {
    judged(best, problem, best.chi2, degrees_of_freedom)
}

fn judged(best: &Minimum, problem: &Problem, chi2: f64, degrees_of_freedom: usize) -> Consistency {
    if !is_inconsistent(chi2, degrees_of_freedom) {
        return Consistency::Consistent;
    }
    let (mut worst_point, mut worst_px, mut worst) = (0, 0.0, -1.0);
    for (i, c) in problem.seen.iter().enumerate() {
        if let Some((_, e, whitened)) = whitened_residual(&best.cam_from_target, c, problem.camera)
            && worst < whitened
        {
            (worst_point, worst_px, worst) = (i, e.norm(), whitened);
        }
    }
    let (chi2_per_degree_of_freedom, worst_prior) =
        (chi2 / degrees_of_freedom as f64, contradicting_prior(best, problem));
    Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_point, worst_px, worst_prior }
}

/// More priors than this are not taken out one by one.
const MAX_PRIORS: usize = 8;

/// The prior without which the rest fits best, if it then fits.
#[cold]
fn contradicting_prior(best: &Minimum, problem: &Problem) -> Option<usize> {
    if MAX_PRIORS < problem.priors.len() {
        return None;
    }
    let without = |k: usize| {
        let kept = problem.priors.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, prior)| *prior);
        let kept: ArrayVec<Prior, MAX_PRIORS> = kept.collect();
        let rest = Problem { priors: &kept, ..*problem };
        let (chi2, degrees_of_freedom) = evidence(&refine_problem(&best.cam_from_target, &rest).ok()?, &rest);
        (!is_unlikely(chi2, degrees_of_freedom)).then_some((chi2, k))
    };
    (0..problem.priors.len()).filter_map(without).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_spoilt_are_no_contradiction() {
        for (lost, seen) in [(0, 0), (0, 5), (1, 2), (2, 4), (2, 13), (4, 47), (4, 30), (14, 702)] {
            assert!(!loses_too_many(lost, seen), "{lost} of {seen}");
        }
        for (lost, seen) in [(1, 1), (2, 3), (3, 14), (7, 30), (20, 30), (253, 702)] {
            assert!(loses_too_many(lost, seen), "{lost} of {seen}");
        }
    }
}
