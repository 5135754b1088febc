//! The covariance of the shared unknowns: from the noise of the residuals, and the contradictions between views.
//! docs/math/intrinsics.md section 6; the scatter of views as docs/math/clustered.md, for one block of any size.

use super::adjust::Fit;
use super::blocks::{self, alone};
use crate::least_squares::shared::Reduced;
use crate::locate::consistency::noise_scale;
use crate::statistics::chi_square::quantile;
use nalgebra::DMatrix;

/// The source of the noise of the corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Noise {
    /// The residuals; the stated sigmas are weights.
    #[default]
    Estimated,
    /// The stated sigmas, increased where the residuals prove them too small.
    Stated,
}

/// The covariance of the shared unknowns, and its parts.
#[derive(Debug, Clone)]
pub(super) struct Spread {
    /// The covariance of the free directions and the shape.
    pub(super) covariance: DMatrix<f64>,
    /// Factor on the stated variances.
    pub(super) noise: f64,
    /// Further factor on the variances, because views contradict each other; 1 where they do not.
    pub(super) contradiction: f64,
    /// Further factor on the variances, because blocks of views in sequence contradict each other; 1 where they do not.
    pub(super) blocks: f64,
}

/// With less redundancy the stated sigmas are used.
const LEAST_REDUNDANCY: usize = 30;
/// The leverage of a view is kept at least this far below one.
const RIDGE: f64 = 1e-6;
/// Probability that views without a shared error seem to contradict each other.
const CHANCE: f64 = 0.01;

/// Computes the covariance; `None` where a direction is undetermined.
pub(super) fn spread(fit: &Fit, stated: Noise) -> Option<Spread> {
    let inverse = fit.reduced()?.information.cholesky()?.inverse();
    let noise = noise_factor(fit, stated);
    let by_view: Vec<Reduced> = scores(fit, &inverse);
    let blocks = blocks::factor(&by_view, &inverse, noise);
    let Some(scatter) = Scatter::of(&inverse, &by_view, noise) else {
        return Some(Spread { covariance: inverse * (noise * blocks), noise, contradiction: 1.0, blocks });
    };
    let (covariance, contradiction) = scatter.covariance(&inverse, noise);
    Some(Spread { covariance: covariance * blocks, noise, contradiction, blocks })
}

fn noise_factor(fit: &Fit, stated: Noise) -> f64 {
    let degrees_of_freedom = fit.degrees_of_freedom();
    match stated {
        Noise::Estimated if LEAST_REDUNDANCY <= degrees_of_freedom => fit.chi2() / degrees_of_freedom as f64,
        _ => noise_scale(fit.chi2(), degrees_of_freedom),
    }
}

/// Returns the information of each view at the minimum: the equations belong to the state one vanishing step before it.
pub(super) fn scores(fit: &Fit, inverse: &DMatrix<f64>) -> Vec<Reduced> {
    let mut by_view: Vec<Reduced> = fit.reduced_by_view().into_iter().flatten().collect();
    let Some(total) = fit.reduced() else { return by_view };
    let step = inverse * total.gradient;
    by_view.iter_mut().for_each(|r| r.gradient -= &r.information * &step);
    by_view
}

/// The scatter of the answers without one view.
struct Scatter {
    /// P Σ w wᵀ P / e, docs/math/clustered.md eq. (5).
    moved: DMatrix<f64>,
    /// Its whitened form Σ y yᵀ, and Σ |y|⁴.
    whitened: DMatrix<f64>,
    fourth: f64,
    n_views: usize,
}

impl Scatter {
    /// Computes the scatter; `None` where the views do not contradict each other.
    fn of(inverse: &DMatrix<f64>, by_view: &[Reduced], base: f64) -> Option<Self> {
        let k = inverse.nrows();
        let factor = inverse.clone().cholesky()?.l();
        let whitening = factor.clone().try_inverse()?;
        let (mut chi2, mut rank) = (0.0, 0);
        for one in by_view {
            let (own, seen) = alone(one, &factor, by_view.len());
            chi2 += own;
            rank += seen;
        }
        if rank <= k || chi2 <= base * quantile(rank - k, CHANCE) {
            return None;
        }
        let (mut meat, mut expected, mut nominal) = (DMatrix::zeros(k, k), 0.0, 0.0);
        let mut moves = Vec::with_capacity(by_view.len());
        for one in by_view {
            let leverage = &one.information * inverse;
            let left = (DMatrix::identity(k, k) * (1.0 + RIDGE) - &leverage).try_inverse()?;
            expected += (&leverage * &left).trace();
            nominal += leverage.trace();
            let w = left * &one.gradient;
            meat += &w * w.transpose();
            moves.push(inverse * w);
        }
        let excess = if 0.0 < nominal { expected / nominal } else { 1.0 };
        let y = moves.iter().map(|moved| &whitening * moved / excess.sqrt());
        let (mut whitened, mut fourth) = (DMatrix::zeros(k, k), 0.0);
        for y in y {
            whitened += &y * y.transpose();
            fourth += y.norm_squared().powi(2);
        }
        let moved = inverse * meat * inverse / excess;
        Some(Scatter { moved, whitened, fourth, n_views: by_view.len() })
    }

    /// Computes docs/math/clustered.md eqs. (6) to (10) for one block, and its trace over that of `base` P.
    fn covariance(&self, inverse: &DMatrix<f64>, base: f64) -> (DMatrix<f64>, f64) {
        let p = inverse.nrows() as f64;
        let sum = self.whitened.trace();
        let factor = sum / p;
        if !(base < factor && 0.0 < self.fourth) {
            return (inverse * base, 1.0);
        }
        let most = (self.n_views as f64 - 1.0).max(1.0);
        let clusters = ((1.0 + 2.0 / p) * sum * sum / self.fourth).clamp(1.0, most);
        let apart =
            (&self.whitened - DMatrix::identity(inverse.nrows(), inverse.nrows()) * factor).norm_squared();
        let chance = (p * p + p - 2.0) * factor * factor / clusters;
        let share = if apart <= chance { 0.0 } else { 1.0 - chance / apart };
        let share = share.min((factor - base) / factor);
        let widening = 1.0 + share * share * (p + 1.0) / clusters + 2.0 / (p * clusters);
        let covariance = inverse * ((factor - share * factor) * widening) + &self.moved * (share * widening);
        (covariance, factor * widening / base)
    }
}
