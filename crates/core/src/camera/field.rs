//! The valid field, in which a lens model is one-to-one, and the inverse of the model there.
//!
//! A polynomial lens model folds: beyond some radius two directions share a pixel, and an inverse that ignores this returns the wrong one. Each
//! model computes its first fold once, when it is created. Derivations: docs/math/camera.md, section 2.

use super::Pixel;
use crate::Error;
use nalgebra::{Matrix2, Vector2};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// tan 89°, the limit of plane models (radius = tan θ): beyond it f64 does not represent a pixel to 1e-9 px any more.
pub(super) const RADIUS_CAP: f64 = 57.29;
/// The limit of the sphere models if they do not fold before: their derivative with respect to the angle grows as the radius squared.
pub(super) const SPHERE_RADIUS_CAP: f64 = 20.0;
/// Fields also end where a lens stretches the image this many times more than at its centre: nothing is calibrated there, and one rounding error
/// of the bearing would be 1e-9 px.
pub(super) const GREATEST_SLOPE: f64 = 50.0;
/// Squared distances from the camera, m², outside which squares underflow or overflow.
const SQUARED_DISTANCE: core::ops::Range<f64> = 1e-200..1e200;
/// Residual allowed after an inversion, px.
pub(super) const RESIDUAL_PX: f64 = 1e-9;
/// The inverse remains this far (relative) inside the field, so that rounding cannot move its result across the edge.
pub(super) const INSIDE: f64 = 1.0 - 8.0 * f64::EPSILON;
/// A pixel this far (relative) beyond the edge still counts as being on it.
pub(super) const ON_EDGE: f64 = 1.0 + 8.0 * f64::EPSILON;
/// Largest number of terms of a polynomial.
const MAX_TERMS: usize = 16;

/// Returns false for NaN, infinity and distances whose square is outside the range of f64.
#[inline]
pub(super) fn distance_is_usable(squared_m2: f64) -> bool {
    SQUARED_DISTANCE.contains(&squared_m2)
}

/// Returns the error for a pixel outside the field.
pub(super) fn outside(pixel: &Pixel, model: &'static str, limit: &'static str, limit_at: f64) -> Error {
    Error::OutsideField { u_px: pixel.x, v_px: pixel.y, model, limit, limit_at }
}

/// Returns `m` if it is in the disc of `radius_max`, moved to `INSIDE` if it is on the edge.
pub(super) fn within(m: Vector2<f64>, radius_max: f64) -> Option<Vector2<f64>> {
    let radius = m.norm();
    (radius <= radius_max * ON_EDGE).then(|| into_disc(m, radius_max * INSIDE))
}

/// Returns the largest `b ≤ upper` such that Σ c_k t^k > 0 on all of [0, b).
///
/// Marches from 0 in steps that provably skip no zero: at `a` positive Taylor coefficients only help, so that the polynomial remains positive at
/// least as long as c₀ + Σ min(c_k, 0) h^k does (camera.md eq. (4)). Close to a simple zero this is Newton's method from the left.
pub(super) fn first_zero(coefficients: &[f64], upper: f64) -> f64 {
    let mut at = 0.0;
    for _ in 0..10_000 {
        let c = taylor(coefficients, at);
        if !(0.0 < c[0]) {
            return at;
        }
        let step = safe_step(&c, upper - at);
        at += step;
        if upper <= at {
            return upper;
        }
        if !(1e-15 * at < step) {
            return at;
        }
    }
    at // Not reached the zero: a smaller field is still a valid one.
}

/// Returns the Taylor coefficients at `at`, by repeated synthetic division.
fn taylor(coefficients: &[f64], at: f64) -> [f64; MAX_TERMS] {
    let n = coefficients.len().min(MAX_TERMS);
    let mut c = [0.0; MAX_TERMS];
    c[..n].copy_from_slice(&coefficients[..n]);
    for i in 0..n.saturating_sub(1) {
        for j in (i..n - 1).rev() {
            c[j] += at * c[j + 1];
        }
    }
    c
}

/// Returns the zero of the concave decreasing c₀ + Σ min(c_k, 0) h^k, at most `longest`; 0 when it cannot be found.
fn safe_step(c: &[f64; MAX_TERMS], longest: f64) -> f64 {
    let bound = |h: f64| {
        let (mut value, mut slope) = (0.0, 0.0);
        for k in (1..MAX_TERMS).rev() {
            slope = slope * h + value;
            value = value * h + c[k].min(0.0);
        }
        (value * h + c[0], slope * h + value)
    };
    if 0.0 <= bound(longest).0 {
        return longest;
    }
    // Started from the right, Newton's method on a concave function stays on the right and decreases monotonically.
    let mut h = longest;
    for _ in 0..2_000 {
        let (value, slope) = bound(h);
        let next = h - value / slope;
        if !(0.0 < next) {
            return 0.0;
        }
        if h - next <= 1e-14 * h {
            return next;
        }
        h = next;
    }
    0.0
}

/// Returns x in [0, upper] with map(x) = target, for an increasing map with map(0) = 0 that returns (value, slope).
///
/// Uses Newton's method, and bisects whenever a step leaves the bracket or does not halve the residual.
pub(super) fn invert_monotone(map: impl Fn(f64) -> (f64, f64), target: f64, upper: f64) -> f64 {
    let (mut low, mut high) = (0.0, upper);
    let mut x = target.min(upper);
    let mut previous_miss = f64::INFINITY;
    for _ in 0..200 {
        let (value, slope) = map(x);
        let miss = value - target;
        if miss == 0.0 {
            return x;
        }
        if 0.0 < miss {
            high = x;
        } else {
            low = x;
        }
        let newton = x - miss / slope;
        let good = low <= newton && newton <= high && 2.0 * miss.abs() <= previous_miss;
        let next = if good { newton } else { 0.5 * (low + high) };
        previous_miss = miss.abs();
        if (next - x).abs() <= f64::EPSILON * x.abs() {
            return next;
        }
        x = next;
    }
    x
}

/// Returns q in the disc of `radius` with map(q) = target, for a map that is one-to-one there and returns (value, derivative).
///
/// Uses Newton's method with halved steps, in a slightly larger disc so that the edge is no obstacle; if that makes no progress, the target is
/// approached from map(0) in sixteen parts. `None` when no q of the disc is within `tolerance`.
pub(super) fn invert_plane(
    map: impl Fn(&Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>),
    target: &Vector2<f64>,
    start: Vector2<f64>,
    radius: f64,
    tolerance: f64,
) -> Option<Vector2<f64>> {
    let answer = |q: Vector2<f64>| {
        let q = into_disc(q, radius);
        ((map(&q).0 - target).norm() <= tolerance).then_some(q)
    };
    let work_radius = 1.02 * radius;
    answer(newton_plane(&map, target, start, work_radius)).or_else(|| {
        let parts = (1..=16).map(|part| target * (f64::from(part) / 16.0));
        answer(parts.fold(Vector2::zeros(), |q, part| newton_plane(&map, &part, q, work_radius)))
    })
}

/// Runs Newton's method with halved steps inside the disc; returns the last point, whether it is a solution or not.
fn newton_plane(
    map: &impl Fn(&Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>),
    target: &Vector2<f64>,
    start: Vector2<f64>,
    radius: f64,
) -> Vector2<f64> {
    let mut q = into_disc(start, radius);
    let (value, mut slope) = map(&q);
    let mut miss = value - target;
    // The limit is two roundings of the map, below which a step cannot be distinguished from noise.
    let converged = (2.0 * f64::EPSILON).powi(2) * target.norm_squared();
    for _ in 0..60 {
        if miss.norm_squared() <= converged {
            return q;
        }
        let Some(step) = solve(&slope, &miss) else { return q };
        if step.norm_squared() <= (2.0 * f64::EPSILON).powi(2) * q.norm_squared() {
            return q;
        }
        let mut halvings = core::iter::successors(Some(1.0), |part| Some(0.5 * part)).take(24);
        let better = halvings.find_map(|part| {
            let candidate = into_disc(q - step * part, radius);
            let (value, slope) = map(&candidate);
            let new_miss = value - target;
            (new_miss.norm_squared() < miss.norm_squared()).then_some((candidate, new_miss, slope))
        });
        let Some(next) = better else { return q };
        (q, miss, slope) = next;
    }
    q
}

/// Returns the nearest point of the disc.
fn into_disc(q: Vector2<f64>, radius: f64) -> Vector2<f64> {
    let norm = q.norm();
    if norm <= radius { q } else { q * (radius / norm) }
}

/// Returns a⁻¹ b; `None` for a singular a.
#[inline]
pub(super) fn solve(a: &Matrix2<f64>, b: &Vector2<f64>) -> Option<Vector2<f64>> {
    let determinant = a.m11 * a.m22 - a.m12 * a.m21;
    let x = Vector2::new(a.m22 * b.x - a.m12 * b.y, a.m11 * b.y - a.m21 * b.x) / determinant;
    (x.x.is_finite() && x.y.is_finite()).then_some(x)
}

/// Returns a d + b z with d = √(β r² + z²), without cancellation behind the camera, where z < 0 and d ≈ −z (camera.md eq. (9)).
#[inline]
pub(super) fn depth_sum(a: f64, b: f64, d: f64, z: f64, beta_r2: f64) -> f64 {
    if z < 0.0 { a * beta_r2 / (d - z) + (b - a) * z } else { a * d + b * z }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_zero_is_the_smallest_positive_root() {
        // (1 − t)(1 − t/2)(1 − t/3), and the same with a pair of roots that almost touches the axis before it.
        let cubic = [1.0, -11.0 / 6.0, 1.0, -1.0 / 6.0];
        assert!((first_zero(&cubic, 57.0) - 1.0).abs() < 1e-13);
        let almost = [0.25 + 1e-9, -1.0, 1.0]; // (t − 1/2)² + 1e-9: no root
        assert_eq!(first_zero(&almost, 57.0), 57.0);
        let touching = [0.25 - 1e-9, -1.0, 1.0];
        assert!((first_zero(&touching, 57.0) - (0.5 - 1e-9_f64.sqrt())).abs() < 1e-9);
    }

    #[test]
    fn first_zero_never_passes_a_root_of_a_product() {
        // Roots at 0.3, 0.9 and 40; degree 15 through t^12 factors that stay positive.
        let mut p = vec![1.0];
        for root in [0.3, 0.9, 40.0] {
            p = multiply(&p, &[1.0, -1.0 / root]);
        }
        for _ in 0..6 {
            p = multiply(&p, &[1.0, 0.1, 0.7]);
        }
        assert!((first_zero(&p, 57.0) - 0.3).abs() < 1e-13);
    }

    fn multiply(a: &[f64], b: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; a.len() + b.len() - 1];
        for (i, x) in a.iter().enumerate() {
            for (j, y) in b.iter().enumerate() {
                product[i + j] += x * y;
            }
        }
        product
    }

    #[test]
    fn monotone_inverse_undoes_a_map_with_a_flat_end() {
        // t − t³/3 is flat at t = 1, where its inverse has infinite slope.
        let map = |t: f64| (t - t * t * t / 3.0, 1.0 - t * t);
        for i in 0..=1000 {
            let t = f64::from(i) / 1000.0;
            let back = map(invert_monotone(map, map(t).0, 1.0)).0;
            assert!((back - map(t).0).abs() < 4.0 * f64::EPSILON, "t = {t}");
        }
    }
}
