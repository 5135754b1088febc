//! The types of messages that are read, and their decoder.

use super::decode::{Layout, decode, from_json};
use super::definition::Definition;
use super::known;
use super::value::Value;

/// A type of message that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An image.
    Image,
    /// A PNG or JPEG image.
    CompressedImage,
    /// Tags found by `apriltag_ros`.
    AprilTags,
    /// Tags found by Isaac ROS.
    IsaacAprilTags,
    /// Intrinsics.
    CameraInfo,
}

impl Kind {
    /// Returns the kind of a type by its name; `None` for types that are not read.
    pub fn of(name: &str) -> Option<Self> {
        Some(match name.replace("/msg/", "/").as_str() {
            "sensor_msgs/Image" | "foxglove.RawImage" | "foxglove_msgs/RawImage" => Kind::Image,
            "sensor_msgs/CompressedImage" | "foxglove.CompressedImage" | "foxglove_msgs/CompressedImage" => {
                Kind::CompressedImage
            }
            "apriltag_msgs/AprilTagDetectionArray" => Kind::AprilTags,
            "isaac_ros_apriltag_interfaces/AprilTagDetectionArray" => Kind::IsaacAprilTags,
            "sensor_msgs/CameraInfo" | "foxglove.CameraCalibration" | "foxglove_msgs/CameraCalibration" => {
                Kind::CameraInfo
            }
            _ => return None,
        })
    }

    /// Returns whether it is an image.
    pub fn is_image(self) -> bool {
        matches!(self, Kind::Image | Kind::CompressedImage)
    }

    /// Returns whether it shows the camera's view.
    pub fn is_camera_message(self) -> bool {
        self != Kind::CameraInfo
    }
}

/// Reads the messages of one topic.
#[derive(Debug, Clone)]
pub enum Decoder {
    /// By a definition.
    Binary(Definition, Layout),
    /// Text.
    Json,
}

impl Decoder {
    /// For messages of type `name` in `message_encoding`, defined by `definition` in `definition_encoding`.
    ///
    /// # Errors
    /// An encoding that is not read, a definition that is none.
    pub fn new(
        name: &str,
        message_encoding: &str,
        definition_encoding: &str,
        definition: &[u8],
    ) -> Result<Self, String> {
        let layout = match message_encoding {
            "cdr" => Layout::Cdr,
            "ros1" => Layout::Ros1,
            "json" => return Ok(Decoder::Json),
            other => return Err(format!("messages are encoded as `{other}`; cdr, ros1 and json are read")),
        };
        if matches!(definition_encoding, "ros2msg" | "ros1msg") && !definition.is_empty() {
            let text =
                std::str::from_utf8(definition).map_err(|_| "the definition is not UTF-8".to_string())?;
            return Ok(Decoder::Binary(Definition::parse(name, text)?, layout));
        }
        // Defined in IDL, or not at all: by what the type is everywhere.
        let text = known::definition(name).ok_or_else(|| {
            format!("{name} is defined as `{definition_encoding}`; ros2msg and ros1msg are read")
        })?;
        Ok(Decoder::Binary(Definition::parse(name, &text)?, layout))
    }

    /// A message.
    ///
    /// # Errors
    /// Bytes that do not fit.
    pub fn read<'a>(&'a self, data: &'a [u8]) -> Result<Value<'a>, String> {
        match self {
            Decoder::Binary(definition, layout) => decode(definition, *layout, data),
            Decoder::Json => from_json(data),
        }
    }
}
