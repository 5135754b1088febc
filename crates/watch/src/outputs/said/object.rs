//! The JSON object of an event: its keys and their types.

use resight::answer::landmarks::RotationObject;
use resight::answer::{SchemaNumber, TransformObject};
use schemars::JsonSchema;
use serde::Serialize;

/// One event. `event` says what happened, and with it which other keys there are.
#[derive(Debug, Clone, Default, Serialize, JsonSchema)]
pub struct EventObject {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `frame`, `state`, `compared`, `learned`, `promised`, `moved_while_learning`, `moved`, `dropped`, `left_out`, `clock`, `oriented`, `source`, `ended`, `verdict`.
    pub event: &'static str,
    /// The camera's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// The target's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// When, in the time of the frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_s: Option<f64>,
    /// Of `frame`.
    #[serde(flatten)]
    pub frame: Option<FrameObject>,
    /// Of `frame` with landmarks.
    #[serde(flatten)]
    pub rotation: Option<RotationObject>,
    /// Of `frame` and `learned`: where the camera is, or is from now on held to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cam_from_target: Option<TransformObject>,
    /// Of `state` and `verdict`: `learning`, `steady`, `checking`, `drifted`, `stale`, `inconsistent`, `tracking`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<&'static str>,
    /// Of the state `learning`: readings so far and needed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readings: Option<usize>,
    /// See `readings`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needed: Option<usize>,
    /// Of the state `stale`: for how long.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    /// Of the state `checking`: `correlated_errors`, `different` or `away`; of `stale`: what is wrong with the frames; of `source`: why it was lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Of the state `drifted` and of `moved_while_learning`.
    #[serde(flatten)]
    pub motion: Option<MotionObject>,
    /// Of the state `drifted`.
    #[serde(flatten)]
    pub drift: Option<DriftObject>,
    /// Of `compared`, and of `state` and `verdict` with the reason `away`: where the camera is beside its reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviation: Option<DeviationObject>,
    /// Of `learned`: the noise of the readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseObject>,
    /// Of `learned`: the motion that is found nine times in ten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detectable: Option<DetectableObject>,
    /// Of `learned`, `promised` and `verdict`: errors for which no rate of false alarms is promised.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unpromised: Option<Vec<UnpromisedObject>>,
    /// Of `moved_while_learning`: `step`, `ramp`, `wander`; of `oriented`: how viewers show the images, by EXIF.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub how: Option<&'static str>,
    /// Of `moved_while_learning`: the number of the reading.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reading: Option<usize>,
    /// Of `moved` and `verdict`: the cameras and targets that moved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moved: Option<Vec<String>>,
    /// What may have moved instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternatives: Option<Alternatives>,
    /// Of `moved`: how.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motions: Option<Vec<NodeMotionObject>>,
    /// Of `dropped` and `left_out`: how many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<u64>,
    /// Of `clock`: by how much the clock of the frames was set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_s: Option<f64>,
    /// Of `source`: whether there are frames again.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub connected: Option<bool>,
    /// Of `verdict`: whether the camera moved while its reference was learned; absent where it did not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moved_while_learning: Option<bool>,
    /// A sentence.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// One frame.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct FrameObject {
    /// Its number.
    pub number: u64,
    /// Its name.
    pub name: String,
    /// Points found.
    pub n_points: usize,
    /// How long it waited and was worked on.
    pub times_us: TimesObject,
    /// Of the pose, among all that fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Of the points of a target.
    #[serde(rename = "rms_px", skip_serializing_if = "Option::is_none")]
    pub points_rms_px: Option<f64>,
}

/// Microseconds.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct TimesObject {
    /// From its arrival to a free thread.
    pub waited: f64,
    /// To find the points.
    pub detect: f64,
    /// To compute the pose.
    pub solve: f64,
    /// To decide whether the camera moved.
    pub decide: f64,
}

/// How far something moved, and since when.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct MotionObject {
    /// `[rotation_rad; translation_m]` of the camera in its old frame.
    pub old_from_new: [f64; 6],
    /// 6×6.
    pub covariance: [[f64; 6]; 6],
    /// When it began.
    pub began_s: f64,
    /// The standard deviation of that time.
    pub began_sigma_s: f64,
}

/// What else is known of a drift.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DriftObject {
    /// The rotation alone, where that explains the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pure_rotation_rad: Option<[f64; 3]>,
    /// Its standard deviations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pure_rotation_sigma_rad: Option<[f64; 3]>,
    /// `step` or `ramp`.
    pub course: &'static str,
    /// Probability that it is that one.
    pub course_probability: f64,
    /// `[rad/s; m/s]` of a ramp.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_per_s: Option<[f64; 6]>,
    /// Its covariance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_covariance: Option<[[f64; 6]; 6]>,
    /// The one axis that explains the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<AxisObject>,
    /// The last motion alone, where the camera had moved before: `began_s` and `course` are of it, the sizes beside it of all together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub again: Option<AgainObject>,
}

/// Where a camera is beside its reference.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DeviationObject {
    /// By how much it is rotated; where chance explains the shift, as if there were none.
    pub rotation_rad: f64,
    /// Its standard deviation.
    pub sigma_rad: f64,
    /// By how much it is shifted; absent where chance explains that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_m: Option<f64>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// `[rotation_rad; translation_m]` of the camera in its frame of the reference.
    pub old_from_new: [f64; 6],
    /// 6×6.
    pub covariance: [[f64; 6]; 6],
    /// Readings that it is the mean of.
    pub n_readings: usize,
}

/// A motion of a camera that had moved before.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct AgainObject {
    /// Which motion it is: the second is 2.
    pub number: u32,
    /// When the first one began.
    pub first_began_s: f64,
    /// `[rotation_rad; translation_m]` of the camera in its frame before this motion.
    pub old_from_new: [f64; 6],
    /// 6×6.
    pub covariance: [[f64; 6]; 6],
}

/// A motion about or along one axis.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct AxisObject {
    /// `tilt`, `pan`, `roll`, `x`, `y`, `range`.
    pub name: &'static str,
    /// About the axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_rad: Option<f64>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_rad: Option<f64>,
    /// Along the axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation_m: Option<f64>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
}

/// The noise of the readings.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NoiseObject {
    /// Measured over stated standard deviation.
    pub sigma_ratio: f64,
    /// Its standard deviation.
    pub sigma_ratio_sigma: f64,
    /// Whether the two contradict each other.
    pub contradicts_stated: bool,
    /// Correlated errors; null where there are none.
    pub correlated: Option<CorrelatedObject>,
    /// Readings behind this.
    pub n_readings: usize,
}

/// Errors that neighbouring readings share.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CorrelatedObject {
    /// Over a reading's own noise.
    pub sigma_ratio: f64,
    /// Their time constant.
    pub time_s: f64,
}

/// A motion that is found nine times in ten.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DetectableObject {
    /// In this time.
    pub within_s: f64,
    /// About each axis.
    pub rotation_rad: [f64; 3],
    /// Along each axis.
    pub translation_m: [f64; 3],
    /// Motions that are held because others like them came back by themselves; null where none did.
    pub held: Option<HeldObject>,
}

/// Motions that are reported only when they have lasted: no rate of false alarms is promised for them.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct HeldObject {
    /// How many came back by themselves.
    pub count: u64,
    /// How long a motion must last.
    pub held_s: f64,
    /// About each axis, the largest that is held.
    pub rotation_rad: [f64; 3],
    /// Along each axis, the largest that is held.
    pub translation_m: [f64; 3],
}

/// Errors for which no rate of false alarms is promised.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct UnpromisedObject {
    /// `unwatched_hours`, `returning`, `contradictions`, `changed_errors`, `key_frames`.
    pub kind: &'static str,
    /// Whether the readings show them; else no reading has excluded them yet.
    pub is_present: bool,
    /// The reason.
    pub message: String,
}

/// What may have moved instead.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Alternatives {
    /// Single cameras.
    Cameras(Vec<String>),
    /// Sets of cameras and targets.
    Sets(Vec<Vec<String>>),
}

/// How a camera or target moved.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NodeMotionObject {
    /// Its name.
    pub name: String,
    /// `[rotation_rad; translation_m]` in its old frame.
    pub old_from_new: [f64; 6],
    /// 6×6.
    pub covariance: [[f64; 6]; 6],
}
