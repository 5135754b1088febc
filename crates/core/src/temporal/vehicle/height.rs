//! Height above the ground, from the ground in units of the distance travelled, and the speed: docs/math/vehicle.md section 7.

use super::blocks::{Sample, blocked};
use super::stretches::{Driven, Stretches};
use super::travel::median;
use super::{Undetermined, VehicleConfig};
use crate::budget::{Budget, ErrorSource};
use nalgebra::{Matrix1, SVector};

/// Height of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Height {
    /// Above the ground, metres.
    pub height_m: f64,
    /// Its standard deviation, that of the scale of the speeds included.
    pub sigma_m: f64,
    /// The parts of its variance, m².
    pub budget: Budget<Matrix1<f64>>,
    /// Pairs of frames that show the ground.
    pub n: usize,
}

/// Shortest distance between two frames that has a scale, metres.
const LEAST_M: f64 = 0.1;
/// A ditch beside the road, or the pavement, against the road below the wheels, as a share of the height.
const ROAD_SHARE: f64 = 0.01;

/// # Errors
/// `NoSpeed`, `NoGround`.
pub(super) fn height(stretches: &Stretches, config: &VehicleConfig) -> Result<Height, Undetermined> {
    let ground: Vec<&Driven> = stretches.straight().filter(|driven| driven.motion.ground.is_some()).collect();
    if ground.is_empty() {
        return Err(Undetermined::NoGround);
    }
    let height = |driven: &&Driven| {
        let (motion, ground) = (driven.motion, driven.motion.ground?);
        let distance_m = motion.speed_m_s?.abs() * motion.duration_s;
        let height_m = ground.height_per_baseline * distance_m;
        (LEAST_M < distance_m).then_some((motion.t_s, height_m, height_m * ground.relative_sigma))
    };
    let heights: Vec<(f64, f64, f64)> = ground.iter().filter_map(height).collect();
    if heights.is_empty() {
        return Err(Undetermined::NoSpeed);
    }
    let centre = median(heights.iter().map(|(_, height, _)| *height));
    let scatter = median(heights.iter().map(|(_, height, _)| (height - centre).abs())) / 0.674_49;
    let kept =
        heights.iter().filter(|(_, height, sigma)| (height - centre).abs() <= 4.0 * scatter.hypot(*sigma));
    let samples: Vec<Sample<1>> = kept
        .map(|(t_s, height, sigma)| Sample {
            t_s: *t_s,
            x: SVector::from([height - centre]),
            weight: SVector::from([(scatter * scatter + sigma * sigma).max(1e-12).recip()]),
            slope: 0.0,
        })
        .collect();
    let fit = blocked(&samples, 1.0).ok_or(Undetermined::NoGround)?;
    let height_m = centre + fit.constant[0];
    let mut budget = Budget::default();
    budget.add(ErrorSource::SharedInBlock, &fit.scatter);
    budget.add(ErrorSource::Distances, &Matrix1::new((height_m * config.speed_relative_sigma).powi(2)));
    budget.add(ErrorSource::Priors, &Matrix1::new((height_m * ROAD_SHARE).powi(2)));
    let sigma_m = variance(&budget).sqrt();
    Ok(Height { height_m, sigma_m, budget, n: samples.len() })
}

/// The sum of the parts.
pub(super) fn variance(budget: &Budget<Matrix1<f64>>) -> f64 {
    budget.parts().iter().map(|part| part.covariance.x).sum()
}
