//! The state of a session for the terminal view and the page. Kept up to date event by event. Time enters as data.

pub mod motion;
pub mod pair;
pub mod statistics;
pub mod strip;
pub mod trail;

use crate::live::{Event, State};
use crate::log::Line;
use crate::names::Names;
use crate::outputs::said::{BY_SEVERITY, EventText, word};
use pair::PairBoard;
use resight::core::temporal::monitor::{Reference, Unrest};
use std::collections::VecDeque;
use strip::{Stretch, StripBin};

/// Lines about events that are kept.
const REPORTED: usize = 200;

/// When something happened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instants {
    /// Seconds since the session began; never steps back.
    pub up_s: f64,
    /// Seconds since 1970.
    pub unix_s: f64,
}

/// A session so far.
#[derive(Clone)]
pub struct Board {
    /// Names of cameras and targets.
    pub names: Names,
    /// The cameras.
    pub cameras: Vec<CameraBoard>,
    /// The pairs of camera and target, in the order of `Names::pair_index`.
    pub pairs: Vec<PairBoard>,
    /// The reported events, oldest first.
    pub reported: VecDeque<Reported>,
    /// No more events will come.
    pub is_over: bool,
}

/// A line about an event.
#[derive(Debug, Clone, PartialEq)]
pub struct Reported {
    /// When and what.
    pub line: Line,
    /// The camera that it concerns; `None` where it concerns several.
    pub camera: Option<usize>,
}

/// One camera.
#[derive(Debug, Clone, Default)]
pub struct CameraBoard {
    /// Frames dropped since the last reset.
    pub dropped: u64,
    /// Frames left out since the last reset.
    pub left_out: u64,
    /// Why its source gives no frames, as long as it does not.
    pub lost: Option<String>,
    /// Whether its source has ended.
    pub has_ended: bool,
    /// It moved, and that is not acknowledged yet.
    pub alarm: Option<Alarm>,
}

/// A motion that waits to be acknowledged.
#[derive(Debug, Clone, PartialEq)]
pub struct Alarm {
    /// When it was raised, seconds since 1970.
    pub unix_s: f64,
    /// What was reported.
    pub words: String,
}

impl Board {
    /// Statistics are over the last `window` frames; `references` by pair, where they are known.
    pub fn new(names: &Names, references: &[Option<Reference>], window: usize) -> Self {
        let pairs =
            (0..names.pairs().len()).map(|i| PairBoard::new(references.get(i).copied().flatten(), window));
        Board {
            names: names.clone(),
            cameras: vec![CameraBoard::default(); names.cameras.len()],
            pairs: pairs.collect(),
            reported: VecDeque::new(),
            is_over: false,
        }
    }

    /// The next event.
    pub fn take(&mut self, event: &Event, now: Instants) {
        if !matches!(event, Event::Observed { .. } | Event::Dropped { .. }) {
            self.report(event, now);
        }
        match event {
            Event::Observed { camera, target, observation } => {
                self.change(*camera, *target, |pair| pair.observed(observation, now));
            }
            Event::StateChanged { camera, target, state, t_s } => {
                self.change(*camera, *target, |pair| pair.is_now(*t_s, state, now));
            }
            Event::Learned { camera, target, reference, .. } => {
                self.change(*camera, *target, |pair| pair.learned(reference, now));
            }
            _ => self.of_source(event),
        }
    }

    fn report(&mut self, event: &Event, now: Instants) {
        let text = EventText::new(&self.names).words(event);
        let camera = camera_of(event);
        if let Some(one) = camera.and_then(|camera| self.cameras.get_mut(camera))
            && is_motion(event)
        {
            one.alarm = Some(Alarm { unix_s: now.unix_s, words: text.clone() });
        }
        if self.reported.len() == REPORTED {
            self.reported.pop_front();
        }
        self.reported.push_back(Reported { line: Line { unix_s: now.unix_s, text }, camera });
    }

    fn of_source(&mut self, event: &Event) {
        let Some(camera) = camera_of(event).and_then(|camera| self.cameras.get_mut(camera)) else { return };
        match event {
            Event::Dropped { frames, .. } => camera.dropped += frames,
            Event::LeftOut { frames, .. } => camera.left_out += frames,
            Event::Source { connected, reason, .. } => {
                let reason = reason.clone().unwrap_or_else(|| "no reason given".to_string());
                camera.lost = (!connected).then_some(reason);
            }
            Event::Ended { .. } => camera.has_ended = true,
            _ => {}
        }
    }

    fn change(&mut self, camera: usize, target: usize, change: impl FnOnce(&mut PairBoard)) {
        let index = self.names.pair_index(camera, target);
        if let Some(pair) = self.pairs.get_mut(index) {
            change(pair);
        }
    }

    /// Forgets all statistics; states, trails and lines stay.
    pub fn reset(&mut self) {
        (0..self.cameras.len()).for_each(|camera| self.reset_camera(camera));
    }

    /// Forgets those of one camera.
    pub fn reset_camera(&mut self, camera: usize) {
        if let Some(one) = self.cameras.get_mut(camera) {
            (one.dropped, one.left_out) = (0, 0);
        }
        for pair in self.pairs_of(camera) {
            self.pairs[pair].reset();
        }
    }

    /// Acknowledges a motion; returns false where there was none.
    pub fn acknowledge(&mut self, camera: usize) -> bool {
        self.cameras.get_mut(camera).is_some_and(|one| one.alarm.take().is_some())
    }

    /// Places of a camera's pairs.
    pub fn pairs_of(&self, camera: usize) -> std::ops::Range<usize> {
        let targets = self.names.targets.len();
        let end = ((camera + 1) * targets).min(self.pairs.len());
        (camera * targets).min(end)..end
    }

    /// Returns the pair of a camera with the gravest state; of equals one whose target is visible, then the first.
    pub fn gravest(&self, camera: usize) -> Option<usize> {
        let weight = |pair: usize| {
            let one = &self.pairs[pair];
            let is_seen = one.last.as_ref().is_some_and(|last| last.reading.is_some());
            (one.state.as_ref().and_then(severity), is_seen, std::cmp::Reverse(pair))
        };
        self.pairs_of(camera).max_by_key(|pair| weight(*pair))
    }

    /// Returns whether a camera gives frames: its source is connected, and the last frame is not older than a few intervals between frames.
    pub fn is_fresh(&self, camera: usize, now: Instants) -> bool {
        let is_there =
            self.cameras.get(camera).is_some_and(|one| one.lost.is_none() && !one.has_ended && !self.is_over);
        is_there && self.pairs_of(camera).any(|pair| self.pairs[pair].is_fresh(now))
    }

    /// Returns the rotations of a pair over time, in `n` columns; while its source continues, including the time since the last reading.
    pub fn trail_columns(&self, pair: usize, n: usize, now: Instants) -> Vec<Option<f64>> {
        let Some(here) = self.pairs.get(pair) else { return Vec::new() };
        let has_ended = self.camera_of(pair).is_some_and(|camera| camera.has_ended);
        here.trail().columns(n, if has_ended { 0.0 } else { here.capture_now_s(now) })
    }

    /// Returns a period of a camera's recorded states: all of this session, in 512 parts at most.
    pub fn strip(&self, camera: usize, stretch: &Stretch) -> Vec<StripBin> {
        let mut changes: Vec<(f64, usize, &'static str)> = self
            .pairs_of(camera)
            .flat_map(|pair| self.pairs[pair].changes.iter().map(move |(t_s, word)| (*t_s, pair, *word)))
            .collect();
        changes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let named = changes.iter().map(|(t_s, pair, word)| {
            let (_, target) = self.names.of_pair(*pair);
            (*t_s, self.names.target(target), *word)
        });
        let trail = self.gravest(camera).map(|pair| self.pairs[pair].trail());
        let bin = |(bin, state): (usize, Option<&'static str>)| {
            let (from_s, to_s) = stretch.bin_s(bin);
            let rotation_rad = trail.and_then(|trail| trail.mean_rad(from_s, to_s));
            StripBin { from_s, state, rotation_rad }
        };
        stretch.gravest(named).into_iter().enumerate().map(bin).collect()
    }

    /// Returns begin and end of a camera's recorded states, seconds of capture; `None` before its first frame.
    pub fn span_s(&self, camera: usize, now: Instants) -> Option<(f64, f64)> {
        let pairs = || self.pairs_of(camera).map(|pair| &self.pairs[pair]);
        let changed = pairs().filter_map(|pair| pair.changes.front()).map(|(t_s, _)| *t_s);
        let first_s = changed.fold(f64::INFINITY, f64::min);
        let last_s = pairs()
            .filter(|pair| pair.last.is_some())
            .map(|pair| pair.capture_now_s(now))
            .fold(f64::NEG_INFINITY, f64::max);
        (first_s < last_s).then_some((first_s, last_s))
    }

    /// The camera of a pair.
    pub fn camera_of(&self, pair: usize) -> Option<&CameraBoard> {
        self.cameras.get(pair / self.names.targets.len().max(1))
    }
}

/// The camera that an event is about.
fn camera_of(event: &Event) -> Option<usize> {
    match event {
        Event::Observed { camera, .. }
        | Event::StateChanged { camera, .. }
        | Event::Compared { camera, .. }
        | Event::Promised { camera, .. }
        | Event::Learned { camera, .. }
        | Event::MovedWhileLearning { camera, .. }
        | Event::Dropped { camera, .. }
        | Event::LeftOut { camera, .. }
        | Event::Clock { camera, .. }
        | Event::Oriented { camera, .. }
        | Event::Source { camera, .. }
        | Event::Ended { camera } => Some(*camera),
        Event::Attributed { .. } => None,
    }
}

/// Returns whether it reports that a camera moved.
fn is_motion(event: &Event) -> bool {
    match event {
        Event::StateChanged { state, .. } => matches!(state, State::Drifted(_)),
        Event::MovedWhileLearning { unsettled, .. } => unsettled.unrest != Unrest::Wander,
        _ => false,
    }
}

/// Returns the severity of a state; larger is graver.
fn severity(state: &State) -> Option<usize> {
    BY_SEVERITY.iter().position(|known| *known == word(state))
}

#[cfg(test)]
mod tests;
