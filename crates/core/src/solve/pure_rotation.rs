//! Rotation between two frames from directions seen in both: own derivation, docs/math/pure_rotation.md, whose equations are cited.
//!
//! A pan–tilt head that turns about its lens, far points in two images, stars: no distance enters. The answer comes with its covariance
//! and with a χ² that betrays a camera that also moved.
//!
//!   aᵢ, bᵢ  one direction in the first and in the second frame   ·   wᵢ = 1/σᵢ²   ·   W = Σ wᵢ
//!   B = Σ wᵢ bᵢ aᵢᵀ / W, with singular values s₁ ≥ s₂ ≥ |s₃|, s₃ of the sign of det B   ·   λ = s₁ + s₂ + s₃
//!   F = |B|², G = |adj B|², D = det B   ·   yᵢ = R aᵢ

use crate::{Bearing, Error};
use nalgebra::{Matrix3, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A direction seen in two frames (or seen in one and known in the other).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionPair {
    /// In the first frame.
    pub in_first: Bearing,
    /// In the second frame.
    pub in_second: Bearing,
    /// Standard deviation of their difference about each of two axes across them, radians: √(σ₁² + σ₂²) of two independent bearings.
    pub sigma_rad: f64,
}

/// A rotation, how uncertain, and how well the directions agree with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// Rotation matrix: direction in the second frame = second_from_first · direction in the first.
    pub second_from_first: Matrix3<f64>,
    /// Covariance of its small left rotation (second frame), rad².
    pub covariance: Matrix3<f64>,
    /// Sum of squared angles between `in_second` and the turned `in_first`, over their variances.
    pub chi2: f64,
    /// 2 n − 3. A `chi2` that `consistency::is_unlikely` calls so was no pure rotation: the camera moved, or a pair is wrong.
    pub degrees_of_freedom: usize,
}

/// Sine off a common axis (root mean square) below which directions are parallel to rounding.
const MIN_SPREAD: f64 = 1e-6;
/// The same in standard deviations: below it the rotation about the common direction is known to no better than a tenth of a radian, and a
/// covariance no longer describes it.
const MIN_SPREAD_SIGMA: f64 = 10.0;
/// (s₁ + s₂)(s₂ + s₃)(s₃ + s₁) below which two rotations fit alike; two directions 1e-6 apart have 1e-12.
const MIN_ZETA: f64 = 1e-14;
/// Newton's steps on the quartic; from above they fall monotonically, quadratically unless the data contradict each other.
const MAX_STEPS: usize = 60;
/// Newton's steps on the rotation; each squares the error that rounding left in the closed form.
const POLISH: usize = 2;

/// The rotation of maximum likelihood for `pairs`, n ≥ 2, whose errors are small, independent and alike in all directions.
///
/// # Errors
/// `TooFewPoints`; `NotFinite`, `NotPositive` (a sigma); `DegenerateView` for directions that are nearly parallel, to rounding or
/// compared with their sigmas, and for pairs that contradict each other so far that two rotations fit alike.
pub fn pure_rotation(pairs: &[DirectionPair]) -> Result<Rotation, Error> {
    check(pairs)?;
    let sum: f64 = pairs.iter().map(weight).sum();
    check_spread(pairs, sum)?;
    let b = moment(pairs, sum, |p| (p.in_second, p.in_first));
    let mut rotation = closest_rotation(&b)?;
    let mut normal = Normal::of(&rotation, pairs);
    for _ in 0..POLISH {
        let turn = normal.information.try_inverse().ok_or_else(|| contradictory(0.0))? * normal.gradient;
        rotation = turned(&rotation, &turn);
        normal = Normal::of(&rotation, pairs);
    }
    let covariance = normal.information.try_inverse().ok_or_else(|| contradictory(0.0))?;
    let whole = (covariance.sum() + rotation.sum() + normal.chi2).is_finite();
    let degrees_of_freedom = 2 * pairs.len() - 3;
    let found = Rotation { second_from_first: rotation, covariance, chi2: normal.chi2, degrees_of_freedom };
    if whole { Ok(found) } else { Err(contradictory(0.0)) }
}

#[cold]
fn contradictory(metric: f64) -> Error {
    let reason = "the directions contradict each other so far that two rotations fit alike; check which belong together";
    Error::DegenerateView { reason, metric, needed: MIN_ZETA }
}

fn weight(p: &DirectionPair) -> f64 {
    1.0 / (p.sigma_rad * p.sigma_rad)
}

fn check(pairs: &[DirectionPair]) -> Result<(), Error> {
    if pairs.len() < 2 {
        return Err(Error::TooFewPoints { seen: pairs.len(), needed: 2 });
    }
    for (index, p) in pairs.iter().enumerate() {
        if !(p.in_first.sum() + p.in_second.sum()).is_finite() {
            return Err(Error::NotFinite { what: "the direction", index });
        }
        if !(0.0 < p.sigma_rad && weight(p).is_finite() && 0.0 < weight(p)) {
            return Err(Error::NotPositive { index, seen: p.sigma_rad });
        }
    }
    Ok(())
}

/// Both bundles of directions must open, eq. (7).
fn check_spread(pairs: &[DirectionPair], sum: f64) -> Result<(), Error> {
    let first = moment(pairs, sum, |p| (p.in_first, p.in_first));
    let second = moment(pairs, sum, |p| (p.in_second, p.in_second));
    let metric = minors(&first).min(minors(&second)).max(0.0).sqrt();
    let reason = "all directions are nearly parallel, which leaves the rotation about them open; add one well beside the others";
    let needed = MIN_SPREAD.max(MIN_SPREAD_SIGMA / sum.sqrt());
    if needed < metric { Ok(()) } else { Err(Error::DegenerateView { reason, metric, needed }) }
}

/// Σ wᵢ xᵢ yᵢᵀ / W of two directions of each pair.
fn moment(
    pairs: &[DirectionPair],
    sum: f64,
    directions: impl Fn(&DirectionPair) -> (Bearing, Bearing),
) -> Matrix3<f64> {
    let term = |p: &DirectionPair| {
        let (x, y) = directions(p);
        x.into_inner() * y.transpose() * (weight(p) / sum)
    };
    pairs.iter().map(term).sum()
}

/// Sum of the principal 2×2 minors: the second invariant.
fn minors(m: &Matrix3<f64>) -> f64 {
    let minor = |i: usize, j: usize| m[(i, i)] * m[(j, j)] - m[(i, j)] * m[(j, i)];
    minor(0, 1) + minor(1, 2) + minor(0, 2)
}

/// Cofactors of B (the adjugate's transpose).
fn cofactors(b: &Matrix3<f64>) -> Matrix3<f64> {
    let [x, y, z]: [Vector3<f64>; 3] = [0, 1, 2].map(|i| b.column(i).into_owned());
    Matrix3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])
}

/// The rotation that maximises tr(Rᵀ B), eqs. (3)–(5).
fn closest_rotation(b: &Matrix3<f64>) -> Result<Matrix3<f64>, Error> {
    let adjugate = cofactors(b);
    let (f, g, d) = (b.norm_squared(), adjugate.norm_squared(), b.column(0).dot(&adjugate.column(0)));
    let lambda = largest_root(f, g, d);
    let kappa = 0.5 * (lambda * lambda - f);
    let zeta = kappa * lambda - d;
    if !(MIN_ZETA < zeta) {
        return Err(contradictory(zeta));
    }
    Ok((b * (kappa + f) + adjugate * lambda - b * b.tr_mul(b)) / zeta)
}

/// λ = s₁ + s₂ + s₃: the largest root of eq. (4), by Newton's method from 1, which no root exceeds.
fn largest_root(f: f64, g: f64, d: f64) -> f64 {
    let constant = f * f - 4.0 * g;
    let mut lambda = 1.0;
    for _ in 0..MAX_STEPS {
        let squared = lambda * lambda;
        let value = (squared - 2.0 * f) * squared - 8.0 * d * lambda + constant;
        let slope = 4.0 * lambda * (squared - f) - 8.0 * d;
        let step = value / slope;
        if !(f64::EPSILON < step) {
            break;
        }
        lambda -= step;
    }
    lambda
}

/// The cost's second-order view at a rotation, eq. (6).
struct Normal {
    chi2: f64,
    gradient: Vector3<f64>,
    information: Matrix3<f64>,
}

impl Normal {
    fn of(rotation: &Matrix3<f64>, pairs: &[DirectionPair]) -> Self {
        let mut normal = Normal { chi2: 0.0, gradient: Vector3::zeros(), information: Matrix3::zeros() };
        for p in pairs {
            let (y, b, w) = (rotation * p.in_first.into_inner(), p.in_second.into_inner(), weight(p));
            let yb = y * b.transpose();
            normal.chi2 += w * (b - y).norm_squared();
            normal.gradient += y.cross(&b) * w;
            normal.information += (Matrix3::identity() * y.dot(&b) - (yb + yb.transpose()) * 0.5) * w;
        }
        normal
    }
}

/// Rotated by a small rotation vector, orthonormal to rounding.
fn turned(rotation: &Matrix3<f64>, turn: &Vector3<f64>) -> Matrix3<f64> {
    let k = turn.cross_matrix();
    crate::pose::orthonormalized(&((Matrix3::identity() + k + k * k * 0.5) * rotation))
}
