//! The relative poses of the cameras of a rig, from frame sets in which they observe a target together.

mod record;

use super::moments::{FrameSetQueue, Shown, SynchronisedFrames, TargetPoints};
use super::{Nodes, RigConfig};
use crate::live::state::{EVERY, StateFile, unix_s};
use crate::live::{Event, LiveConfig, Observation, State};
use nalgebra::DMatrix;
use resight_core::temporal::monitor::learn::LEAST_READINGS;
use resight_core::temporal::monitor::rig::{
    FrameSet, RigMonitor, RigReference, RigUnsettled, TargetObservation, learn_observation_noise, learn_rig,
    unsettled_rig,
};
use resight_core::temporal::monitor::{Unrest, Watch};
use resight_core::{Camera, Error, Pose};
use std::time::{Duration, Instant};

/// The cameras of a rig, before and after their noise (and where unknown their poses) are learned.
pub(in crate::live) struct Cameras {
    nodes: Nodes,
    reference: Option<(Vec<Pose>, DMatrix<f64>)>,
    config: LiveConfig,
    frame_sets: FrameSetQueue,
    learning: Vec<SynchronisedFrames>,
    monitor: Option<RigMonitor>,
    /// The incomplete frame of each camera: a frame has one event for each target.
    open: Vec<Option<Shown>>,
    /// The last complete frame of each camera: its capture time, and its arrival by the clock of the machine, seconds.
    whole: Vec<Option<(f64, f64)>>,
    /// Capture time of each camera's last frame in an earlier session, and its age, seconds.
    resumed: Vec<Option<(f64, f64)>>,
    /// Whether there is something that the state file does not contain yet, and when it is handed over.
    is_new: bool,
    due: Instant,
    /// Time of each camera's last observation together with another; from the first frame on.
    last_s: f64,
    /// The continued time while no camera provides frames, also since an earlier session; none while one does.
    idle_s: Option<f64>,
    /// Capture time and arrival of each camera's last event.
    heard: Vec<Option<(f64, Instant)>>,
    lost: Vec<Lost>,
    first_s: Option<f64>,
    seen_s: Vec<Option<f64>>,
    /// Reason why the last frame of each camera shows nothing.
    reasons: Vec<Option<String>>,
    reported: Vec<Option<State>>,
    /// Motions within the frame sets for learning that are not reported yet.
    unsettled: Vec<RigUnsettled>,
    reported_moved: (Vec<usize>, Vec<Vec<usize>>),
}

/// The result of learning.
enum Learned {
    Monitor(Box<RigMonitor>),
    /// A camera moved.
    Motion(Box<RigUnsettled>),
}

/// Whether a camera's source provides frames, and will.
#[derive(Clone, Copy, PartialEq)]
enum Lost {
    No,
    ForNow,
    /// The source ended while it was lost: the state of the camera is unknown.
    ForGood,
}

/// Size of a record that is handed over as often as that of a single camera.
const AT_ONCE: f64 = 10_000.0;
/// All cameras are silent after this long without events.
const SILENT: Duration = Duration::from_secs(1);

impl Cameras {
    pub fn new(nodes: Nodes, rig: &RigConfig, config: &LiveConfig, state: Option<&StateFile>) -> Self {
        let n = nodes.cameras.len();
        let mut cameras = Cameras {
            reference: rig.reference.clone(),
            config: config.clone(),
            frame_sets: FrameSetQueue::new(&nodes.is_live, rig.sync_tolerance_s, &nodes.pace, Instant::now()),
            learning: Vec::new(),
            monitor: None,
            open: vec![None; n],
            whole: vec![None; n],
            resumed: vec![None; n],
            is_new: false,
            due: Instant::now(),
            last_s: 0.0,
            idle_s: None,
            heard: vec![None; n],
            lost: vec![Lost::No; n],
            first_s: None,
            seen_s: vec![None; n],
            reasons: vec![None; n],
            reported: vec![None; n],
            unsettled: Vec::new(),
            reported_moved: Default::default(),
            nodes,
        };
        if let Some((state, record)) = state.and_then(|state| Some((state, state.rig()?))) {
            state.say(&match cameras.restore(&record) {
                Ok(()) => format!("the rig continues from {:.3} s", cameras.last_s),
                Err(reason) => format!("the rig begins anew: {reason}"),
            });
        }
        cameras
    }

    /// Returns the capture time of a camera's last frame in an earlier session, and its age, seconds.
    pub fn resumed(&self, camera: usize) -> Option<(f64, f64)> {
        self.resumed[camera]
    }

    /// Hands over the state when it is due, and at the end.
    pub fn keep(&mut self, state: &StateFile, is_end: bool) {
        if self.is_new && (is_end || self.due <= Instant::now()) {
            let record = self.record();
            // The statistics of many cameras are large: they are written rarely enough to keep the disk idle.
            self.due = Instant::now() + EVERY.mul_f64(1.0_f64.max(record.size() as f64 / AT_ONCE));
            self.is_new = false;
            state.put_rig(record);
        }
    }

    pub fn take(&mut self, event: Event, now: Instant) -> Vec<Event> {
        let mut events = Vec::new();
        match event {
            Event::Observed { camera, target, mut observation } => {
                self.shown(camera, target, &mut observation, now);
                events.push(Event::Observed { camera, target, observation });
            }
            // A single camera reports only whether it observes the target. A live one's clock continues while none does; a recorded one may be
            // far ahead of the others.
            Event::StateChanged { camera, t_s, .. } => {
                if self.nodes.is_live[camera] {
                    self.last_s = self.last_s.max(t_s);
                }
            }
            Event::Source { camera, connected, reason } => {
                self.lost[camera] = if connected { Lost::No } else { Lost::ForNow };
                events.push(Event::Source { camera, connected, reason });
            }
            Event::Ended { camera } => {
                self.frame_sets.ended(camera);
                self.heard[camera] = None;
                if self.lost[camera] == Lost::ForNow {
                    self.lost[camera] = Lost::ForGood;
                }
                events.push(Event::Ended { camera });
            }
            other => events.push(other),
        }
        events.extend(self.flow(now));
        events
    }

    /// Continues the clock of the cameras that have not ended, after a time without frames.
    pub fn idle(&mut self, now: Instant) -> Vec<Event> {
        let heard = || self.heard.iter().flatten();
        let silent = |at: &Instant| now.saturating_duration_since(*at);
        let all_silent = heard().all(|(_, at)| SILENT < silent(at));
        let now_s = heard().map(|(t_s, at)| t_s + silent(at).as_secs_f64()).fold(f64::INFINITY, f64::min);
        if all_silent && now_s.is_finite() {
            self.idle_s = Some(now_s);
        }
        self.flow(now)
    }

    fn now_s(&self) -> f64 {
        self.idle_s.map_or(self.last_s, |idle_s| idle_s.max(self.last_s))
    }

    /// Processes complete frame sets.
    fn flow(&mut self, now: Instant) -> Vec<Event> {
        let mut events = Vec::new();
        for frame_set in self.frame_sets.complete(now) {
            self.push(frame_set);
            events.extend(self.reported(self.now_s()));
        }
        events.extend(self.reported(self.now_s()));
        events
    }

    pub fn finish(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        for (camera, state) in self.states(self.last_s).into_iter().enumerate() {
            // The estimate is better at the end than at the time of the report.
            if matches!(state, State::Drifted(_)) {
                events.extend(self.changed(camera, self.last_s, &state));
            }
        }
        events
    }

    /// Records the observation of one target by a camera; the frame is complete with the last target.
    fn shown(&mut self, camera: usize, target: usize, observation: &mut Observation, now: Instant) {
        let t_s = observation.capture_s;
        if self.resumed[camera].is_some_and(|(last_s, _)| t_s <= last_s) {
            return; // return; // An earlier session processed it.
        }
        (self.heard[camera], self.idle_s) = (Some((t_s, now)), None);
        self.reasons[camera].clone_from(&observation.reason);
        let mut frame = match self.open[camera].take() {
            Some(frame) if frame.t_s == t_s => frame,
            _ => Shown { camera, t_s, seen: Vec::new() },
        };
        if let (Some(estimate), Some(lens)) = (observation.estimate, observation.lens.take()) {
            let points = std::mem::take(&mut observation.seen);
            frame.seen.push(TargetPoints { target, points, lens: *lens, estimate });
        }
        if target + 1 < self.nodes.targets.len() {
            self.open[camera] = Some(frame);
        } else {
            self.frame_sets.push(frame, now);
            (self.whole[camera], self.is_new) = (Some((t_s, unix_s())), true);
        }
    }

    fn push(&mut self, frame_set: SynchronisedFrames) {
        self.last_s = self.last_s.max(frame_set.t_s);
        self.first_s.get_or_insert(frame_set.t_s);
        for frame in frame_set.frames.iter().filter(|frame| is_shared(&frame_set, frame)) {
            self.seen_s[frame.camera] = Some(frame_set.t_s);
        }
        match &mut self.monitor {
            Some(monitor) => monitor.push(&borrowed(&frame_set)),
            None if frame_set.frames.iter().any(|frame| is_shared(&frame_set, frame)) => {
                self.learn(frame_set)
            }
            None => {}
        }
    }

    /// Adds a frame set to learn from; where the rig was known before, those learned from are monitored afterwards.
    fn learn(&mut self, frame_set: SynchronisedFrames) {
        self.learning.push(frame_set);
        if self.learning.len() < self.config.learn_readings.max(LEAST_READINGS) {
            return;
        }
        let frame_sets: Vec<FrameSet> = self.learning.iter().map(borrowed).collect();
        match self.learned(&frame_sets) {
            Ok(Learned::Monitor(monitor)) => (self.monitor, self.learning) = (Some(*monitor), Vec::new()),
            Ok(Learned::Motion(unsettled)) => {
                let is_step = unsettled.unsettled.unrest == Unrest::Step;
                let after = if is_step { unsettled.unsettled.reading } else { frame_sets.len() / 2 };
                self.learning.drain(..after);
                self.unsettled.push(*unsettled);
            }
            // They do not connect all cameras yet: the older half is discarded once there are many, and learning continues.
            Err(_) if 4 * self.config.learn_readings <= self.learning.len() => {
                self.learning.drain(..self.learning.len() / 2);
            }
            Err(_) => {}
        }
    }

    fn learned(&self, frame_sets: &[FrameSet]) -> Result<Learned, Error> {
        match &self.reference {
            Some((cam_from_rig, covariance)) => {
                let mut monitor = self.watched_from(cam_from_rig, covariance, frame_sets)?;
                frame_sets.iter().for_each(|frame_set| monitor.push(frame_set));
                Ok(Learned::Monitor(Box::new(monitor)))
            }
            None => {
                let reference = learn_rig(&self.lenses(), frame_sets, &self.config.correlated)?;
                let unsettled = unsettled_rig(&reference.cam_from_rig, frame_sets, &self.config.correlated);
                if let Some(unsettled) = unsettled {
                    return Ok(Learned::Motion(Box::new(unsettled)));
                }
                let start_s = frame_sets.last().map_or(0.0, |frame_set| frame_set.t_s);
                let monitor = RigMonitor::new(&reference, &self.config.monitor, start_s)?;
                Ok(Learned::Monitor(Box::new(monitor)))
            }
        }
    }

    /// Learns the noise of an observation for known extrinsics. A camera that moved within these frame sets would make that noise as large as
    /// its motion: the noise is learned from the longer part, before or after, and the monitor then finds what moved.
    fn watched_from(
        &self,
        cam_from_rig: &[Pose],
        covariance: &DMatrix<f64>,
        frame_sets: &[FrameSet],
    ) -> Result<RigMonitor, Error> {
        let correlated = &self.config.correlated;
        let part = match unsettled_rig(cam_from_rig, frame_sets, correlated) {
            Some(RigUnsettled { unsettled, .. }) if unsettled.unrest == Unrest::Step => {
                let (before, after) = frame_sets.split_at(unsettled.reading);
                if after.len() < before.len() { before } else { after }
            }
            _ => frame_sets,
        };
        let reference = RigReference {
            noise: learn_observation_noise(cam_from_rig, part, correlated),
            cam_from_rig: cam_from_rig.to_vec(),
            covariance: covariance.clone(),
        };
        let start_s = frame_sets.first().map_or(0.0, |frame_set| frame_set.t_s);
        RigMonitor::new(&reference, &self.config.monitor, start_s)
    }

    /// Returns the lenses at the size of the images that are learned from.
    fn lenses(&self) -> Vec<Camera> {
        let frames = || self.learning.iter().rev().flat_map(|frame_set| &frame_set.frames);
        let seen = |camera| frames().filter(move |f| f.camera == camera).find_map(|f| f.seen.first());
        let lens = |(camera, own): (usize, &Camera)| seen(camera).map_or(own, |seen| &seen.lens).clone();
        self.nodes.lenses.iter().enumerate().map(lens).collect()
    }

    fn states(&self, t_s: f64) -> Vec<State> {
        let stale = |camera: usize, for_s| State::Stale { for_s, reason: self.reasons[camera].clone() };
        let state = |camera: usize| match &self.monitor {
            _ if self.lost[camera] == Lost::ForGood => {
                stale(camera, self.seen_s[camera].map_or(0.0, |seen_s| t_s - seen_s))
            }
            Some(monitor) => match monitor.watch(camera, t_s) {
                Watch::Stale { for_s } => stale(camera, for_s),
                watch => watch.into(),
            },
            None => {
                let since_s = self.seen_s[camera].or(self.first_s).unwrap_or(t_s);
                let for_s = t_s - since_s;
                match self.config.monitor.stale_after_s < for_s {
                    true => stale(camera, for_s),
                    false => State::Learning {
                        readings: self.learning.len(),
                        needed: self.config.learn_readings.max(LEAST_READINGS),
                    },
                }
            }
        };
        (0..self.nodes.cameras.len()).map(state).collect()
    }

    /// Returns what has changed since it was reported: what moved first, then the cameras' states.
    fn reported(&mut self, t_s: f64) -> Vec<Event> {
        if self.first_s.is_none() {
            return Vec::new();
        }
        let unsettled = |RigUnsettled { camera, alternatives, unsettled }| {
            let unsettled = Box::new(unsettled);
            Event::MovedWhileLearning { camera, target: 0, alternatives, unsettled }
        };
        let mut events: Vec<Event> = self.unsettled.drain(..).map(unsettled).collect();
        events.extend(self.moved());
        for (camera, state) in self.states(t_s).into_iter().enumerate() {
            let is_new = self.reported[camera].as_ref().is_none_or(|before| is_news(before, &state));
            self.reported[camera] = Some(state.clone());
            if is_new {
                events.extend(self.changed(camera, t_s, &state));
            }
        }
        events
    }

    /// Returns the events for a camera's state, which is the same for all targets that it observes.
    fn changed(&self, camera: usize, t_s: f64, state: &State) -> Vec<Event> {
        let event = |target| Event::StateChanged { camera, target, t_s, state: state.clone() };
        (0..self.nodes.targets.len()).map(event).collect()
    }

    fn moved(&mut self) -> Option<Event> {
        let now = self.monitor.as_ref()?.moved();
        let nodes: Vec<usize> = now.moved.iter().map(|moved| moved.node).collect();
        let is_reported = self.reported_moved.0 == nodes && self.reported_moved.1 == now.alternatives;
        if is_reported {
            return None;
        }
        self.reported_moved = (nodes, now.alternatives.clone());
        let name = |node: &usize| self.nodes.cameras[*node].clone();
        Some(Event::Attributed {
            t_s: now.began_s,
            moved: now.moved.iter().map(|moved| (name(&moved.node), moved.clone())).collect(),
            alternatives: now.alternatives.iter().map(|set| set.iter().map(name).collect()).collect(),
        })
    }
}

/// Returns whether a change is new: not the duration of a stale state, nor each frame set learned, nor a slightly better estimate of a drift.
fn is_news(before: &State, now: &State) -> bool {
    match (before, now) {
        (State::Learning { .. }, State::Learning { .. }) | (State::Stale { .. }, State::Stale { .. }) => {
            false
        }
        (State::Drifted(before), State::Drifted(now)) => before.began_s != now.began_s,
        (before, now) => before != now,
    }
}

/// Returns whether another camera observes a target of this frame too.
fn is_shared(frame_set: &SynchronisedFrames, frame: &Shown) -> bool {
    let sees = |other: &Shown, target: usize| other.seen.iter().any(|seen| seen.target == target);
    let others = || frame_set.frames.iter().filter(|other| other.camera != frame.camera);
    frame.seen.iter().any(|seen| others().any(|other| sees(other, seen.target)))
}

fn borrowed<'a>(frame_set: &'a SynchronisedFrames) -> FrameSet<'a> {
    let target_observation = |frame: &'a Shown, seen: &'a TargetPoints| TargetObservation {
        camera: frame.camera,
        target: seen.target,
        lens: &seen.lens,
        seen: &seen.points,
        estimate: &seen.estimate,
    };
    let of = |frame: &'a Shown| frame.seen.iter().map(move |seen| target_observation(frame, seen));
    FrameSet { t_s: frame_set.t_s, target_observations: frame_set.frames.iter().flat_map(of).collect() }
}
