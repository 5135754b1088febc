//! What the uncertainty of the intrinsics adds to yaw, pitch, roll and height: docs/math/vehicle.md section 9.

use super::height::variance;
use super::{FrameMotion, RollSource, Undetermined, VehicleConfig, VehicleEstimate, estimated, roll, travel};
use crate::Error;
use crate::budget::ErrorSource;
use core::f64::consts::{PI, TAU};
use nalgebra::{Matrix1, Matrix2, SVector};

/// The same drive through two other lenses, whose parameters differ from those stated by one of the columns l of eq. (18), to both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct LensVariation {
    /// The motions, with the parameters k + l.
    pub plus: Vec<FrameMotion>,
    /// … k − l.
    pub minus: Vec<FrameMotion>,
}

/// Yaw, pitch, roll, roll by curves, roll by the ground, their difference, height.
const N: usize = 7;

/// Numbers that are not determined are NaN.
fn numbers(estimate: &VehicleEstimate) -> SVector<f64, N> {
    let travel = estimate.travel.as_ref().ok();
    let roll = estimate.roll.as_ref().ok();
    let curves = roll.and_then(|roll| roll.by_curves).map(|source| source.roll_rad);
    let ground = roll.and_then(|roll| roll.by_ground).map(|source| source.roll_rad);
    let all = [
        travel.map(|travel| travel.yaw_rad),
        travel.map(|travel| travel.pitch_rad),
        roll.map(|roll| roll.roll_rad),
        curves,
        ground,
        curves.zip(ground).map(|(curves, ground)| curves - ground),
        estimate.height.as_ref().ok().map(|height| height.height_m),
    ];
    SVector::from(all.map(|x| x.unwrap_or(f64::NAN)))
}

/// Half the difference of both sides; where one of them determines nothing, the difference of the other.
fn column(at: &SVector<f64, N>, plus: &SVector<f64, N>, minus: &SVector<f64, N>) -> SVector<f64, N> {
    SVector::from_fn(|k, _| {
        let by = |x: f64, y: f64| if k == 0 { (x - y + PI).rem_euclid(TAU) - PI } else { x - y };
        match (plus[k].is_finite(), minus[k].is_finite()) {
            (true, true) => 0.5 * by(plus[k], minus[k]),
            (true, false) => by(plus[k], at[k]),
            _ => by(at[k], minus[k]),
        }
    })
}

/// Adds the part of the lens to each covariance: eq. (18). Returns what it adds to the variance of the difference between both rolls.
///
/// # Errors
/// Motions that cannot be.
pub(super) fn add(
    estimate: &mut VehicleEstimate,
    variations: &[LensVariation],
    config: &VehicleConfig,
) -> Result<f64, Error> {
    let at = numbers(estimate);
    let mut columns = Vec::new();
    for LensVariation { plus, minus } in variations {
        columns.push(column(&at, &numbers(&estimated(plus, config)?), &numbers(&estimated(minus, config)?)));
    }
    let product = |i: usize, j: usize| columns.iter().map(|c| c[i] * c[j]).sum::<f64>();
    if let Ok(found) = &mut estimate.travel {
        let part = Matrix2::new(product(0, 0), product(0, 1), product(1, 0), product(1, 1));
        found.budget.add(ErrorSource::Lens, &part);
        found.covariance += part;
        let sigma_rad = found.covariance.diagonal().max().sqrt();
        if let Some(reason) = too_uncertain(sigma_rad, travel::MOST_SIGMA_RAD) {
            estimate.travel = Err(reason);
            estimate.roll = Err(Undetermined::NoDirection);
        }
    }
    if let Ok(found) = &mut estimate.roll {
        found.budget.add(ErrorSource::Lens, &Matrix1::new(product(2, 2)));
        found.sigma_rad = variance(&found.budget).sqrt();
        for (source, k) in [(&mut found.by_curves, 3), (&mut found.by_ground, 4)] {
            let with_lens = |sigma_rad: f64| sigma_rad.hypot(product(k, k).sqrt());
            *source = source
                .map(|source| RollSource { sigma_rad: with_lens(source.sigma_rad), ..source })
                .filter(|source| source.sigma_rad.is_finite());
        }
        if let Some(reason) = too_uncertain(found.sigma_rad, roll::MOST_SIGMA_RAD) {
            estimate.roll = Err(reason);
        }
    }
    if let Ok(found) = &mut estimate.height {
        found.budget.add(ErrorSource::Lens, &Matrix1::new(product(6, 6)));
        found.sigma_m = variance(&found.budget).sqrt();
        if !found.sigma_m.is_finite() {
            estimate.height = Err(Undetermined::LensUncertain { sigma_rad: None });
        }
    }
    Ok(product(5, 5))
}

/// A sigma that is no number is that of a lens through which the drive determines nothing.
fn too_uncertain(sigma_rad: f64, most_rad: f64) -> Option<Undetermined> {
    (!(sigma_rad <= most_rad)).then_some(Undetermined::LensUncertain {
        sigma_rad: sigma_rad.is_finite().then_some((sigma_rad, most_rad)),
    })
}
