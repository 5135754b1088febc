//! How probable is each minimum? Laplace's approximation of the likelihood's mass about it.
//!
//! ```text
//!   wᵢ ∝ exp(−Δχ²ᵢ/2s) √det Σᵢ,   Σ wᵢ = 1
//!   Σᵢ  covariance of minimum i by the pixels' sigmas  ·  s ≥ 1  variance by which the residuals exceed the stated sigmas
//! ```
//! The prior is flat over poses: rotations alike, places alike. Derivation, and where it fails: docs/math/posterior.md eqs. (1)–(6).

use crate::least_squares::ALTERNATIVE_MARGIN_CHI2;
use crate::locate::choose::{Minima, Minimum, are_within, count_alternatives};
use crate::locate::curvature::Bends;
use arrayvec::ArrayVec;
use nalgebra::Matrix3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Probabilities of minima, in their order.
pub(crate) type Weights = ArrayVec<f64, 8>;

/// The share of the likelihood's mass that each minimum holds.
///
/// Farther above the first than `ALTERNATIVE_MARGIN_CHI2` it is given as 0: it is below e⁻⁵⁰ times a ratio of volumes.
pub(crate) fn weights(minima: &Minima, noise_scale: f64) -> Weights {
    let Some((best, others)) = minima.split_first() else { return Weights::new() };
    let above = |m: &Minimum| m.cost_above(best, noise_scale) / noise_scale;
    let is_near = |m: &Minimum| above(m) < ALTERNATIVE_MARGIN_CHI2;
    let mut weights: Weights = core::iter::once(1.0).collect();
    if !others.iter().any(is_near) {
        weights.extend(others.iter().map(|_| 0.0));
        return weights;
    }
    let volume = volume_squared(best);
    for m in others {
        // Volumes that leave the range of numbers compare as equal: the costs are left.
        let ratio = Some(volume_squared(m) / volume).filter(|r| r.is_normal() && 0.0 < *r).unwrap_or(1.0);
        let mass = (-0.5 * above(m)).exp() * ratio.sqrt();
        weights.push(if is_near(m) { mass } else { 0.0 });
    }
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= total);
    weights
}

/// Removes minima that are one with a lower minimum where the residuals exceed the stated noise: the valley is then flatter by as much, and two
/// descents may end in it at places that the stated noise would distinguish.
pub(crate) fn merge(minima: &mut Minima, bends: &mut Bends, noise_scale: f64) {
    if noise_scale <= 1.0 {
        return;
    }
    let mut i = 1;
    while i < minima.len() {
        if !minima[..i].iter().any(|m| are_within(m, &minima[i], noise_scale)) {
            i += 1;
            continue;
        }
        minima.remove(i);
        if i < bends.len() {
            bends[i..].rotate_left(1);
            bends[bends.len() - 1] = None;
        }
    }
}

/// A minimum whose rotation is known worse than this leads no sharper one: there the quadratic form that its mass is taken from reaches around
/// the whole circle, and the determinant of so bad a covariance is rounding. One view in 10,000 at 4–15 m and 1 px.
const FLAT_RAD: f64 = 0.5;

/// Puts the minima that second solution each other in order of probability, the more probable first, with what belongs to each: of two poses that
/// fit, the broader one may be the more probable though its χ² is a little higher. What lies outside the gate stays where it is, and a
/// minimum too flat for its probability to mean much overtakes nothing.
pub(crate) fn lead_with_the_most_probable(
    minima: &mut Minima,
    weights: &mut Weights,
    bends: &mut Bends,
    noise_scale: f64,
    gate: f64,
) {
    for i in 1..count_alternatives(minima, noise_scale, gate) {
        let mut place = i;
        while 0 < place && weights[place - 1] < weights[place] && !is_flat(&minima[place]) {
            minima.swap(place - 1, place);
            weights.swap(place - 1, place);
            bends.swap(place - 1, place);
            place -= 1;
        }
    }
}

fn is_flat(m: &Minimum) -> bool {
    FLAT_RAD * FLAT_RAD < (0..3).map(|i| m.covariance[(i, i)]).fold(0.0, f64::max)
}

/// det Σ = det Σ_ωω · det(Σ_νν − Σ_νω Σ_ωω⁻¹ Σ_ων), docs/math/posterior.md eq. (4).
fn volume_squared(m: &Minimum) -> f64 {
    let block = |i: usize, j: usize| -> Matrix3<f64> { m.covariance.fixed_view::<3, 3>(i, j).into_owned() };
    let (turns, cross) = (block(0, 0), block(0, 3));
    let Some(inverse) = turns.try_inverse() else { return f64::NAN };
    turns.determinant() * (block(3, 3) - cross.transpose() * inverse * cross).determinant()
}
