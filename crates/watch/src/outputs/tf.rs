//! `--tf`: poses, references and drift corrections as a recording of ROS 2 messages.
//!
//! The file is written by a thread of its own, so that a slow disk delays nothing else, and every chunk is passed to the disk within a second:
//! however the program ends, what was written before can be read. An existing file is kept; the new one gets the next free name.

mod frames;
mod recorder;

use super::super::names::Names;
use super::said::{state_words, word};
use super::{Output, Session};
use crate::live::{Event, Observation, State};
use crate::ros::write::{Level, Status, nanoseconds};
use anyhow::Result;
use frames::Frames;
use recorder::{Item, Recorder};
use resight::core::temporal::monitor::{Drift, Reference};
use resight::core::{Pose, Vector6};
use std::path::PathBuf;

/// The settings of a recording of poses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TfConfig {
    /// The file; where it exists, the next free name is used.
    pub file: PathBuf,
    /// Whether the target is the parent on `/tf`; otherwise the camera.
    pub target_is_parent: bool,
    /// `NAME=FRAME_ID` of cameras and targets with another frame id.
    pub frames: Vec<String>,
}

/// The output of events as ROS 2 messages.
pub struct Tf {
    names: Names,
    frames: Frames,
    recorder: Recorder,
    /// Capture time of the last frame of each camera, ns, used for what has no time of its own. None before the first frame.
    last_ns: Vec<Option<u64>>,
    /// Pairs that are reported as moved.
    corrected: Vec<bool>,
}

/// Opens the file.
///
/// # Errors
/// Invalid frame ids; a file that cannot be written.
pub(super) fn open(config: &TfConfig, session: &Session<'_>) -> Result<Box<dyn Output>> {
    let names = session.names;
    let mut tf = Tf {
        frames: Frames::new(names, config.target_is_parent, &config.frames)?,
        names: names.clone(),
        recorder: Recorder::open(&config.file, session.log)?,
        last_ns: vec![None; names.cameras.len()],
        corrected: vec![false; names.pairs().len()],
    };
    // References that are known from the start are valid from the start.
    for (pair, reference) in session.references.iter().enumerate() {
        if let Some(reference) = reference {
            tf.reference(pair / names.targets.len(), pair % names.targets.len(), reference, None);
        }
    }
    Ok(Box::new(tf))
}

impl Output for Tf {
    fn take(&mut self, event: &Event) -> Result<()> {
        match event {
            Event::Observed { camera, target, observation } => self.pose(*camera, *target, observation),
            Event::Learned { camera, target, reference, .. } => {
                self.reference(*camera, *target, reference, self.last_ns[*camera]);
            }
            Event::StateChanged { camera, target, t_s, state } => self.state(*camera, *target, *t_s, state),
            Event::Source { camera, connected, reason } => {
                self.source(*camera, *connected, reason.as_deref())
            }
            Event::Dropped { .. }
            | Event::LeftOut { .. }
            | Event::Clock { .. }
            | Event::Oriented { .. }
            | Event::MovedWhileLearning { .. }
            | Event::Ended { .. }
            | Event::Compared { .. }
            | Event::Promised { .. }
            | Event::Attributed { .. } => {}
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.recorder.finish();
        Ok(())
    }
}

impl Tf {
    fn pose(&mut self, camera: usize, target: usize, observation: &Observation) {
        let time_ns = nanoseconds(observation.capture_s);
        self.last_ns[camera] = Some(time_ns);
        let Some(tracked) = &observation.tracked else { return };
        self.recorder.push(Item::Transforms(
            time_ns,
            vec![self.frames.seen(camera, target, &tracked.cam_from_target)],
        ));
        self.recorder.push(Item::Pose {
            topic: format!("/{}/pose", self.names.pair(camera, target)),
            time_ns,
            target_frame: self.frames.target(camera, target),
            cam_from_target: tracked.cam_from_target,
            covariance: Box::new(tracked.covariance),
        });
    }

    /// Records the reference pose of a camera that has not moved from it. `time_ns` is none before the first frame.
    fn reference(&mut self, camera: usize, target: usize, reference: &Reference, time_ns: Option<u64>) {
        let transforms = vec![
            self.frames.reference(camera, target, &reference.a_from_b),
            self.frames.correction(camera, target, &Pose::identity()),
        ];
        self.recorder.push(Item::Static(time_ns, transforms));
    }

    fn state(&mut self, camera: usize, target: usize, t_s: f64, state: &State) {
        let time_ns = nanoseconds(t_s);
        let pair = self.names.pair_index(camera, target);
        let old_from_new = match state {
            State::Drifted(drift) => Some(moved(drift)),
            State::Steady if self.corrected[pair] => Some(Pose::identity()),
            _ => None,
        };
        if let Some(old_from_new) = old_from_new {
            self.corrected[pair] = !matches!(state, State::Steady);
            let correction = self.frames.correction(camera, target, &old_from_new);
            self.recorder.push(Item::Static(Some(time_ns), vec![correction]));
        }
        let status = Status {
            level: level(state),
            name: format!("resight: {}", self.names.pair(camera, target)),
            message: state_words(state),
            hardware_id: self.names.camera(camera).to_string(),
            values: values(self.names.target(target), state),
        };
        self.recorder.push(Item::Diagnostics(Some(time_ns), vec![status]));
    }

    fn source(&mut self, camera: usize, connected: bool, reason: Option<&str>) {
        let lost = || format!("source lost: {}", reason.unwrap_or("no reason given"));
        let status = Status {
            level: if connected { Level::Ok } else { Level::Stale },
            name: format!("resight: source of {}", self.names.camera(camera)),
            message: if connected { "source is there".to_string() } else { lost() },
            hardware_id: self.names.camera(camera).to_string(),
            values: Vec::new(),
        };
        self.recorder.push(Item::Diagnostics(self.last_ns[camera], vec![status]));
    }
}

/// Returns the present pose of the camera in its own old frame: a rotation alone where that explains the motion, because it is far more certain.
fn moved(drift: &Drift) -> Pose {
    let motion = match drift.pure_rotation() {
        Some((turn, _)) => Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0),
        None => drift.old_from_new,
    };
    Pose::exp(&motion)
}

fn level(state: &State) -> Level {
    match state {
        State::Steady | State::Learning { .. } | State::Tracking => Level::Ok,
        State::Checking(_) => Level::Warn,
        State::Drifted(_) | State::Inconsistent => Level::Error,
        State::Stale { .. } => Level::Stale,
    }
}

fn values(target: &str, state: &State) -> Vec<(String, String)> {
    let value = |key: &str, value: String| (key.to_string(), value);
    let mut all = vec![value("state", word(state).to_string()), value("target", target.to_string())];
    if let State::Drifted(drift) = state {
        let parts = ["x_rad", "y_rad", "z_rad", "x_m", "y_m", "z_m"];
        let motion = drift.old_from_new.iter().zip(parts);
        all.extend(motion.map(|(x, part)| value(&format!("old_from_new_{part}"), x.to_string())));
        all.push(value("began_s", drift.began_s.to_string()));
        all.push(value("began_sigma_s", drift.began_sigma_s.to_string()));
    }
    all
}
