//! The answer of the job that measures a rotation by natural landmarks.

use super::{SchemaNumber, Status};
use crate::landmarks::LandmarkObservation;
use schemars::JsonSchema;
use serde::Serialize;

/// How a camera has rotated since its reference image.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LandmarksAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// The image's name.
    pub view: String,
    /// `inconsistent` where most landmarks contradict the rotation.
    pub status: Status,
    /// The rotation, where there is one.
    #[serde(flatten)]
    pub rotation: Option<RotationObject>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// A rotation by landmarks.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RotationObject {
    /// Rotation vector of old_from_new, camera frame.
    pub rotation_rad: [f64; 3],
    /// Standard deviations of its components.
    pub sigma_rad: [f64; 3],
    /// Their covariance.
    pub rotation_covariance_rad2: [[f64; 3]; 3],
    /// How far the image has shifted, columns and rows, where the rotation does not explain it all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_px: Option<[f64; 2]>,
    /// Its standard deviations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift_sigma_px: Option<[f64; 2]>,
    /// Landmarks that agree.
    pub n_landmarks: usize,
    /// Landmarks found again.
    pub n_matched: usize,
    /// Landmarks that the camera should see.
    pub n_in_view: usize,
    /// Of the landmarks that agree.
    pub rms_px: f64,
    /// Whether most landmarks agree.
    pub is_consistent: bool,
}

impl From<&LandmarkObservation> for RotationObject {
    fn from(observation: &LandmarkObservation) -> Self {
        let relative_rotation = &observation.relative_rotation;
        let (rotation_rad, covariance) = relative_rotation.old_from_new();
        let shift = observation.shift.as_ref();
        RotationObject {
            rotation_rad: rotation_rad.into(),
            sigma_rad: covariance.diagonal().map(f64::sqrt).into(),
            rotation_covariance_rad2: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
            shift_px: shift.map(|shift| shift.px.into()),
            shift_sigma_px: shift.map(|shift| shift.covariance_px2.diagonal().map(f64::sqrt).into()),
            n_landmarks: relative_rotation.used.len(),
            n_matched: relative_rotation.given,
            n_in_view: observation.in_view,
            rms_px: relative_rotation.rms_px,
            is_consistent: relative_rotation.is_consistent(),
        }
    }
}
