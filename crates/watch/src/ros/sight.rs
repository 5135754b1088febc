//! What a camera sees, from the messages that show it.

use super::{apriltag_msgs, image, isaac_apriltag};
use resight::GrayImage;
use resight_core::correspondence::Detection;
pub use resight_recording::ros::decoder::{Decoder, Kind};
use resight_recording::ros::value::Value;

/// What a camera sees.
#[derive(Debug, Clone, PartialEq)]
pub enum Sight {
    /// A picture.
    Image(GrayImage),
    /// What another program found in one.
    Detections(Vec<Detection>),
}

/// What a message shows.
///
/// # Errors
/// A message of another shape, a picture that cannot be read.
pub fn sight(kind: Kind, message: &Value<'_>) -> Result<Sight, String> {
    match kind {
        Kind::Image => image::raw(message).map(Sight::Image),
        Kind::CompressedImage => image::compressed(message).map(Sight::Image),
        Kind::AprilTags => apriltag_msgs::read(message).map(Sight::Detections),
        Kind::IsaacAprilTags => isaac_apriltag::read(message).map(Sight::Detections),
        Kind::CameraInfo => Err("a camera_info topic holds intrinsics, no pictures".to_string()),
    }
}
