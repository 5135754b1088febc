//! The share of contradicted intrinsics in the covariance of a rig. docs/math/rig.md section 11.
//!
//! Intrinsics are taken as exact until views agree that some camera's are not. From then on every camera's intrinsics are as uncertain as their
//! estimated offset, and poses follow them: a focal length 3 % off moves a camera by 3 % of its distance from the board, hardly visible in
//! residuals.

use super::lens_score::{LensScore, LensStep};
use crate::Matrix6;
use crate::least_squares::rig::Common;
use crate::statistics::variance_ratio::as_normal;
use nalgebra::{DMatrix, DVector, Matrix4, SMatrix};

/// One in ten thousand, as in the other tests. Standard normal quantile.
const QUANTILE: f64 = 3.719;
/// Errors that points share within a view are expected to be no larger than the noise: this counts as so many views that say so.
pub(super) const EXPECTED_DEGREES: f64 = 8.0;
/// Fewer views beyond the number of parameters do not show what they share.
const LEAST_DEGREES: f64 = 4.0;

/// The uncertainty of one camera's parameters, and the derivatives of the poses by them.
struct LensUncertainty<'a> {
    /// E θ θᵀ.
    squared: Matrix4<f64>,
    following: &'a [Common; 4],
}

/// The share of the intrinsics in the covariances; empty where nothing contradicts them.
pub(super) struct LensDoubts<'a> {
    doubts: Vec<LensUncertainty<'a>>,
}

impl<'a> LensDoubts<'a> {
    pub(super) fn none() -> Self {
        LensDoubts { doubts: Vec::new() }
    }

    pub(super) fn new(lenses: &'a [Option<LensScore>], variance: f64) -> Self {
        let known = || lenses.iter().flatten();
        if !known().any(|lens| QUANTILE < contradiction(lens, variance)) {
            return Self::none();
        }
        let doubt = |lens: &'a LensScore| {
            let four = lens.four(variance).map(|step| squared(&step));
            let three = || lens.three(variance).map(|step| squared(&step).fixed_resize(0.0));
            Some(LensUncertainty { squared: four.or_else(three)?, following: &lens.following })
        };
        LensDoubts { doubts: known().filter_map(doubt).collect() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.doubts.is_empty()
    }

    /// Adds the share to the covariance of the shared blocks.
    pub(super) fn add_to_shared(&self, covariance: &mut DMatrix<f64>) {
        for doubt in &self.doubts {
            let by: [&DVector<f64>; 4] = doubt.following.each_ref().map(|f| &f.shared);
            let moved = DMatrix::from_fn(covariance.nrows(), 4, |i, k| by[k][i]);
            *covariance += &moved * doubt.squared * moved.transpose();
        }
    }

    /// Adds the share to the covariance of a body in a view.
    pub(super) fn add_to_body(&self, covariance: &mut Matrix6, body: usize) {
        for doubt in &self.doubts {
            let moved =
                SMatrix::<f64, 6, 4>::from_columns(&doubt.following.each_ref().map(|f| f.bodies[body]));
            *covariance += moved * doubt.squared * moved.transpose();
        }
    }
}

/// Returns E θ θᵀ about the value given, without prior knowledge.
fn squared<const N: usize>(step: &LensStep<N>) -> SMatrix<f64, N, N> {
    step.x * step.x.transpose() + step.by_views.unwrap_or(step.by_points)
}

/// Returns the contradiction between observations and lens as a standard normal number: the largest of focal length alone and of all that is
/// shown.
fn contradiction(lens: &LensScore, variance: f64) -> f64 {
    let focal = lens.step::<1>(variance).map(|step| unlikely(&step));
    let all = lens.step::<4>(variance).map(|step| unlikely(&step));
    let all = all.or_else(|| lens.step::<3>(variance).map(|step| unlikely(&step)));
    focal.into_iter().chain(all).fold(0.0, f64::max)
}

/// Returns how unlikely a step is by chance, as a standard normal number: docs/math/rig.md eqs. (19), (20). Few views tell how far they scatter
/// along the step, many how far in each direction.
fn unlikely<const N: usize>(step: &LensStep<N>) -> f64 {
    let p = N as f64;
    let (Some(chi2), Some((excess, degrees))) =
        (step.by_points.try_inverse().map(|c| step.x.dot(&(c * step.x))), excess(step))
    else {
        return 0.0;
    };
    let degrees_of_views = degrees - EXPECTED_DEGREES;
    if degrees_of_views < LEAST_DEGREES {
        return 0.0;
    }
    let along_step = as_normal(chi2 / excess / p, p, degrees);
    let chi2_of_views = step.by_views.and_then(|c| Some(step.x.dot(&(c.try_inverse()? * step.x))));
    let by_views = chi2_of_views.filter(|c| 0.0 <= *c).map_or(0.0, |c| as_normal(c / p, p, degrees_of_views));
    along_step.max(by_views.min(as_normal(chi2 / p, p, f64::INFINITY)))
}

/// Returns by how much errors that views share widen the variance along a step, at least 1, and its degrees of freedom: docs/math/rig.md eq. (19).
pub(super) fn excess<const N: usize>(step: &LensStep<N>) -> Option<(f64, f64)> {
    let along = step.by_points.try_inverse()? * step.x;
    let chi2 = step.x.dot(&along);
    let degrees_of_views = step.n_views.saturating_sub(N) as f64;
    let scatter = if 0.0 < chi2 { along.dot(&(step.of_views * along)) / chi2 } else { 1.0 };
    let degrees = EXPECTED_DEGREES + degrees_of_views;
    Some((f64::max(1.0, (EXPECTED_DEGREES + degrees_of_views * scatter) / degrees), degrees))
}
