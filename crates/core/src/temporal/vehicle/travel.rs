//! Yaw and pitch: the direction of travel on straight stretches, with what curvature adds taken out: docs/math/vehicle.md sections 3 and 4.

use super::blocks::{Blocked, Sample, blocked};
use super::stretches::{Driven, Stretches, tangent};
use super::{Undetermined, VehicleAxes};
use crate::budget::{Budget, ErrorSource};
use crate::statistics::variance_ratio::tail_with_estimated_noise;
use nalgebra::{Matrix2, Vector2, Vector3};

/// Yaw and pitch of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Travel {
    /// Direction of travel, unit vector in the camera frame.
    pub in_cam: Vector3<f64>,
    /// The camera is rotated to the left of the direction of travel by this angle.
    pub yaw_rad: f64,
    /// The camera is rotated down from the direction of travel by this angle.
    pub pitch_rad: f64,
    /// Covariance of `[yaw; pitch]`, rad².
    pub covariance: Matrix2<f64>,
    /// Its parts.
    pub budget: Budget<Matrix2<f64>>,
    /// Shift of the direction by a rate of heading: radians per rad/s or, with speeds, per 1/m; to the left and up. The camera's distance ahead of
    /// the axle that does not slip is the first, in metres, where speeds are known and the camera has no roll.
    pub by_curvature: Vector2<f64>,
    /// Root mean square of single pairs about it, radians: `[yaw; pitch]`.
    pub scatter_rad: Vector2<f64>,
    /// Blocks of time that the covariance is computed from, and their length, seconds.
    pub n_blocks: usize,
    /// Their length, seconds.
    pub block_s: f64,
    /// The halves of the drive, where they disagree.
    pub(super) contradiction: Option<Halves>,
}

/// Difference of the direction between the halves of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Halves {
    /// `[yaw; pitch]` of the second half less that of the first, radians.
    pub difference_rad: Vector2<f64>,
    /// Their standard deviations.
    pub sigma_rad: Vector2<f64>,
    /// Probability of as much by chance.
    pub p: f64,
}

/// Seconds of straight motion needed: the blocks of time below are one second at least.
const LEAST_S: f64 = 10.0;
/// Standard deviation beyond which an angle is of no use.
pub(super) const MOST_SIGMA_RAD: f64 = 0.0175;
/// Scatter, in robust standard deviations, beyond which a pair is an outlier.
const GATE: f64 = 4.0;
/// MAD of a normal number.
const MAD: f64 = 0.674_49;
/// Probability below which halves disagree.
const ALPHA: f64 = 1e-4;
/// Prior of the shift by curvature: 3 m ahead of the axle; at 5 m/s or more where speeds are not known.
const LEVER_M: f64 = 3.0;
const LEVER_S: f64 = 0.6;

/// # Errors
/// What is not determined, and why.
pub(super) fn travel(stretches: &Stretches) -> Result<Travel, Undetermined> {
    if let Some(reason) = stretches.undetermined(LEAST_S) {
        return Err(reason);
    }
    let too_little =
        Undetermined::TooLittleStraight { straight_s: stretches.straight_s(), needed_s: LEAST_S };
    let straight: Vec<&Driven> = stretches.straight().collect();
    if stretches.straight_s() < LEAST_S {
        return Err(too_little);
    }
    let has_speed = straight.iter().all(|driven| driven.motion.speed_m_s.is_some_and(|v| 1.0 < v.abs()));
    let lever = if has_speed { LEVER_M } else { LEVER_S };
    let mut axes = VehicleAxes::new(&median_direction(&straight, &stretches.forward));
    let (mut samples, mut fit) = (Vec::new(), None);
    for _ in 0..2 {
        samples = gated(&straight, &axes, has_speed);
        let found: Blocked<2> = blocked(&samples, lever).ok_or(too_little)?;
        let moved = axes.forward + axes.left * found.constant.x + axes.up * found.constant.y;
        axes = VehicleAxes::new(&moved);
        fit = Some(found);
    }
    let fit = fit.ok_or(too_little)?;
    let travel = described(&axes, &fit, &samples, lever);
    let sigma_rad = travel.covariance.diagonal().max().sqrt();
    match sigma_rad <= MOST_SIGMA_RAD {
        true => Ok(travel),
        false => Err(Undetermined::Uncertain { sigma_rad, most_rad: MOST_SIGMA_RAD }),
    }
}

fn described(axes: &VehicleAxes, fit: &Blocked<2>, samples: &[Sample<2>], lever: f64) -> Travel {
    // A direction farther to the left is a camera rotated to the right of it, and by more the steeper it looks; one farther up, a camera rotated down.
    let by_tangent = Matrix2::new(-1.0 / axes.pitch_rad.cos(), 0.0, 0.0, 1.0);
    let square = |sample: &Sample<2>| {
        (sample.x - fit.constant - fit.slope * sample.slope).map(|residual| residual * residual)
    };
    let mean = samples.iter().map(square).sum::<Vector2<f64>>() / samples.len() as f64;
    let mut budget = Budget::default();
    for (source, part) in [(ErrorSource::SharedInBlock, &fit.scatter), (ErrorSource::Priors, &fit.prior)] {
        budget.add(source, &(by_tangent * part * by_tangent.transpose()));
    }
    Travel {
        in_cam: axes.forward,
        yaw_rad: axes.yaw_rad,
        pitch_rad: axes.pitch_rad,
        covariance: by_tangent * fit.covariance() * by_tangent.transpose(),
        budget,
        by_curvature: fit.slope,
        scatter_rad: mean.map(f64::sqrt),
        n_blocks: fit.n_blocks,
        block_s: fit.block_s,
        contradiction: halves(samples, lever, &by_tangent),
    }
}

/// The coordinates of each pair, without outliers, weighted by their own variance and the scatter that all have.
fn gated(straight: &[&Driven], axes: &VehicleAxes, has_speed: bool) -> Vec<Sample<2>> {
    let x: Vec<Vector2<f64>> =
        straight.iter().map(|driven| tangent(axes, &driven.direction.in_cam).into()).collect();
    let stated: Vec<Vector2<f64>> = straight.iter().map(|driven| variances(axes, driven)).collect();
    let centre = Vector2::from_fn(|k, _| median(x.iter().map(|x| x[k])));
    let scatter = Vector2::from_fn(|k, _| median(x.iter().map(|x| (x[k] - centre[k]).abs())) / MAD);
    let typical = Vector2::from_fn(|k, _| median(stated.iter().map(|v| v[k])));
    let common = Vector2::from_fn(|k, _| (scatter[k].powi(2) - typical[k]).max(0.1 * scatter[k].powi(2)));
    let is_near = |x: &Vector2<f64>, own: &Vector2<f64>| {
        (0..2).all(|k| (x[k] - centre[k]).abs() <= GATE * (own[k] + common[k]).sqrt())
    };
    let kept = straight.iter().zip(x.iter().zip(&stated)).filter(|(_, (x, own))| is_near(x, own));
    let sample = |(driven, (x, own)): (&&Driven, (&Vector2<f64>, &Vector2<f64>))| {
        let sign = if driven.is_reverse { -1.0 } else { 1.0 };
        let speed = driven.motion.speed_m_s.filter(|_| has_speed).map_or(sign, |v| v);
        Sample {
            t_s: driven.motion.t_s,
            x: *x,
            weight: (own + common).map(|variance| variance.max(f64::MIN_POSITIVE).recip()),
            slope: driven.rate.dot(&axes.up) / speed,
        }
    };
    kept.map(sample).collect()
}

fn variances(axes: &VehicleAxes, driven: &Driven) -> Vector2<f64> {
    let covariance = &driven.direction.covariance;
    Vector2::new(axes.left.dot(&(covariance * axes.left)), axes.up.dot(&(covariance * axes.up)))
}

/// Median of each coordinate across the main direction.
fn median_direction(straight: &[&Driven], forward: &Vector3<f64>) -> Vector3<f64> {
    let axes = VehicleAxes::new(forward);
    let at = |k: usize| median(straight.iter().map(|driven| tangent(&axes, &driven.direction.in_cam)[k]));
    axes.forward + axes.left * at(0) + axes.up * at(1)
}

pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The second half of the samples less the first; `None` where chance explains it.
fn halves(samples: &[Sample<2>], lever: f64, by_tangent: &Matrix2<f64>) -> Option<Halves> {
    let (first, second) = samples.split_at(samples.len() / 2);
    let [first, second]: [Blocked<2>; 2] = [blocked(first, lever)?, blocked(second, lever)?];
    let difference = by_tangent * (second.constant - first.constant);
    let covariance = by_tangent * (first.covariance() + second.covariance()) * by_tangent.transpose();
    let chi2 = difference.dot(&covariance.cholesky()?.solve(&difference));
    // The covariance is that of a mean with these degrees of freedom, widened for them once already.
    let freedom = (first.n_blocks.min(second.n_blocks) as f64 - 2.0).max(1.0);
    let p = tail_with_estimated_noise(2, freedom, chi2);
    let sigma_rad = covariance.diagonal().map(f64::sqrt);
    (p < ALPHA).then_some(Halves { difference_rad: difference, sigma_rad, p })
}
