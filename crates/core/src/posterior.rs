//! How probable is each minimum? Laplace's approximation of the likelihood's mass about it.
//!
//! ```text
//!   wᵢ ∝ exp(−Δχ²ᵢ/2s) √det Σᵢ,   Σ wᵢ = 1
//!   Σᵢ  covariance of minimum i by the pixels' sigmas  ·  s ≥ 1  variance by which the residuals exceed the stated sigmas
//! ```
//! The prior is flat over poses: rotations alike, places alike. Derivation, and where it fails: docs/math/posterior.md eqs. (1)–(6).

use crate::choose::{Minima, Minimum};
use crate::least_squares::RIVAL_MARGIN_CHI2;
use arrayvec::ArrayVec;
use nalgebra::Matrix3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Probabilities of minima, in their order.
pub(crate) type Weights = ArrayVec<f64, 8>;

/// The share of the likelihood's mass that each minimum holds.
///
/// Farther above the first than `RIVAL_MARGIN_CHI2` it is given as 0: it is below e⁻⁵⁰ times a ratio of volumes.
pub(crate) fn weights(minima: &Minima, noise_scale: f64) -> Weights {
    let Some((best, others)) = minima.split_first() else { return Weights::new() };
    let is_near = |m: &Minimum| m.chi2 - best.chi2 < RIVAL_MARGIN_CHI2 * noise_scale;
    let mut weights: Weights = core::iter::once(1.0).collect();
    if !others.iter().any(is_near) {
        weights.extend(others.iter().map(|_| 0.0));
        return weights;
    }
    let volume = volume_squared(best);
    for m in others {
        // Volumes that leave the range of numbers compare as equal: the costs are left.
        let ratio = Some(volume_squared(m) / volume).filter(|r| r.is_normal() && 0.0 < *r).unwrap_or(1.0);
        let mass = (-(m.chi2 - best.chi2) / (2.0 * noise_scale)).exp() * ratio.sqrt();
        weights.push(if is_near(m) { mass } else { 0.0 });
    }
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    weights
}

/// det Σ = det Σ_ωω · det(Σ_νν − Σ_νω Σ_ωω⁻¹ Σ_ων), docs/math/posterior.md eq. (4).
fn volume_squared(m: &Minimum) -> f64 {
    let block = |i: usize, j: usize| -> Matrix3<f64> { m.covariance.fixed_view::<3, 3>(i, j).into_owned() };
    let (turns, cross) = (block(0, 0), block(0, 3));
    let Some(inverse) = turns.try_inverse() else { return f64::NAN };
    turns.determinant() * (block(3, 3) - cross.transpose() * inverse * cross).determinant()
}
