//! What a camera sees, from the messages that show it.

use super::{apriltag_msgs, image, isaac_apriltag};
use resight::GrayImage;
use resight_core::correspondence::Detection;
pub use resight_recording::ros::decoder::{Decoder, Kind};
use resight_recording::ros::value::Value;

/// What a camera sees.
#[derive(Debug, Clone, PartialEq)]
pub enum MessageContent {
    /// An image.
    Image(GrayImage),
    /// What another program found in one.
    Detections(Vec<Detection>),
}

/// What a message shows.
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
