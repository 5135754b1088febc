//! Poses and states as ROS 2 writes them to MCAP: transforms, poses with covariance, diagnostics.

use super::cdr::Cdr;
use super::known;
use super::pose_covariance;
use crate::{RecordingError, Writer};
use resight_core::{Matrix6, Pose};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// A transform as TF has it: the pose of the child in the parent.
#[derive(Debug, Clone, PartialEq)]
pub struct Transform {
    /// The parent's frame id.
    pub parent: String,
    /// The child's frame id.
    pub child: String,
    /// x_in_parent = parent_from_child · x_in_child.
    pub parent_from_child: Pose,
}

/// Level of a `diagnostic_msgs/DiagnosticStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// No fault.
    Ok = 0,
    /// Look at it.
    Warn = 1,
    /// It is wrong.
    Error = 2,
    /// Nothing is known any more.
    Stale = 3,
}

/// One line of diagnostics.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Severity.
    pub level: Level,
    /// Name of the component.
    pub name: String,
    /// The message.
    pub message: String,
    /// The device.
    pub hardware_id: String,
    /// Numbers.
    pub values: Vec<(String, String)>,
}

/// Later subscribers get the last message too, as TF needs it for static transforms when a recording is played.
const LATCHED: &str = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  \
    lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    \
    nsec: 854775807\n  avoid_ros_namespace_conventions: false";

/// A recording of ROS 2 messages being written.
pub struct RosWriter<W: Write + Seek> {
    file: Writer<W>,
    channels: BTreeMap<String, u16>,
}

impl<W: Write + Seek> RosWriter<W> {
    /// Starts a recording.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn new(to: W) -> Result<Self, RecordingError> {
        Ok(RosWriter { file: Writer::new(to, "ros2", 1 << 20)?, channels: BTreeMap::new() })
    }

    /// About how many chunks the file has; see `Writer::chunks`.
    pub fn chunks(&self) -> u64 {
        self.file.chunks()
    }

    fn write(&mut self, topic: &str, kind: &str, time_ns: u64, message: Cdr) -> Result<(), RecordingError> {
        let channel = match self.channels.get(topic) {
            Some(channel) => *channel,
            None => self.channel(topic, kind)?,
        };
        self.file.message(channel, time_ns, &message.into_bytes())
    }

    fn channel(&mut self, topic: &str, kind: &str) -> Result<u16, RecordingError> {
        let definition = known::definition(kind).unwrap_or_default();
        let name = kind.replace('/', "/msg/");
        let schema = self.file.schema(&name, "ros2msg", definition.as_bytes())?;
        let latched = topic == "/tf_static";
        let qos =
            if latched { LATCHED.to_string() } else { LATCHED.replace("durability: 1", "durability: 2") };
        let metadata = BTreeMap::from([("offered_qos_profiles".to_string(), qos)]);
        let channel = self.file.channel(schema, topic, "cdr", &metadata)?;
        self.channels.insert(topic.to_string(), channel);
        Ok(channel)
    }

    /// Writes transforms that are valid at a time, on `/tf`.
    ///
    /// # Errors
    /// An error of the medium; so also below.
    pub fn transforms(&mut self, time_ns: u64, transforms: &[Transform]) -> Result<(), RecordingError> {
        self.write("/tf", "tf2_msgs/TFMessage", time_ns, tf_message(time_ns, transforms))
    }

    /// Transforms that hold from a time on, on `/tf_static`.
    pub fn static_transforms(
        &mut self,
        time_ns: u64,
        transforms: &[Transform],
    ) -> Result<(), RecordingError> {
        self.write("/tf_static", "tf2_msgs/TFMessage", time_ns, tf_message(time_ns, transforms))
    }

    /// The camera's pose in the target's frame, `covariance` as that of `cam_from_target` everywhere here.
    pub fn camera_pose(
        &mut self,
        topic: &str,
        time_ns: u64,
        target_frame: &str,
        cam_from_target: &Pose,
        covariance: &Matrix6,
    ) -> Result<(), RecordingError> {
        let pose = cam_from_target.inverse();
        let covariance = pose_covariance(&pose, covariance);
        let message = Cdr::new()
            .header(time_ns, target_frame)
            .f64s(pose.translation.iter().copied())
            .quaternion(pose.quaternion_wxyz())
            .f64s(covariance.transpose().iter().copied()); // Row by row.
        self.write(topic, "geometry_msgs/PoseWithCovarianceStamped", time_ns, message)
    }

    /// Diagnostics, on `/diagnostics`.
    pub fn diagnostics(&mut self, time_ns: u64, all: &[Status]) -> Result<(), RecordingError> {
        let start = Cdr::new().header(time_ns, "").u32(all.len() as u32);
        let message = all.iter().fold(start, |cdr, status| {
            let cdr = cdr.u8(status.level as u8).text(&status.name).text(&status.message);
            let cdr = cdr.text(&status.hardware_id).u32(status.values.len() as u32);
            status.values.iter().fold(cdr, |cdr, (key, value)| cdr.text(key).text(value))
        });
        self.write("/diagnostics", "diagnostic_msgs/DiagnosticArray", time_ns, message)
    }

    /// Closes the chunk and hands it to the medium: what has been written can be read from now on, whatever happens.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.file.flush()
    }

    /// Writes the indexes.
    pub fn finish(self) -> Result<W, RecordingError> {
        self.file.finish()
    }
}

fn tf_message(time_ns: u64, transforms: &[Transform]) -> Cdr {
    transforms.iter().fold(Cdr::new().u32(transforms.len() as u32), |cdr, transform| {
        let pose = &transform.parent_from_child;
        cdr.header(time_ns, &transform.parent)
            .text(&transform.child)
            .f64s(pose.translation.iter().copied())
            .quaternion(pose.quaternion_wxyz())
    })
}

/// Seconds as the nanoseconds of a recording; times before 1970 and those that are none become 0.
pub fn nanoseconds(t_s: f64) -> u64 {
    // Seconds of today have steps of 0.24 µs in a double.
    (1e9 * t_s).round() as u64
}
