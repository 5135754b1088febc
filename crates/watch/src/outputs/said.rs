//! Events in words and as JSON.

mod drifted;
mod promised;

use super::super::names::Names;
use super::measured::measured;
use crate::live::{CheckingReason, Event, Observation, State};
use resight::answer::TransformObject;
use resight::core::temporal::monitor::attribute::MovedNode;
use resight::core::temporal::monitor::{Unrest, Unsettled};
use resight::core::{Matrix6, Vector6};
use resight::report::turned::{self, parts};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Says events in words and as JSON.
pub struct EventText {
    names: Names,
}

/// What moved, as it was last reported.
#[derive(Debug, Clone, Default)]
pub struct Moved {
    nodes: Vec<String>,
    alternatives: Vec<Vec<String>>,
    /// Cameras and targets that moved while their reference was learned.
    while_learning: BTreeSet<(usize, usize)>,
}

impl Moved {
    /// The next event of the session.
    pub fn take(&mut self, event: &Event) {
        if let Event::Attributed { moved, alternatives, .. } = event {
            let nodes = moved.iter().map(|(name, _)| name.clone()).collect();
            (self.nodes, self.alternatives) = (nodes, alternatives.clone());
        }
        if let Event::MovedWhileLearning { camera, target, unsettled, .. } = event
            && unsettled.unrest != Unrest::Wander
        {
            self.while_learning.insert((*camera, *target));
        }
    }

    /// `camera gate moved`, or `one of camera gate, target door moved`.
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

/// What moved, and how each pair ended: one line each, in words or as JSON.
pub fn verdict_lines(names: &Names, json: bool, states: &[Option<State>], moved: &Moved) -> Vec<String> {
    let mut lines = Vec::new();
    if !moved.nodes.is_empty() {
        lines.push(match json {
            true => json!({"schema": 2, "event": "verdict", "moved": moved.nodes, "alternatives": moved.alternatives,
                "message": moved.words(names)})
            .to_string(),
            false => moved.words(names),
        });
    }
    for (index, (pair, state)) in names.pairs().iter().zip(states).enumerate() {
        let word = state.as_ref().map_or("stale", word);
        let (camera, target) = names.of_pair(index);
        let has_moved = moved.while_learning.contains(&(camera, target));
        lines.push(match (json, has_moved) {
            (true, _) => {
                let mut object = json!({"schema": 2, "event": "verdict", "camera": names.camera(camera),
                    "target": names.target(target), "state": word});
                if has_moved {
                    object["moved_while_learning"] = json!(true);
                }
                object.to_string()
            }
            (false, true) => format!("{pair}: {word}; it moved while its reference was learned"),
            (false, false) => format!("{pair}: {word}"),
        });
    }
    lines
}

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Every camera is where it was, or followed.
    Steady,
    /// Of some camera it cannot be said: not seen, contradicts itself, still learning or checking.
    Unclear,
    /// Something moved, also while its reference was learned.
    Moved,
}

/// How a session of these last states ends. Only who is where it was is answered; who may just have moved suddenly is not.
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
    /// Of the cameras and targets of these names.
    pub fn new(names: &Names) -> Self {
        EventText { names: names.clone() }
    }

    /// Cameras that may have moved instead.
    fn others(&self, alternatives: &[usize]) -> String {
        let names: Vec<&str> =
            alternatives.iter().map(|alternative| self.names.camera(*alternative)).collect();
        if names.is_empty() { String::new() } else { format!("; or {} moved instead", names.join(" or ")) }
    }

    /// An event in words.
    pub fn words(&self, event: &Event) -> String {
        match event {
            Event::Observed { camera, target, observation } => {
                format!("{}  {}", self.names.pair(*camera, *target), observed_words(observation))
            }
            Event::StateChanged { camera, target, t_s, state } => {
                format!("{}  {t_s:.3} s  {}", self.names.pair(*camera, *target), state_words(state))
            }
            Event::Learned { camera, target, reference, promise } => {
                let sigma = reference.noise.reference.diagonal().map(f64::sqrt);
                let (turn, shift) = (sigma.fixed_rows::<3>(0).norm(), sigma.fixed_rows::<3>(3).norm());
                let [turn, shift] = [turn.to_degrees(), 1e3 * shift];
                let promised = promise.as_ref().map(|promise| promised::words(promise)).unwrap_or_default();
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
                        format!("{}, by {}, since {t_s:.1} s", said.words(&self.names), how.join(" and "))
                    }
                }
            }
            Event::Dropped { camera, frames } => {
                format!("{}  {frames} frames dropped", self.names.camera(*camera))
            }
            Event::LeftOut { camera, frames, reason } => {
                format!("{}  {}", self.names.camera(*camera), left_out_words(*frames, reason))
            }
            Event::Clock { camera, t_s, step_s } => {
                format!("{}  {t_s:.3} s  {}", self.names.camera(*camera), clock_words(*step_s))
            }
            Event::Source { camera, connected: true, .. } => {
                format!("{}  source is back", self.names.camera(*camera))
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

    /// The event as one JSON object.
    pub fn object(&self, event: &Event) -> Value {
        match event {
            Event::Observed { camera, target, observation } => {
                let mut object = observed_object(observation);
                object["camera"] = json!(self.names.camera(*camera));
                object["target"] = json!(self.names.target(*target));
                object
            }
            Event::StateChanged { camera, target, t_s, state } => {
                let mut object = state_object(state);
                object["event"] = json!("state");
                object["camera"] = json!(self.names.camera(*camera));
                object["target"] = json!(self.names.target(*target));
                object["t_s"] = json!(t_s);
                object
            }
            Event::Learned { camera, target, reference, promise } => {
                let mut object = json!({"schema": 2, "event": "learned", "camera": self.names.camera(*camera),
                "target": self.names.target(*target), "cam_from_target": TransformObject::from(reference.a_from_b)});
                if let Some(promise) = promise {
                    (object["noise"], object["detectable"]) = promised::objects(promise);
                }
                object
            }
            Event::MovedWhileLearning { camera, target, alternatives, unsettled } => {
                let drift = &unsettled.drift;
                let alternatives: Vec<&str> =
                    alternatives.iter().map(|alternative| self.names.camera(*alternative)).collect();
                json!({"schema": 2, "event": "moved_while_learning", "camera": self.names.camera(*camera),
                    "target": self.names.target(*target), "how": unrest_word(unsettled.unrest),
                    "reading": unsettled.reading, "began_s": drift.began_s, "began_sigma_s": drift.began_sigma_s,
                    "old_from_new": drift.old_from_new.as_slice(), "covariance": rows(&drift.covariance),
                    "alternatives": alternatives, "message": self.words(event)})
            }
            Event::Attributed { t_s, moved, alternatives } => {
                let mut said = Moved::default();
                said.take(event);
                let motions: Vec<Value> = moved
                    .iter()
                    .map(|(name, node)| {
                        json!({"name": name, "old_from_new": node.old_from_new.as_slice(),
                            "covariance": rows(&node.covariance)})
                    })
                    .collect();
                json!({"schema": 2, "event": "moved", "t_s": t_s, "moved": said.nodes, "alternatives": alternatives,
                    "motions": motions, "message": said.words(&self.names)})
            }
            Event::Dropped { camera, frames } => {
                json!({"schema": 2, "event": "dropped", "camera": self.names.camera(*camera), "frames": frames})
            }
            Event::LeftOut { camera, frames, reason } => {
                json!({"schema": 2, "event": "left_out", "camera": self.names.camera(*camera), "frames": frames,
                "message": reason})
            }
            Event::Clock { camera, t_s, step_s } => {
                json!({"schema": 2, "event": "clock", "camera": self.names.camera(*camera), "t_s": t_s, "step_s": step_s})
            }
            Event::Source { camera, connected, reason } => {
                json!({"schema": 2, "event": "source", "camera": self.names.camera(*camera),
                "connected": connected, "reason": reason})
            }
            Event::Ended { camera } => {
                json!({"schema": 2, "event": "ended", "camera": self.names.camera(*camera)})
            }
        }
    }
}

fn left_out_words(frames: u64, reason: &str) -> String {
    let frames = if frames == 1 { "1 frame".to_string() } else { format!("{frames} frames") };
    format!("{frames} left out: {reason}")
}

fn clock_words(step_s: f64) -> String {
    let way = if step_s < 0.0 { "back" } else { "forward" };
    format!("the clock of its frames went {way} by {:.3} s; times go on without that", step_s.abs())
}

/// All words of `word`.
pub const WORDS: [&str; 7] =
    ["learning", "steady", "checking", "drifted", "stale", "inconsistent", "tracking"];

/// The word of the JSON.
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

/// A state in words.
pub fn state_words(state: &State) -> String {
    match state {
        State::Learning { readings, needed } => format!("learning: {readings} of {needed} readings"),
        State::Stale { for_s } => format!("stale: no usable reading for {for_s:.1} s"),
        State::Checking(CheckingReason::Different) => "checking: something is different, not yet decided".to_string(),
        State::Checking(CheckingReason::CorrelatedErrors) => "checking: errors are correlated for longer, or are larger, than was learned; what was found is no larger than they are".to_string(),
        State::Inconsistent => "inconsistent: intrinsics or target are wrong, part of it is hidden, or landmarks move".to_string(),
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

/// Why learning continues.
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
    let (began_s, began_sigma_s) = (drift.began_s, drift.began_sigma_s);
    match unrest {
        Unrest::Step => format!(
            "moved after reading {reading} while its reference was learned, at {began_s:.1} s ± {began_sigma_s:.1} s: {by}; learning again from there"
        ),
        Unrest::Ramp => format!(
            "moves while its reference is learned, since {began_s:.1} s ± {began_sigma_s:.1} s, so far {by}; it is not learned while it moves"
        ),
        Unrest::Wander => format!(
            "does not keep still while its reference is learned: from the first readings to the last {by}; learning continues with more readings. If that is an error of the readings, state it with --bias-deg and --bias-mm"
        ),
    }
}

fn state_object(state: &State) -> Value {
    let mut object = json!({"schema": 2, "state": word(state)});
    match state {
        State::Drifted(drift) => {
            object["old_from_new"] = json!(drift.old_from_new.as_slice());
            object["covariance"] = json!(rows(&drift.covariance));
            object["began_s"] = json!(drift.began_s);
            object["began_sigma_s"] = json!(drift.began_sigma_s);
            if let Some((turn, covariance)) = drift.pure_rotation() {
                object["pure_rotation_rad"] = json!(turn.as_slice());
                object["pure_rotation_sigma_rad"] = json!(covariance.diagonal().map(f64::sqrt).as_slice());
            }
            drifted::add_to(&mut object, drift);
        }
        State::Stale { for_s } => object["for_s"] = json!(for_s),
        State::Learning { readings, needed } => {
            object["readings"] = json!(readings);
            object["needed"] = json!(needed);
        }
        State::Checking(doubt) => {
            let errors = *doubt == CheckingReason::CorrelatedErrors;
            object["reason"] = json!(if errors { "correlated_errors" } else { "different" });
        }
        State::Steady | State::Inconsistent | State::Tracking => {}
    }
    object["message"] = json!(state_words(state));
    object
}

fn rows(covariance: &Matrix6) -> Vec<Vec<f64>> {
    (0..6).map(|i| (0..6).map(|j| covariance[(i, j)]).collect()).collect()
}

/// The size of a node's motion.
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

fn observed_object(observation: &Observation) -> Value {
    let mut object = json!({"schema": 2, "event": "frame", "number": observation.number, "t_s": observation.capture_s,
        "name": observation.name, "n_points": observation.n_points,
        "times_us": {"waited": observation.times.waited_us, "detect": observation.times.detect_us,
            "solve": observation.times.solve_us, "decide": observation.times.decide_us}});
    if let Some(tracked) = &observation.tracked {
        object["cam_from_target"] = json!(TransformObject::from(tracked.cam_from_target));
        object["probability"] = json!(tracked.probability);
    }
    if let Some(measured) = measured(observation) {
        object["rms_px"] = json!(measured.rms_px);
    }
    if let Some(landmark_observation) = &observation.landmarks {
        turned::add_to(&mut object, landmark_observation);
    }
    if let Some(reason) = &observation.reason {
        object["message"] = json!(reason);
    }
    object
}
