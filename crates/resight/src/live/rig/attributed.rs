//! Cameras and targets that all stand still: which of them an alarm is about.

use super::Nodes;
use crate::live::{Event, LiveConfig, Observation, State};
use resight_core::Pose;
use resight_core::monitor::attribute::{Attribution, Edge, attribute};
use resight_core::monitor::{Drift, Monitor, MonitorConfig, Reference, Watch};

/// Every pair of a camera and a target, watched as its own camera watches it.
pub(in crate::live) struct Pairs {
    nodes: Nodes,
    config: MonitorConfig,
    pairs: Vec<Pair>,
    told: Told,
    /// For each camera the capture time of its newest frame, and that of the newest when it was last asked what moved, seconds.
    newest_s: Vec<f64>,
    asked_s: Vec<f64>,
    /// Whose frame it was.
    asked_by: usize,
}

#[derive(Default)]
struct Pair {
    reference: Option<Reference>,
    monitor: Option<Monitor>,
    /// As its camera says, and as it was told.
    state: Option<State>,
    told: Option<State>,
}

/// What moved, as last told.
#[derive(Default)]
struct Told {
    moved: Vec<usize>,
    rivals: Vec<Vec<usize>>,
    is_explained: bool,
}

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
            told: Told::default(),
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
                self.pairs[index].state = Some(state);
                self.weighed(t_s)
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
                    events.extend(self.weighed(t_s));
                }
                events
            }
            Event::Learned { camera, target, reference } => {
                let index = self.index(camera, target);
                self.pairs[index].reference = Some(*reference);
                vec![Event::Learned { camera, target, reference }]
            }
            other => vec![other],
        }
    }

    /// What the last frames say is told at the end.
    pub fn finish(&mut self) -> Vec<Event> {
        let t_s = self.newest_s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.is_any_drifted() { self.weighed(t_s) } else { Vec::new() }
    }

    /// All sets that may have moved are looked through: once a decision period by the clock of one camera, and by another's when that
    /// one is silent.
    fn is_due(&self, camera: usize) -> bool {
        let periods = if camera == self.asked_by { 1.0 } else { 2.0 };
        self.asked_s[camera] + periods * self.config.decision_period_s <= self.newest_s[camera]
    }

    fn is_any_drifted(&self) -> bool {
        self.pairs.iter().any(|pair| pair.began_s().is_some())
    }

    /// What moved, and every state that is not as last told because of it.
    fn weighed(&mut self, t_s: f64) -> Vec<Event> {
        self.asked_s.clone_from(&self.newest_s);
        let mut events: Vec<Event> = self.attributed().into_iter().collect();
        events.extend((0..self.pairs.len()).filter_map(|pair| self.tell(pair, t_s)));
        events
    }

    /// The state of a pair when it is not as last told.
    fn tell(&mut self, index: usize, t_s: f64) -> Option<Event> {
        let targets = self.nodes.targets.len();
        let (camera, target) = (index / targets, index % targets);
        let pair = &self.pairs[index];
        let state = match &pair.state {
            // Landmarks are no target that could be carried away.
            Some(State::Drifted(drift)) if pair.is_of_target(drift) => {
                let target = self.nodes.cameras.len() + target;
                self.told.blamed(camera, target).unwrap_or_else(|| State::Drifted(drift.clone()))
            }
            state => state.clone()?,
        };
        let pair = &mut self.pairs[index];
        if pair.told.as_ref() == Some(&state) {
            return None;
        }
        pair.told = Some(state.clone());
        Some(Event::StateChanged { camera, target, t_s, state })
    }

    /// What moved, when that is not as last told.
    fn attributed(&mut self) -> Option<Event> {
        let (attribution, began_s) = self.attribution();
        let moved: Vec<usize> = attribution.moved.iter().map(|moved| moved.node).collect();
        self.told.is_explained = attribution.is_explained;
        if moved == self.told.moved && attribution.rivals == self.told.rivals {
            return None;
        }
        (self.told.moved, self.told.rivals) = (moved, attribution.rivals);
        let name = |node: &usize| match node.checked_sub(self.nodes.cameras.len()) {
            Some(target) => self.nodes.targets[target].clone(),
            None => self.nodes.cameras[*node].clone(),
        };
        Some(Event::Attributed {
            t_s: began_s,
            moved: attribution.moved.iter().map(|moved| (name(&moved.node), moved.clone())).collect(),
            rivals: self.told.rivals.iter().map(|set| set.iter().map(name).collect()).collect(),
        })
    }

    fn attribution(&self) -> (Attribution, f64) {
        let began_s = self.pairs.iter().filter_map(Pair::began_s).fold(f64::INFINITY, f64::min);
        if !began_s.is_finite() {
            return (Attribution::default(), 0.0);
        }
        let edges: Vec<Edge> = (0..self.pairs.len()).filter_map(|pair| self.edge(pair, began_s)).collect();
        (attribute(self.nodes.cameras.len() + self.nodes.targets.len(), &edges), began_s)
    }

    /// What a pair says of a motion since then; none where it has not been seen since, or waits to be sure.
    fn edge(&self, index: usize, began_s: f64) -> Option<Edge> {
        let targets = self.nodes.targets.len();
        let pair = &self.pairs[index];
        let (monitor, reference) = (pair.monitor.as_ref()?, pair.reference.as_ref()?);
        let is_sure = matches!(monitor.watch(monitor.last_usable_s()), Watch::Steady | Watch::Drifted(_));
        if !is_sure || monitor.last_usable_s() <= began_s {
            return None;
        }
        let (motion, covariance) = monitor.jump_since(began_s)?;
        let (a, b) = (index / targets, self.nodes.cameras.len() + index % targets);
        let a_from_b: Pose = reference.a_from_b;
        Some(Edge { a, b, a_from_b, motion, covariance: covariance + reference.noise.bias })
    }
}

impl Told {
    /// What a drift of a camera against a target comes to: none where it is the camera's. A camera whose target was carried away has not
    /// moved, and while it may have been either nothing is decided.
    fn blamed(&self, camera: usize, target: usize) -> Option<State> {
        if self.moved.is_empty() || !self.is_explained {
            return None;
        }
        let sets = || std::iter::once(&self.moved).chain(&self.rivals);
        if sets().all(|set| set.contains(&camera)) {
            return None;
        }
        if sets().all(|set| set.contains(&target) && !set.contains(&camera)) {
            return Some(State::Steady);
        }
        (!self.rivals.is_empty()).then_some(State::Settling)
    }
}

impl Pair {
    /// When its drift began, seconds.
    fn began_s(&self) -> Option<f64> {
        Some(self.monitor.as_ref()?.drift()?.began_s)
    }

    /// Whether a drift is one against the target, or one that landmarks found while it was not seen.
    fn is_of_target(&self, drift: &Drift) -> bool {
        self.began_s() == Some(drift.began_s)
    }

    fn push(&mut self, observation: &Observation, config: &MonitorConfig) {
        if observation.landmarks.is_some() {
            return; // A turn since a picture, not a pose against the target.
        }
        let Some((reference, reading)) = self.reference.as_ref().zip(observation.reading.as_ref()) else {
            return;
        };
        if self.monitor.is_none() {
            self.monitor = Monitor::new(reference, config, reading.t_s).ok();
            self.monitor.iter_mut().for_each(|monitor| monitor.measure_noise(&[]));
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.push(reading);
        }
    }
}

#[cfg(test)]
mod tests;
