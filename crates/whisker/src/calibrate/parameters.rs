//! The parameters of a calibration, and their priors.

use crate::{Cell, Error};
use nalgebra::{SMatrix, SVector};

/// The number of parameters.
pub const COUNT: usize = 15;

/// One number per [`Parameter`], in the order of [`Parameter::ALL`] and its unit.
pub type Values = SVector<f64, COUNT>;

/// Covariance of [`Values`], in the products of their units.
pub type Covariance = SMatrix<f64, COUNT, COUNT>;

/// A parameter of the rig. docs/math/whisker_calibrate.md eqs. (1)–(4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Parameter {
    /// ln(EI / the EI given).
    Stiffness,
    /// The cell's reading along the clamped whisker with nothing touched, newtons.
    ForceXZero,
    /// Its transverse force reading, newtons.
    ForceYZero,
    /// Its torque reading, newton metres.
    TorqueZero,
    /// ln(force / reading).
    ForceGain,
    /// ln(torque / reading).
    TorqueGain,
    /// Direction of the cell's x axis from the clamped whisker's, radians.
    CellAngle,
    /// Direction of the clamped whisker from the hub angle read, radians.
    HubAngle,
    /// The clamp from the hub position read, along the world's x axis, metres.
    HubX,
    /// The clamp from the hub position read, along the world's y axis, metres.
    HubY,
    /// The cell's origin from the clamp, along the clamped whisker, metres.
    CellOriginX,
    /// The cell's origin from the clamp, to the whisker's left, metres.
    CellOriginY,
    /// Intrinsic curvature besides the one given, 1/m.
    Curvature,
    /// φ = atan μ while the whisker slides, radians.
    FrictionAngle,
    /// The whisker's weight in the plane, newtons.
    Weight,
}

impl Parameter {
    /// All parameters, in the order of [`Values`].
    pub const ALL: [Parameter; COUNT] = [
        Parameter::Stiffness,
        Parameter::ForceXZero,
        Parameter::ForceYZero,
        Parameter::TorqueZero,
        Parameter::ForceGain,
        Parameter::TorqueGain,
        Parameter::CellAngle,
        Parameter::HubAngle,
        Parameter::HubX,
        Parameter::HubY,
        Parameter::CellOriginX,
        Parameter::CellOriginY,
        Parameter::Curvature,
        Parameter::FrictionAngle,
        Parameter::Weight,
    ];

    /// Returns its index in [`Values`].
    pub fn index(self) -> usize {
        self as usize
    }

    /// Returns its name in files and messages, which ends in its unit.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::Stiffness => "ln_stiffness",
            Parameter::ForceXZero => "zero_fx_n",
            Parameter::ForceYZero => "zero_fy_n",
            Parameter::TorqueZero => "zero_mz_n_m",
            Parameter::ForceGain => "ln_force_gain",
            Parameter::TorqueGain => "ln_torque_gain",
            Parameter::CellAngle => "cell_angle_offset_rad",
            Parameter::HubAngle => "hub_angle_offset_rad",
            Parameter::HubX => "hub_offset_x_m",
            Parameter::HubY => "hub_offset_y_m",
            Parameter::CellOriginX => "cell_origin_x_m",
            Parameter::CellOriginY => "cell_origin_y_m",
            Parameter::Curvature => "curvature_offset_per_m",
            Parameter::FrictionAngle => "friction_angle_rad",
            Parameter::Weight => "weight_n",
        }
    }
}

/// The prior of each parameter: a standard deviation about the start, 0 for a fixed one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priors(Values);

impl Priors {
    /// A rig as it is delivered: EI within 10 %, torque gain within 3 %, angles within half a degree, the clamp within 1 mm, zeros
    /// within 100 standard deviations of the cell, friction unknown. Held: the force gain, which sets the unit of force
    /// (docs/math/whisker_calibrate.md section 3), and what few rigs leave open: cell origin, intrinsic curvature, weight.
    pub fn of_a_new_rig(cell: &Cell) -> Self {
        let mut sigmas = Values::zeros();
        let half_degree = 0.5_f64.to_radians();
        let noise = cell.load_covariance().diagonal().map(f64::sqrt) * 100.0;
        for (parameter, sigma) in [
            (Parameter::Stiffness, 0.1),
            (Parameter::ForceXZero, noise.x),
            (Parameter::ForceYZero, noise.y),
            (Parameter::TorqueZero, noise.z),
            (Parameter::TorqueGain, 0.03),
            (Parameter::CellAngle, half_degree),
            (Parameter::HubAngle, half_degree),
            (Parameter::HubX, 1e-3),
            (Parameter::HubY, 1e-3),
            (Parameter::FrictionAngle, 0.5),
        ] {
            sigmas[parameter.index()] = sigma;
        }
        Priors(sigmas)
    }

    /// Every parameter held.
    pub fn all_held() -> Self {
        Priors(Values::zeros())
    }

    /// Returns the priors with another standard deviation for one parameter; 0 fixes it.
    pub fn with(mut self, parameter: Parameter, sigma: f64) -> Self {
        self.0[parameter.index()] = sigma;
        self
    }

    /// The standard deviation of `parameter`, in its unit.
    pub fn sigma(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Returns all standard deviations.
    pub fn sigmas(&self) -> &Values {
        &self.0
    }

    /// The covariance they amount to.
    pub fn covariance(&self) -> Covariance {
        Covariance::from_diagonal(&self.0.map(|sigma| sigma * sigma))
    }

    /// The parameters that are not held.
    pub fn free(&self) -> Vec<Parameter> {
        Parameter::ALL.into_iter().filter(|p| 0.0 < self.sigma(*p)).collect()
    }

    /// Refuses what is no standard deviation.
    pub fn check(&self) -> Result<(), Error> {
        let what = "a calibration's prior standard deviation";
        match self.0.iter().find(|sigma| !(sigma.is_finite() && 0.0 <= **sigma)) {
            Some(seen) if seen.is_finite() => Err(Error::Negative { what, seen: *seen }),
            Some(_) => Err(Error::NotFinite { what }),
            None => Ok(()),
        }
    }
}
