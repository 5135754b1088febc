//! Why a view leaves the focal length open, and what would determine it: the same points tilted more, or nearer.

use super::cost::{Descent, FocalProblem, FocalState, JointCovariance};
use crate::Pose;
use crate::error::FocalRemedy;
use crate::solve::configuration::{Configuration, Geometry};
use nalgebra::{Matrix3, Vector3};

/// Tilts tried, radians: every five degrees to sixty.
const TILT_STEP_RAD: f64 = 5.0 * core::f64::consts::PI / 180.0;
const TILTS: i32 = 12;
/// Distances tried: each this part of the one before.
const NEARER: f64 = 0.85;
const DISTANCES: i32 = 16;

/// A view that says nothing of its focal length is judged as through a lens of one of these horizontal fields of view, radians: 15° to 100°.
const USUAL_FIELD_RAD: core::ops::RangeInclusive<f64> = 0.261_799..=1.745_329;

/// The remedy for a view in which log f has too large a standard deviation; `noise_scale` multiplies its variances.
pub(super) fn remedy(
    problem: &FocalProblem,
    state: &FocalState,
    geometry: &Geometry,
    is_enough: impl Fn(&JointCovariance) -> bool,
) -> FocalRemedy {
    let state = &problem.within_fields(state, &USUAL_FIELD_RAD);
    let is_enough_at = |state: &FocalState| {
        let descent = problem.equations(state).map(|equations| Descent {
            state: *state,
            chi2: equations.chi2,
            information: equations.information,
            is_minimum: true,
        });
        descent.and_then(|d| problem.covariance(&d)).is_some_and(|covariance| is_enough(&covariance))
    };
    let nearer = |k: i32| problem.displaced(state, &Matrix3::identity(), NEARER.powi(k));
    let is_flat = matches!(geometry.configuration, Configuration::Planar | Configuration::LinePlusOne { .. });
    let distance_m = problem.distance_m(state);
    let needed_distance_m =
        (1..=DISTANCES).find(|k| is_enough_at(&nearer(*k))).map(|k| distance_m * NEARER.powi(k));
    if !is_flat {
        return FocalRemedy::Depth { distance_m, needed_distance_m };
    }
    let normal = problem.pose(state).rotation * plane_normal(problem);
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let tilt_rad = tilt(&normal);
    let across = Vector3::new(-normal.y, normal.x, 0.0);
    let axis = across.try_normalize(1e-9).unwrap_or(Vector3::x());
    let tilted = |to_rad: f64| {
        let turn = axis * (to_rad - tilt_rad);
        let motion = crate::Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0);
        problem.displaced(state, &Pose::exp(&motion).rotation, 1.0)
    };
    let tilts = (1..=TILTS).map(|k| f64::from(k) * TILT_STEP_RAD).filter(|rad| tilt_rad < *rad);
    let needed_tilt_rad = tilts.into_iter().find(|rad| is_enough_at(&tilted(*rad)));
    FocalRemedy::Tilt { tilt_rad, needed_tilt_rad, distance_m, needed_distance_m }
}

/// Between the plane and the image's.
fn tilt(normal: &Vector3<f64>) -> f64 {
    normal.x.hypot(normal.y).atan2(normal.z.abs())
}

/// Direction in which the points spread least, target frame.
fn plane_normal(problem: &FocalProblem) -> Vector3<f64> {
    let mean = crate::locate::refine::centroid(problem.seen);
    let scatter: Matrix3<f64> =
        problem.seen.iter().map(|c| c.x_in_target - mean).map(|x| x * x.transpose()).sum();
    let eigen = scatter.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
}
