//! The answer of the job that determines the rotation of a camera against its vehicle.

use super::budget::NumbersPartObject;
use super::{SchemaNumber, Status};
use schemars::JsonSchema;
use serde::Serialize;

/// The rotation of a camera against the vehicle that carries it. The vehicle frame is x forward (the mean direction of travel), y left, z up.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct VehicleAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `vehicle`.
    pub kind: &'static str,
    /// Name of the drive: its video, or its first image.
    pub view: String,
    /// `ok` where yaw and pitch are determined and nothing contradicts them, whether or not roll and height are; `undecided` where the drive does
    /// not determine them; `inconsistent` where the camera moved, or something contradicts them.
    pub status: Status,
    /// The camera is rotated to the left of the direction of travel by this angle; null where it is not determined.
    pub yaw_rad: Option<f64>,
    /// Its standard deviation.
    pub yaw_sigma_rad: Option<f64>,
    /// The camera is rotated down from the direction of travel by this angle; null where it is not determined.
    pub pitch_rad: Option<f64>,
    /// Its standard deviation.
    pub pitch_sigma_rad: Option<f64>,
    /// Covariance of yaw and pitch.
    pub yaw_pitch_covariance_rad2: Option<[[f64; 2]; 2]>,
    /// Its parts, of yaw and of pitch; the shares are those of the sum of both variances.
    pub budget: Vec<NumbersPartObject>,
    /// Direction of travel, unit vector in the camera frame.
    pub travel_in_cam: Option<[f64; 3]>,
    /// The camera is rotated about the direction of travel, its right side down, by this angle; null where it is not determined.
    pub roll_rad: Option<f64>,
    /// Its standard deviation.
    pub roll_sigma_rad: Option<f64>,
    /// The parts of its variance.
    pub roll_budget: Vec<NumbersPartObject>,
    /// Roll by the axis of curves alone.
    pub roll_by_curves: Option<RollObject>,
    /// Roll by the ground alone.
    pub roll_by_ground: Option<RollObject>,
    /// Quaternion w, x, y, z of x_cam = R x_vehicle; null unless yaw, pitch and roll are determined.
    pub cam_from_vehicle_wxyz: Option<[f64; 4]>,
    /// Height of the camera above the ground, metres; null where it is not determined.
    pub height_m: Option<f64>,
    /// Its standard deviation.
    pub height_sigma_m: Option<f64>,
    /// The parts of its variance.
    pub height_budget: Vec<NumbersPartObject>,
    /// What is not determined, and why.
    pub undetermined: Vec<UndeterminedObject>,
    /// What contradicts the answer, in sentences.
    pub contradictions: Vec<String>,
    /// What nothing in the drive checks.
    pub remarks: Vec<String>,
    /// Whether the camera moved on its vehicle; null where the direction of travel is not determined.
    pub alarm: Option<AlarmObject>,
    /// Seconds in which the camera moved.
    pub moving_s: f64,
    /// … straight ahead.
    pub straight_s: f64,
    /// … in curves.
    pub curve_s: f64,
    /// Pairs of frames.
    pub n_pairs: usize,
    /// … that show no parallax.
    pub n_still: usize,
    /// … that give no motion for other reasons.
    pub n_failed: usize,
    /// The answer in a sentence.
    pub message: String,
}

/// The roll that one source gives.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct RollObject {
    /// Roll.
    pub roll_rad: f64,
    /// Its standard deviation.
    pub sigma_rad: f64,
    /// Number of curves, or of pairs of frames that show the ground.
    pub n: usize,
    /// Whether all curves are to one side, so that the lean of the body in curves is in the roll.
    pub one_sided: bool,
}

/// A number that is not determined.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct UndeterminedObject {
    /// `yaw_pitch`, `roll` or `height`.
    pub what: &'static str,
    /// Why, and what would help.
    pub reason: String,
}

/// What the change detector found.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AlarmObject {
    /// `too_short`, `steady`, `checking` or `moved`.
    pub state: &'static str,
    /// Rotation vector of the camera in its old frame, in the axes right, down, forward of the direction of travel; null unless it moved. The rotation
    /// about the last is not seen.
    pub rotation_rad: Option<[f64; 3]>,
    /// When the motion began, seconds from the first frame.
    pub began_s: Option<f64>,
    /// When the alarm was raised.
    pub alarm_s: Option<f64>,
    /// The state in a sentence.
    pub message: String,
}
