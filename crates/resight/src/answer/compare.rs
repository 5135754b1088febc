//! The answer of the job that compares two calibrations.

use super::{SchemaNumber, Status, TransformObject};
use schemars::JsonSchema;
use serde::Serialize;

/// What moved between two calibrations.
#[derive(Debug, Clone)]
pub enum CompareAnswer {
    /// Between two rigs.
    Rigs(Box<RigsCompared>),
    /// Between the poses of each view that both have.
    Views(Vec<ViewCompared>),
}

impl CompareAnswer {
    /// Returns whether anything moved, even where it is not known what.
    pub fn has_moved(&self) -> bool {
        match self {
            CompareAnswer::Rigs(rigs) => rigs.verdict != Verdict::Unmoved,
            CompareAnswer::Views(views) => views.iter().any(|view| view.verdict == Verdict::Moved),
        }
    }
}

/// What a comparison comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing moved.
    Unmoved,
    /// Something moved, and it is known what.
    Moved,
    /// Something moved, but other sets of cameras explain it as well.
    Undecided,
    /// A file has no pose of this view.
    Error,
}

impl Verdict {
    /// Returns the word used in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Unmoved => "unmoved",
            Verdict::Moved => "moved",
            Verdict::Undecided => "undecided",
            Verdict::Error => "error",
        }
    }

    /// Returns whether the answer may be relied on.
    pub(crate) fn status(self) -> Status {
        match self {
            Verdict::Unmoved | Verdict::Moved => Status::Ok,
            Verdict::Undecided => Status::Undecided,
            Verdict::Error => Status::Error,
        }
    }
}

/// A motion with its test.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Motion {
    /// The new pose in the camera's own old frame.
    pub old_from_new: TransformObject,
    /// 6×6, `[rotation_rad; translation_m]`.
    pub covariance: [[f64; 6]; 6],
    /// How far, metres.
    pub moved_m: f64,
    /// Standard deviation along that way.
    pub moved_sigma_m: f64,
    /// By how much it rotated.
    pub rotation_rad: f64,
    /// Standard deviation about that axis.
    pub rotation_sigma_rad: f64,
    /// Axis of the rotation in the old frame; null where the rotation is less than two standard deviations.
    pub rotation_axis: Option<[f64; 3]>,
    /// Squared motion over its covariance.
    pub chi2: f64,
    /// Numbers behind it.
    pub degrees_of_freedom: usize,
    /// Probability of as much or more if nothing moved.
    pub p: f64,
}

/// One camera of a rig that moved.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraMotion {
    /// Its name.
    pub camera: String,
    /// How it moved.
    #[serde(flatten)]
    pub motion: Motion,
    /// The motion in words.
    pub message: String,
}

/// What moved between two rigs.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigsCompared {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `rigs`.
    pub kind: &'static str,
    /// `undecided` where something moved and it is not known what.
    pub status: Status,
    /// What the comparison comes to.
    pub verdict: Verdict,
    /// Probability of a false alarm that the test was made with.
    pub alpha: f64,
    /// Of all relative poses together, if nothing moved.
    pub chi2: f64,
    /// Numbers behind it.
    pub degrees_of_freedom: usize,
    /// Degrees of freedom of the noise, where A or B estimated it: `p` is of an F distribution then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_degrees_of_freedom: Option<f64>,
    /// Probability of as much or more if nothing moved.
    pub p: f64,
    /// Cameras that kept their relative poses.
    pub unmoved: Vec<String>,
    /// Cameras that moved.
    pub moved: Vec<CameraMotion>,
    /// Other sets of unmoved cameras that explain the poses about as well.
    pub alternatives: Vec<Vec<String>>,
    /// Cameras of A alone.
    pub only_in_a: Vec<String>,
    /// Cameras of B alone.
    pub only_in_b: Vec<String>,
    /// Whether both files state the covariance of all cameras together.
    pub joint_covariance: bool,
    /// Of files that do not: what the test takes for granted instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assumed: Option<String>,
    /// The verdict in a sentence.
    pub message: String,
}

/// Whether one view's camera moved.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ViewCompared {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `pose`.
    pub kind: &'static str,
    /// `error` where a file has no pose of this view.
    pub status: Status,
    /// Its name.
    pub view: String,
    /// What the comparison comes to.
    pub verdict: Verdict,
    /// Probability of a false alarm that this view was tested with.
    pub alpha: f64,
    /// The motion, moved or not.
    #[serde(flatten)]
    pub motion: Option<Motion>,
    /// The verdict in a sentence.
    pub message: String,
}
