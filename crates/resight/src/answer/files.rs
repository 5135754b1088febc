//! The answers of the jobs on files of cameras and targets.

use super::{SchemaNumber, Status};
use crate::core::Pose;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A camera or target file in sentences.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Explanation {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// Always `ok`: a file that cannot be read is an error of the job.
    pub status: Status,
    /// The file.
    pub file: String,
    /// Frames, directions, units, quaternion order, camera centres.
    pub text: String,
    /// What is unusual about the file, such as lengths that are hardly metres.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// Cameras in another format, or why that cannot hold them.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ConvertAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `error` where the format cannot hold the cameras.
    pub status: Status,
    /// The frame that poses are in; null for a map of tags.
    pub reference: Option<String>,
    /// Where each camera stands in it; null where no pose joins the two.
    pub cameras: BTreeMap<String, Option<CameraPosition>>,
    /// The files: names as the format wants them, or the paths written to.
    pub files: Vec<String>,
    /// What they do not hold, or hold under another name.
    pub lost: Vec<String>,
    /// What is unusual about the files read.
    pub warnings: Vec<String>,
    /// Whether the files were read back and compared; formats that are only written cannot be.
    pub checked: bool,
    /// What was written, or why nothing.
    pub message: String,
    /// The contents of each of `files`.
    #[serde(skip)]
    pub contents: Vec<String>,
}

/// Where a camera stands and looks.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraPosition {
    /// Its centre in the reference frame.
    pub centre_m: [f64; 3],
    /// Its optical axis there.
    pub looks_along: [f64; 3],
    /// Of reference_from_cam.
    pub rotation_wxyz: [f64; 4],
}

impl From<&Pose> for CameraPosition {
    fn from(reference_from_cam: &Pose) -> Self {
        CameraPosition {
            centre_m: reference_from_cam.translation.into(),
            looks_along: reference_from_cam.rotation.column(2).into_owned().into(),
            rotation_wxyz: reference_from_cam.quaternion_wxyz(),
        }
    }
}
