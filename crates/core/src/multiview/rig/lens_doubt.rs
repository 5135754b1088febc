//! The share of contradicted intrinsics in the covariance of a rig. docs/math/rig.md section 11.
//!
//! Intrinsics are taken as exact until views agree that some camera's are not. From then on every camera's intrinsics are as uncertain as their
//! estimated offset, and poses follow them: a focal length 3 % off moves a camera by 3 % of its distance from the board, hardly visible in
//! residuals.

use super::lens_score::{LensScore, LensStep, Shared};
use crate::Matrix6;
use crate::least_squares::rig::Common;
use crate::statistics::variance_ratio::as_normal;
use nalgebra::{DMatrix, DVector, Matrix4, SMatrix};

/// One in ten thousand for each camera, as in the other tests: the covariance may grow a thousandfold. Standard normal quantile.
const QUANTILE: f64 = 3.719;

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

    pub(super) fn new(lenses: &'a [Option<LensScore>], variance: f64, shared: &Shared) -> Self {
        let known = || lenses.iter().flatten();
        if !known().any(|lens| QUANTILE < contradiction(lens, variance, shared)) {
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

/// Returns the contradiction between views and lens as a standard normal number: the lesser of those by points and by views.
fn contradiction(lens: &LensScore, variance: f64, shared: &Shared) -> f64 {
    match (lens.four(variance), lens.three(variance)) {
        (Some(four), _) => by_both(lens, four, variance, shared),
        (None, Some(three)) => by_both(lens, three, variance, shared),
        (None, None) => 0.0,
    }
}

fn by_both<const N: usize>(lens: &LensScore, mut step: LensStep<N>, variance: f64, shared: &Shared) -> f64 {
    let rough = unlikely(&step);
    // Taking off the whole leverage of a view costs as much as an elimination and can only lower the result.
    if rough <= QUANTILE || shared.clusters.is_empty() {
        return rough;
    }
    step.by_views = Some(lens.whole_scatter(&step, variance, shared));
    rough.min(unlikely(&step))
}

fn unlikely<const N: usize>(step: &LensStep<N>) -> f64 {
    let p = N as f64;
    let chi2 = |covariance: &SMatrix<f64, N, N>| Some(step.x.dot(&(covariance.try_inverse()? * step.x)));
    let left = step.n_views.saturating_sub(N) as f64;
    let by_views = step.by_views.as_ref().and_then(chi2).filter(|c| 0.0 <= *c);
    match (chi2(&step.by_points), by_views) {
        (Some(points), Some(views)) => {
            as_normal(points / p, p, f64::INFINITY).min(as_normal(views / p, p, left))
        }
        _ => 0.0,
    }
}
