//! The correction of readings, and its derivatives by every parameter.
//!
//! ```text
//!   r = [fx, fy, mz] read · z zeros · w weight, γ its load at the hub angle ψ · G_f, G_m gains · δ cell angle · p cell origin
//!   d = r − z − w γ(ψ) · f = G_f R(δ) d_xy · M₀ = G_m d_m + p × f                        docs/math/whisker_calibrate.md (1)–(2)
//!   clamp in the world = hub read + o, direction ψ + α                                                                    (3)
//! ```

use super::parameters::{Parameter, Values};
use crate::rod::{IntrinsicCurvature, Stiffness};
use crate::{HubLoad, PlanarPose, Rod, Sample};
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

use super::parameters::COUNT;

/// Gravity in the plane of bending.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gravity {
    /// Direction in which things fall, world, counter-clockwise from its x axis, radians.
    pub direction_rad: f64,
    /// The whisker's centre of mass from the clamp, metres; half the length of a uniform whisker.
    pub lever_m: f64,
}

/// The load a unit weight adds: `[1, 1, m]` along the clamped whisker, across it, and about the clamp.
pub fn unit_weight(gravity: &Gravity, hub_angle_rad: f64) -> Vector3<f64> {
    let (sin, cos) = (gravity.direction_rad - hub_angle_rad).sin_cos();
    Vector3::new(cos, sin, gravity.lever_m * sin)
}

/// A sample as it is meant: the load at the clamp, clamp axes, and the clamp's place.
#[derive(Debug, Clone, Copy)]
pub struct Meant {
    /// Load of the object on the whisker.
    pub load: HubLoad,
    /// The pose of the clamp.
    pub world_from_hub: PlanarPose,
    /// ∂load/∂reading.
    pub load_by_reading: Matrix3<f64>,
    /// ∂load/∂parameters: only those that act on the load (the rod's and the hub's do not).
    pub load_by_parameters: SMatrix<f64, 3, COUNT>,
}

/// `sample` corrected by `values`.
pub fn meant(values: &Values, gravity: Option<&Gravity>, sample: &Sample) -> Meant {
    let v = |parameter: Parameter| values[parameter.index()];
    let weight = gravity.map_or(Vector3::zeros(), |g| unit_weight(g, sample.world_from_hub.angle_rad));
    let zeros = Vector3::new(v(Parameter::ForceXZero), v(Parameter::ForceYZero), v(Parameter::TorqueZero));
    let reading = sample.load.to_vector() - zeros - weight * v(Parameter::Weight);
    let (sin, cos) = v(Parameter::CellAngle).sin_cos();
    let turn = Matrix2::new(cos, -sin, sin, cos) * v(Parameter::ForceGain).exp();
    let torque_gain = v(Parameter::TorqueGain).exp();
    let (px, py) = (v(Parameter::CellOriginX), v(Parameter::CellOriginY));
    let force = turn * reading.xy();
    let moment_of = |f: Vector2<f64>| px * f.y - py * f.x;
    let load = Vector3::new(force.x, force.y, torque_gain * reading.z + moment_of(force));
    let (turn_x, turn_y): (Vector2<f64>, Vector2<f64>) = (turn.column(0).into(), turn.column(1).into());
    let load_by_reading = Matrix3::from_columns(&[
        Vector3::new(turn_x.x, turn_x.y, moment_of(turn_x)),
        Vector3::new(turn_y.x, turn_y.y, moment_of(turn_y)),
        Vector3::new(0.0, 0.0, torque_gain),
    ]);
    let across = Vector2::new(-force.y, force.x);
    let mut by = SMatrix::<f64, 3, COUNT>::zeros();
    let mut set = |parameter: Parameter, column: Vector3<f64>| by.set_column(parameter.index(), &column);
    set(Parameter::ForceXZero, -load_by_reading.column(0));
    set(Parameter::ForceYZero, -load_by_reading.column(1));
    set(Parameter::TorqueZero, -load_by_reading.column(2));
    set(Parameter::ForceGain, Vector3::new(force.x, force.y, moment_of(force)));
    set(Parameter::TorqueGain, Vector3::new(0.0, 0.0, torque_gain * reading.z));
    set(Parameter::CellAngle, Vector3::new(across.x, across.y, moment_of(across)));
    set(Parameter::CellOriginX, Vector3::new(0.0, 0.0, force.y));
    set(Parameter::CellOriginY, Vector3::new(0.0, 0.0, -force.x));
    set(Parameter::Weight, -(load_by_reading * weight));
    Meant {
        load: HubLoad::from_vector(&load),
        world_from_hub: PlanarPose {
            x_m: sample.world_from_hub.x_m + v(Parameter::HubX),
            y_m: sample.world_from_hub.y_m + v(Parameter::HubY),
            angle_rad: sample.world_from_hub.angle_rad + v(Parameter::HubAngle),
        },
        load_by_reading,
        load_by_parameters: by,
    }
}

/// The rod under `values`: its EI scaled everywhere, its curvature shifted everywhere.
pub fn rod_of(values: &Values, rod: &Rod) -> Rod {
    let scale = values[Parameter::Stiffness.index()].exp();
    let shift = values[Parameter::Curvature.index()];
    let stiffness = match &rod.stiffness {
        Stiffness::Uniform { ei_n_m2 } => Stiffness::Uniform { ei_n_m2: ei_n_m2 * scale },
        Stiffness::Taper { ei_base_n_m2, taper } => {
            Stiffness::Taper { ei_base_n_m2: ei_base_n_m2 * scale, taper: *taper }
        }
        Stiffness::Profile { s_m, ei_n_m2 } => {
            Stiffness::Profile { s_m: s_m.clone(), ei_n_m2: ei_n_m2.iter().map(|ei| ei * scale).collect() }
        }
    };
    let intrinsic_curvature = match &rod.intrinsic_curvature {
        IntrinsicCurvature::Constant { per_m } => IntrinsicCurvature::Constant { per_m: per_m + shift },
        IntrinsicCurvature::Profile { s_m, per_m } => IntrinsicCurvature::Profile {
            s_m: s_m.clone(),
            per_m: per_m.iter().map(|kappa| kappa + shift).collect(),
        },
    };
    Rod { stiffness, intrinsic_curvature, ..rod.clone() }
}
