//! The answer of the jobs that find points in images.

use super::{SchemaNumber, Status};
use crate::core::correspondence::Detection;
use schemars::JsonSchema;
use serde::Serialize;

/// The points found in one image.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DetectionAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// The image's name.
    pub view: String,
    /// The points.
    pub detections: Vec<DetectedPoint>,
    /// `not_found` where there is none, `inconsistent` where the target is seen mirrored, `error` where the image cannot be read or the target is
    /// in it several times.
    pub status: Status,
    /// What was found instead, or what is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// What is unusual, such as an id found twice.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// One point: the corner of a tag, of a chessboard, or a dot.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DetectedPoint {
    /// The tag's family, where tags of any family were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
    /// Id of the tag, or number of the corner or dot.
    pub id: u32,
    /// Corner of the tag, counted from 0; 0 for other points.
    pub corner: u8,
    /// Column; (0, 0) is the centre of the top-left pixel.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard deviation of u and of v by the image.
    pub sigma_px: f64,
    /// What the lens may do besides, as a standard deviation of u and of v.
    pub lens_sigma_px: f64,
}

impl DetectedPoint {
    pub(crate) fn new(d: &Detection, family: Option<&str>) -> Self {
        DetectedPoint {
            family: family.map(str::to_owned),
            id: d.feature.id,
            corner: d.feature.corner,
            u_px: d.pixel.x,
            v_px: d.pixel.y,
            sigma_px: d.sigma_px,
            lens_sigma_px: d.lens_sigma_px,
        }
    }
}

impl DetectionAnswer {
    /// Returns the answer for an image that cannot be read or searched.
    pub fn error(view: impl Into<String>, reason: impl Into<String>) -> Self {
        DetectionAnswer {
            status: Status::Error,
            ..DetectionAnswer::new(view, Vec::new(), Some(reason.into()))
        }
    }

    /// Builds the answer of one image, with a message where nothing was found.
    pub(crate) fn new(
        view: impl Into<String>,
        detections: Vec<DetectedPoint>,
        message: Option<String>,
    ) -> Self {
        let status = if message.is_some() { Status::NotFound } else { Status::Ok };
        DetectionAnswer {
            schema: SchemaNumber,
            view: view.into(),
            detections,
            status,
            message,
            remarks: Vec::new(),
        }
    }
}
