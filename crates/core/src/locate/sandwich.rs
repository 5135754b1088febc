//! What a loss other than the square makes of covariance and χ².
//!
//! With ψ = ρ′(s) r the pull of a residual, the minimum scatters by A⁻¹ B A⁻¹, A = Σ Jᵀ E[∂ψ/∂r] J, B = Σ Jᵀ E[ψψᵀ] J. Good points
//! are taken at their word (unit normal residuals, for which both expectations are known numbers), wrong ones as they are seen to
//! pull: docs/math/refine.md eqs. (19)–(22).

use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::accumulate::{normal_equations, whitened_residual};
use crate::locate::choose::Minimum;
use crate::locate::factor;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

use crate::{Matrix6, Point, Pose};

/// A squared residual that one good point in a thousand exceeds: χ² of two coordinates.
const WRONG: f64 = 13.816;
/// Nodes of the expectations over good residuals, at equal shares of their probability: exact to 1 %.
const NODES: usize = 64;

/// Means over points of the weight ρ′, of the stiffness E[∂ψ/∂r] and of the pull E[ψψᵀ], per coordinate.
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    weight: f64,
    stiffness: f64,
    pull: f64,
}

impl Moments {
    fn add(&mut self, weight: f64, stiffness: f64, pull: f64, times: f64) {
        self.weight += weight * times;
        self.stiffness += stiffness * times;
        self.pull += pull * times;
    }

    /// Of good residuals: s is exponential with mean 2, and E[∂ψ/∂r] = E[ψᵀr]/2 (Stein), jumps of ρ′ included.
    fn of_good(loss: Loss) -> Self {
        let mut sum = Moments::default();
        for i in 0..NODES {
            let squared = -2.0 * (1.0 - (i as f64 + 0.5) / NODES as f64).ln();
            let weight = loss.at(squared).1;
            sum.add(weight, 0.5 * weight * squared, 0.5 * weight * weight * squared, 1.0 / NODES as f64);
        }
        sum
    }

    /// Over the points of a problem: a point beyond `WRONG` counts as it is seen: across its residual the pull stiffens as
    /// its weight, along it no longer.
    fn of(problem: &Problem, cam_from_target: &Pose) -> Option<Self> {
        let good = Moments::of_good(problem.loss);
        let share = 1.0 / problem.seen.len().max(1) as f64;
        let mut sum = Moments::default();
        for c in problem.seen {
            let (_, _, squared) = whitened_residual(cam_from_target, c, problem.camera)?;
            let weight = problem.loss.at(squared).1;
            if squared <= WRONG {
                sum.add(good.weight, good.stiffness, good.pull, share);
            } else {
                sum.add(weight, 0.5 * weight, 0.5 * weight * weight * squared, share);
            }
        }
        Some(sum)
    }
}

/// Factors on the information of the points under a loss, Σ ρ′ JᵀC⁻¹J: A and B of docs/math/refine.md eq. (22). Both are 1 for the square.
pub(crate) struct Pull {
    /// For A.
    pub(crate) stiffness: f64,
    /// For B.
    pub(crate) pull: f64,
}

impl Pull {
    /// None where a point leaves the field.
    pub(crate) fn of(problem: &Problem, cam_from_target: &Pose) -> Option<Self> {
        if problem.loss == Loss::Squared {
            return Some(Pull { stiffness: 1.0, pull: 1.0 });
        }
        let moments = Moments::of(problem, cam_from_target)?;
        Some(Pull { stiffness: moments.stiffness / moments.weight, pull: moments.pull / moments.weight })
    }
}

/// What a loss makes of the inverse of its own information, good points alone: E[ρ′] E[ψψᵀ] / E[∂ψ/∂r]², docs/math/refine.md eq. (20).
#[cfg(feature = "std")]
pub(crate) fn widening(loss: Loss) -> f64 {
    if loss == Loss::Squared {
        return 1.0;
    }
    let good = Moments::of_good(loss);
    good.weight * good.pull / (good.stiffness * good.stiffness)
}

/// A⁻¹ B A⁻¹ of the small left motion of the camera frame; none where the points do not determine the pose.
#[cold]
pub(crate) fn sandwich(
    place: &PivotedPose,
    pivot: &Point,
    normal: &NormalEquations,
    problem: &Problem,
) -> Option<Matrix6> {
    let Pull { stiffness, pull } = Pull::of(problem, &place.pose(pivot))?;
    let of_points = normal_equations(place, pivot, &Problem { priors: &[], ..*problem })?.information();
    let of_priors = normal.information() - of_points;
    let scaled = |by: f64| of_points * by + of_priors;
    let inverse = scaled(stiffness).cholesky()?.inverse();
    let about_pivot = inverse * scaled(pull) * inverse;
    let mut transport = Matrix6::identity();
    transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&place.pivot_in_cam.cross_matrix());
    let covariance = transport * about_pivot * transport.transpose();
    covariance.sum().is_finite().then(|| crate::pose::symmetric(&covariance))
}

/// The χ² and degrees of freedom by which stated sigmas are judged. A robust loss is there because some points are wrong: they are
/// set apart, unless they are most of them.
pub(crate) fn evidence(m: &Minimum, problem: &Problem) -> (f64, usize) {
    let degrees_of_freedom = problem.degrees_of_freedom();
    if problem.loss == Loss::Squared {
        return (m.chi2, degrees_of_freedom);
    }
    let of_priors: f64 = problem.priors.iter().map(|prior| factor::chi2(prior, &m.cam_from_target)).sum();
    let (mut good, mut all, mut n_wrong) = (of_priors, of_priors, 0);
    for c in problem.seen {
        let Some((_, _, squared)) = whitened_residual(&m.cam_from_target, c, problem.camera) else {
            continue;
        };
        all += squared;
        if squared <= WRONG { good += squared } else { n_wrong += 1 }
    }
    if problem.seen.len() < 2 * n_wrong {
        return (all, degrees_of_freedom);
    }
    (good, degrees_of_freedom.saturating_sub(2 * n_wrong))
}
