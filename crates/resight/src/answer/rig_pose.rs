//! The answer of the job that locates a known rig.

use super::budget::{BudgetPartObject, parts};
use super::pose::rows;
use super::{SchemaNumber, Status, TransformObject};
use crate::core::budget::Budget;
use crate::core::multiview::rig_pose::{RigAmbiguity, RigPoseEstimate};
use crate::report::words::{sigmas, translation_sigma_m};
use schemars::JsonSchema;
use serde::Serialize;

/// Where a rig is in one view. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigPoseAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `rig_pose`.
    pub kind: &'static str,
    /// Its name.
    pub view: String,
    /// `ok`, `ambiguous`, `inconsistent`, `degenerate` or `error`.
    pub status: Status,
    /// The status in a sentence, with the way out.
    pub message: String,
    /// x_in_rig = rig_from_target · x_in_target; null where there is no pose.
    pub rig_from_target: Option<TransformObject>,
    /// The inverse: its translation is the position of the rig.
    pub target_from_rig: Option<TransformObject>,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, rig frame, intrinsics and places of the cameras included.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The parts of `covariance` by the sources of the errors.
    pub budget: Option<Vec<BudgetPartObject>>,
    /// Standard deviations of the rotation about the rig's axes.
    pub sigma_rad: Option<[f64; 3]>,
    /// Standard deviations of the rig's position, along the rig's axes.
    pub sigma_m: Option<[f64; 3]>,
    /// Of the translation of `rig_from_target` itself, which a rotation changes too.
    pub sigma_translation_m: Option<[f64; 3]>,
    /// Of the position's, those with exact intrinsics; null where all cameras' are exact.
    pub sigma_exact_intrinsics_m: Option<[f64; 3]>,
    /// Root mean square reprojection error over the points used, px.
    pub rms_px: Option<f64>,
    /// Sum of squared residuals over their variances.
    pub chi2: Option<f64>,
    /// Of that sum.
    pub degrees_of_freedom: Option<usize>,
    /// Points given.
    pub n_points: usize,
    /// Whether another pose fits.
    pub ambiguity: Option<RigAmbiguityObject>,
    /// The cameras that see any.
    pub cameras: Vec<RigCameraFit>,
    /// Which rows agree, where wrong ones were looked for.
    pub agreement: Option<RigAgreement>,
    /// The estimate that the JSON shows.
    #[serde(skip)]
    pub estimate: Option<RigPoseEstimate>,
    /// The budget that the JSON shows.
    #[serde(skip)]
    pub parts: Option<Budget>,
    /// What is unusual about the input.
    pub remarks: Vec<String>,
}

/// How one camera fits.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigCameraFit {
    /// Its name.
    pub name: String,
    /// Rows of it.
    pub n_points: usize,
    /// Those that took part.
    pub n_inliers: usize,
    /// Root mean square reprojection error of these, px.
    pub rms_px: Option<f64>,
}

/// What the search for wrong rows came to.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigAgreement {
    /// How far off a row may be.
    pub threshold_px: f64,
    /// How many rows agree.
    pub n_inliers: usize,
    /// These, counted from 0 within the view in file order.
    pub inliers: Vec<usize>,
    /// Samples of three points drawn.
    pub n_samples: usize,
    /// Probability that no larger consensus was missed.
    pub confidence: f64,
    /// log₁₀ of the expected number of poses that as many random rows would agree with.
    pub log10_false_alarms: f64,
    /// What χ² per degree of freedom is expected to be, the tail beyond the threshold missing.
    pub truncation: f64,
}

/// Whether another pose fits as well.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigAmbiguityObject {
    /// `unique` or `ambiguous`.
    pub verdict: &'static str,
    /// Residual sum of squares of the other over the first; null where there is no other.
    pub ratio: Option<f64>,
    /// The other pose, `rig_from_target`.
    pub other: Option<TransformObject>,
}

impl RigPoseAnswer {
    pub(crate) fn unsolved(view: String, n_points: usize) -> Self {
        RigPoseAnswer {
            schema: SchemaNumber,
            kind: "rig_pose",
            view,
            status: Status::Error,
            message: String::new(),
            rig_from_target: None,
            target_from_rig: None,
            covariance: None,
            budget: None,
            sigma_rad: None,
            sigma_m: None,
            sigma_translation_m: None,
            sigma_exact_intrinsics_m: None,
            rms_px: None,
            chi2: None,
            degrees_of_freedom: None,
            n_points,
            ambiguity: None,
            cameras: Vec::new(),
            agreement: None,
            estimate: None,
            parts: None,
            remarks: Vec::new(),
        }
    }

    pub(crate) fn with_estimate(
        self,
        e: &RigPoseEstimate,
        budget: Option<Budget>,
        sigma_exact_intrinsics_m: Option<[f64; 3]>,
    ) -> Self {
        let (sigma_rad, sigma_m) = sigmas(&e.covariance);
        let ambiguity = match e.ambiguity {
            RigAmbiguity::Unique { ratio } => RigAmbiguityObject { verdict: "unique", ratio, other: None },
            RigAmbiguity::Ambiguous { ratio, other } => RigAmbiguityObject {
                verdict: "ambiguous",
                ratio: Some(ratio),
                other: Some(other.rig_from_target.into()),
            },
        };
        RigPoseAnswer {
            rig_from_target: Some(e.rig_from_target.into()),
            target_from_rig: Some(e.rig_from_target.inverse().into()),
            covariance: Some(rows(&e.covariance)),
            budget: budget.as_ref().map(parts),
            parts: budget,
            sigma_rad: Some(sigma_rad),
            sigma_m: Some(sigma_m),
            sigma_translation_m: Some(translation_sigma_m(&e.rig_from_target, &e.covariance)),
            sigma_exact_intrinsics_m,
            rms_px: Some(e.rms_px),
            chi2: Some(e.chi2),
            degrees_of_freedom: Some(e.degrees_of_freedom),
            ambiguity: Some(ambiguity),
            estimate: Some(*e),
            ..self
        }
    }
}
