//! Observations of a camera from messages of ROS 1 and ROS 2 in recordings; the messages themselves are read in `resight-recording`.

mod image;
mod bayer;
mod tags;
mod apriltag_msgs;
mod isaac_apriltag;
pub mod sight;

pub use resight_recording::ros::{decode, definition, pose_covariance, value, write};
