//! The output of every frame and event to a history file, by a thread of its own.

use super::super::log::Log;
use super::super::names::Names;
use super::Output;
use super::measured::measured;
use super::said::{EventText, word};
use crate::history::{
    EventRow, FrameRow, HistoryError, NotStored, Recorder, Recording, Reported, Retention, Store, Stored,
    StoredRotation, recorder,
};
use crate::live::{Event, Observation};
use anyhow::Result;
use resight::answer::SchemaNumber;
use resight::landmarks::LandmarkObservation;
use resight::report::turned::contradiction;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

/// The history of a session.
#[derive(Clone)]
pub struct HistoryConfig {
    /// The SQLite file.
    pub file: PathBuf,
    /// The treatment of old rows.
    pub retention: Retention,
    /// Longest time until a frame is on the disk, seconds.
    pub commit_s: f64,
    /// Receives, from the thread that writes, what is on the disk permanently: an object `{"event": "stored", …}`.
    pub on_stored: Option<OnStored>,
}

/// Receives an object with what is stored.
pub type OnStored = Arc<dyn Fn(&Value) + Send + Sync>;

/// Largest number of frames that wait for the disk: some 20 MB, half a minute of 20 cameras at 30 frames a second.
const WAITING: usize = 20_000;

/// Opens the output.
///
/// # Errors
/// A file that needs the user's attention; a full disk is tried again instead.
pub(super) fn open(config: HistoryConfig, names: &Names, log: &Log) -> Result<Box<dyn Output>> {
    let pairs: Vec<(String, String)> = names
        .cameras
        .iter()
        .flat_map(|camera| names.targets.iter().map(move |target| (camera.clone(), target.clone())))
        .collect();
    let recording = Recording {
        path: config.file,
        pairs: pairs.clone(),
        commit_s: config.commit_s,
        waiting: WAITING,
        retry_s: 1.0,
        retention: config.retention,
    };
    let reported = Teller { pairs: names.pairs(), on_stored: config.on_stored, log: log.clone() };
    let store = begin(&recording, &reported)?;
    let (recorder, writer) = recorder(recording, store);
    let thread = thread::spawn(move || writer.run(|what| reported.tell(what)));
    let states = vec!["stale"; pairs.len()];
    let said = EventText::new(names);
    Ok(Box::new(Kept { names: names.clone(), said, states, recorder, thread: Some(thread) }))
}

/// Starts the history; returns an error where a file needs the user's attention; a full disk is tried again.
fn begin(recording: &Recording, reported: &Teller) -> Result<Option<Store>, HistoryError> {
    match Store::open(&recording.path, &recording.pairs) {
        Ok(opened) => {
            if let Some((path, reason)) = opened.put_aside {
                reported.tell(Reported::PutAside(path, reason));
            }
            Ok(Some(opened.store))
        }
        Err(error) if error.may_pass() => {
            reported.tell(Reported::Degraded(error));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

struct Kept {
    names: Names,
    said: EventText,
    /// The last reported state of each pair.
    states: Vec<&'static str>,
    recorder: Recorder,
    thread: Option<JoinHandle<()>>,
}

impl Output for Kept {
    fn take(&mut self, event: &Event) -> Result<()> {
        if let Event::Observed { camera, target, observation } = event {
            let pair = self.names.pair_index(*camera, *target);
            self.recorder.frame(frame(pair, self.states[pair], observation));
            return Ok(());
        }
        if let Event::StateChanged { camera, target, state, .. } = event {
            let pair = self.names.pair_index(*camera, *target);
            self.states[pair] = word(state);
        }
        let row = self.row(event);
        self.recorder.event(row);
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.recorder.close();
        if let Some(thread) = self.thread.take() {
            // A writer that panicked has reported so itself.
            let _ = thread.join();
        }
        Ok(())
    }
}

impl Kept {
    fn row(&self, event: &Event) -> EventRow {
        let detail = self.said.object(event);
        let text = |key: &str| detail[key].as_str().map(str::to_string);
        let (state, pair) = match event {
            Event::StateChanged { camera, target, state, .. } => {
                (Some(word(state)), Some(self.names.pair_index(*camera, *target)))
            }
            _ => (None, None),
        };
        EventRow {
            t_s: detail["t_s"].as_f64(),
            camera: text("camera"),
            target: text("target"),
            kind: text("event").unwrap_or_default(),
            state,
            pair,
            detail: detail.to_string(),
        }
    }
}

/// Returns the row of a frame with the frame's own pose, because a filtered one could not be averaged. A rotation of natural landmarks is no
/// pose against the target and has a column of its own.
fn frame(pair: usize, state: &'static str, observation: &Observation) -> FrameRow {
    let landmark_observation = observation.landmarks.as_deref();
    FrameRow {
        pair,
        t_s: observation.capture_s,
        number: observation.number,
        state,
        n_points: observation.n_points,
        measured: measured(observation),
        rotated: landmark_observation.and_then(rotated),
        reason: observation.reason.clone().or_else(|| landmark_observation.and_then(contradiction)),
    }
}

/// Returns the rotation by landmarks, unless most of them contradict it: such a rotation must not count in a mean.
fn rotated(landmark_observation: &LandmarkObservation) -> Option<StoredRotation> {
    let (rotation_rad, covariance_rad2) = landmark_observation.relative_rotation.old_from_new();
    let n_landmarks = landmark_observation.relative_rotation.used.len() as f64;
    landmark_observation.relative_rotation.is_consistent().then_some(StoredRotation {
        rotation_rad,
        covariance_rad2,
        n_landmarks,
    })
}

/// Reports the progress.
struct Teller {
    pairs: Vec<String>,
    on_stored: Option<OnStored>,
    log: Log,
}

impl Teller {
    fn tell(&self, what: Reported) {
        let say = |text: &str| self.log.say("history", text);
        match what {
            Reported::Stored(stored) => {
                if let Some(on_stored) = &self.on_stored {
                    on_stored(&serde_json::to_value(self.object(&stored)).unwrap_or_default());
                }
            }
            Reported::Degraded(reason) => say(&format!(
                "degraded: {reason}; frames go on, and what waits is stored as soon as it can be"
            )),
            Reported::Recovered(lost) if lost == NotStored::default() => {
                say("stored again; nothing was lost")
            }
            Reported::Recovered(lost) => say(&format!("stored again; {} were not stored", count(&lost))),
            Reported::PutAside(path, reason) => say(&format!(
                "the file was damaged ({reason}); it is now {}, and a new one begun",
                path.display()
            )),
            Reported::Lost(lost) => say(&format!("the session ended; {} were not stored", count(&lost))),
        }
    }

    fn object(&self, stored: &Stored) -> StoredObject {
        let through = self.pairs.iter().zip(&stored.through_s);
        StoredObject {
            schema: SchemaNumber,
            event: "stored",
            session: stored.session,
            frames: stored.frames,
            events: stored.events,
            not_stored: NotStoredObject {
                frames: stored.not_stored.frames,
                events: stored.not_stored.events,
            },
            through_s: through.filter_map(|(pair, t_s)| Some((pair.clone(), (*t_s)?))).collect(),
        }
    }
}

/// What is on the disk by now.
#[derive(Debug, Serialize, JsonSchema)]
pub struct StoredObject {
    schema: SchemaNumber,
    event: &'static str,
    session: i64,
    frames: u64,
    events: u64,
    not_stored: NotStoredObject,
    /// Of each camera and target the time of the last frame stored.
    through_s: BTreeMap<String, f64>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct NotStoredObject {
    frames: u64,
    events: u64,
}

fn count(lost: &NotStored) -> String {
    format!("{} frames and {} events", lost.frames, lost.events)
}
