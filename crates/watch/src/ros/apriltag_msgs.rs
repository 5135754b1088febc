//! `apriltag_msgs/AprilTagDetectionArray`, which the package `apriltag_ros` publishes.
//!
//! Its node copies the corners of the AprilTag C library byte by byte (christianrauch/apriltag_ros, src/AprilTagNode.cpp: `memcpy` from
//! `det->p`): first the bottom-left, then bottom-right, top-right, top-left of the upright tag, and the centre of the top-left pixel is (0.5,
//! 0.5). Both are those of the library's own results in `detect/apriltag.rs`. Older messages contain eight numbers, newer ones four points. The
//! node processes rectified images by default: the camera is then that of P, without distortion.

use super::tags::{ReportedTag, detections, four_corners, label};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_recording::ros::value::Value;

/// Returns all corners of a message.
///
/// # Errors
/// A message of another shape.
pub(super) fn read(message: &Value<'_>) -> Result<Vec<Detection>, String> {
    detections(message, |tag| {
        let (family, id) = label(tag)?;
        let theirs = four_corners(tag)?;
        let corners = [3, 2, 1, 0].map(|k: usize| theirs[k] - Pixel::new(0.5, 0.5));
        Ok(ReportedTag { family, id, margin_gray: tag.number("decision_margin").ok(), corners })
    })
}
