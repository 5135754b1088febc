//! The answer of the job that reads a camera's focal length, tilt, roll and height from marked lines.

use super::budget::{BudgetPartObject, parts};
use super::pose::rows;
use super::{SchemaNumber, Status, TransformObject};
use crate::core::budget::Budget;
use crate::core::locate::unknown_focal::marked_lines::{Estimate, SceneView};
use schemars::JsonSchema;
use serde::Serialize;

/// How a camera stands over the scene of one view. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct SceneViewAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `scene_view`.
    pub kind: &'static str,
    /// Its name.
    pub view: String,
    /// `ok`, `inconsistent`, `degenerate` or `error`.
    pub status: Status,
    /// The status in a sentence, with the way out.
    pub message: String,
    /// Lines given.
    pub n_lines: usize,
    /// Those of them with a length.
    pub n_lengths: usize,
    /// Pixels; null where the camera was given.
    pub focal_px: Option<f64>,
    /// Its standard deviation.
    pub focal_sigma_px: Option<f64>,
    /// From the left to the right edge of the image; null where the camera was given.
    pub horizontal_field_of_view_rad: Option<f64>,
    /// By how much the optical axis points below the horizon.
    pub tilt_rad: Option<f64>,
    /// Its standard deviation.
    pub tilt_sigma_rad: Option<f64>,
    /// By how much the camera is rotated about its axis, clockwise as seen from behind it.
    pub roll_rad: Option<f64>,
    /// Its standard deviation.
    pub roll_sigma_rad: Option<f64>,
    /// Heading of the optical axis, from the scene's y (along) towards its x (across); null where no line runs along or across: y is then the way
    /// that the camera looks.
    pub heading_rad: Option<f64>,
    /// Its standard deviation.
    pub heading_sigma_rad: Option<f64>,
    /// Of the camera over the ground; null without a known length.
    pub height_m: Option<f64>,
    /// Its standard deviation.
    pub height_sigma_m: Option<f64>,
    /// x_in_cam = cam_from_scene · x_in_scene: x across, y along, z up, the origin on the ground below the camera. Null without a known length.
    pub cam_from_scene: Option<TransformObject>,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The parts of `covariance` by the sources of the errors.
    pub budget: Option<Vec<BudgetPartObject>>,
    /// The budget that the JSON shows.
    #[serde(skip)]
    pub parts: Option<Budget>,
    /// Sum of squared residuals over their variances.
    pub chi2: Option<f64>,
    /// Of that sum.
    pub degrees_of_freedom: Option<usize>,
    /// The line (or its length) that fits worst.
    pub worst_line: Option<String>,
    /// Its residual, in standard deviations.
    pub worst_sigmas: Option<f64>,
    /// What is unusual about the input.
    pub remarks: Vec<String>,
}

impl SceneViewAnswer {
    pub(crate) fn unsolved(view: String, n_lines: usize, n_lengths: usize) -> Self {
        SceneViewAnswer {
            schema: SchemaNumber,
            kind: "scene_view",
            view,
            status: Status::Error,
            message: String::new(),
            n_lines,
            n_lengths,
            focal_px: None,
            focal_sigma_px: None,
            horizontal_field_of_view_rad: None,
            tilt_rad: None,
            tilt_sigma_rad: None,
            roll_rad: None,
            roll_sigma_rad: None,
            heading_rad: None,
            heading_sigma_rad: None,
            height_m: None,
            height_sigma_m: None,
            cam_from_scene: None,
            covariance: None,
            budget: None,
            parts: None,
            chi2: None,
            degrees_of_freedom: None,
            worst_line: None,
            worst_sigmas: None,
            remarks: Vec::new(),
        }
    }

    pub(crate) fn with_view(
        self,
        found: &SceneView,
        width_px: Option<u32>,
        name_of: impl Fn(usize) -> String,
    ) -> Self {
        let two = |estimate: Estimate| (Some(estimate.value), Some(estimate.sigma));
        let or_none = |estimate: Option<Estimate>| estimate.map_or((None, None), two);
        let ((focal_px, focal_sigma_px), (height_m, height_sigma_m)) =
            (or_none(found.focal_px), or_none(found.height_m));
        let ((tilt_rad, tilt_sigma_rad), (roll_rad, roll_sigma_rad), (heading_rad, heading_sigma_rad)) =
            (two(found.tilt_rad), two(found.roll_rad), or_none(found.heading_rad));
        let field = |(focal_px, width_px): (f64, u32)| 2.0 * (0.5 * f64::from(width_px)).atan2(focal_px);
        SceneViewAnswer {
            focal_px,
            focal_sigma_px,
            horizontal_field_of_view_rad: focal_px.zip(width_px).map(field),
            tilt_rad,
            tilt_sigma_rad,
            roll_rad,
            roll_sigma_rad,
            heading_rad,
            heading_sigma_rad,
            height_m,
            height_sigma_m,
            cam_from_scene: height_m.map(|_| found.cam_from_scene.into()),
            covariance: height_m.map(|_| rows(&found.covariance)),
            budget: height_m.map(|_| parts(&found.budget)),
            parts: height_m.map(|_| found.budget.clone()),
            chi2: Some(found.chi2),
            degrees_of_freedom: Some(found.degrees_of_freedom),
            worst_line: Some(name_of(found.worst.0)),
            worst_sigmas: Some(found.worst.1),
            ..self
        }
    }
}
