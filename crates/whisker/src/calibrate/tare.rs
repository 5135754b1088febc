//! The readings of the cell with nothing touched.

use super::model::{Gravity, unit_weight};
use crate::{Cell, Error, Sample};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Vector3, Vector4};

/// The readings of an untouched whisker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tare {
    /// `[fx, fy, mz]` without weight, N, N, N·m.
    pub zeros: Vector3<f64>,
    /// The whisker's weight in the plane, newtons; 0 without gravity.
    pub weight_n: f64,
    /// Covariance of `[fx, fy, mz, weight]`, N, N·m.
    pub covariance: Matrix4<f64>,
    /// Squared misfit of the readings, in the noise stated.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
}

/// Fewer samples leave the zeros as uncertain as a reading.
const LEAST: usize = 3;

/// Zeros, and with gravity the weight, from samples during which nothing is touched; the mean where there is no gravity.
/// docs/math/whisker_calibrate.md eq. (5). The weight needs two hub angles: at one alone it is part of the zeros, and stays 0.
pub fn tare(cell: &Cell, free: &[Sample], gravity: Option<&Gravity>) -> Result<Tare, Error> {
    if free.len() < LEAST {
        let way_out = "record the whisker in free air for some seconds";
        return Err(Error::TooFew { what: "free samples", seen: free.len(), needed: LEAST, way_out });
    }
    if free.iter().any(|s| !s.load.is_finite() || !s.world_from_hub.angle_rad.is_finite()) {
        return Err(Error::NotFinite { what: "a free sample's load or hub angle" });
    }
    let weights = cell.load_covariance().try_inverse().unwrap_or_else(Matrix3::identity);
    let turns =
        free.iter().any(|s| 1e-3 < (s.world_from_hub.angle_rad - free[0].world_from_hub.angle_rad).abs());
    let gravity = gravity.filter(|_| turns);
    let mut information = Matrix4::zeros();
    let mut right = Vector4::zeros();
    if gravity.is_none() {
        information[(3, 3)] = 1.0;
    }
    let design = |sample: &Sample| {
        let weight = gravity.map_or(Vector3::zeros(), |g| unit_weight(g, sample.world_from_hub.angle_rad));
        let mut design = Matrix3x4::identity();
        design.set_column(3, &weight);
        design
    };
    for sample in free {
        let a = design(sample);
        information += a.transpose() * weights * a;
        right += a.transpose() * weights * sample.load.to_vector();
    }
    let mut covariance =
        information.try_inverse().ok_or(Error::NotPositive { what: "the cell's noise", seen: 0.0 })?;
    if gravity.is_none() {
        covariance[(3, 3)] = 0.0;
    }
    let solution = covariance * right;
    let chi2 = free
        .iter()
        .map(|s| {
            let off = s.load.to_vector() - design(s) * solution;
            off.dot(&(weights * off))
        })
        .sum();
    let unknowns = if gravity.is_some() { 4 } else { 3 };
    Ok(Tare {
        zeros: solution.xyz(),
        weight_n: solution.w,
        covariance,
        chi2,
        degrees_of_freedom: 3 * free.len() - unknowns,
    })
}

/// The most crowded place among the readings, roughly: the mean of those within 4 σ of the reading that has most of them. Only an
/// untouched whisker reads the same again and again while the hub moves; so this finds the zeros without knowing which samples are free.
pub fn most_crowded(cell: &Cell, samples: &[Sample]) -> Option<Vector3<f64>> {
    let weights = cell.load_covariance().try_inverse()?;
    let loads: Vec<Vector3<f64>> =
        samples.iter().filter(|s| s.load.is_finite()).map(|s| s.load.to_vector()).collect();
    // Two honest free readings differ by χ² of three degrees of freedom times two: 95 % within 16.
    let near = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).dot(&(weights * (a - b))) < 16.0;
    let every = 1 + loads.len() / 500;
    let mut centre =
        *loads.iter().step_by(every).max_by_key(|a| loads.iter().filter(|b| near(a, b)).count())?;
    for _ in 0..3 {
        let crowd: Vec<&Vector3<f64>> = loads.iter().filter(|load| near(&centre, load)).collect();
        if crowd.is_empty() {
            break;
        }
        centre = crowd.iter().copied().sum::<Vector3<f64>>() / crowd.len() as f64;
    }
    Some(centre)
}
