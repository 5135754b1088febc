//! Whether the gripper rotated enough to determine the camera's pose, decided from the known motions before solving.
//!
//! docs/math/hand_eye.md eqs. (10)–(11).

use super::views::Known;
use super::{HandEyeConfig, MAX_GRIPPER_SIGMA_RAD, Mounting};
use crate::{Error, Pose};
use nalgebra::{Matrix3, Vector3};

/// Smaller rotations are not used: at 0.01 rad a position is a hundred times less certain than the target's pose.
pub(crate) const MIN_ROTATION_RAD: f64 = 0.01;
/// … nor are rotations within the noise of the motions.
const NOISE_FACTOR: f64 = 5.0;
/// Above this number, each view is compared with a part of the others only.
const ALL_PAIRS_UP_TO: usize = 60;
/// Least cosine between the height's direction and the common axis: farther off, the height does not determine the open direction.
const MIN_COSINE: f64 = 0.1;

/// Principal axes of the rotations: root mean square angles, rad, the largest first, and the main axis in the carrier frame.
pub(super) struct Turning {
    pub rotations_rad: [f64; 3],
    pub main_axis: Vector3<f64>,
}

/// Returns the vector part of the unit quaternion with w ≥ 0: sin(θ/2) times the axis.
pub(super) fn half_rotation(motion: &Pose) -> Vector3<f64> {
    let [_, x, y, z] = motion.quaternion_wxyz();
    Vector3::new(x, y, z)
}

/// Analyses all pairs of views, or each view with as many others as keep the work linear.
pub(super) fn turning(views: &[Known]) -> Turning {
    let n = views.len();
    let stride = n.div_ceil(ALL_PAIRS_UP_TO).max(1);
    let (mut sum, mut pairs) = (Matrix3::zeros(), 0usize);
    for (i, view) in views.iter().enumerate() {
        for other in views[..i].iter().step_by(stride) {
            let m = half_rotation(&(view.carrier_from_holder * other.carrier_from_holder.inverse()));
            sum += m * m.transpose() * 4.0;
            pairs += 1;
        }
    }
    let eigen = (sum / pairs.max(1) as f64).symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| eigen.eigenvalues[*j].total_cmp(&eigen.eigenvalues[*i]));
    Turning {
        rotations_rad: order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt()),
        main_axis: eigen.eigenvectors.column(order[0]).into_owned(),
    }
}

/// Returns the smallest rotation that is used.
pub(super) fn needed_rad(views: &[Known]) -> f64 {
    let variance = |view: &Known| {
        let variance = view.covariance.map_or(0.0, |c| c.fixed_view::<3, 3>(0, 0).trace() / 3.0);
        // An estimated noise is limited to that of a real robot: anything beyond it has another cause.
        if view.parts.is_some() {
            variance.min(MAX_GRIPPER_SIGMA_RAD * MAX_GRIPPER_SIGMA_RAD)
        } else {
            variance
        }
    };
    let mean = views.iter().map(variance).sum::<f64>() / views.len().max(1) as f64;
    f64::max(MIN_ROTATION_RAD, NOISE_FACTOR * (2.0 * mean).sqrt())
}

/// Returns whether all rotations are about one direction.
pub(super) fn are_parallel(views: &[Known]) -> bool {
    turning(views).rotations_rad[1] < needed_rad(views)
}

/// Returns the rotations, and refuses those that do not determine the answer.
pub(super) fn check(views: &[Known], config: &HandEyeConfig) -> Result<[f64; 3], Error> {
    let (turning, needed) = (turning(views), needed_rad(views));
    let turns = turning.rotations_rad;
    let degenerate =
        |reason, metric, needed, way_out| Err(Error::DegenerateMotion { reason, metric, needed, way_out });
    if turns[0] < needed {
        let reason = "the gripper hardly rotated between the views: shifts alone do not determine the position of the camera";
        let way_out = "turn the gripper about two different axes, by 30 degrees or more";
        return degenerate(reason, turns[0], needed, way_out);
    }
    if needed <= turns[1] {
        return Ok(turns);
    }
    let Some(height) = config.height else {
        let reason =
            "the gripper rotated about parallel axes only: the camera's position along them stays unknown";
        let way_out = match config.mounting {
            Mounting::CameraOnGripper => {
                "turn about a second axis (tilt by 30 degrees), or state the camera's height along the axis (height_known)"
            }
            Mounting::TargetOnGripper => {
                "turn about a second axis (tilt by 30 degrees), or state the camera's height above the base (height_known)"
            }
        };
        return degenerate(reason, turns[1], needed, way_out);
    };
    let cosine = height.direction_in_carrier.normalize().dot(&turning.main_axis).abs();
    if cosine < MIN_COSINE {
        let reason = "the known height runs across the axis of all turns, and leaves the place along that axis unknown";
        let way_out = "state the height along the axis, or turn about a second axis";
        return degenerate(reason, cosine.asin(), MIN_COSINE, way_out);
    }
    Ok(turns)
}
