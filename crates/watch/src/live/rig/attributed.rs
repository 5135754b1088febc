//! Cameras and targets that are all fixed: the attribution of an alarm to one of them.

use super::Nodes;
use crate::live::{CheckingReason, Event, LiveConfig, Observation, State};
use resight_core::Pose;
use resight_core::temporal::monitor::attribute::{Attribution, Edge, attribute};
use resight_core::temporal::monitor::{Drift, Monitor, MonitorConfig, Reading, Reference, Watch};

/// Every pair of a camera and a target, with the state that its own camera reports.
pub(in crate::live) struct Pairs {
    nodes: Nodes,
    config: MonitorConfig,
    pairs: Vec<Pair>,
    reported: Reported,
    /// Capture times of each camera's newest frame, and of the newest one at the last attribution, seconds.
    newest_s: Vec<f64>,
    asked_s: Vec<f64>,
    /// The camera of that frame.
    asked_by: usize,
}

#[derive(Default)]
struct Pair {
    reference: Option<Reference>,
    /// The readings from which the monitor is learned, until there is one.
    learned_from: Vec<Reading>,
    monitor: Option<Monitor>,
    /// The state from its camera, and the state as reported.
    state: Option<State>,
    reported: Option<State>,
}

/// The last report of what moved.
#[derive(Default)]
struct Reported {
    answer: Answer,
    /// Number of corrections since it was last new.
    corrections: u32,
    /// A different answer, and the time since which it has not changed, seconds.
    other: Option<(Answer, f64)>,
}

#[derive(Debug, Clone, Default)]
struct Answer {
    moved: Vec<usize>,
    alternatives: Vec<Vec<usize>>,
    is_explained: bool,
}

/// A correction of what moved must last for this many decision periods, and twice as long after each one: the n-th comes at least 2ⁿ periods
/// after the alarm, however similar two explanations are.
const FIRST_CORRECTION: f64 = 2.0;

impl Pairs {
    pub fn new(nodes: Nodes, config: &LiveConfig) -> Self {
        let known = nodes.references.iter().zip(&nodes.monitors);
        let pair = |(reference, monitor): (&Option<Reference>, &Option<Monitor>)| Pair {
            reference: *reference,
            monitor: monitor.clone(),
            ..Pair::default()
        };
        let pairs = known.map(pair).collect();
        let never_s = vec![f64::NEG_INFINITY; nodes.cameras.len()];
        Pairs {
            nodes,
            config: config.monitor,
            pairs,
            reported: Reported::default(),
            newest_s: never_s.clone(),
            asked_s: never_s,
            asked_by: 0,
        }
    }

    fn index(&self, camera: usize, target: usize) -> usize {
        camera * self.nodes.targets.len() + target
    }

    pub fn take(&mut self, event: Event) -> Vec<Event> {
        match event {
            Event::StateChanged { camera, target, t_s, state } => {
                let index = self.index(camera, target);
                self.pairs[index].is_now(state);
                self.weighed(t_s, false)
            }
            Event::Observed { camera, target, observation } => {
                let (index, t_s) = (self.index(camera, target), observation.capture_s);
                let before = self.pairs[index].began_s();
                self.pairs[index].push(&observation, &self.config);
                self.newest_s[camera] = self.newest_s[camera].max(t_s);
                let is_news = before != self.pairs[index].began_s();
                let mut events = vec![Event::Observed { camera, target, observation }];
                if is_news || (self.is_due(camera) && self.is_any_drifted()) {
                    self.asked_by = camera;
                    events.extend(self.weighed(t_s, is_news));
                }
                events
            }
            Event::Learned { camera, target, reference, promise } => {
                let index = self.index(camera, target);
                self.pairs[index].reference = Some(*reference);
                self.pairs[index].learned_from =
                    promise.as_ref().map_or(Vec::new(), |promise| promise.learned_from.clone());
                vec![Event::Learned { camera, target, reference, promise }]
            }
            other => vec![other],
        }
    }

    /// Reports the state of the last frames at the end.
    pub fn finish(&mut self) -> Vec<Event> {
        let t_s = self.newest_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.is_any_drifted() { self.weighed(t_s, true) } else { Vec::new() }
    }

    /// Returns whether the search over all sets that may have moved is due: once in a decision period by the clock of one camera, or by
    /// another's when that one is silent.
    fn is_due(&self, camera: usize) -> bool {
        let periods = if camera == self.asked_by { 1.0 } else { 2.0 };
        self.asked_s[camera] + periods * self.config.decision_period_s <= self.newest_s[camera]
    }

    fn is_any_drifted(&self) -> bool {
        self.pairs.iter().any(|pair| pair.began_s().is_some())
    }

    /// Returns what moved, and every state that differs from its report because of it. `is_news`: a pair has just moved, or is back.
    fn weighed(&mut self, t_s: f64, is_news: bool) -> Vec<Event> {
        self.asked_s.clone_from(&self.newest_s);
        let mut events: Vec<Event> = self.attributed(t_s, is_news).into_iter().collect();
        events.extend((0..self.pairs.len()).filter_map(|pair| self.tell(pair, t_s)));
        events
    }

    /// Returns the state of a pair when it differs from its report.
    fn tell(&mut self, index: usize, t_s: f64) -> Option<Event> {
        let targets = self.nodes.targets.len();
        let (camera, target) = (index / targets, index % targets);
        let pair = &self.pairs[index];
        let state = match &pair.state {
            // Landmarks are no target that could be removed.
            Some(State::Drifted(drift)) if pair.is_of_target(drift) => {
                let target = self.nodes.cameras.len() + target;
                self.reported.blamed(camera, target).unwrap_or_else(|| State::Drifted(drift.clone()))
            }
            state => state.clone()?,
        };
        let pair = &mut self.pairs[index];
        if pair.reported.as_ref() == Some(&state) {
            return None;
        }
        pair.reported = Some(state.clone());
        Some(Event::StateChanged { camera, target, t_s, state })
    }

    /// Returns what moved, when it differs from its report.
    fn attributed(&mut self, t_s: f64, is_news: bool) -> Option<Event> {
        let (attribution, began_s) = self.attribution();
        let answer = Answer::of(&attribution);
        let before = self.reported.answer.clone();
        if !self.reported.corrected(answer, t_s, is_news, self.config.decision_period_s) {
            return None;
        }
        let answer = &self.reported.answer;
        if (&answer.moved, &answer.alternatives) == (&before.moved, &before.alternatives) {
            return None;
        }
        let name = |node: &usize| match node.checked_sub(self.nodes.cameras.len()) {
            Some(target) => self.nodes.targets[target].clone(),
            None => self.nodes.cameras[*node].clone(),
        };
        Some(Event::Attributed {
            t_s: began_s,
            moved: attribution.moved.iter().map(|moved| (name(&moved.node), moved.clone())).collect(),
            alternatives: answer.alternatives.iter().map(|set| set.iter().map(name).collect()).collect(),
        })
    }

    fn attribution(&self) -> (Attribution, f64) {
        let began_s = self.pairs.iter().filter_map(Pair::first_began_s).fold(f64::INFINITY, f64::min);
        if !began_s.is_finite() {
            return (Attribution::default(), 0.0);
        }
        let edges: Vec<Edge> = (0..self.pairs.len()).filter_map(|pair| self.edge(pair, began_s)).collect();
        (attribute(self.nodes.cameras.len() + self.nodes.targets.len(), &edges), began_s)
    }

    /// Returns a pair's evidence of a motion since then; none where it has not been observed since, or is still uncertain.
    fn edge(&self, index: usize, began_s: f64) -> Option<Edge> {
        let targets = self.nodes.targets.len();
        let pair = &self.pairs[index];
        let (monitor, reference) = (pair.monitor.as_ref()?, pair.reference.as_ref()?);
        let is_certain = matches!(monitor.watch(monitor.last_usable_s()), Watch::Steady | Watch::Drifted(_));
        // The reading at the very time of its start contains the motion.
        if !is_certain || monitor.last_usable_s() < began_s {
            return None;
        }
        let (motion, covariance) = monitor.jump_since(began_s)?;
        let (a, b) = (index / targets, self.nodes.cameras.len() + index % targets);
        let a_from_b: Pose = reference.a_from_b;
        Some(Edge { a, b, a_from_b, motion, covariance: covariance + reference.noise.bias })
    }
}

impl Answer {
    fn of(attribution: &Attribution) -> Self {
        let moved = attribution.moved.iter().map(|moved| moved.node).collect();
        Answer {
            moved,
            alternatives: attribution.alternatives.clone(),
            is_explained: attribution.is_explained,
        }
    }

    /// Returns whether two answers are the same; which of the alternatives fits slightly better does not matter.
    fn is_same(&self, other: &Answer) -> bool {
        let sets = |of: &Answer| {
            let mut sets: Vec<Vec<usize>> =
                std::iter::once(&of.moved).chain(&of.alternatives).cloned().collect();
            sets.sort();
            sets
        };
        self.is_explained == other.is_explained && sets(self) == sets(other)
    }
}

impl Reported {
    /// Returns whether this answer replaces the reported one: at once where there was none or it is new, else when it has lasted.
    fn corrected(&mut self, answer: Answer, t_s: f64, is_news: bool, period_s: f64) -> bool {
        if answer.is_same(&self.answer) {
            self.other = None;
            return false;
        }
        let is_first = is_news || (self.corrections == 0 && self.answer.moved.is_empty());
        let since_s = match &self.other {
            Some((other, since_s)) if other.is_same(&answer) => *since_s,
            _ => t_s,
        };
        let lasts_s = FIRST_CORRECTION * period_s * f64::from(self.corrections.min(60)).exp2();
        if !is_first && t_s < since_s + lasts_s {
            self.other = Some((answer, since_s));
            return false;
        }
        self.corrections = if is_news { 0 } else { self.corrections + u32::from(!is_first) };
        (self.answer, self.other) = (answer, None);
        true
    }

    /// Returns the state that replaces a camera's drift against a target: none where the drift is the camera's. A camera whose target was
    /// removed has not moved, and while both are possible nothing is decided.
    fn blamed(&self, camera: usize, target: usize) -> Option<State> {
        let Answer { moved, alternatives, is_explained } = &self.answer;
        if moved.is_empty() || !is_explained {
            return None;
        }
        let sets = || std::iter::once(moved).chain(alternatives);
        if sets().all(|set| set.contains(&camera)) {
            return None;
        }
        if sets().all(|set| set.contains(&target) && !set.contains(&camera)) {
            return Some(State::Steady);
        }
        (!alternatives.is_empty()).then_some(State::Checking(CheckingReason::Different))
    }
}

impl Pair {
    /// Returns the start of its last motion, seconds.
    fn began_s(&self) -> Option<f64> {
        Some(self.monitor.as_ref()?.drift()?.began_s)
    }

    /// Returns when it was last at its reference pose, seconds.
    fn first_began_s(&self) -> Option<f64> {
        Some(self.monitor.as_ref()?.drift()?.first_began_s())
    }

    /// Returns whether a drift is one against the target, or one that landmarks found while the target was not observed.
    fn is_of_target(&self, drift: &Drift) -> bool {
        self.began_s() == Some(drift.began_s)
    }

    /// Updates the state; a pair that learns again has no reference to compare with.
    fn is_now(&mut self, state: State) {
        if matches!(state, State::Learning { .. }) {
            (self.reference, self.monitor) = (None, None);
        }
        self.state = Some(state);
    }

    fn push(&mut self, observation: &Observation, config: &MonitorConfig) {
        if observation.landmarks.is_some() {
            return; // return; // A rotation since an image is no pose against the target.
        }
        let Some((reference, reading)) = self.reference.as_ref().zip(observation.reading.as_ref()) else {
            return;
        };
        if self.monitor.is_none() {
            self.monitor = Monitor::new(reference, config, reading.t_s).ok();
            // The monitor is built like the one whose state is reported, so that both have the same state.
            let learned_from = std::mem::take(&mut self.learned_from);
            self.monitor.iter_mut().for_each(|monitor| monitor.measure_noise(&learned_from));
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.push(reading);
        }
    }
}

#[cfg(test)]
mod tests;
