//! Several cameras and targets: the decision whether a camera or a target moved, from all observations.
//!
//! Where targets are fixed every pair of a camera and a target is an edge, and the smallest set of nodes that explains the alarms moved. Where a
//! target is hand-held only the relative poses of the cameras are monitored, by frame set.

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

/// The cameras and targets of a session, by name.
pub(super) struct Nodes {
    pub cameras: Vec<String>,
    pub lenses: Vec<Camera>,
    pub targets: Vec<String>,
    /// Whether each camera's source is live.
    pub is_live: Vec<bool>,
    /// References of each camera and each target, camera by camera, where they are known.
    pub references: Vec<Option<Reference>>,
    /// Monitors of an earlier session, in the same order.
    pub monitors: Vec<Option<Monitor>>,
    /// The settings on which the state of a rig with hand-held targets depends, by name.
    pub settings: BTreeMap<String, String>,
    /// Controls which camera must wait for which.
    pub pace: Arc<Pace>,
}

/// Processes events between the cameras' threads and the listener, and adds results that need all of them.
pub(super) enum Relations {
    /// One camera and one target: which of them moved cannot be known.
    None,
    /// Fixed targets.
    Pairs(Box<Pairs>),
    /// Hand-held targets.
    Cameras(Box<Cameras>),
}

impl Relations {
    /// Builds the relations; a rig continues from the `state` of an earlier session.
    pub fn new(nodes: Nodes, config: &LiveConfig, state: Option<&StateFile>) -> Self {
        match &config.rig {
            Some(rig) => Relations::Cameras(Box::new(Cameras::new(nodes, rig, config, state))),
            // Landmarks alone give each camera's rotation independently.
            None if nodes.targets.is_empty() => Relations::None,
            None if 2 < nodes.cameras.len() + nodes.targets.len() => {
                Relations::Pairs(Box::new(Pairs::new(nodes, config)))
            }
            None => Relations::None,
        }
    }

    /// Returns the event as it is to be reported, and those that follow from it.
    pub fn take(&mut self, event: Event) -> Vec<Event> {
        match self {
            Relations::None => vec![event],
            Relations::Pairs(pairs) => pairs.take(event),
            Relations::Cameras(cameras) => cameras.take(event, Instant::now()),
        }
    }

    /// Returns the events after a time without any frame.
    pub fn idle(&mut self) -> Vec<Event> {
        match self {
            Relations::Cameras(cameras) => cameras.idle(Instant::now()),
            _ => Vec::new(),
        }
    }

    /// Returns the capture time of a camera's last frame in an earlier session as part of a rig, and its age, seconds.
    pub fn resumed(&self, camera: usize) -> Option<(f64, f64)> {
        match self {
            Relations::Cameras(cameras) => cameras.resumed(camera),
            _ => None,
        }
    }

    /// Hands over the state when it is due, and at the end; without relations the cameras hand over their own.
    pub fn keep(&mut self, state: Option<&StateFile>, is_end: bool) {
        if let (Relations::Cameras(cameras), Some(state)) = (self, state) {
            cameras.keep(state, is_end);
        }
    }

    /// Returns the events to report when all sources have ended.
    pub fn finish(&mut self) -> Vec<Event> {
        match self {
            Relations::Cameras(cameras) => cameras.finish(),
            Relations::Pairs(pairs) => pairs.finish(),
            Relations::None => Vec::new(),
        }
    }
}
