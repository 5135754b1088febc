//! A focal length that was estimated with the pose, as JSON has it.

use crate::core::locate::unknown_focal::FocalEstimate;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The focal length of one view, and the camera that goes with it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EstimatedFocal {
    /// Pixels; that of both axes but for the ratio of `parameters`.
    pub focal_px: f64,
    /// Its standard deviation.
    pub sigma_px: f64,
    /// From the left to the right edge of the image.
    pub horizontal_field_of_view_rad: f64,
    /// Covariance of log(focal_px) with `[rotation_rad; translation_m]` of the pose.
    pub covariance_with_pose: [f64; 6],
    /// Focal lengths of the other poses that fit, in the order of `minima`.
    pub other_focal_px: Vec<f64>,
    /// All parameters of the camera: what the points do not show is as usual for lenses.
    pub parameters: BTreeMap<String, f64>,
    /// Their standard deviations, those that are not 0.
    pub parameter_sigmas: BTreeMap<String, f64>,
}

impl EstimatedFocal {
    /// Converts an estimate for images of this width.
    pub(crate) fn of(found: &FocalEstimate, width_px: u32) -> Self {
        let parameters = found.camera.parameters();
        let sigma = |(i, (name, _)): (usize, &(&'static str, f64))| {
            ((*name).to_owned(), found.intrinsics_covariance[(i, i)].max(0.0).sqrt())
        };
        EstimatedFocal {
            focal_px: found.focal_px,
            sigma_px: found.sigma_px,
            horizontal_field_of_view_rad: 2.0 * (0.5 * f64::from(width_px)).atan2(found.focal_px),
            covariance_with_pose: std::array::from_fn(|i| found.covariance[(i, 6)]),
            other_focal_px: found.other_focal_px.clone(),
            parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
            parameter_sigmas: parameters.iter().enumerate().map(sigma).filter(|(_, s)| 0.0 < *s).collect(),
        }
    }

    /// Describes the focal length in words: "focal length 1203 ± 14 px (estimated)".
    pub fn words(&self) -> String {
        let field = self.horizontal_field_of_view_rad.to_degrees();
        let digits = digits(self.sigma_px);
        let (focal_px, sigma_px) = (self.focal_px, self.sigma_px);
        let mut words = format!(
            "focal length {focal_px:.digits$} ± {sigma_px:.digits$} px (estimated), a horizontal field of view of {field:.1}°"
        );
        for other in &self.other_focal_px {
            words += &format!("; with the next pose {other:.digits$} px");
        }
        words
    }
}

/// Returns the number of decimals that a standard deviation justifies.
fn digits(sigma_px: f64) -> usize {
    if sigma_px < 1.0 {
        2
    } else if sigma_px < 10.0 {
        1
    } else {
        0
    }
}
