//! Events in words and as JSON.

mod compared;
mod drifted;
pub mod object;
mod promised;

use super::super::names::Names;
use super::measured::measured;
use crate::live::{CheckingReason, Event, Observation, State};
use object::{
    Alternatives, EventObject, FrameObject, MotionObject, NodeMotionObject, TimesObject, UnpromisedObject,
};
use resight::answer::landmarks::RotationObject;
use resight::answer::{TransformObject, pose};
use resight::core::Vector6;
use resight::core::temporal::monitor::attribute::MovedNode;
use resight::core::temporal::monitor::{Deviation, Drift, Unrest, Unsettled};
use resight::image::orientation_remark;
use resight::report::turned::{self, parts};
use resight::report::words::{counted, moment};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};

/// Converts events to words and JSON.
pub struct EventText {
    names: Names,
}

/// What moved, according to the last report.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    nodes: Vec<String>,
    alternatives: Vec<Vec<String>>,
    /// Cameras and targets that moved while their reference was learned.
    while_learning: BTreeSet<(usize, usize)>,
    /// Errors for which no rate of false alarms is promised, of each camera and target.
    unpromised: BTreeMap<(usize, usize), Vec<UnpromisedObject>>,
}

impl Moved {
    /// Processes the next event of the session.
    pub fn take(&mut self, event: &Event) {
        if let Event::Attributed { moved, alternatives, .. } = event {
            let nodes = moved.iter().map(|(name, _)| name.clone()).collect();
            (self.nodes, self.alternatives) = (nodes, alternatives.clone());
        }
        if let Event::Promised { camera, target, promise, .. }
        | Event::Learned { camera, target, promise: Some(promise), .. } = event
        {
            self.unpromised.insert((*camera, *target), promised::unpromised(promise));
        }
        if let Event::MovedWhileLearning { camera, target, unsettled, .. } = event
            && unsettled.unrest != Unrest::Wander
        {
            self.while_learning.insert((*camera, *target));
        }
    }

    /// Returns `camera gate moved`, or `one of camera gate, target door moved`.
    fn words(&self, names: &Names) -> String {
        let set =
            |set: &Vec<String>| set.iter().map(|node| names.kind(node)).collect::<Vec<_>>().join(" and ");
        let others: Vec<String> = self.alternatives.iter().map(set).collect();
        match others.as_slice() {
            _ if self.nodes.is_empty() => "all is back where it was".to_string(),
            [] => format!("{} moved", set(&self.nodes)),
            others => format!("one of {}, {} moved", set(&self.nodes), others.join(", ")),
        }
    }
}

/// Returns what moved, and the last state of each pair: one line each, in words or as JSON.
pub fn verdict_lines(names: &Names, json: bool, states: &[Option<State>], moved: &Moved) -> Vec<String> {
    let mut lines = Vec::new();
    if !moved.nodes.is_empty() {
        lines.push(match json {
            true => line(&EventObject {
                event: "verdict",
                moved: Some(moved.nodes.clone()),
                alternatives: Some(Alternatives::Sets(moved.alternatives.clone())),
                message: Some(moved.words(names)),
                ..EventObject::default()
            }),
            false => moved.words(names),
        });
    }
    for (index, (pair, state)) in names.pairs().iter().zip(states).enumerate() {
        let word = state.as_ref().map_or("stale", word);
        let (camera, target) = names.of_pair(index);
        let has_moved = moved.while_learning.contains(&(camera, target));
        let away = state.as_ref().and_then(away);
        let now = away.map(|deviation| format!(", {}", compared::words(deviation))).unwrap_or_default();
        let unpromised = moved.unpromised.get(&(camera, target));
        let present = unpromised.and_then(|of| promised::present(of));
        let present = present.map(|present| format!("; {present}")).unwrap_or_default();
        lines.push(match (json, has_moved) {
            (true, _) => line(&EventObject {
                event: "verdict",
                camera: Some(names.camera(camera).to_owned()),
                target: Some(names.target(target).to_owned()),
                state: Some(word),
                deviation: away.map(compared::object),
                moved_while_learning: has_moved.then_some(true),
                unpromised: unpromised.cloned(),
                ..EventObject::default()
            }),
            (false, true) => {
                format!("{pair}: {word}{now}; it moved while its reference was learned{present}")
            }
            (false, false) => format!("{pair}: {word}{now}{present}"),
        });
    }
    lines
}

/// Returns the deviation of a camera that is in doubt because of it.
fn away(state: &State) -> Option<&Deviation> {
    match state {
        State::Checking(CheckingReason::Away(deviation)) => Some(deviation),
        _ => None,
    }
}

fn line(object: &EventObject) -> String {
    value(object).to_string()
}

/// Converts an object to JSON, which never fails for numbers, strings, lists and maps of strings.
fn value(object: &EventObject) -> Value {
    serde_json::to_value(object).unwrap_or_default()
}

/// The result of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Every camera is at its reference pose, or tracked.
    Steady,
    /// The state of some camera is open: not observed, contradictory, still learning or checking.
    Unclear,
    /// Something moved, perhaps while its reference was learned.
    Moved,
}

/// Returns the verdict from the last states of a session. Only a camera at its reference pose counts as answered.
pub fn verdict(states: &[Option<State>], moved: &Moved) -> Verdict {
    let is_drifted = |state: &Option<State>| matches!(state, Some(State::Drifted(_)));
    let is_well = |state: &Option<State>| matches!(state, Some(State::Steady | State::Tracking));
    match states {
        _ if !moved.nodes.is_empty() || !moved.while_learning.is_empty() => Verdict::Moved,
        _ if states.iter().any(is_drifted) => Verdict::Moved,
        _ if states.iter().all(is_well) => Verdict::Steady,
        _ => Verdict::Unclear,
    }
}

impl EventText {
    /// Builds the converter for cameras and targets of these names.
    pub fn new(names: &Names) -> Self {
        EventText { names: names.clone() }
    }

    /// Returns the cameras that may have moved instead, in words.
    fn others(&self, alternatives: &[usize]) -> String {
        let names: Vec<&str> =
            alternatives.iter().map(|alternative| self.names.camera(*alternative)).collect();
        if names.is_empty() { String::new() } else { format!("; or {} moved instead", names.join(" or ")) }
    }

    /// Returns an event in words.
    pub fn words(&self, event: &Event) -> String {
        match event {
            Event::Observed { camera, target, observation } => {
                format!("{}  {}", self.names.pair(*camera, *target), observed_words(observation))
            }
            Event::StateChanged { camera, target, t_s, state } => {
                format!("{}  {}  {}", self.names.pair(*camera, *target), moment(*t_s, 3), state_words(state))
            }
            Event::Compared { camera, target, t_s, deviation } => {
                format!(
                    "{}  {}  {}",
                    self.names.pair(*camera, *target),
                    moment(*t_s, 3),
                    compared::words(deviation)
                )
            }
            Event::Promised { camera, target, t_s, promise } => {
                let (pair, promised) = (self.names.pair(*camera, *target), promised::words(promise));
                format!("{pair}  {t_s:.3} s  promised from now on: {promised}")
            }
            Event::Learned { camera, target, reference, promise } => {
                let sigma = reference.noise.reference.diagonal().map(f64::sqrt);
                let (turn, shift) = (sigma.fixed_rows::<3>(0).norm(), sigma.fixed_rows::<3>(3).norm());
                let [turn, shift] = [turn.to_degrees(), 1e3 * shift];
                let promised = promise
                    .as_ref()
                    .map(|promise| format!("; {}", promised::words(promise)))
                    .unwrap_or_default();
                format!(
                    "{}  reference learned, ± {turn:.4}°, ± {shift:.2} mm{promised}",
                    self.names.pair(*camera, *target)
                )
            }
            Event::MovedWhileLearning { camera, target, alternatives, unsettled } => {
                let (pair, others) = (self.names.pair(*camera, *target), self.others(alternatives));
                format!("{pair}  {}{others}", unsettled_words(unsettled))
            }
            Event::Attributed { t_s, moved, .. } => {
                let mut said = Moved::default();
                said.take(event);
                let how: Vec<String> = moved.iter().map(|(_, node)| by(node)).collect();
                match moved.is_empty() {
                    true => said.words(&self.names),
                    false => {
                        format!(
                            "{}, by {}, since {}",
                            said.words(&self.names),
                            how.join(" and "),
                            moment(*t_s, 1)
                        )
                    }
                }
            }
            Event::Dropped { camera, frames } => {
                format!("{}  {} dropped", self.names.camera(*camera), counted(*frames as usize, "frame"))
            }
            Event::LeftOut { camera, frames, reason } => {
                format!("{}  {}", self.names.camera(*camera), left_out_words(*frames, reason))
            }
            Event::Clock { camera, t_s, step_s } => {
                format!("{}  {}  {}", self.names.camera(*camera), moment(*t_s, 3), clock_words(*step_s))
            }
            Event::Oriented { camera, how } => {
                format!("{}  {}", self.names.camera(*camera), orientation_remark("its images", how))
            }
            Event::Source { camera, connected: true, .. } => {
                format!("{}  source gives frames", self.names.camera(*camera))
            }
            Event::Source { camera, reason, .. } => {
                format!(
                    "{}  source lost: {}",
                    self.names.camera(*camera),
                    reason.as_deref().unwrap_or("no reason given")
                )
            }
            Event::Ended { camera } => format!("{}  source has ended", self.names.camera(*camera)),
        }
    }

    /// Returns the event as one JSON object.
    pub fn object(&self, event: &Event) -> Value {
        value(&self.event_object(event))
    }

    fn event_object(&self, event: &Event) -> EventObject {
        let camera = |camera: &usize| Some(self.names.camera(*camera).to_owned());
        let target = |target: &usize| Some(self.names.target(*target).to_owned());
        let none = EventObject::default;
        match event {
            Event::Observed { camera: c, target: t, observation } => {
                EventObject { camera: camera(c), target: target(t), ..observed_object(observation) }
            }
            Event::StateChanged { camera: c, target: t, t_s, state } => EventObject {
                event: "state",
                camera: camera(c),
                target: target(t),
                t_s: Some(*t_s),
                ..state_object(state)
            },
            Event::Compared { camera: c, target: t, t_s, deviation } => EventObject {
                event: "compared",
                camera: camera(c),
                target: target(t),
                t_s: Some(*t_s),
                deviation: Some(compared::object(deviation)),
                message: Some(compared::words(deviation)),
                ..none()
            },
            Event::Promised { camera: c, target: t, t_s, promise } => {
                let (noise, detectable) = promised::objects(promise);
                EventObject {
                    event: "promised",
                    camera: camera(c),
                    target: target(t),
                    t_s: Some(*t_s),
                    noise: Some(noise),
                    detectable: Some(detectable),
                    unpromised: Some(promised::unpromised(promise)),
                    message: Some(self.words(event)),
                    ..none()
                }
            }
            Event::Learned { camera: c, target: t, reference, promise } => {
                let (noise, detectable) = promise.as_ref().map(|p| promised::objects(p)).unzip();
                let cam_from_target = Some(TransformObject::from(reference.a_from_b));
                EventObject {
                    event: "learned",
                    camera: camera(c),
                    target: target(t),
                    cam_from_target,
                    noise,
                    detectable,
                    unpromised: promise.as_ref().map(|p| promised::unpromised(p)),
                    ..none()
                }
            }
            Event::MovedWhileLearning { camera: c, target: t, alternatives, unsettled } => EventObject {
                event: "moved_while_learning",
                camera: camera(c),
                target: target(t),
                how: Some(unrest_word(unsettled.unrest)),
                reading: Some(unsettled.reading),
                motion: Some(motion(&unsettled.drift)),
                alternatives: Some(Alternatives::Cameras(alternatives.iter().filter_map(camera).collect())),
                message: Some(self.words(event)),
                ..none()
            },
            Event::Attributed { t_s, moved, alternatives } => {
                let mut all = Moved::default();
                all.take(event);
                let motions = moved.iter().map(|(name, node)| NodeMotionObject {
                    name: name.clone(),
                    old_from_new: node.old_from_new.into(),
                    covariance: pose::rows(&node.covariance),
                });
                EventObject {
                    event: "moved",
                    t_s: Some(*t_s),
                    motions: Some(motions.collect()),
                    alternatives: Some(Alternatives::Sets(alternatives.clone())),
                    message: Some(all.words(&self.names)),
                    moved: Some(all.nodes),
                    ..none()
                }
            }
            Event::Dropped { camera: c, frames } => {
                EventObject { event: "dropped", camera: camera(c), frames: Some(*frames), ..none() }
            }
            Event::LeftOut { camera: c, frames, reason } => EventObject {
                event: "left_out",
                camera: camera(c),
                frames: Some(*frames),
                message: Some(reason.to_string()),
                ..none()
            },
            Event::Clock { camera: c, t_s, step_s } => EventObject {
                event: "clock",
                camera: camera(c),
                t_s: Some(*t_s),
                step_s: Some(*step_s),
                ..none()
            },
            Event::Oriented { camera: c, how } => EventObject {
                event: "oriented",
                camera: camera(c),
                how: Some(how),
                message: Some(orientation_remark("its images", how)),
                ..none()
            },
            Event::Source { camera: c, connected, reason } => EventObject {
                event: "source",
                camera: camera(c),
                connected: Some(*connected),
                reason: reason.clone(),
                ..none()
            },
            Event::Ended { camera: c } => EventObject { event: "ended", camera: camera(c), ..none() },
        }
    }
}

fn left_out_words(frames: u64, reason: &str) -> String {
    format!("{} left out: {reason}", counted(frames as usize, "frame"))
}

fn clock_words(step_s: f64) -> String {
    let way = if step_s < 0.0 { "back" } else { "forward" };
    format!("the clock of its frames went {way} by {:.3} s; times go on without that", step_s.abs())
}

/// All results of `word`.
pub const WORDS: [&str; 7] =
    ["learning", "steady", "checking", "drifted", "stale", "inconsistent", "tracking"];

/// The same words, the gravest last.
pub const BY_SEVERITY: [&str; 7] =
    ["steady", "tracking", "learning", "stale", "checking", "inconsistent", "drifted"];

/// Returns the word of a state in JSON.
pub fn word(state: &State) -> &'static str {
    match state {
        State::Learning { .. } => "learning",
        State::Steady => "steady",
        State::Stale { .. } => "stale",
        State::Checking(_) => "checking",
        State::Drifted(_) => "drifted",
        State::Inconsistent => "inconsistent",
        State::Tracking => "tracking",
    }
}

/// Returns a state in words.
pub fn state_words(state: &State) -> String {
    match state {
        State::Learning { readings, needed } => format!("learning: {readings} of {needed} readings"),
        State::Stale { for_s, reason } => {
            let why = reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
            format!("stale: no usable reading for {for_s:.1} s{why}")
        }
        State::Checking(CheckingReason::Different) => "checking: something is different, not yet decided".to_string(),
        State::Checking(CheckingReason::CorrelatedErrors) => "checking: errors are correlated for longer, or are larger, than was learned; what was found is no larger than they are".to_string(),
        State::Checking(CheckingReason::Away(deviation)) => format!(
            "checking: {}, which is more than is promised to be found; errors that are not excluded would explain it",
            compared::words(deviation)
        ),
        State::Inconsistent => "inconsistent: readings contradict their stated noise: intrinsics, target or sigma are wrong, part of the target is hidden, or landmarks move".to_string(),
        State::Drifted(drift) => drifted::words(drift),
        State::Steady => "steady".to_string(),
        State::Tracking => "tracking: the camera moves, that is no drift".to_string(),
    }
}

fn unrest_word(unrest: Unrest) -> &'static str {
    match unrest {
        Unrest::Step => "step",
        Unrest::Ramp => "ramp",
        Unrest::Wander => "wander",
    }
}

/// Returns the reason why learning continues, in words.
fn unsettled_words(unsettled: &Unsettled) -> String {
    let Unsettled { unrest, reading, drift } = unsettled;
    let sigma = drift.covariance.diagonal().map(f64::sqrt);
    let by = match drift.pure_rotation() {
        Some((turn, covariance)) => {
            let motion = Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0);
            let sigma = covariance.diagonal().map(f64::sqrt);
            format!("rotated {}", parts(&motion, |i| sigma.as_slice().get(i).copied()))
        }
        None => format!("rotated and shifted {}", parts(&drift.old_from_new, |i| Some(sigma[i]))),
    };
    let (began, began_sigma_s) = (moment(drift.began_s, 1), drift.began_sigma_s);
    match unrest {
        Unrest::Step => format!(
            "moved after reading {reading} while its reference was learned, at {began} ± {began_sigma_s:.1} s: {by}; learning again from there"
        ),
        Unrest::Ramp => format!(
            "moves while its reference is learned, since {began} ± {began_sigma_s:.1} s, so far {by}; it is not learned while it moves"
        ),
        Unrest::Wander => format!(
            "does not keep still while its reference is learned: from the first readings to the last {by}; learning continues with more readings. If that is an error of the readings, state it with --correlated-deg and --correlated-mm"
        ),
    }
}

fn motion(drift: &Drift) -> MotionObject {
    MotionObject {
        old_from_new: drift.old_from_new.into(),
        covariance: pose::rows(&drift.covariance),
        began_s: drift.began_s,
        began_sigma_s: drift.began_sigma_s,
    }
}

fn state_object(state: &State) -> EventObject {
    let object =
        EventObject { state: Some(word(state)), message: Some(state_words(state)), ..EventObject::default() };
    match state {
        State::Drifted(drift) => {
            EventObject { motion: Some(motion(drift)), drift: Some(drifted::object(drift)), ..object }
        }
        State::Stale { for_s, reason } => {
            EventObject { for_s: Some(*for_s), reason: reason.clone(), ..object }
        }
        State::Learning { readings, needed } => {
            EventObject { readings: Some(*readings), needed: Some(*needed), ..object }
        }
        State::Checking(reason) => {
            let word = match reason {
                CheckingReason::Different => "different",
                CheckingReason::CorrelatedErrors => "correlated_errors",
                CheckingReason::Away(_) => "away",
            };
            let deviation = away(state).map(compared::object);
            EventObject { reason: Some(word.into()), deviation, ..object }
        }
        State::Steady | State::Inconsistent | State::Tracking => object,
    }
}

/// Returns the size of a node's motion, in words.
fn by(node: &MovedNode) -> String {
    let turn_deg = node.old_from_new.fixed_rows::<3>(0).norm().to_degrees();
    let shift_mm = 1e3 * node.old_from_new.fixed_rows::<3>(3).norm();
    format!("{turn_deg:.3}° and {shift_mm:.2} mm")
}

fn observed_words(observation: &Observation) -> String {
    if let Some(landmark_observation) = &observation.landmarks {
        return format!("{}  {}", observation.name, turned::words(landmark_observation));
    }
    match (&observation.tracked, &observation.reason) {
        (_, Some(reason)) => format!("{}  {reason}", observation.name),
        (Some(tracked), None) => {
            let x = tracked.cam_from_target.origin() * 1e3;
            format!("{}  camera at {:.2} {:.2} {:.2} mm (target frame)", observation.name, x.x, x.y, x.z)
        }
        (None, None) => observation.name.clone(),
    }
}

fn observed_object(observation: &Observation) -> EventObject {
    let (tracked, times) = (observation.tracked.as_ref(), &observation.times);
    let frame = FrameObject {
        number: observation.number,
        name: observation.name.clone(),
        n_points: observation.n_points,
        times_us: TimesObject {
            waited: times.waited_us,
            detect: times.detect_us,
            solve: times.solve_us,
            decide: times.decide_us,
        },
        probability: tracked.map(|tracked| tracked.probability),
        points_rms_px: measured(observation)
            .filter(|_| observation.landmarks.is_none())
            .map(|measured| measured.rms_px),
    };
    EventObject {
        event: "frame",
        t_s: Some(observation.capture_s),
        frame: Some(frame),
        cam_from_target: tracked.map(|tracked| tracked.cam_from_target.into()),
        rotation: observation.landmarks.as_deref().map(RotationObject::from),
        message: observation.reason.clone(),
        ..EventObject::default()
    }
}
