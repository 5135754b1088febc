//! `curvature::is_bent` for several problems at once.

use super::lanes::{Lanes, Mask, Matrix, Vector};
use super::refine::{Minimum, ObservedPoints, Place};
use crate::locate::curvature::{PROBE, STRAIGHT, STRAIGHT_COMMUTATOR};
use pulp::Simd;

/// Squared angle up to which the series below are exact to rounding: the next term is (0.25)⁷/15! of the first.
const SERIES_ANGLE_SQUARED: f64 = 0.25;

/// Returns where χ² is quadratic along the weakest rotation, so that neither the covariance nor the search needs more.
#[inline(always)]
pub(super) fn is_straight<S: Simd, const N: usize>(m: &Minimum<S>, seen: &ObservedPoints<S, N>) -> Mask<S> {
    let (w, v) = weakest_turn(m);
    let mut straight = w.x.is_finite() & is_surely_straight(m);
    for side in [PROBE, -PROBE] {
        let (probe, is_near) = turned(&m.place, w * w.x.like(side), v * w.x.like(side));
        let rise = seen.residual_sums(&probe).0 - m.chi2;
        straight =
            straight & is_near & rise.below(PROBE * PROBE * STRAIGHT) & rise.above(PROBE * PROBE / STRAIGHT);
    }
    straight
}

/// As `curvature::is_surely_straight`; elsewhere `curvature::is_bent` tries more places.
#[inline(always)]
fn is_surely_straight<S: Simd>(m: &Minimum<S>) -> Mask<S> {
    let [xx, xy, xz, yy, yz, zz] = m.covariance.rotation.0;
    let (of_x, of_y, of_z) = (yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy);
    let determinant = xx * of_x - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let minors = of_x + of_y + of_z;
    (minors * minors).less(determinant * (STRAIGHT_COMMUTATOR * STRAIGHT_COMMUTATOR))
}

/// Returns one standard deviation of the weakest rotation, as `curvature::Turn::weakest`: rotation and translation.
#[inline(always)]
fn weakest_turn<S: Simd>(m: &Minimum<S>) -> (Vector<S>, Vector<S>) {
    let rotation = &m.covariance.rotation;
    let r = rotation.0;
    let inverse_trace = (r[0] + r[3] + r[5]).recip();
    let mut scaled = *rotation;
    for x in &mut scaled.0 {
        *x = *x * inverse_trace;
    }
    let eighth = scaled.squared().squared().squared();
    let [xx, _, _, yy, _, zz] = eighth.0;
    let [x, y, z] = eighth.full().rows;
    let best = Vector::choose(xx.less(yy), &y, &x);
    let top = xx.less(yy).choose(yy, xx);
    let axis = Vector::choose(top.less(zz), &z, &best).unit();
    let with_axis = rotation.apply(axis);
    let inverse_sigma = axis.dot(with_axis).sqrt().recip();
    (with_axis * inverse_sigma, m.covariance.cross.apply_transposed(axis) * inverse_sigma)
}

/// Applies Exp([w; v]) on the left, docs/math/pose.md eq. (6); false where the angle is too large for the series.
#[inline(always)]
fn turned<S: Simd>(place: &Place<S>, w: Vector<S>, v: Vector<S>) -> (Place<S>, Mask<S>) {
    let t2 = w.norm_squared();
    let (a, b, c) = (series(t2, 1), series(t2, 2), series(t2, 3));
    let [x, y, z] = place.rotation.transpose().rows;
    let rotation = Matrix::from_columns(sum(x, w, a, b), sum(y, w, a, b), sum(z, w, a, b));
    let pivot_in_cam = sum(place.pivot_in_cam, w, a, b) + sum(v, w, b, c);
    (Place { rotation, pivot_in_cam }, t2.below(SERIES_ANGLE_SQUARED))
}

/// Returns x + a w × x + b w × (w × x).
#[inline(always)]
fn sum<S: Simd>(x: Vector<S>, w: Vector<S>, a: Lanes<S>, b: Lanes<S>) -> Vector<S> {
    let wx = w.cross(x);
    x + wx * a + w.cross(wx) * b
}

/// Returns Σ (−t²)ᵏ/(2k + first)!: sin t/t, (1 − cos t)/t², (t − sin t)/t³ for first = 1, 2, 3.
#[inline(always)]
fn series<S: Simd>(t2: Lanes<S>, first: usize) -> Lanes<S> {
    let mut sum = t2.like(1.0);
    for k in (1..7).rev() {
        let n = (2 * k + first) as f64;
        sum = sum.like(1.0) - sum * t2 * (1.0 / (n * (n - 1.0)));
    }
    let leading = if first == 3 { 6.0 } else { first as f64 };
    sum * (1.0 / leading)
}
