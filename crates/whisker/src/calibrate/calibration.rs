//! A calibrated rig: the correction of its readings, and the share of its uncertainty in a contact.

use super::constraints::{Posed, Setting, State};
use super::model::{self, Gravity};
use super::parameters::{COUNT, Covariance, Parameter, Values};
use crate::contact::Method;
use crate::estimate::Mode;
use crate::{Cell, PlanarPose, Rod, Sample};
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};

/// The calibrated rig: converts readings to loads at the clamp, and computes the contribution of its own uncertainty to a contact.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The rod as it was given, before [`Parameter::Stiffness`] and [`Parameter::Curvature`].
    pub nominal_rod: Rod,
    /// The parameters.
    pub values: Values,
    /// Their covariance; parameters that were held have none.
    pub covariance: Covariance,
    /// Gravity, where the weight is modelled.
    pub gravity: Option<Gravity>,
}

impl Calibration {
    /// An ideal rig: nothing to correct, nothing uncertain.
    pub fn ideal(rod: &Rod) -> Self {
        Calibration {
            nominal_rod: rod.clone(),
            values: Values::zeros(),
            covariance: Covariance::zeros(),
            gravity: None,
        }
    }

    /// One parameter, in its unit.
    pub fn value(&self, parameter: Parameter) -> f64 {
        self.values[parameter.index()]
    }

    /// Its standard deviation; 0 where it was fixed.
    pub fn sigma(&self, parameter: Parameter) -> f64 {
        self.covariance[(parameter.index(), parameter.index())].sqrt()
    }

    /// The rod: the one given with its EI scaled and its curvature shifted.
    pub fn rod(&self) -> Rod {
        model::rod_of(&self.values, &self.nominal_rod)
    }

    /// The readings of the cell with nothing touched, without weight: N, N, N·m.
    pub fn zeros(&self) -> Vector3<f64> {
        let [x, y, m] = [Parameter::ForceXZero, Parameter::ForceYZero, Parameter::TorqueZero];
        Vector3::new(self.value(x), self.value(y), self.value(m))
    }

    /// Force over reading.
    pub fn force_gain(&self) -> f64 {
        self.value(Parameter::ForceGain).exp()
    }

    /// Torque over reading.
    pub fn torque_gain(&self) -> f64 {
        self.value(Parameter::TorqueGain).exp()
    }

    /// The clamp from the hub position read, world axes, metres.
    pub fn hub_offset_m(&self) -> Vector2<f64> {
        Vector2::new(self.value(Parameter::HubX), self.value(Parameter::HubY))
    }

    /// The cell's origin from the clamp, hub axes, metres.
    pub fn cell_origin_m(&self) -> Vector2<f64> {
        Vector2::new(self.value(Parameter::CellOriginX), self.value(Parameter::CellOriginY))
    }

    /// Coefficient of friction.
    pub fn mu(&self) -> f64 {
        self.value(Parameter::FrictionAngle).tan()
    }

    /// Its standard deviation.
    pub fn mu_sigma(&self) -> f64 {
        self.sigma(Parameter::FrictionAngle) / self.value(Parameter::FrictionAngle).cos().powi(2)
    }

    /// The sample as it is meant: the load of the object at the clamp, clamp axes; the clamp's place in the world.
    pub fn apply(&self, sample: &Sample) -> Sample {
        let meant = model::meant(&self.values, self.gravity.as_ref(), sample);
        Sample { load: meant.load, world_from_hub: meant.world_from_hub, ..*sample }
    }

    /// The cell with the noise of loads as [`Calibration::apply`] gives them: gains scale it. Turning it by the cell's angle and
    /// moving it by the cell's origin are left out, a part in 10⁴ of it.
    pub fn apply_to_cell(&self, cell: &Cell) -> Cell {
        let (force, torque) = (self.force_gain(), self.torque_gain());
        Cell {
            force_sigma_n: cell.force_sigma_n * force,
            force_step_n: cell.force_step_n * force,
            torque_sigma_n_m: cell.torque_sigma_n_m * torque,
            torque_step_n_m: cell.torque_step_n_m * torque,
            ..*cell
        }
    }

    /// The share of the calibration's own uncertainty in the covariance of a contact `[x, y, θ]` of `sample` (as read, not applied),
    /// world: the same error in all samples, so it does not average out. For `Mode::Mid` and `Mode::Tip` of a contact estimated
    /// under that constraint, `Mode::Free` of one estimated from its load alone. None where the sample has no contact.
    /// docs/math/whisker_calibrate.md eqs. (16)–(17).
    pub fn systematic_covariance(&self, cell: &Cell, sample: &Sample, mode: Mode) -> Option<Matrix3<f64>> {
        let by_parameters = self.contact_by_parameters(cell, sample, mode)?;
        Some(by_parameters * self.covariance * by_parameters.transpose())
    }

    /// ∂[x, y, θ]/∂parameters of the contact of `sample`, world.
    fn contact_by_parameters(
        &self,
        cell: &Cell,
        sample: &Sample,
        mode: Mode,
    ) -> Option<SMatrix<f64, 3, COUNT>> {
        let state = State::at(self.values);
        let setting = Setting {
            rod: &self.nominal_rod,
            gravity: self.gravity.as_ref(),
            outline: None,
            method: Method::Auto,
            curvature_is_free: 0.0 < self.sigma(Parameter::Curvature),
        };
        let posed = Posed::new(setting, &state);
        let touched = posed.touched(sample)?;
        let hub = &touched.meant.world_from_hub;
        let turn = world_axes(hub);
        let by_load = turn * touched.by_load.fixed_rows::<3>(0);
        let mut by = by_load * touched.meant.load_by_parameters;
        let mut add = |parameter: Parameter, column: Vector3<f64>| {
            let sum = by.column(parameter.index()) + column;
            by.set_column(parameter.index(), &sum);
        };
        let arm = hub.rotate(touched.at.x_in_hub);
        add(Parameter::Stiffness, turn * touched.by_stiffness.fixed_rows::<3>(0));
        add(Parameter::Curvature, turn * touched.by_curvature.fixed_rows::<3>(0));
        add(Parameter::HubAngle, Vector3::new(-arm.y, arm.x, 1.0));
        add(Parameter::HubX, Vector3::x());
        add(Parameter::HubY, Vector3::y());
        let constraint = match mode {
            Mode::Free => return Some(by),
            Mode::Mid => posed.sliding(&touched),
            Mode::Tip => posed.at_tip(&touched),
        };
        // Projected onto the constraint, the contact follows the constraint's own shift: K = J Σ gᵀ/(g Σ gᵀ).
        let by_reading = by_load * touched.meant.load_by_reading;
        let gradient = constraint.by_observed.fixed_columns::<3>(0).transpose();
        let spread = cell.load_covariance() * gradient;
        let gain = by_reading * spread / gradient.dot(&spread);
        Some(by - gain * constraint.by_parameters)
    }
}

/// Turns `[x, y, θ]` of the hub frame into world axes.
fn world_axes(hub: &PlanarPose) -> Matrix3<f64> {
    let (sin, cos) = hub.angle_rad.sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}
