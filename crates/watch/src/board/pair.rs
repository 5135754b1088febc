//! The state of one camera and one of its targets.

use super::Instants;
use super::motion::{Present, Recent, WayBack, way_back};
use super::statistics::{Rate, Rolling, Spread};
use super::trail::Trail;
use crate::live::{Observation, State};
use crate::outputs::said::{state_words, word};
use resight::core::Pose;
use resight::core::temporal::monitor::{Reading, Reference, rotation_alone};
use std::collections::VecDeque;

/// Number of state changes that are kept: the strip of a session without a history.
const CHANGES: usize = 500;
/// Number of frames whose points are kept.
const FRAMES: usize = 60;

/// One camera and one target.
#[derive(Debug, Clone)]
pub struct PairBoard {
    /// The last reported state.
    pub state: Option<State>,
    /// When that state was reported.
    reported_up_s: f64,
    /// Changes of state: seconds of capture, and the word.
    pub changes: VecDeque<(f64, &'static str)>,
    /// Readings since learning began.
    learned: usize,
    /// For the last frames, microseconds: the time until a thread was free,
    pub waited_us: Rolling,
    /// looking for the target,
    pub detect_us: Rolling,
    /// its pose,
    pub solve_us: Rolling,
    /// the decision,
    pub decide_us: Rolling,
    /// and all of it, from capture or arrival on.
    pub latency_us: Rolling,
    /// Frames a second.
    pub rate: Rate,
    /// The scatter of the poses of the last frames.
    pub spread: Spread,
    /// Turns of the camera, seen from its reference: the rotation alone, and beside a shift.
    trails: [Trail; 2],
    recent: Recent,
    /// When the last frame came.
    seen_up_s: f64,
    /// The current reference.
    pub reference: Option<Learnt>,
    /// The previous reference.
    pub earlier: Option<Learnt>,
    /// The last frame.
    pub last: Option<Observation>,
    /// Whether the reference is an image of landmarks: then rotations since the image are compared, not poses relative to the target.
    by_landmarks: bool,
    /// The last frame without a pose, and why.
    pub last_reason: Option<(String, String)>,
    /// For the last frames, oldest first: numbers of points found, and of points that agree with the pose.
    pub points: VecDeque<Points>,
    /// Frames since the last reset, and those with a pose.
    pub frames: u64,
    /// Number of frames with a pose.
    pub poses: u64,
}

/// A reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learnt {
    /// The pose and its noise.
    pub reference: Reference,
    /// Time when it was learned, seconds since 1970; `None` where it was given.
    pub unix_s: Option<f64>,
}

/// The points of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Points {
    /// Number of the frame.
    pub frame: u64,
    /// Found.
    pub found: usize,
    /// Number of points that agree; `None` without a pose.
    pub agree: Option<usize>,
}

impl PairBoard {
    /// Nothing seen yet.
    pub fn new(reference: Option<Reference>, window: usize) -> Self {
        PairBoard {
            state: None,
            reported_up_s: 0.0,
            changes: VecDeque::new(),
            learned: 0,
            waited_us: Rolling::new(window),
            detect_us: Rolling::new(window),
            solve_us: Rolling::new(window),
            decide_us: Rolling::new(window),
            latency_us: Rolling::new(window),
            rate: Rate::default(),
            spread: Spread::new(window),
            trails: [Trail::new(), Trail::new()],
            recent: Recent::default(),
            seen_up_s: 0.0,
            reference: reference.map(|reference| Learnt { reference, unix_s: None }),
            earlier: None,
            last: None,
            by_landmarks: false,
            last_reason: None,
            points: VecDeque::new(),
            frames: 0,
            poses: 0,
        }
    }

    pub(super) fn observed(&mut self, observation: &Observation, now: Instants) {
        self.frames += 1;
        self.rate.push(now.up_s);
        self.seen_up_s = now.up_s;
        self.timed(observation);
        if let Some(reason) = &observation.reason {
            self.last_reason = Some((observation.name.clone(), reason.clone()));
        }
        if self.points.len() == FRAMES {
            self.points.pop_front();
        }
        let agree = observation.estimate.is_some().then(|| observation.residuals.iter().filter(|r| r.agrees));
        self.points.push_back(Points {
            frame: observation.number,
            found: observation.n_points,
            agree: agree.map(Iterator::count),
        });
        if let Some(reading) = &observation.reading {
            self.poses += 1;
            self.learned += 1;
            self.read(reading, observation.landmarks.is_some());
        }
        self.last = Some(observation.clone());
    }

    /// Rotations since an image and poses against a target are two things; a camera that changes over begins anew.
    fn read(&mut self, reading: &Reading, by_landmarks: bool) {
        if self.by_landmarks != by_landmarks {
            self.by_landmarks = by_landmarks;
            self.recent.clear();
            self.spread.clear();
        }
        self.spread.push(reading.a_from_b);
        let reference = self.reference.as_ref().map(|learnt| &learnt.reference);
        if by_landmarks {
            self.compared(&Pose::identity(), reading, &reading.covariance.clone());
        } else if let Some(reference) = reference {
            let (pose, covariance) = (reference.a_from_b, reading.covariance + reference.noise.reference);
            self.compared(&pose, reading, &covariance);
        }
    }

    fn compared(&mut self, reference: &Pose, reading: &Reading, covariance: &resight::core::Matrix6) {
        let old_from_new = (*reference * reading.a_from_b.inverse()).log();
        self.recent.push(reading.t_s, old_from_new, *covariance);
        let turn = old_from_new.fixed_rows::<3>(0).into();
        let alone = rotation_alone(&old_from_new, &reading.covariance).map_or(turn, |(turn, _)| turn);
        self.trails[0].push(reading.t_s, &alone);
        self.trails[1].push(reading.t_s, &turn);
    }

    /// Returns its current pose relative to its reference, from the readings of the last half second; `None` without both.
    pub fn present(&self) -> Option<Present> {
        self.recent.present()
    }

    /// Returns the motion that returns a moved camera to its reference: from its last readings, or from the alarm where there are none (as for a
    /// rig whose target is hand-held).
    pub fn way_back(&self) -> Option<WayBack> {
        let Some(State::Drifted(drift)) = &self.state else { return None };
        let found = Present { old_from_new: drift.old_from_new, covariance: drift.covariance };
        Some(way_back(drift, &self.present().unwrap_or(found)))
    }

    /// Returns the rotation over time: for a pure rotation, which is much more certain, until it is known that the camera shifted too.
    pub fn trail(&self) -> &Trail {
        &self.trails[usize::from(self.has_shifted())]
    }

    /// Returns whether the state reports more than a rotation.
    pub fn has_shifted(&self) -> bool {
        matches!(&self.state, Some(State::Drifted(drift)) if drift.pure_rotation().is_none())
    }

    /// The capture clock now: that of the last frame, and the time since it came.
    pub fn capture_now_s(&self, now: Instants) -> f64 {
        let last_s = self.last.as_ref().map_or(0.0, |last| last.capture_s);
        last_s + self.age_s(now).unwrap_or(0.0)
    }

    /// Seconds since the last frame.
    pub fn age_s(&self, now: Instants) -> Option<f64> {
        self.last.as_ref().map(|_| (now.up_s - self.seen_up_s).max(0.0))
    }

    /// Returns whether the last frame is not older than a few intervals between frames.
    pub fn is_fresh(&self, now: Instants) -> bool {
        self.age_s(now).is_some_and(|age_s| age_s <= self.rate.patience_s())
    }

    /// Records the durations of the stages; a stage that was not reached is left out.
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

    pub(super) fn is_now(&mut self, t_s: f64, state: &State, now: Instants) {
        if let State::Learning { readings, .. } = state {
            self.learned = *readings;
        }
        if self.changes.back().is_none_or(|(_, before)| *before != word(state)) {
            if self.changes.len() == CHANGES {
                self.changes.pop_front();
            }
            self.changes.push_back((t_s, word(state)));
        }
        (self.state, self.reported_up_s) = (Some(state.clone()), now.up_s);
    }

    pub(super) fn learned(&mut self, reference: &Reference, now: Instants) {
        let learnt = Learnt { reference: *reference, unix_s: Some(now.unix_s) };
        self.earlier = self.reference.replace(learnt).or(self.earlier);
        self.trails = [Trail::new(), Trail::new()];
        self.recent.clear();
    }

    pub(super) fn reset(&mut self) {
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

    /// Describes the current state: a session reports changes only, not each reading or each second without one.
    pub fn words(&self, now: Instants) -> String {
        match &self.state {
            None => "waiting for the first frame".to_string(),
            Some(State::Learning { needed, .. }) => {
                state_words(&State::Learning { readings: self.learned.min(*needed), needed: *needed })
            }
            Some(State::Stale { for_s, reason }) => state_words(&State::Stale {
                for_s: for_s + (now.up_s - self.reported_up_s).max(0.0),
                reason: reason.clone(),
            }),
            Some(state) => state_words(state),
        }
    }
}
