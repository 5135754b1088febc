//! Where parallel lines meet, and the rotations that known line directions allow: own derivation, docs/math/lines.md, whose equations are
//! cited.
//!
//!   nᵢ = aᵢ × bᵢ  normal of the plane through the camera and line i, from the bearings of its ends   ·   v  direction of the lines, camera frame
//!   M = Σ wᵢ nᵢ nᵢᵀ   ·   gᵢ = nᵢ·v, sᵢ its standard deviation

use super::pure_rotation::{DirectionPair, Rotation, pure_rotation};
use crate::line::ImageLine;
use crate::{Bearing, Error};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The common direction of parallel lines, as an image shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VanishingPoint {
    /// Unit vector along the lines, camera frame; lines have no arrow, so its opposite is as good. At right angles to the optical axis
    /// where the lines look parallel: nothing goes to infinity.
    pub direction: Bearing,
    /// Its covariance, rad² (3×3, of rank two: nothing along the direction).
    pub covariance: Matrix3<f64>,
    /// Sum of squared residuals of the lines over their variances.
    pub chi2: f64,
    /// n − 2. A `chi2` that `consistency::is_unlikely` calls so has lines in it that are not parallel.
    pub degrees_of_freedom: usize,
}

/// Rotations, on the stack.
pub type Rotations = ArrayVec<Rotation, 4>;

/// The direction must be known better than this many radians, or no covariance describes it.
const MAX_SIGMA_RAD: f64 = 0.1;
/// Gauss–Newton's steps; three are usual.
const MAX_STEPS: usize = 20;
/// Most line directions taken; vanishing points are few.
pub(crate) const MAX_DIRECTIONS: usize = 8;
/// Sign choices whose χ² is within this of the best explain the directions as well: five standard deviations.
const SIGN_GATE_CHI2: f64 = 25.0;

impl VanishingPoint {
    /// This direction and the one it has in the target, for [`rotations`]; its two variances are taken as one.
    pub fn pair(&self, direction_in_target: Unit<Vector3<f64>>) -> DirectionPair {
        let sigma_rad = (0.5 * self.covariance.trace()).sqrt();
        DirectionPair { in_first: direction_in_target, in_second: self.direction, sigma_rad }
    }
}

/// The common direction of `n` ≥ 2 lines that are parallel in space: least squares of the ends' pixel errors, to first order.
///
/// # Errors
/// `TooFewPoints` for less than two lines; `DegenerateView` where all lines lie nearly in one plane with the camera.
pub fn vanishing_point(lines: &[ImageLine]) -> Result<VanishingPoint, Error> {
    if lines.len() < 2 {
        return Err(Error::TooFewPoints { seen: lines.len(), needed: 2 });
    }
    let mut best = Fit::at(start(lines), lines);
    for _ in 0..MAX_STEPS {
        let Some(step) = best.step() else { break };
        let next = Fit::at(best.v + step, lines);
        let is_better = next.chi2 < best.chi2;
        if !is_better {
            break;
        }
        best = next;
    }
    let covariance = best.information.try_inverse().filter(|c| c.sum().is_finite() && 0.0 < c.trace());
    let sigma_rad = covariance.map_or(f64::INFINITY, |c| c.trace().sqrt());
    match covariance {
        Some(c) if sigma_rad < MAX_SIGMA_RAD => Ok(VanishingPoint {
            direction: Unit::new_normalize(best.v),
            covariance: best.across * c * best.across.transpose(),
            chi2: best.chi2,
            degrees_of_freedom: lines.len() - 2,
        }),
        _ => {
            let reason =
                "the lines lie nearly in one plane with the camera, which leaves their direction open";
            Err(Error::DegenerateView { reason, metric: 1.0 / sigma_rad, needed: 1.0 / MAX_SIGMA_RAD })
        }
    }
}

/// The least eigenvector of M, by squaring its adjugate.
fn start(lines: &[ImageLine]) -> Vector3<f64> {
    let mut m = Matrix3::zeros();
    for line in lines {
        let [a, b] = line.bearings.map(|b| b.into_inner());
        let n = a.cross(&(b - a)) / line.sigma_px;
        m += n * n.transpose();
    }
    let m = m / m.trace();
    let column = |i: usize| m.column(i).into_owned();
    let mut adjugate = Matrix3::from_columns(&[
        column(1).cross(&column(2)),
        column(2).cross(&column(0)),
        column(0).cross(&column(1)),
    ]);
    for _ in 0..4 {
        adjugate /= adjugate.norm().max(f64::MIN_POSITIVE);
        adjugate *= adjugate;
    }
    let largest = adjugate.diagonal().iamax();
    adjugate.column(largest).into_owned()
}

/// Residuals and their normal equations on the sphere, at one direction.
struct Fit {
    v: Vector3<f64>,
    /// Axes across v.
    across: Matrix3x2<f64>,
    chi2: f64,
    gradient: Vector2<f64>,
    information: Matrix2<f64>,
}

impl Fit {
    fn at(v: Vector3<f64>, lines: &[ImageLine]) -> Self {
        let v = v.normalize();
        let axis = Vector3::from_fn(|i, _| if i == v.iamin() { 1.0 } else { 0.0 });
        let x = v.cross(&axis).normalize();
        let across = Matrix3x2::from_columns(&[x, v.cross(&x)]);
        let mut fit = Fit { v, across, chi2: 0.0, gradient: Vector2::zeros(), information: Matrix2::zeros() };
        for line in lines {
            let (r, by_direction) = line.direction_residual(&v);
            let j = across.tr_mul(&by_direction);
            fit.chi2 += r * r;
            fit.gradient += j * r;
            fit.information += j * j.transpose();
        }
        fit
    }

    /// Gauss–Newton's step; none when it is rounding.
    fn step(&self) -> Option<Vector3<f64>> {
        let step = -(self.information.try_inverse()? * self.gradient);
        (f64::EPSILON < step.norm()).then(|| self.across * step)
    }
}

/// Every rotation that lays known line directions (`in_first`, target) along seen ones (`in_second`, camera), whatever their arrows:
/// up to four, those of the best χ² first.
///
/// Two directions that are not at right angles leave two rotations, at right angles four; three that are not in a plane leave those
/// of their signs that fit. Which of them is true, what is in front of the camera must say.
///
/// # Errors
/// Those of `pure_rotation`; `WrongLayout` for more than `MAX_DIRECTIONS`.
pub fn rotations(pairs: &[DirectionPair]) -> Result<Rotations, Error> {
    if MAX_DIRECTIONS < pairs.len() {
        return Err(Error::WrongLayout {
            method: "rotations",
            reason: "it takes at most eight line directions",
        });
    }
    let [i, j] = widest(pairs).ok_or(Error::TooFewPoints { seen: pairs.len(), needed: 2 })?;
    let mut found = Rotations::new();
    let mut refusal = None;
    for (flip_i, flip_j) in [(false, false), (true, true), (false, true), (true, false)] {
        let first = [signed(&pairs[i], flip_i), signed(&pairs[j], flip_j)];
        match pure_rotation(&first).and_then(|r| pure_rotation(&along(&r.second_from_first, pairs))) {
            Ok(rotation) => found.push(rotation),
            Err(reason) => refusal = Some(reason),
        }
    }
    found.sort_unstable_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let gate = found.first().map_or(f64::INFINITY, |best| best.chi2 + SIGN_GATE_CHI2);
    found.retain(|r| r.chi2 <= gate);
    match refusal {
        Some(reason) if found.is_empty() => Err(reason),
        _ => Ok(found),
    }
}

fn signed(pair: &DirectionPair, flip: bool) -> DirectionPair {
    if flip { DirectionPair { in_second: -pair.in_second, ..*pair } } else { *pair }
}

/// The pairs with the arrows that a rotation gives them.
fn along(rotation: &Matrix3<f64>, pairs: &[DirectionPair]) -> ArrayVec<DirectionPair, MAX_DIRECTIONS> {
    let flip = |p: &DirectionPair| (rotation * p.in_first.into_inner()).dot(&p.in_second) < 0.0;
    pairs.iter().map(|p| signed(p, flip(p))).collect()
}

/// The two directions nearest to a right angle.
fn widest(pairs: &[DirectionPair]) -> Option<[usize; 2]> {
    let sine = |[i, j]: &[usize; 2]| pairs[*i].in_first.cross(&pairs[*j].in_first).norm_squared();
    let all = (0..pairs.len()).flat_map(|i| (i + 1..pairs.len()).map(move |j| [i, j]));
    all.max_by(|a, b| sine(a).total_cmp(&sine(b)))
}
