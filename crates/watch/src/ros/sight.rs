//! Observations of a camera from the messages that contain them.

use super::{apriltag_msgs, image, isaac_apriltag};
use resight::GrayImage;
use resight_core::correspondence::Detection;
pub use resight_recording::ros::decoder::{Decoder, Kind};
use resight_recording::ros::value::Value;

/// The content of a message.
#[derive(Debug, Clone, PartialEq)]
pub enum MessageContent {
    /// An image.
    Image(GrayImage),
    /// Detections of another program in an image.
    Detections(Vec<Detection>),
}

/// Returns the content of a message.
///
/// # Errors
/// A message of another shape, an image that cannot be read.
pub fn decode_content(kind: Kind, message: &Value<'_>) -> Result<MessageContent, String> {
    match kind {
        Kind::Image => image::raw(message).map(MessageContent::Image),
        Kind::CompressedImage => image::compressed(message).map(MessageContent::Image),
        Kind::AprilTags => apriltag_msgs::read(message).map(MessageContent::Detections),
        Kind::IsaacAprilTags => isaac_apriltag::read(message).map(MessageContent::Detections),
        Kind::CameraInfo => Err("a camera_info topic holds intrinsics, no images".to_string()),
    }
}
