//! Roll: the axis of rotation in curves, and the normal of the ground: docs/math/vehicle.md sections 5 and 6.

use super::blocks::{Sample, blocked};
use super::height::variance;
use super::stretches::{Curve, Stretches};
use super::travel::{Travel, median};
use super::{Contradiction, Undetermined, VehicleAxes};
use crate::budget::{Budget, ErrorSource};
use nalgebra::{Matrix1, Matrix2, SVector, Vector2};

/// Roll of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Roll {
    /// The camera is rotated about the direction of travel, its right side down, by this angle.
    pub roll_rad: f64,
    /// Its standard deviation.
    pub sigma_rad: f64,
    /// The parts of its variance, rad².
    pub budget: Budget<Matrix1<f64>>,
    /// Roll by the curves alone.
    pub by_curves: Option<RollSource>,
    /// Roll by the ground alone.
    pub by_ground: Option<RollSource>,
}

/// What one source tells of the roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RollSource {
    /// Roll.
    pub roll_rad: f64,
    /// Its standard deviation.
    pub sigma_rad: f64,
    /// Number of curves, or of pairs of frames that show the ground.
    pub n: usize,
    /// Whether all curves are to one side, so that the body's own lean is in the roll; false for the ground.
    pub one_sided: bool,
}

/// Change of heading from which on a curve counts, radians.
const LEAST_HEADING_RAD: f64 = 0.17;
/// A curve's change of grade, or of the body's pitch from its begin to its end, radians.
const GRADE_RAD: f64 = 0.01;
/// Scatter of the body's lean and the road's bank from curve to curve, radians: 1°.
const LEAN_SCATTER_RAD: f64 = 0.0175;
/// Lean and bank common to all curves, outwards positive: 2°.
const LEAN_RAD: f64 = 0.035;
/// Weight of these scatters, in curves, against the scatter that the curves show.
const PRIOR_FREEDOM: f64 = 4.0;
/// The road below the camera against the plane that the wheels stand on, crossfall and ruts: 0.2°.
const ROAD_RAD: f64 = 0.0035;
/// Pairs that must show the ground.
const LEAST_PAIRS: usize = 20;
/// A larger standard deviation is of no use.
pub(super) const MOST_SIGMA_RAD: f64 = 0.0875;
/// Beyond this angle curves do not tell whether the camera stands on its head.
const MOST_ROLL_RAD: f64 = 1.2;
/// Sources differ by more than this many standard deviations: once in 10,000 times.
const CONFLICT: f64 = 3.9;

/// The roll of all sources.
///
/// # Errors
/// What is not determined, and why.
pub(super) fn roll(stretches: &Stretches, travel: &Travel) -> Result<Roll, Undetermined> {
    let axes = VehicleAxes::new(&travel.in_cam);
    let (by_curves, by_ground) = (of_curves(&stretches.curves(), &axes), of_ground(stretches, &axes));
    let sources: Vec<&Source> = [by_curves.as_ref().ok(), by_ground.as_ref()].into_iter().flatten().collect();
    let weights: f64 = sources.iter().map(|(source, _)| source.sigma_rad.powi(-2)).sum();
    if !(0.0 < weights) {
        return Err(by_curves.err().unwrap_or(Undetermined::NoGround));
    }
    let (mut roll_rad, mut budget) = (0.0, Budget::default());
    for (source, parts) in sources {
        let share = source.sigma_rad.powi(-2) / weights;
        roll_rad += share * source.roll_rad;
        parts.parts().iter().for_each(|part| budget.add(part.source, &(part.covariance * share * share)));
    }
    let sigma_rad = weights.sqrt().recip();
    let (by_curves, by_ground) =
        (by_curves.ok().map(|(source, _)| source), by_ground.map(|(source, _)| source));
    match (roll_rad.abs() <= MOST_ROLL_RAD, sigma_rad <= MOST_SIGMA_RAD) {
        (true, true) => Ok(Roll { roll_rad, sigma_rad, budget, by_curves, by_ground }),
        (false, _) => Err(Undetermined::NotUpright { roll_rad, most_rad: MOST_ROLL_RAD }),
        (_, false) => Err(Undetermined::Uncertain { sigma_rad, most_rad: MOST_SIGMA_RAD }),
    }
}

/// Whether the sources differ by more than they state; `lens_variance` is what the intrinsics add to the variance of their difference.
pub(super) fn conflict(roll: &Roll, lens_variance: f64) -> Option<Contradiction> {
    let (curves, ground) = (roll.by_curves?, roll.by_ground?);
    let difference_rad = curves.roll_rad - ground.roll_rad;
    let sigma_rad = (curves.sigma_rad.powi(2) + ground.sigma_rad.powi(2) + lens_variance).sqrt();
    (CONFLICT * sigma_rad < difference_rad.abs())
        .then_some(Contradiction::RollSources { difference_rad, sigma_rad })
}

/// A source of the roll, with the parts of its variance.
type Source = (RollSource, Budget<Matrix1<f64>>);

/// The axis of each curve, with the body's lean as a second unknown: eqs. (13)–(16).
fn of_curves(curves: &[Curve], axes: &VehicleAxes) -> Result<Source, Undetermined> {
    let largest = curves.iter().map(|curve| curve.rotation.norm()).fold(0.0, f64::max);
    let none = Undetermined::NoCurve { heading_rad: largest, needed_rad: LEAST_HEADING_RAD };
    // Coordinates (up, left) of each axis; a mean axis first, so that a camera far from upright is no special case.
    let used: Vec<Vector2<f64>> = curves
        .iter()
        .map(|curve| Vector2::new(axes.up.dot(&curve.rotation), axes.left.dot(&curve.rotation)))
        .filter(|rotation| LEAST_HEADING_RAD <= rotation.norm())
        .collect();
    let doubled: Vector2<f64> = used.iter().map(squared_direction).sum();
    if used.is_empty() || !(0.0 < doubled.norm()) {
        return Err(none);
    }
    let centre = 0.5 * doubled.y.atan2(doubled.x);
    let (sin, cos) = centre.sin_cos();
    let (mut information, mut sum, mut squares) = (Matrix2::zeros(), Vector2::zeros(), 0.0);
    information[(1, 1)] = LEAN_RAD.powi(-2);
    for rotation in &used {
        let (along, across) = (cos * rotation.x + sin * rotation.y, cos * rotation.y - sin * rotation.x);
        let (own, weight) = (across / along, weight(along));
        // The body leans outwards: to the right in a curve to the left.
        let row = Vector2::new(1.0, along.signum());
        information += row * row.transpose() * weight;
        sum += row * (own * weight);
        squares += own * own * weight;
    }
    let inverse = information.try_inverse().ok_or(none)?;
    let fitted = inverse * sum;
    // With the prior of the lean, as many terms as curves less the roll itself.
    let chi2 = (squares - fitted.dot(&sum)).max(0.0);
    let freedom = used.len() as f64 - 1.0;
    let beyond = ((PRIOR_FREEDOM + chi2) / (PRIOR_FREEDOM + freedom) - 1.0).max(0.0);
    let mut budget = Budget::default();
    budget.add(ErrorSource::Priors, &Matrix1::new(inverse[(0, 0)]));
    budget.add(ErrorSource::Residuals, &Matrix1::new(inverse[(0, 0)] * beyond));
    let left = used.iter().filter(|rotation| 0.0 < cos * rotation.x + sin * rotation.y).count();
    let source = RollSource {
        roll_rad: centre + fitted.x,
        sigma_rad: variance(&budget).sqrt(),
        n: used.len(),
        one_sided: left == 0 || left == used.len(),
    };
    Ok((source, budget))
}

/// The direction at twice the angle, which an axis and its opposite have in common, weighted by the square of the length.
fn squared_direction(v: &Vector2<f64>) -> Vector2<f64> {
    Vector2::new(v.x * v.x - v.y * v.y, 2.0 * v.x * v.y)
}

/// Inverse variance of the axis of a curve, eq. (14).
fn weight(heading_rad: f64) -> f64 {
    (2.0 * (GRADE_RAD / heading_rad).powi(2) + LEAN_SCATTER_RAD.powi(2)).recip()
}

/// The mean of the ground's normals on straight stretches.
fn of_ground(stretches: &Stretches, axes: &VehicleAxes) -> Option<Source> {
    let seen = stretches.straight().filter_map(|driven| Some((driven.motion.t_s, driven.motion.ground?)));
    let angle = |up: &nalgebra::Vector3<f64>| axes.left.dot(up).atan2(axes.up.dot(up));
    let all: Vec<(f64, f64, f64)> =
        seen.map(|(t_s, ground)| (t_s, angle(&ground.up_in_cam), ground.roll_sigma_rad)).collect();
    if all.len() < LEAST_PAIRS {
        return None;
    }
    let centre = median(all.iter().map(|(_, angle, _)| *angle));
    let scatter = (median(all.iter().map(|(_, angle, _)| (angle - centre).abs())) / 0.674_49).max(1e-6);
    let kept = all.iter().filter(|(_, angle, sigma)| (angle - centre).abs() <= 4.0 * scatter.hypot(*sigma));
    let samples: Vec<Sample<1>> = kept
        .map(|(t_s, angle, sigma)| Sample {
            t_s: *t_s,
            x: SVector::from([angle - centre]),
            weight: SVector::from([(scatter * scatter + sigma * sigma).recip()]),
            slope: 0.0,
        })
        .collect();
    let fit = blocked(&samples, 1.0)?;
    let mut budget = Budget::default();
    budget.add(ErrorSource::SharedInBlock, &fit.scatter);
    budget.add(ErrorSource::Priors, &Matrix1::new(ROAD_RAD * ROAD_RAD));
    let (roll_rad, sigma_rad) = (centre + fit.constant[0], variance(&budget).sqrt());
    Some((RollSource { roll_rad, sigma_rad, n: samples.len(), one_sided: false }, budget))
}
