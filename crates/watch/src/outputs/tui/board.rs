//! All that a terminal view shows, kept up to date event by event. Time enters as data.

use super::super::super::log::Line;
use super::super::super::names::Names;
use super::super::Session;
use super::super::said::{EventText, state_words};
use super::statistics::{Rate, Rolling, Spread};
use super::trail::Trail;
use crate::live::{Event, Observation, State};
use resight::core::Pose;
use resight::core::temporal::monitor::{Reading, rotation_alone};
use std::collections::VecDeque;

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
    pub names: Names,
    /// By camera.
    pub cameras: Vec<CameraBoard>,
    /// By pair of camera and target, as `Names::pair_index` counts them.
    pub pairs: Vec<PairBoard>,
    /// What happened, oldest first.
    pub reported: VecDeque<Line>,
    /// No more events will come.
    pub is_over: bool,
}

/// One camera.
#[derive(Debug, Clone, Default)]
pub struct CameraBoard {
    /// Frames dropped since the last reset.
    pub dropped: u64,
    /// Why its source gives nothing, while it gives nothing.
    pub lost: Option<String>,
    pub has_ended: bool,
}

/// One camera and one target.
#[derive(Debug, Clone)]
pub struct PairBoard {
    pub state: Option<State>,
    /// When that state was reported.
    reported_up_s: f64,
    /// Readings since learning began.
    learned: usize,
    pub waited_us: Rolling,
    pub detect_us: Rolling,
    pub solve_us: Rolling,
    pub decide_us: Rolling,
    /// From capture or arrival to the decision.
    pub latency_us: Rolling,
    pub rate: Rate,
    pub spread: Spread,
    /// Turns of the camera, seen from its reference: the rotation alone, and beside a shift.
    trails: [Trail; 2],
    /// When the last frame came.
    seen_up_s: f64,
    pub reference: Option<Pose>,
    pub last: Option<Observation>,
    /// The last frame without a pose, and why.
    pub last_reason: Option<(String, String)>,
    /// Frames since the last reset, and those with a pose.
    pub frames: u64,
    pub poses: u64,
}

impl Board {
    /// Statistics are over the last `window` frames.
    pub fn new(session: &Session<'_>, window: usize) -> Self {
        let pairs = (0..session.names.pairs().len()).map(|i| {
            let reference = session.references.get(i).copied().flatten();
            PairBoard::new(reference.map(|reference| reference.a_from_b), window)
        });
        Board {
            names: session.names.clone(),
            cameras: vec![CameraBoard::default(); session.names.cameras.len()],
            pairs: pairs.collect(),
            reported: VecDeque::new(),
            is_over: false,
        }
    }

    /// The next event.
    pub fn take(&mut self, event: &Event, now: Instants) {
        if !matches!(event, Event::Observed { .. } | Event::Dropped { .. }) {
            let text = EventText::new(&self.names).words(event);
            if self.reported.len() == REPORTED {
                self.reported.pop_front();
            }
            self.reported.push_back(Line { unix_s: now.unix_s, text });
        }
        match event {
            Event::Observed { camera, target, observation } => {
                self.change(*camera, *target, |pair| pair.observed(observation, now));
            }
            Event::StateChanged { camera, target, state, .. } => {
                self.change(*camera, *target, |pair| pair.is_now(state, now));
            }
            Event::Learned { camera, target, reference, .. } => {
                self.change(*camera, *target, |pair| pair.learned(reference.a_from_b));
            }
            _ => self.of_source(event),
        }
    }

    fn of_source(&mut self, event: &Event) {
        match event {
            Event::Dropped { camera, frames } => {
                if let Some(camera) = self.cameras.get_mut(*camera) {
                    camera.dropped += frames;
                }
            }
            Event::Source { camera, connected, reason } => {
                if let Some(camera) = self.cameras.get_mut(*camera) {
                    let reason = reason.clone().unwrap_or_else(|| "no reason given".to_string());
                    camera.lost = (!connected).then_some(reason);
                }
            }
            Event::Ended { camera } => {
                if let Some(camera) = self.cameras.get_mut(*camera) {
                    camera.has_ended = true;
                }
            }
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
        self.pairs.iter_mut().for_each(PairBoard::reset);
        self.cameras.iter_mut().for_each(|camera| camera.dropped = 0);
    }

    /// Turns of a pair through time, in so many columns; while its source continues, the time since the last reading too.
    pub fn trail_columns(&self, pair: usize, n: usize, now: Instants) -> Vec<Option<f64>> {
        let Some(here) = self.pairs.get(pair) else { return Vec::new() };
        let has_ended = self.camera_of(pair).is_some_and(|camera| camera.has_ended);
        here.trail().columns(n, if has_ended { 0.0 } else { here.capture_now_s(now) })
    }

    /// The camera of a pair.
    pub fn camera_of(&self, pair: usize) -> Option<&CameraBoard> {
        self.cameras.get(pair / self.names.targets.len().max(1))
    }
}

impl PairBoard {
    fn new(reference: Option<Pose>, window: usize) -> Self {
        PairBoard {
            state: None,
            reported_up_s: 0.0,
            learned: 0,
            waited_us: Rolling::new(window),
            detect_us: Rolling::new(window),
            solve_us: Rolling::new(window),
            decide_us: Rolling::new(window),
            latency_us: Rolling::new(window),
            rate: Rate::default(),
            spread: Spread::new(window),
            trails: [Trail::new(), Trail::new()],
            seen_up_s: 0.0,
            reference,
            last: None,
            last_reason: None,
            frames: 0,
            poses: 0,
        }
    }

    fn observed(&mut self, observation: &Observation, now: Instants) {
        self.frames += 1;
        self.rate.push(now.up_s);
        self.seen_up_s = now.up_s;
        self.timed(observation);
        if let Some(reason) = &observation.reason {
            self.last_reason = Some((observation.name.clone(), reason.clone()));
        }
        if let Some(reading) = &observation.reading {
            self.poses += 1;
            self.learned += 1;
            self.spread.push(reading.a_from_b);
            if let Some(reference) = self.reference {
                self.compared(&reference, reading);
            }
        }
        self.last = Some(observation.clone());
    }

    fn compared(&mut self, reference: &Pose, reading: &Reading) {
        let old_from_new = (*reference * reading.a_from_b.inverse()).log();
        let turn = old_from_new.fixed_rows::<3>(0).into();
        let alone = rotation_alone(&old_from_new, &reading.covariance).map_or(turn, |(turn, _)| turn);
        self.trails[0].push(reading.t_s, &alone);
        self.trails[1].push(reading.t_s, &turn);
    }

    /// The rotation through time: as if it only turned, which is known much better, until it is known that it shifted too.
    pub fn trail(&self) -> &Trail {
        &self.trails[usize::from(self.has_shifted())]
    }

    /// The state says that the camera did not only turn.
    pub fn has_shifted(&self) -> bool {
        matches!(&self.state, Some(State::Drifted(drift)) if drift.pure_rotation().is_none())
    }

    /// The capture clock now: that of the last frame, and the time since it came.
    pub fn capture_now_s(&self, now: Instants) -> f64 {
        let last_s = self.last.as_ref().map_or(0.0, |last| last.capture_s);
        last_s + (now.up_s - self.seen_up_s).max(0.0)
    }

    /// A stage that was not reached took no time; that says nothing of how long it takes.
    fn timed(&mut self, observation: &Observation) {
        let times = &observation.times;
        let latency_us = times.waited_us + times.detect_us + times.solve_us + times.decide_us;
        self.waited_us.push(times.waited_us);
        self.latency_us.push(latency_us);
        let stages = [
            (&mut self.detect_us, times.detect_us),
            (&mut self.solve_us, times.solve_us),
            (&mut self.decide_us, times.decide_us),
        ];
        for (stage, took_us) in stages {
            if 0.0 < took_us {
                stage.push(took_us);
            }
        }
    }

    fn is_now(&mut self, state: &State, now: Instants) {
        if let State::Learning { readings, .. } = state {
            self.learned = *readings;
        }
        (self.state, self.reported_up_s) = (Some(state.clone()), now.up_s);
    }

    fn learned(&mut self, reference: Pose) {
        self.reference = Some(reference);
        self.trails = [Trail::new(), Trail::new()];
    }

    fn reset(&mut self) {
        let stages = [
            &mut self.waited_us,
            &mut self.detect_us,
            &mut self.solve_us,
            &mut self.decide_us,
            &mut self.latency_us,
        ];
        stages.into_iter().for_each(Rolling::clear);
        self.rate.clear();
        self.spread.clear();
        (self.frames, self.poses) = (0, 0);
    }

    /// The state in words, as of now: a session tells changes only, not each reading learned nor each second of blindness.
    pub fn words(&self, now: Instants) -> String {
        match &self.state {
            None => "waiting for the first frame".to_string(),
            Some(State::Learning { needed, .. }) => {
                state_words(&State::Learning { readings: self.learned.min(*needed), needed: *needed })
            }
            Some(State::Stale { for_s }) => {
                state_words(&State::Stale { for_s: for_s + (now.up_s - self.reported_up_s).max(0.0) })
            }
            Some(state) => state_words(state),
        }
    }
}
