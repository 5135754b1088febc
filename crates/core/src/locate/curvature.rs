//! Widens a covariance where the likelihood is curved, not only quadratic.
//!
//! A nearly frontal target shows its tilt to second order only: its likelihood is a bent ridge, and the inverse of the
//! information matrix, the ridge's tangent ellipsoid, is too thin across the bend and too short along it. In the two weakest
//! turns w₁, w₂ the ridge runs as ξ(s) = s₁d₁ + s₂d₂ + s₁²b₁ + s₂²b₂ + s₁s₂b₁₂, s in standard deviations; for normal s
//!   Σ' = Σ + 3b₁b₁ᵀ + 3b₂b₂ᵀ + b₁b₂ᵀ + b₂b₁ᵀ + b₁₂b₁₂ᵀ + Σₖ (4/Δχ²ₖ − 1) dₖdₖᵀ,
//! Δχ²ₖ the rise of χ² along the ridge at two standard deviations (4 where it is straight).
//! Where the ridge turns faster than that, Σ' is widened until no point of the ridge is much farther from the minimum by Σ' than by χ².
//! Derivation: docs/math/refine.md eqs. (10)–(14d).

use crate::covariance::is_covariance;
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::choose::Minimum;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations, residual_sums};
use crate::{Matrix6, Point, Pose, Vector6};
use nalgebra::{Matrix3, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Whether the likelihood is bent at each of the first four minima; none where that is not known yet.
pub(crate) type Bends = [Option<bool>; 4];

/// Where the ridge is tried, standard deviations: far enough to feel the bend, near enough to stay on it.
pub(crate) const PROBE: f64 = 2.0;
/// Off a straight ridge χ² rises by PROBE² = 4; within this factor nothing is bent that matters.
pub(crate) const STRAIGHT: f64 = 1.25;
/// The smallest rise taken at its word: a flatter ridge widens the covariance tenfold and no more.
const LEAST_RISE: f64 = 0.4;

/// Directions in the plane of both weak rotations in which the likelihood is tried.
const DIRECTIONS: usize = 8;
/// Largest σ₁σ₂/σ₃ of the rotation at which the order of two rotations does not matter: docs/math/refine.md eq. (14b).
pub(crate) const STRAIGHT_COMMUTATOR: f64 = 0.1;
/// A step along the ridge, standard deviations.
const STEP: f64 = 1.5;
/// Most steps in one direction.
const STEPS: usize = 8;
/// Rise of χ² up to which the covariance holds every point of the ridge.
const MOST_RISE_HELD: f64 = 16.0;
/// A smaller rise counts as this.
const LEAST_RISE_HELD: f64 = 4.0;
/// Squared distance allowed half-way from `MOST_RISE_HELD` to twice of it, where a place no longer counts.
const STEEP: f64 = 480.0;
/// Squared distance, in standard deviations, allowed for each unit of χ².
const SLACK: f64 = 1.35;

/// What is needed of a cost to walk along its ridge: that of one camera, or of a rig.
pub(crate) trait Cost {
    /// The point about which small motions turn, target frame.
    fn pivot(&self) -> Point;
    /// Gauss–Newton's view of the cost; none where a point leaves a camera's field.
    fn normal_equations(&self, place: &PivotedPose, pivot: &Point) -> Option<NormalEquations>;
    /// The cost; infinite where a point leaves a camera's field.
    fn chi2(&self, cam_from_target: &Pose) -> f64;
}

impl Cost for Problem<'_> {
    fn pivot(&self) -> Point {
        centroid(self.seen)
    }

    fn normal_equations(&self, place: &PivotedPose, pivot: &Point) -> Option<NormalEquations> {
        normal_equations(place, pivot, self)
    }

    fn chi2(&self, cam_from_target: &Pose) -> f64 {
        residual_sums(cam_from_target, self).0
    }
}

/// Whether χ² rises otherwise than quadratically along the weakest rotations, so that the covariance needs the bend's share and
/// another minimum may lie along the ridge.
#[inline]
pub(crate) fn is_bent(m: &Minimum, cost: &impl Cost) -> bool {
    let rotation = rotation_block(&m.covariance);
    let first = Turn::weakest(&m.covariance, &rotation);
    let straight = |motion: Vector6| {
        let probe = Pose::exp(&motion) * m.cam_from_target;
        let rise = cost.chi2(&probe) - m.chi2;
        rise < PROBE * PROBE * STRAIGHT && PROBE * PROBE / STRAIGHT < rise
    };
    if !(straight(first.motion * PROBE) && straight(first.motion * -PROBE)) {
        return true;
    }
    !is_surely_straight(&rotation) && is_bent_between(m, first, &rotation, straight)
}

/// Returns whether the two weak rotations are so small beside the third that their order does not matter: docs/math/refine.md eq. (14b).
#[inline]
fn is_surely_straight(rotation: &Matrix3<f64>) -> bool {
    let minor =
        |i: usize, j: usize| rotation[(i, i)] * rotation[(j, j)] - rotation[(i, j)] * rotation[(j, i)];
    let minors = minor(0, 1) + minor(0, 2) + minor(1, 2);
    minors * minors < STRAIGHT_COMMUTATOR * STRAIGHT_COMMUTATOR * rotation.determinant()
}

/// As `is_bent`, along the second weak rotation and between the two.
#[cold]
fn is_bent_between(
    m: &Minimum,
    first: Turn,
    rotation: &Matrix3<f64>,
    straight: impl Fn(Vector6) -> bool,
) -> bool {
    let second = first.next(&m.covariance, rotation);
    !(0..DIRECTIONS).map(direction).all(|[c, s]| straight((first.motion * c + second.motion * s) * PROBE))
}

/// Cosine and sine of one of the directions about the minimum.
fn direction(k: usize) -> [f64; 2] {
    let angle = core::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
    [angle.cos(), angle.sin()]
}

/// Gauss–Newton steps from the end of a descent to the bottom: a walk along the ridge multiplies what is left.
const POLISH: usize = 2;

/// One Gauss–Newton step on; none where it does not descend.
fn polished(m: &Minimum, cost: &impl Cost) -> Option<Minimum> {
    let pivot = cost.pivot();
    let place = PivotedPose::new(&m.cam_from_target, &pivot);
    let normal = cost.normal_equations(&place, &pivot)?;
    let step =
        normal.covariance_at_camera(&place.pivot_in_cam)? * normal.gradient_at_camera(&place.pivot_in_cam);
    let cam_from_target = Pose::exp(&step) * m.cam_from_target;
    let chi2 = cost.chi2(&cam_from_target);
    (chi2 <= m.chi2 + 1e-6).then_some(Minimum { cam_from_target, chi2, ..*m })
}

/// The covariance of a minimum, with the shares of the bend and of the range added.
#[cfg(feature = "std")]
pub(crate) fn with_curvature(m: &Minimum, cost: &impl Cost) -> Matrix6 {
    Ridge::of(m, cost).with_share() + range_share(m, &cost.pivot())
}

/// A smaller part of the variance across the line of sight is left out.
const LEAST_RANGE_SHARE: f64 = 0.01;

/// What the rotation and the range of a target, both uncertain, add across the line of sight because they do not commute: docs/math/refine.md
/// eqs. (14e), (14f). Zero where the target is large enough or near enough.
#[inline]
pub(crate) fn range_share(m: &Minimum, pivot: &Point) -> Matrix6 {
    let c = m.cam_from_target * *pivot;
    let block = |i: usize, j: usize| m.covariance.fixed_view::<3, 3>(i, j).into_owned();
    let (rotations, shifts, cross, distance_squared) =
        (block(0, 0), block(3, 3), c.cross_matrix(), c.norm_squared());
    let range = c.dot(&(shifts * c)) / distance_squared;
    let rotated = distance_squared * rotations.trace() - c.dot(&(rotations * c));
    let across = shifts.trace() - 2.0 * cross.dot(&block(3, 0)) + rotated - range;
    let is_small = range * rotated < 4.0 * LEAST_RANGE_SHARE * across * distance_squared;
    let mut share = Matrix6::zeros();
    if !is_small {
        let of_both = block(0, 3) + rotations * cross;
        let of_shift = shifts + block(3, 0) * cross - cross * of_both;
        share.fixed_view_mut::<3, 3>(3, 3).copy_from(&commutator(&rotations, &of_both, &of_shift));
    }
    share
}

/// ¼ E (ω × δ)(ω × δ)ᵀ from the covariances of ω, of ω with δ, and of δ: docs/math/refine.md eq. (14f).
#[cold]
fn commutator(rotation: &Matrix3<f64>, both: &Matrix3<f64>, shift: &Matrix3<f64>) -> Matrix3<f64> {
    let mixed = |a: &Matrix3<f64>, b: &Matrix3<f64>| {
        let (ab, a_trace, b_trace) = (a * b, a.trace(), b.trace());
        let diagonal = Matrix3::from_diagonal_element(a_trace * b_trace - ab.trace());
        diagonal + (ab + b * a - a * b_trace - b * a_trace).transpose()
    };
    let mean =
        Vector3::new(both[(1, 2)] - both[(2, 1)], both[(2, 0)] - both[(0, 2)], both[(0, 1)] - both[(1, 0)]);
    (mixed(rotation, shift) - mixed(both, &both.transpose()) + mean * mean.transpose()) * 0.25
}

/// The covariances of a minimum that is bent: with the share of the bend added, and widened besides where the ridge leaves it and by the range.
pub(crate) fn along_the_ridge(m: &Minimum, cost: &impl Cost) -> [Matrix6; 2] {
    // Where points are uncertain the minimum is not one of χ² alone.
    let steps = if m.log_determinant == 0.0 { POLISH } else { 0 };
    let m = &(0..steps).try_fold(*m, |m, _| polished(&m, cost)).unwrap_or(*m);
    let ridge = Ridge::of(m, cost);
    let (with_share, range) = (ridge.with_share(), range_share(m, &ridge.pivot));
    if is_surely_straight(&rotation_block(&m.covariance)) {
        return [with_share, with_share + range];
    }
    let mut covariance = with_share;
    for k in 0..DIRECTIONS {
        ridge.walk(direction(k), &mut covariance);
    }
    // Where lengths differ by many orders of magnitude the sum may be rounding alone.
    [with_share, range + if is_covariance(&covariance) { covariance } else { with_share }]
}

fn rotation_block(covariance: &Matrix6) -> Matrix3<f64> {
    covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

/// A weak rotation: its axis w and the motion d that goes with one standard deviation of it.
struct Turn {
    axis: Vector3<f64>,
    motion: Vector6,
}

impl Turn {
    /// The largest eigenvector of the rotation block, or of its part `within` a plane: a column of the eighth power.
    fn weakest(covariance: &Matrix6, within: &Matrix3<f64>) -> Self {
        let scaled = within / within.trace();
        let squared = scaled * scaled;
        let fourth = squared * squared;
        let eighth = fourth * fourth;
        let axis = eighth.column(eighth.diagonal().imax()).normalize();
        let sigma = axis.dot(&(within * axis)).sqrt();
        Turn { axis, motion: covariance.fixed_view::<6, 3>(0, 0) * axis / sigma }
    }

    /// The weakest rotation across this one.
    fn next(&self, covariance: &Matrix6, rotation: &Matrix3<f64>) -> Self {
        let across = Matrix3::identity() - self.axis * self.axis.transpose();
        Turn::weakest(covariance, &(across * rotation * across))
    }

    fn component(&self, motion: &Vector6) -> f64 {
        self.axis.x * motion[0] + self.axis.y * motion[1] + self.axis.z * motion[2]
    }
}

struct Ridge<'a, C: Cost> {
    m: &'a Minimum,
    turns: [Turn; 2],
    pivot: Point,
    cost: &'a C,
}

/// The cost at a point near the ridge.
struct OnRidge {
    /// Back onto the ridge, both turns held; a left motion.
    shift: Vector6,
    /// χ² there, above the minimum's.
    rise: f64,
    /// Motions along the ridge that change one turn by a radian and leave the other.
    along: [Vector6; 2],
}

impl<'a, C: Cost> Ridge<'a, C> {
    fn of(m: &'a Minimum, cost: &'a C) -> Self {
        let rotation = rotation_block(&m.covariance);
        let first = Turn::weakest(&m.covariance, &rotation);
        let second = first.next(&m.covariance, &rotation);
        Ridge { m, turns: [first, second], pivot: cost.pivot(), cost }
    }

    fn with_share(&self) -> Matrix6 {
        self.share().map_or(self.m.covariance, |share| self.m.covariance + share)
    }

    /// Widens a covariance until no point of the ridge in one direction is much farther from the minimum by it than by χ²: docs/math/refine.md
    /// eq. (14d). Ends where χ² is far above the minimum's, or the ridge cannot be followed.
    fn walk(&self, [c, s]: [f64; 2], covariance: &mut Matrix6) -> Option<()> {
        let [t1, t2] = &self.turns;
        let (first, second) = (t1.motion * (STEP * c), t2.motion * (STEP * s));
        let turns = [t1.component(&first), t2.component(&second)];
        let target_from_cam = self.m.cam_from_target.inverse();
        let mut pose = Pose::exp(&(first + second)) * self.m.cam_from_target;
        let mut highest = 0.0;
        for _ in 0..STEPS {
            let OnRidge { shift, rise, along } = self.near(&pose)?;
            let off = (Pose::exp(&shift) * pose * target_from_cam).log();
            let squared = off.dot(&covariance.cholesky()?.solve(&off));
            // A place beyond the last rise that counts widens less and less, and not at all from twice that rise on.
            let beyond = (rise / MOST_RISE_HELD - 1.0).max(0.0);
            // Beyond a saddle begins another minimum, which answers for itself.
            if 1.0 <= beyond || rise < highest {
                break;
            }
            highest = rise;
            let allowed = SLACK * rise.max(LEAST_RISE_HELD) + STEEP * beyond / (1.0 - beyond);
            if squared.is_finite() && allowed < squared {
                *covariance += off * off.transpose() * (1.0 / allowed - 1.0 / squared);
            }
            pose = Pose::exp(&(shift + along[0] * turns[0] + along[1] * turns[1])) * pose;
        }
        Some(())
    }

    fn share(&self) -> Option<Matrix6> {
        let [d1, d2] = [self.turns[0].motion, self.turns[1].motion];
        let q = PROBE / 2f64.sqrt();
        let even = |s1: f64, s2: f64| Some((self.shift(s1, s2)?, self.shift(-s1, -s2)?));
        let (along1, along2) = (even(PROBE, 0.0)?, even(0.0, PROBE)?);
        let (same, opposite) = (even(q, q)?, even(q, -q)?);
        let mean = |pair: &((Vector6, f64), (Vector6, f64))| (pair.0.0 + pair.1.0) / (2.0 * PROBE * PROBE);
        let (b1, b2) = (mean(&along1), mean(&along2));
        // The diagonals hold s₁s₂ = ±q², q² = PROBE²/2, so their difference is b₁₂ when divided as the means are.
        let b12 = mean(&same) - mean(&opposite);
        let longer = |pair: &((Vector6, f64), (Vector6, f64))| {
            let rise = pair.0.1.min(pair.1.1).clamp(LEAST_RISE, PROBE * PROBE);
            PROBE * PROBE / rise - 1.0
        };
        let square = |a: &Vector6, b: &Vector6| a * b.transpose();
        let bend = square(&b1, &b1) * 3.0 + square(&b2, &b2) * 3.0 + square(&b1, &b2) + square(&b2, &b1);
        let length = square(&d1, &d1) * longer(&along1) + square(&d2, &d2) * longer(&along2);
        Some(bend + square(&b12, &b12) + length)
    }

    /// From the tangent point s₁d₁ + s₂d₂ back onto the ridge: the step, in left motions, and the rise of χ² on the ridge.
    fn shift(&self, s1: f64, s2: f64) -> Option<(Vector6, f64)> {
        let [t1, t2] = &self.turns;
        let probe = Pose::exp(&(t1.motion * s1 + t2.motion * s2)) * self.m.cam_from_target;
        let OnRidge { shift, rise, .. } = self.near(&probe)?;
        Some((shift, rise))
    }

    /// One Gauss–Newton step with both turns held, and the tangents of the ridge.
    fn near(&self, probe: &Pose) -> Option<OnRidge> {
        let [t1, t2] = &self.turns;
        let place = PivotedPose::new(probe, &self.pivot);
        let normal = self.cost.normal_equations(&place, &self.pivot)?;
        let covariance = normal.covariance_at_camera(&place.pivot_in_cam)?;
        let gradient = normal.gradient_at_camera(&place.pivot_in_cam);
        let step = covariance * gradient;
        let by_turn = covariance.fixed_view::<6, 3>(0, 0);
        let (c1, c2): (Vector6, Vector6) = (by_turn * t1.axis, by_turn * t2.axis);
        let (m11, m12, m22) = (t1.component(&c1), t1.component(&c2), t2.component(&c2));
        let (r1, r2) = (t1.component(&step), t2.component(&step));
        let det = m11 * m22 - m12 * m12;
        let along = [(c1 * m22 - c2 * m12) / det, (c2 * m11 - c1 * m12) / det];
        let shift = step - along[0] * r1 - along[1] * r2;
        let rise = normal.chi2 - gradient.dot(&shift) - self.m.chi2;
        let is_finite = (shift + along[0] + along[1]).iter().all(|x| x.is_finite()) && rise.is_finite();
        is_finite.then_some(OnRidge { shift, rise, along })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use crate::Correspondence;
    use crate::camera::{CameraMatrix, Pinhole};
    use crate::locate::refine::refine;
    use crate::{Lens, Pixel};

    /// E ξξᵀ of the bends by Gauss–Hermite quadrature (three nodes each way: exact to the fifth power) from the ridge itself
    /// equals the stated sum. Both tilts of a frontal target shorten its range, so the cross terms add.
    #[test]
    fn bend_is_the_second_moment_of_the_ridge() {
        let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 0.0, cy_px: 0.0 };
        let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
        let truth = Pose::new(Matrix3::identity(), Vector3::new(0.05, -0.02, 3.0));
        let seen: Vec<_> = [[-0.5, -0.5], [0.5, -0.4], [0.5, 0.5], [-0.4, 0.5], [0.1, 0.0]]
            .iter()
            .filter_map(|[x, y]| {
                let x = Point::new(*x, *y, 0.0);
                let pixel: Pixel = camera.project(&(truth * x))?;
                Correspondence::new(&camera, x, pixel, 0.01).ok()
            })
            .collect();
        let m = refine(&truth, &seen, &camera).unwrap();
        let problem = Problem::new(&seen, &camera);
        let ridge = Ridge::of(&m, &problem);
        let nodes = [(-(3f64.sqrt()), 1.0 / 6.0), (0.0, 2.0 / 3.0), (3f64.sqrt(), 1.0 / 6.0)];
        let mut moment = Matrix6::zeros();
        for (s1, w1) in nodes {
            for (s2, w2) in nodes {
                let (shift, _) = ridge.shift(s1, s2).unwrap();
                moment += shift * shift.transpose() * (w1 * w2);
            }
        }
        // Seen across both turns: along them the ridge's lengthening adds, which is not its bend.
        let [d1, d2] = [ridge.turns[0].motion, ridge.turns[1].motion];
        let d1 = d1.normalize();
        let d2 = (d2 - d1 * d1.dot(&d2)).normalize();
        let depth = Vector6::ith(5, 1.0);
        let across = depth - d1 * d1.dot(&depth) - d2 * d2.dot(&depth);
        let seen_across = |m: &Matrix6| across.dot(&(m * across));
        let ratio = seen_across(&ridge.share().unwrap()) / seen_across(&moment);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}
