//! `isaac_ros_apriltag_interfaces/AprilTagDetectionArray` of NVIDIA's Isaac ROS.
//!
//! Corners run top-left, top-right, bottom-right, bottom-left (NVIDIA's description of the detector; its node reverses the order of VPI, that of
//! the AprilTag C library, before it publishes: isaac_ros_apriltag, src/apriltag_node.cpp, "Corners are in reverse order from expected"). That
//! is our order. The convention of pixel centres is not documented; VPI calls itself a drop-in replacement for the reference detector, whose
//! centre of the top-left pixel is (0.5, 0.5), so half a pixel is subtracted here too. If the library in use has another convention, every pose
//! is rotated by half a pixel, the same in all images: no drift.

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
        let corners = four_corners(tag)?.map(|corner| corner - Pixel::new(0.5, 0.5));
        Ok(ReportedTag { family, id, margin_gray: None, corners })
    })
}
