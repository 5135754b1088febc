//! Poses and states published to a NetworkTables 4 server, such as the controller of an FRC robot.

mod link;
mod wire;

use super::courier::Courier;
use super::measured::measured;
use super::notice::weight;
use super::outbox::Weight;
use super::said::word;
use super::topics::Topics;
use super::{Common, Output};
use crate::live::{Event, Observation, State};
use crate::names::Names;
use crate::ros::pose_covariance;
use anyhow::{Result, bail};
use link::{Link, Sample, Server};
use nalgebra::{Matrix3, Vector3};
use resight::core::Pose;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};
use ureq::http::uri::Authority;
use wire::{Topic, Value};

/// Largest number of waiting messages; alarms are dropped last.
const WAITING: usize = 1000;
/// The port of NetworkTables 4.
const PORT: u16 = 5810;
/// The largest number of a team, whose robot has the address 10.TE.AM.2.
const LARGEST_TEAM: u32 = 25_599;
/// A frame whose capture time is older, or in the future, has the time at which it was solved, seconds.
const OLDEST_S: f64 = 10.0;

/// The structures of WPILib, by type and declaration.
const STRUCTURES: [(&str, &str); 4] = [
    ("Pose3d", "Translation3d translation;Rotation3d rotation"),
    ("Translation3d", "double x;double y;double z"),
    ("Rotation3d", "Quaternion q"),
    ("Quaternion", "double w;double x;double y;double z"),
];

/// The settings of the server.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Nt4Config {
    /// `HOST[:PORT]`, or the number of a team.
    pub server: String,
}

/// Opens the output.
///
/// # Errors
/// An address that is none; two cameras that would share a topic.
pub(super) fn open(config: &Nt4Config, common: &mut Common<'_>) -> Result<Box<dyn Output>> {
    let server = Server::read(&config.server)?;
    let topics = Topics::new("/resight", common.names);
    if let Some(topic) = topics.shared() {
        bail!(
            "--nt4: two of the names give the topic {topic}; NetworkTables needs them to differ in more than / + #"
        );
    }
    let began = Instant::now();
    let is_up = Arc::new(AtomicBool::new(false));
    let declared = (0..STRUCTURES.len()).map(|i| (i, (0, Value::Declaration(STRUCTURES[i].1)))).collect();
    let receiver = format!("nt4://{}:{}", server.host, server.port);
    let link = Link {
        server,
        topics: published(&topics, common.names),
        began,
        is_up: Arc::clone(&is_up),
        kept: declared,
    };
    let courier = Courier::start("nt4", &receiver, WAITING, common, move |outbox, standing, runtime| {
        runtime.block_on(link.run(&outbox, standing));
    })?;
    let numbers = Numbers { n_targets: common.names.targets.len() };
    let is_reported = vec![false; common.names.cameras.len()];
    Ok(Box::new(Nt4 { courier, began, is_up, numbers, is_reported }))
}

impl Server {
    /// # Errors
    /// What is neither an address nor the number of a team.
    fn read(text: &str) -> Result<Self> {
        if let Ok(team) = text.parse::<u32>() {
            if LARGEST_TEAM < team || team == 0 {
                bail!(
                    "--nt4 {text}: the number of a team is 1 to {LARGEST_TEAM}; otherwise give HOST[:PORT]"
                );
            }
            return Ok(Server { host: format!("10.{}.{}.2", team / 100, team % 100), port: PORT });
        }
        let authority = text.parse::<Authority>().ok();
        let authority = authority.filter(|a| !a.host().is_empty() && !text.contains('@'));
        let is_port_right =
            |a: &Authority| a.as_str() == a.host() || a.port_u16().is_some_and(|port| 0 < port);
        let Some(authority) = authority.filter(is_port_right) else {
            bail!(
                "--nt4 {text}: HOST[:PORT] or the number of a team is needed, such as 10.12.34.2, roborio-1234-frc.local or 1234"
            );
        };
        let host = authority.host().trim_start_matches('[').trim_end_matches(']').to_string();
        Ok(Server { host, port: authority.port_u16().unwrap_or(PORT) })
    }
}

/// What is published of a camera against a target, with the types, in the order of its topics.
const OF_PAIR: [(&str, &str); 4] =
    [("target_from_cam", "struct:Pose3d"), ("sigma", "double[]"), ("state", "string"), ("moved", "boolean")];
const POSE: usize = 0;
const SIGMA: usize = 1;
const STATE: usize = 2;
const MOVED: usize = 3;

/// The numbers of the topics: declarations of structures, then for each camera whether its source gives frames, and what is published against each
/// target.
#[derive(Clone, Copy)]
struct Numbers {
    n_targets: usize,
}

impl Numbers {
    fn of_camera(self, camera: usize) -> usize {
        STRUCTURES.len() + camera * (1 + OF_PAIR.len() * self.n_targets)
    }

    fn of_pair(self, camera: usize, target: usize, what: usize) -> usize {
        self.of_camera(camera) + 1 + OF_PAIR.len() * target + what
    }
}

/// The topics, in the order of their numbers.
fn published(topics: &Topics, names: &Names) -> Vec<Topic> {
    let declarations =
        STRUCTURES.map(|(kind, _)| Topic { name: format!("/.schema/struct:{kind}"), kind: "structschema" });
    let of_camera = |camera: usize| {
        let of_pair = move |target: usize| {
            OF_PAIR.map(|(what, kind)| Topic { name: topics.of_pair(camera, target, what), kind })
        };
        let connected = Topic { name: topics.of_camera(camera, "connected"), kind: "boolean" };
        std::iter::once(connected).chain((0..names.targets.len()).flat_map(of_pair))
    };
    declarations.into_iter().chain((0..names.cameras.len()).flat_map(of_camera)).collect()
}

struct Nt4 {
    courier: Courier<Sample>,
    began: Instant,
    /// Whether the server is connected; frames do not wait for it.
    is_up: Arc<AtomicBool>,
    numbers: Numbers,
    /// For each camera whether the state of its source was reported.
    is_reported: Vec<bool>,
}

impl Output for Nt4 {
    fn take(&mut self, event: &Event) -> Result<()> {
        match event {
            Event::Observed { camera, target, observation } => {
                if self.is_reported.get(*camera) == Some(&false) {
                    self.take(&Event::Source { camera: *camera, connected: true, reason: None })?;
                }
                if self.is_up.load(Ordering::Relaxed) {
                    self.frame(*camera, *target, observation);
                }
            }
            Event::StateChanged { camera, target, state, .. } => {
                let is_moved = matches!(state, State::Drifted(_));
                let values = vec![
                    (self.numbers.of_pair(*camera, *target, STATE), Value::Text(word(state))),
                    (self.numbers.of_pair(*camera, *target, MOVED), Value::Boolean(is_moved)),
                ];
                self.publish(event, values);
            }
            Event::Source { camera, connected, .. } => {
                if let Some(is_reported) = self.is_reported.get_mut(*camera) {
                    *is_reported = true;
                }
                self.publish(event, vec![(self.numbers.of_camera(*camera), Value::Boolean(*connected))]);
            }
            _ => {}
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.courier.finish();
        Ok(())
    }
}

impl Nt4 {
    fn publish(&self, event: &Event, values: Vec<(usize, Value)>) {
        let weight = weight(event).unwrap_or(Weight::Routine);
        let time_us = self.began.elapsed().as_micros() as i64;
        self.courier.tell(weight, Sample { time_us, values, is_kept: true });
    }

    /// Publishes the pose of a frame, at the time at which it was taken.
    fn frame(&self, camera: usize, target: usize, observation: &Observation) {
        let is_usable = observation.reading.as_ref().is_some_and(|reading| reading.is_consistent);
        let Some(pose) = measured(observation).filter(|_| is_usable) else { return };
        let target_from_cam = pose.cam_from_target.inverse();
        let covariance = pose_covariance(&target_from_cam, &pose.covariance);
        let sigma = (0..6).map(|i| covariance[(i, i)].max(0.0).sqrt()).collect();
        let values = vec![
            (self.numbers.of_pair(camera, target, POSE), Value::Structure(pose3d(&target_from_cam))),
            (self.numbers.of_pair(camera, target, SIGMA), Value::Doubles(sigma)),
        ];
        let now_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |t| t.as_secs_f64());
        let age_s = now_s - observation.capture_s;
        let age_s = if (0.0..=OLDEST_S).contains(&age_s) { age_s } else { 0.0 };
        let time_us = self.began.elapsed().as_micros() as i64 - (1e6 * age_s) as i64;
        self.courier.tell(Weight::Frame, Sample { time_us, values, is_kept: false });
    }
}

/// Returns the members of WPILib's `Pose3d` of the camera in the target's frame: x, y, z in metres, and a quaternion w, x, y, z. WPILib's camera looks
/// along x, with y to the left and z up.
fn pose3d(target_from_cam: &Pose) -> Vec<f64> {
    let optical_from_body = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let pose = *target_from_cam * Pose::new(optical_from_body, Vector3::zeros());
    pose.translation.iter().copied().chain(pose.quaternion_wxyz()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_is_an_address_or_the_number_of_a_team() {
        let read = |text: &str| Server::read(text).map(|Server { host, port }| (host, port)).ok();
        let place = |host: &str, port| Some((host.to_string(), port));
        assert_eq!(read("1234"), place("10.12.34.2", 5810));
        assert_eq!(read("7"), place("10.0.7.2", 5810));
        assert_eq!(read("25599"), place("10.255.99.2", 5810));
        assert_eq!(read("roborio-1234-frc.local"), place("roborio-1234-frc.local", 5810));
        assert_eq!(read("10.12.34.2:1735"), place("10.12.34.2", 1735));
        assert_eq!(read("[::1]:99"), place("::1", 99));
        for wrong in ["", "0", "25600", "host:", "host:0", "host:99999", "a@host", "http://host", "a b"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }

    /// A camera at the target's origin whose axes are the target's looks along z: in WPILib's axes x is then z, y is −x, and z is −y.
    #[test]
    fn poses_have_the_axes_of_wpilib() {
        let all = pose3d(&Pose::new(Matrix3::identity(), Vector3::new(1.0, 2.0, 3.0)));
        assert_eq!(all[..3], [1.0, 2.0, 3.0]);
        let turned = Pose::from_quaternion_wxyz([all[3], all[4], all[5], all[6]], Vector3::zeros());
        let axes = [Vector3::z(), -Vector3::x(), -Vector3::y()];
        for (i, axis) in axes.into_iter().enumerate() {
            assert!((turned.rotation.column(i) - axis).norm() < 1e-15);
        }
    }

    #[test]
    fn topics_are_found_by_their_numbers() {
        let names = Names {
            cameras: ["gate", "yard/2"].map(String::from).to_vec(),
            targets: ["door", "field"].map(String::from).to_vec(),
        };
        let all = published(&Topics::new("/resight", &names), &names);
        let name = |number: usize| all[number].name.as_str();
        let numbers = Numbers { n_targets: 2 };
        assert_eq!(name(numbers.of_pair(1, 1, MOVED)), "/resight/yard_2/field/moved");
        assert_eq!(name(numbers.of_pair(0, 0, POSE)), "/resight/gate/door/target_from_cam");
        assert_eq!(
            (name(numbers.of_camera(1)), all.len()),
            ("/resight/yard_2/connected", numbers.of_camera(2))
        );
        assert_eq!(name(3), "/.schema/struct:Quaternion");
    }
}
