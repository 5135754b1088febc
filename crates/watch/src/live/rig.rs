//! Several cameras and targets: what moved, camera or target, decided from all that they see of each other.
//!
//! Where targets stand still every pair of a camera and a target is an edge, and the smallest set of nodes that explains the alarms
//! moved. Where a target is hand-held only the relations among the cameras are watched, frame set by frame set.

mod config;
mod attributed;
mod moments;
mod watched;

use super::pace::Pace;
use super::state::StateFile;
use super::{Event, LiveConfig};
use attributed::Pairs;
pub use config::RigConfig;
use resight_core::Camera;
use resight_core::temporal::monitor::{Monitor, Reference};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;
use watched::Cameras;

/// What a session is made of, by name.
pub(super) struct Nodes {
    pub cameras: Vec<String>,
    pub lenses: Vec<Camera>,
    pub targets: Vec<String>,
    /// Whether each camera's frames come at their own pace.
    pub is_live: Vec<bool>,
    /// Of each camera against each target, camera by camera, where they are known.
    pub references: Vec<Option<Reference>>,
    /// As an earlier session left them, in the same order.
    pub monitors: Vec<Option<Monitor>>,
    /// What the state of a rig whose targets are hand-held depends on, by name.
    pub settings: BTreeMap<String, String>,
    /// Which camera must wait for which.
    pub pace: Arc<Pace>,
}

/// Stands between the cameras' threads and the listener, and adds what only all of them together say.
pub(super) enum Relations {
    /// One camera and one target, of which it cannot be known which moved.
    None,
    /// Targets that stand still.
    Pairs(Box<Pairs>),
    /// Targets that are hand-held.
    Cameras(Box<Cameras>),
}

impl Relations {
    /// A rig continues from what an earlier session left in `state`.
    pub fn new(nodes: Nodes, config: &LiveConfig, state: Option<&StateFile>) -> Self {
        match &config.rig {
            Some(rig) => Relations::Cameras(Box::new(Cameras::new(nodes, rig, config, state))),
            // Landmarks alone tell each camera's rotation for itself.
            None if nodes.targets.is_empty() => Relations::None,
            None if 2 < nodes.cameras.len() + nodes.targets.len() => {
                Relations::Pairs(Box::new(Pairs::new(nodes, config)))
            }
            None => Relations::None,
        }
    }

    /// The event, as it is to be reported, and what follows from it.
    pub fn take(&mut self, event: Event) -> Vec<Event> {
        match self {
            Relations::None => vec![event],
            Relations::Pairs(pairs) => pairs.take(event),
            Relations::Cameras(cameras) => cameras.take(event, Instant::now()),
        }
    }

    /// The consequences of a time without any frame.
    pub fn idle(&mut self) -> Vec<Event> {
        match self {
            Relations::Cameras(cameras) => cameras.idle(Instant::now()),
            _ => Vec::new(),
        }
    }

    /// Up to when a camera was heard as part of a rig by an earlier session, a capture time, and how long ago that was, seconds.
    pub fn resumed(&self, camera: usize) -> Option<(f64, f64)> {
        match self {
            Relations::Cameras(cameras) => cameras.resumed(camera),
            _ => None,
        }
    }

    /// Hands over how things stand when it is time, and at the end; cameras alone hand over their own.
    pub fn keep(&mut self, state: Option<&StateFile>, is_end: bool) {
        if let (Relations::Cameras(cameras), Some(state)) = (self, state) {
            cameras.keep(state, is_end);
        }
    }

    /// What is still to be reported when all sources have ended.
    pub fn finish(&mut self) -> Vec<Event> {
        match self {
            Relations::Cameras(cameras) => cameras.finish(),
            Relations::Pairs(pairs) => pairs.finish(),
            Relations::None => Vec::new(),
        }
    }
}
