//! What the solvers for an unknown focal length share: candidates, polish, roots. Own, docs/math/focal.md; equation numbers refer to it.
//!
//! Pixels are square and given from the principal point, without distortion: u = f x/z, v = f y/z.

use crate::{Pixel, Point, Pose, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A pose and the focal length that goes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocalPose {
    /// The pose.
    pub cam_from_target: Pose,
    /// Focal length, px (the unit of the pixels).
    pub focal_px: f64,
}

/// Candidates, the one that reprojects best first.
pub type FocalCandidates = ArrayVec<FocalPose, 4>;

/// A candidate that misses the pixels by more than this part of their spread (root mean square) is none.
pub(super) const MAX_MISS: f64 = 0.05;
/// An algebraic solution that misses by more than this part of the spread solves the eliminated equations only.
const MAX_START: f64 = 0.5;
/// With a better candidate than this, in parts of the spread, no more are sought: a pixel or two in an image.
const GOOD_MISS: f64 = 3e-3;
/// A miss below this part of the spread is rounding: no step can lower it.
const ROUNDING: f64 = 1e-13;
/// Gauss–Newton steps at most; from an algebraic solution of noisy pixels two or three do.
const MAX_STEPS: usize = 25;
/// … of which a candidate that is not good may take so many.
const PATIENCE: usize = 6;
/// An undamped step that leaves more than this part of the miss has reached the minimum.
const FLAT: f64 = 0.999;
/// Damping after the first step that fails, relative to the diagonal; beyond the last no step helps.
const FIRST_DAMPING: f64 = 1e-4;
const LAST_DAMPING: f64 = 1e3;
/// Two candidates closer than this (chordal rotation, relative focal length) are one.
const SAME: f64 = 1e-6;

/// Points and pixels about their centroid, or about the principal point, both of unit size.
pub(super) struct Scene<const N: usize> {
    pub points: [Point; N],
    pub pixels: [Pixel; N],
    centre: Point,
    size_m: f64,
    size_px: f64,
    /// Root mean square distance of the (unit) pixels from their mean.
    spread: f64,
}

impl<const N: usize> Scene<N> {
    /// None where a number is not finite or all points or pixels coincide.
    pub fn new(pixels: &[Pixel; N], points: &[Point; N]) -> Option<Self> {
        let centre = points.iter().sum::<Point>() / N as f64;
        let mean = pixels.iter().sum::<Pixel>() / N as f64;
        let root_mean = |sum: f64| (sum / N as f64).sqrt();
        let size_m = root_mean(points.iter().map(|x| (x - centre).norm_squared()).sum());
        let size_px = root_mean(pixels.iter().map(|u| u.norm_squared()).sum());
        let spread = root_mean(pixels.iter().map(|u| (u - mean).norm_squared()).sum()) / size_px;
        let is_usable = |x: f64| 0.0 < x && x.is_finite();
        let usable = [size_m, size_px, spread, 1.0 / size_m, 1.0 / size_px].into_iter().all(is_usable);
        let scene = Scene {
            points: points.map(|x| (x - centre) / size_m),
            pixels: pixels.map(|u| u / size_px),
            centre,
            size_m,
            size_px,
            spread,
        };
        usable.then_some(scene)
    }

    /// Whether a candidate explains the pixels as well as noise lets one hope.
    pub fn is_good(&self, fit: &Fit) -> bool {
        fit.miss < GOOD_MISS * self.spread
    }

    /// Polishes a candidate in the scene's units, and keeps it if it fits, is in front and is new.
    pub(crate) fn admit(&self, candidate: Fit, found: &mut ArrayVec<Fit, 4>) {
        let Some(fit) = self.polished(candidate) else { return };
        let is_duplicate = |other: &Fit| {
            (other.rotation - fit.rotation).norm() < SAME && (other.focal / fit.focal - 1.0).abs() < SAME
        };
        if !(fit.miss < MAX_MISS * self.spread) || found.iter().any(is_duplicate) {
            return;
        }
        let place = found.iter().position(|other| fit.miss < other.miss).unwrap_or(found.len());
        if found.is_full() {
            found.pop();
        }
        if place <= found.len() && !found.is_full() {
            found.insert(place, fit);
        }
    }

    /// Back to metres and pixels.
    pub fn undone(&self, found: &ArrayVec<Fit, 4>) -> FocalCandidates {
        let undo = |fit: &Fit| {
            let rotation = crate::pose::orthonormalized(&fit.rotation);
            let translation = fit.centre_in_cam * self.size_m - rotation * self.centre;
            FocalPose {
                cam_from_target: Pose::new(rotation, translation),
                focal_px: fit.focal * self.size_px,
            }
        };
        let is_finite = |c: &FocalPose| {
            (c.cam_from_target.matrix().as_flattened().iter().sum::<f64>() + c.focal_px).is_finite()
        };
        found.iter().map(undo).filter(is_finite).collect()
    }

    /// Steps on the reprojection error until it no longer falls; none with a point behind the camera.
    fn polished(&self, candidate: Fit) -> Option<Fit> {
        let (mut best, mut equations) = self.evaluated(candidate)?;
        if !(best.miss < MAX_START * self.spread) {
            return None;
        }
        let mut damping = 0.0;
        for steps in 0..MAX_STEPS {
            let is_hopeless = steps == PATIENCE && !self.is_good(&best);
            if best.miss < ROUNDING * self.spread || is_hopeless {
                break;
            }
            let step = equations.step(damping).and_then(|step| self.evaluated(best.moved(&step)));
            match step.filter(|(next, _)| next.miss < best.miss) {
                Some((next, at_next)) => {
                    let is_flat = damping == 0.0 && FLAT * best.miss < next.miss;
                    (best, equations, damping) = (next, at_next, 0.1 * damping);
                    if is_flat {
                        break;
                    }
                }
                None if LAST_DAMPING < damping => break,
                None => damping = f64::max(10.0 * damping, FIRST_DAMPING),
            }
            if damping < FIRST_DAMPING {
                damping = 0.0;
            }
        }
        Some(best)
    }

    /// Miss and normal equations, docs/math/focal.md eq. (3).
    fn evaluated(&self, candidate: Fit) -> Option<(Fit, Equations)> {
        let (mut normal, mut gradient, mut sum) = (Matrix7::zeros(), Vector7::zeros(), 0.0);
        for (point, pixel) in self.points.iter().zip(&self.pixels) {
            let y = candidate.rotation * point;
            let x = y + candidate.centre_in_cam;
            if !(0.0 < x.z) {
                return None;
            }
            let (iz, f) = (1.0 / x.z, candidate.focal);
            let predicted = Vector2::new(x.x, x.y) * (f * iz);
            let e = pixel - predicted;
            sum += e.norm_squared();
            let a = f * iz;
            for (e, predicted, j) in [
                (e.x, predicted.x, Vector3::new(a, 0.0, -predicted.x * iz)),
                (e.y, predicted.y, Vector3::new(0.0, a, -predicted.y * iz)),
            ] {
                let w = y.cross(&j);
                let row = Vector7::from([w.x, w.y, w.z, j.x, j.y, j.z, predicted]);
                gradient += row * e;
                normal += row * row.transpose();
            }
        }
        let miss = (sum / N as f64).sqrt();
        miss.is_finite().then_some((Fit { miss, ..candidate }, Equations { normal, gradient }))
    }
}

type Matrix7 = SMatrix<f64, 7, 7>;
type Vector7 = SVector<f64, 7>;

struct Equations {
    normal: Matrix7,
    gradient: Vector7,
}

impl Equations {
    /// Marquardt's step.
    fn step(&self, damping: f64) -> Option<Vector7> {
        let mut normal = self.normal;
        for i in 0..7 {
            normal[(i, i)] *= 1.0 + damping;
        }
        normal.cholesky().map(|c| c.solve(&self.gradient))
    }
}

/// A candidate in the scene's units: the points' centroid is held, not the origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub rotation: Matrix3<f64>,
    pub centre_in_cam: Point,
    pub focal: f64,
    /// Root mean square distance between pixels and predictions.
    pub miss: f64,
}

impl Fit {
    pub fn new(rotation: Matrix3<f64>, centre_in_cam: Point, focal: f64) -> Self {
        Fit { rotation, centre_in_cam, focal, miss: f64::INFINITY }
    }

    /// Moved by [rotation; translation; log f], so that f stays positive.
    fn moved(&self, step: &Vector7) -> Self {
        let motion = Vector6::new(step[0], step[1], step[2], 0.0, 0.0, 0.0);
        let rotation = Pose::exp(&motion).rotation * self.rotation;
        let centre_in_cam = self.centre_in_cam + Vector3::new(step[3], step[4], step[5]);
        Fit { rotation, centre_in_cam, focal: self.focal * step[6].exp(), miss: f64::INFINITY }
    }
}

/// Roots of Σ c[i] xⁱ in [−1, 1], by Descartes' rule on ever smaller intervals, docs/math/focal.md eq. (4): an interval whose Bernstein
/// coefficients keep their sign has no root, one with a single change has one. A cluster that stays together to `NARROWEST` counts once.
pub(super) fn roots_up_to_one<const N: usize>(c: &[f64; N]) -> ArrayVec<f64, 16> {
    let mut roots = ArrayVec::new();
    let mut open: ArrayVec<(f64, f64, [f64; N]), 32> = ArrayVec::new();
    let whole = bernstein(c);
    let rounding = ROUNDED * whole.iter().map(|b| b.abs()).fold(0.0, f64::max);
    if rounding.is_finite() && 0.0 < rounding {
        open.push((-1.0, 1.0, whole));
    }
    while let Some((low, high, b)) = open.pop() {
        if b[N - 1].abs() <= rounding {
            let _ = roots.try_push(high);
        }
        match sign_changes(&b, rounding) {
            0 => {}
            1 => {
                // The sign before the root: the first coefficient itself may be zero.
                let before = b.iter().copied().find(|b| rounding < b.abs()).unwrap_or(0.0);
                let _ = roots.try_push(bracketed_root(c, low, high, before));
            }
            _ if high - low < NARROWEST || open.remaining_capacity() < 2 => {
                let _ = roots.try_push(0.5 * (low + high));
            }
            _ => {
                let (left, right) = halves(b);
                let middle = 0.5 * (low + high);
                open.push((middle, high, right));
                open.push((low, middle, left));
            }
        }
    }
    roots
}

/// A Bernstein coefficient below this part of the largest is zero but for rounding.
const ROUNDED: f64 = 1e-15;
/// Roots closer than this are one: the polish of the candidates parts or joins them.
const NARROWEST: f64 = 1e-6;

/// Coefficients on [−1, 1], docs/math/focal.md eq. (4).
fn bernstein<const N: usize>(c: &[f64; N]) -> [f64; N] {
    let mut b = *c;
    for k in 0..N {
        (k..N - 1).rev().for_each(|i| b[i] -= b[i + 1]);
    }
    let (mut power, mut binomial) = (1.0, 1.0);
    for (i, b) in b.iter_mut().enumerate() {
        *b *= power / binomial;
        power *= 2.0;
        binomial *= (N - 1 - i) as f64 / (i + 1) as f64;
    }
    for k in 0..N {
        (k + 1..N).rev().for_each(|i| b[i] += b[i - 1]);
    }
    b
}

fn sign_changes<const N: usize>(b: &[f64; N], rounding: f64) -> usize {
    let (mut changes, mut last) = (0, 0.0);
    for &b in b.iter().filter(|b| rounding < b.abs()) {
        changes += usize::from(b * last < 0.0);
        last = b.signum();
    }
    changes
}

/// De Casteljau: the coefficients on both halves.
fn halves<const N: usize>(mut b: [f64; N]) -> ([f64; N], [f64; N]) {
    let mut left = b;
    for k in 1..N {
        (0..N - k).for_each(|i| b[i] = 0.5 * (b[i] + b[i + 1]));
        left[k] = b[0];
    }
    (left, b)
}

/// Newton's steps, halved where they leave the bracket, where the polynomial has the sign of `before` before the root.
fn bracketed_root<const N: usize>(c: &[f64; N], mut low: f64, mut high: f64, before: f64) -> f64 {
    let mut x = 0.5 * (low + high);
    for _ in 0..60 {
        let (value, slope) = c.iter().rev().fold((0.0, 0.0), |(p, dp), c| (p * x + c, dp * x + p));
        if value == 0.0 {
            return x;
        }
        if value * before < 0.0 {
            high = x
        } else {
            low = x
        }
        let next = x - value / slope;
        let next = if low < next && next < high { next } else { 0.5 * (low + high) };
        if (next - x).abs() <= NEAR * x.abs() {
            return next;
        }
        x = next;
    }
    x
}

/// A step this small, relative, is the last: the next would be its square.
const NEAR: f64 = 1e-8;

#[cfg(test)]
mod tests {
    use super::*;

    /// Coefficients of the monic polynomial with five given roots.
    fn quintic(roots: [f64; 5]) -> [f64; 6] {
        let mut c = [0.0; 6];
        c[0] = 1.0;
        for (degree, root) in roots.into_iter().enumerate() {
            for i in (0..=degree + 1).rev() {
                c[i] = if i == 0 { 0.0 } else { c[i - 1] } - root * c[i];
            }
        }
        c
    }

    #[test]
    fn roots_in_the_interval_are_found_and_no_others() {
        let cases = [
            ([-3.0, -0.9, 0.2, 0.200_1, 5.0], vec![-0.9, 0.2, 0.200_1]),
            ([-0.5, 0.0, 0.5, 1.5, 2.0], vec![-0.5, 0.0, 0.5]),
            ([-7.0, -3.0, 1.5, 2.0, 4.0], vec![]),
            ([-0.99, -0.7, 0.1, 0.6, 0.98], vec![-0.99, -0.7, 0.1, 0.6, 0.98]),
        ];
        for (roots, expected) in cases {
            let mut found = roots_up_to_one(&quintic(roots));
            found.sort_unstable_by(f64::total_cmp);
            assert_eq!(found.len(), expected.len(), "{found:?} {expected:?}");
            for (x, y) in found.iter().zip(&expected) {
                assert!((x - y).abs() < 1e-10, "{found:?} {expected:?}");
            }
        }
    }

    /// A double root, which rounding makes two or none, is found as one place at least.
    #[test]
    fn a_double_root_is_found() {
        for double in [-0.3, 0.123, 0.77] {
            let found = roots_up_to_one(&quintic([-4.0, 3.0, 5.0, double, double]));
            assert!(found.iter().any(|x| (x - double).abs() < 1e-6), "{found:?}");
            assert!(found.iter().all(|x| (x - double).abs() < 1e-5), "{found:?}");
        }
    }

    #[test]
    fn hostile_polynomials_have_no_roots() {
        for c in [[0.0; 4], [f64::NAN; 4], [f64::INFINITY; 4], [1.0, 0.0, 0.0, 0.0]] {
            assert!(roots_up_to_one(&c).is_empty());
        }
    }
}
