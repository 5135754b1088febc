//! Cameras and targets that all stand still: which of them an alarm is about.

use super::Nodes;
use crate::live::{Event, LiveConfig, Observation, State};
use resight_core::Pose;
use resight_core::monitor::attribute::{Attribution, Edge, attribute};
use resight_core::monitor::{Monitor, MonitorConfig, Reference, Watch};

/// Every pair of a camera and a target, watched as its own camera watches it.
pub(in crate::live) struct Pairs {
    nodes: Nodes,
    config: MonitorConfig,
    pairs: Vec<Pair>,
    /// As last told.
    told: (Vec<usize>, Vec<Vec<usize>>),
}

#[derive(Default)]
struct Pair {
    reference: Option<Reference>,
    monitor: Option<Monitor>,
    /// As its camera says, and as it was told.
    state: Option<State>,
    told: Option<State>,
}

impl Pairs {
    pub fn new(nodes: Nodes, config: &LiveConfig) -> Self {
        let pair = |reference: &Option<Reference>| Pair { reference: *reference, ..Pair::default() };
        let pairs = nodes.references.iter().map(pair).collect();
        Pairs { nodes, config: config.monitor, pairs, told: Default::default() }
    }

    fn index(&self, camera: usize, target: usize) -> usize {
        camera * self.nodes.targets.len() + target
    }

    pub fn take(&mut self, event: Event) -> Vec<Event> {
        match event {
            Event::StateChanged { camera, target, t_s, state } => {
                let index = self.index(camera, target);
                self.pairs[index].state = Some(state);
                let mut events: Vec<Event> = self.attributed().into_iter().collect();
                events.extend(self.tell(index, t_s));
                events
            }
            Event::Observed { camera, target, observation } => {
                let (index, t_s) = (self.index(camera, target), observation.capture_s);
                self.pairs[index].push(&observation, &self.config);
                let mut events = vec![Event::Observed { camera, target, observation }];
                if self.is_any_drifted() {
                    events.extend(self.attributed());
                    events.extend((0..self.pairs.len()).filter_map(|pair| self.tell(pair, t_s)));
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

    fn is_any_drifted(&self) -> bool {
        self.pairs.iter().any(|pair| pair.monitor.as_ref().is_some_and(|m| m.drift().is_some()))
    }

    /// The state of a pair when it is not as last told: a camera whose target was carried away has not moved.
    fn tell(&mut self, index: usize, t_s: f64) -> Option<Event> {
        let targets = self.nodes.targets.len();
        let (camera, target) = (index / targets, index % targets);
        let (moved, rivals) = &self.told;
        let is_targets = rivals.is_empty()
            && moved.contains(&(self.nodes.cameras.len() + target))
            && !moved.contains(&camera);
        let pair = &mut self.pairs[index];
        let state = match &pair.state {
            Some(State::Drifted(_)) if is_targets => State::Steady,
            state => state.clone()?,
        };
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
        let now = (moved, attribution.rivals);
        if now == self.told {
            return None;
        }
        self.told = now;
        let name = |node: &usize| match node.checked_sub(self.nodes.cameras.len()) {
            Some(target) => self.nodes.targets[target].clone(),
            None => self.nodes.cameras[*node].clone(),
        };
        Some(Event::Attributed {
            t_s: began_s,
            moved: attribution.moved.iter().map(|moved| (name(&moved.node), moved.clone())).collect(),
            rivals: self.told.1.iter().map(|set| set.iter().map(name).collect()).collect(),
        })
    }

    fn attribution(&self) -> (Attribution, f64) {
        let drifts = self.pairs.iter().filter_map(|pair| pair.monitor.as_ref()?.drift());
        let began_s = drifts.map(|drift| drift.began_s).fold(f64::INFINITY, f64::min);
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

impl Pair {
    fn push(&mut self, observation: &Observation, config: &MonitorConfig) {
        if observation.landmarks.is_some() {
            return; // A turn since a picture, not a pose against the target.
        }
        let Some(reference) = &self.reference else { return };
        if self.monitor.is_none() {
            self.monitor = Monitor::new(reference, config, observation.capture_s).ok();
        }
        if let Some((monitor, reading)) = self.monitor.as_mut().zip(observation.reading.as_ref()) {
            monitor.push(reading);
        }
    }
}
