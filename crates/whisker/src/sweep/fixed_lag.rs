//! The smoother of sweeps as an online method: a window of the last contacts, with all earlier ones represented by one quadratic form.
//!
//! Every sample is answered at once (filtered) and again when it leaves the window (settled). Memory and time per sample are
//! constant. Derivation: docs/math/whisker_sweep.md, section 7.

use super::batch::Prior;
use super::chain::{Chain, Eliminated, Local, Solution};
use super::envelope::{self, Pair};
use super::node::{Instrument, Linear, Node, Role};
use super::record;
use super::roles::{self, Costs};
use super::start::{self, Goal};
use super::tip;
use super::window::{Entry, Inherited, add_link, add_own};
use super::{JUMP, Options, coefficient, estimate, prior, without_contact};
use crate::estimate::ContactEstimate;
use crate::{Cell, Error, HubContact, PlanarPose, Rod, Sample};
use nalgebra::Matrix4;

/// Solutions per sample at most.
const ROUNDS: usize = 6;
/// A node that moved by less, in standard deviations of measurement, keeps its derivatives.
const STILL: f64 = 0.02;
/// Another round where the newest solution moved a node by more.
const SETTLED: f64 = 0.3;
/// Steps are cut to this, in standard deviations: the first contacts bend the model most.
const LONGEST_STEP: f64 = 20.0;
/// The friction angle's step is cut to this, radians.
const LONGEST_TURN_RAD: f64 = 0.1;
/// Levenberg damping, as a share of the measurements' own weight: only against rounding.
const DAMPING: f64 = 1e-6;
/// A last contact is taken to the tip where that fits better by this much in χ².
const CLEARLY_TIP: f64 = 4.0;
/// Friction is distinguished from none, and so one direction of sliding from the other, above this many standard deviations.
const SLIDING_REPORTED: f64 = 4.0;

/// The final answer for one sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Settled {
    /// Its sweep.
    pub sweep: u32,
    /// Its number within the sweep.
    pub sample: u32,
    /// What the samples up to the lag after it say.
    pub estimate: ContactEstimate,
}

/// What a new sample brings.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// The new sample's contact from all samples up to it.
    pub now: ContactEstimate,
    /// Samples that got their final answer, oldest first.
    pub settled: Vec<Settled>,
    /// Coefficient of friction so far.
    pub mu: f64,
    /// Its standard deviation.
    pub mu_sigma: f64,
}

/// The smoother.
#[derive(Debug, Clone)]
pub struct FixedLag {
    with: Instrument,
    options: Options,
    window: Vec<Entry>,
    present: Vec<Linear>,
    inherited: Inherited,
    shared_rad: f64,
    shared_variance: f64,
    /// The last sample without contact: sweep and pose.
    free: Option<(u32, PlanarPose)>,
    last_angle: Option<(u32, f64)>,
    path: Costs,
    chain: Chain,
    factors: Vec<Eliminated>,
    solution: Solution,
}

impl FixedLag {
    /// Errors as `smooth`.
    pub fn new(rod: &Rod, cell: &Cell, options: &Options) -> Result<Self, Error> {
        let prior = prior(&options.friction)?;
        Ok(FixedLag {
            with: Instrument::new(rod, cell, options.method)?,
            options: *options,
            window: Vec::with_capacity(options.lag_samples + 3),
            present: Vec::with_capacity(options.lag_samples + 3),
            inherited: Inherited::of_prior(&prior),
            shared_rad: prior.angle_rad,
            shared_variance: prior.sigma_rad.powi(2),
            free: None,
            last_angle: None,
            path: roles::FIRST,
            chain: Chain::default(),
            factors: Vec::with_capacity(options.lag_samples + 3),
            solution: Solution::default(),
        })
    }

    /// The next sample.
    pub fn push(&mut self, sample: Sample) -> Update {
        let mut settled = Vec::new();
        if self.window.last().and_then(|e| e.name).is_some_and(|(sweep, _)| sweep != sample.sweep) {
            self.finish_into(&mut settled);
        }
        let now = if record::touched(&self.with, &sample) {
            self.contact(&sample, &mut settled)
        } else {
            self.finish_into(&mut settled);
            if record::is_number(&sample) {
                self.free = Some((sample.sweep, sample.world_from_hub));
            }
            let now = without_contact(&sample);
            settled.push(Settled { sweep: sample.sweep, sample: sample.sample, estimate: now.clone() });
            now
        };
        self.last_angle = Some((sample.sweep, sample.world_from_hub.angle_rad));
        let (mu, mu_sigma) = coefficient(self.shared_rad, self.shared_variance, &self.options.friction);
        // The first way of sliding counts as positive; friction has no sign.
        Update { now, settled, mu: mu.abs(), mu_sigma }
    }

    /// Settles what is left.
    pub fn finish(&mut self) -> Vec<Settled> {
        let mut settled = Vec::new();
        self.finish_into(&mut settled);
        settled
    }

    fn finish_into(&mut self, settled: &mut Vec<Settled>) {
        self.end_at_tip();
        for index in 0..self.window.len() {
            self.settle(index, settled);
        }
        if !self.window.is_empty() {
            let sigma_rad = self.shared_variance.sqrt();
            self.inherited = Inherited::of_prior(&Prior { angle_rad: self.shared_rad, sigma_rad });
        }
        self.window.clear();
        self.solution.covariances.clear();
        self.path = roles::FIRST;
        self.free = None;
    }

    /// A sample in contact: into the window, solve, let go of the oldest.
    fn contact(&mut self, sample: &Sample, settled: &mut Vec<Settled>) -> ContactEstimate {
        if !self.enter(sample) {
            self.finish_into(settled);
            let mut estimate = without_contact(sample);
            estimate.status = crate::estimate::Status::NoZero;
            settled.push(Settled { sweep: sample.sweep, sample: sample.sample, estimate: estimate.clone() });
            return estimate;
        }
        self.solve(SETTLED);
        while self.options.lag_samples + 1 < self.window.len() {
            self.settle(0, settled);
            self.let_go();
        }
        self.answer(self.window.len() - 1)
    }

    /// Adds a sample, and before the first of a run the moment of touch; false where its load has no contact.
    fn enter(&mut self, sample: &Sample) -> bool {
        let seen = record::see(&self.with, 0, sample);
        let costs = roles::costs(&self.with, &seen.raw, self.shared_rad, self.shared_variance);
        let role = self.role(&costs);
        let weak = start::WEAK * self.with.rod.length_m;
        let clear = seen.raw.as_ref().is_some_and(|(_, by)| by.row(3).norm() < weak);
        let before = self.window.last().and_then(|e| e.linear.contact.as_ref()).map(|(at, _)| at.s_m);
        let default_m = 0.6 * self.with.rod.length_m;
        let s_m = (!clear).then_some(before.unwrap_or(default_m).min(0.98 * self.with.rod.length_m));
        let goal = Goal { role, shared_rad: self.shared_rad, s_m };
        let Some(start) = start::load(&self.with, &seen.measured, &goal) else { return false };
        let fresh_angle = self
            .last_angle
            .is_some_and(|(sweep, angle)| sweep == sample.sweep && angle != sample.world_from_hub.angle_rad);
        let node = Node {
            hub: sample.world_from_hub,
            measured: seen.measured,
            side: if start.z < 0.0 { -1.0 } else { 1.0 },
            role,
            offset_sigma_m: record::offset_sigma_m(&self.with, &start, fresh_angle),
            fresh_angle,
        };
        if self.window.is_empty() {
            self.touch(sample, &node, &start.push(0.0));
        }
        self.add(node, start.push(0.0), Some((sample.sweep, sample.sample)))
    }

    fn touch(&mut self, sample: &Sample, first: &Node, start: &Local) {
        let before = self.free.filter(|(sweep, _)| *sweep == sample.sweep);
        if let (Some((_, before)), Some((at, _))) = (before, self.with.contact(&start.xyz())) {
            let (node, state) = record::touch_node(&self.with, before, first, at.s_m);
            self.add(node, state, None);
        }
    }

    fn add(&mut self, node: Node, state: Local, name: Option<(u32, u32)>) -> bool {
        let Some(linear) = node.linear(&self.with, &state, self.shared_rad) else { return false };
        let continues = !self.window.is_empty() && self.continues(&linear);
        if let Some(last) = self.window.last_mut() {
            last.linked = continues;
        } else {
            self.inherited.reference.0 = state;
        }
        self.window.push(Entry { node, state, linear, at: (state, self.shared_rad), name, linked: false });
        true
    }

    /// The cheapest role after the cheapest path so far.
    fn role(&mut self, costs: &Costs) -> Role {
        self.path = roles::extend(&self.path, costs);
        let reported = SLIDING_REPORTED * self.shared_variance.sqrt() < self.shared_rad.abs();
        roles::cheapest(&self.path, reported)
    }

    /// Builds the normal equations; the sum of squares they are of.
    fn fill(&mut self) -> f64 {
        self.chain.reset(self.window.len());
        let mut chi2 = self.inherited.add_to(&mut self.chain, &self.window[0].state, self.shared_rad);
        self.present.clear();
        self.present.extend(self.window.iter().map(|entry| entry.present(self.shared_rad)));
        for index in 0..self.window.len() {
            chi2 += add_own(&mut self.chain, index, &self.window[index], &self.present[index]);
            if index + 1 < self.window.len() {
                let pair = [&self.present[index], &self.present[index + 1]];
                chi2 += add_link(&mut self.chain, index, &self.window[index], pair, &self.with);
            }
        }
        chi2
    }

    /// A few steps on the window, until no node moves by more than `still`; derivatives are taken anew only where one moved.
    fn solve(&mut self, still: f64) {
        for _ in 0..ROUNDS {
            self.fill();
            self.chain.damp(DAMPING);
            match self.step() {
                Some(moved) if still <= moved => {}
                _ => break,
            }
        }
    }

    /// A run often ends with a single contact at the tip before the whisker slips off, too short for the costs of roles to
    /// follow: both are tried, the better is kept.
    fn end_at_tip(&mut self) {
        let Some(last) = self.window.last() else { return };
        let length = self.with.rod.length_m;
        let near = |at: &HubContact| (at.s_m - length).abs() < tip::NEAR_TIP * length;
        let mid = !matches!(last.node.role, Role::Tip | Role::Touch { .. });
        if !(mid && last.linear.contact.as_ref().is_some_and(|(at, _)| near(at))) {
            return;
        }
        let goal = Goal { role: Role::Tip, shared_rad: self.shared_rad, s_m: None };
        let Some(start) = start::load(&self.with, &last.node.measured, &goal) else { return };
        let as_is = self.converged();
        let (window, shared) = (self.window.clone(), (self.shared_rad, self.shared_variance));
        let index = self.window.len() - 1;
        (self.window[index].node.role, self.window[index].state) = (Role::Tip, start.push(0.0));
        self.relinearise(index);
        if as_is < self.converged() + CLEARLY_TIP {
            self.window = window;
            (self.shared_rad, self.shared_variance) = shared;
            self.converged();
        }
    }

    /// The sum of squares at the window's minimum.
    fn converged(&mut self) -> f64 {
        self.solve(1e-4);
        self.fill()
    }

    /// One step; the largest move of an unknown, none where the equations are singular.
    fn step(&mut self) -> Option<f64> {
        self.chain.solve(&mut self.factors, &mut self.solution)?;
        let moved = self.solution.steps.iter().map(|s| s.amax()).fold(0.0, f64::max);
        let turn = self.solution.shared_step.abs();
        let share = (LONGEST_STEP / moved).min(LONGEST_TURN_RAD / turn).min(1.0);
        self.shared_rad += share * self.solution.shared_step;
        self.shared_variance = self.solution.shared_variance;
        for index in 0..self.window.len() {
            self.window[index].state += self.solution.steps[index] * share;
            self.relinearise(index);
        }
        Some(moved)
    }

    /// New derivatives where the node moved; a step to where there is no contact is taken back.
    fn relinearise(&mut self, index: usize) {
        let newest = index + 1 == self.window.len();
        let entry = &mut self.window[index];
        if !newest && (entry.state - entry.at.0).amax() < STILL {
            return;
        }
        match entry.node.linear(&self.with, &entry.state, self.shared_rad) {
            Some(linear) => (entry.linear, entry.at) = (linear, (entry.state, self.shared_rad)),
            None => entry.state = entry.at.0,
        }
    }

    /// Whether a new node continues the contact of the newest in the window: its envelope condition against what both are
    /// known to, eq. (20). A touch has no covariance yet and is always continued.
    fn continues(&self, next: &Linear) -> bool {
        let index = self.window.len() - 1;
        let (Some(last), Some(known)) = (self.window.last(), self.solution.covariances.get(index)) else {
            return true;
        };
        if matches!(last.node.role, Role::Touch { .. }) {
            return true;
        }
        let present = last.present(self.shared_rad);
        let pair = Pair::envelope(&present, next);
        let alone = match &next.constraint {
            // (I + c cᵀ)⁻¹ of the readings and the constraint.
            Some((_, c, _)) => Matrix4::identity() - c * c.transpose() / (1.0 + c.norm_squared()),
            None => Matrix4::identity(),
        };
        let variance = pair.by[0].dot(&(known * pair.by[0]))
            + pair.by[1].dot(&(alone * pair.by[1]))
            + envelope::sigma_m(&present, next).powi(2);
        pair.residual_m * pair.residual_m < JUMP * JUMP * variance
    }

    fn answer(&self, index: usize) -> ContactEstimate {
        let entry = &self.window[index];
        estimate(&self.with, &entry.node, &entry.state, &entry.linear, &self.solution.covariances[index])
    }

    fn settle(&mut self, index: usize, settled: &mut Vec<Settled>) {
        let Some((sweep, sample)) = self.window[index].name else { return };
        let entry = &mut self.window[index];
        if let Some(linear) = entry.node.linear(&self.with, &entry.state, self.shared_rad) {
            (entry.linear, entry.at) = (linear, (entry.state, self.shared_rad));
        }
        settled.push(Settled { sweep, sample, estimate: self.answer(index) });
    }

    /// Sums the first node up into a form of the second, eq. (19).
    fn let_go(&mut self) {
        let shared_rad = self.shared_rad;
        self.chain.reset(2);
        self.inherited.add_to(&mut self.chain, &self.window[0].state, shared_rad);
        let pair = [self.window[0].present(shared_rad), self.window[1].present(shared_rad)];
        add_own(&mut self.chain, 0, &self.window[0], &pair[0]);
        add_link(&mut self.chain, 0, &self.window[0], [&pair[0], &pair[1]], &self.with);
        if self.chain.eliminate(0).is_some() {
            let (hessian, border, gradient) = self.chain.block(1);
            let (corner, corner_gradient) = self.chain.shared();
            let reference = (self.window[1].state, shared_rad);
            self.inherited = Inherited { hessian, border, gradient, corner, corner_gradient, reference };
        }
        self.window.remove(0);
        self.solution.covariances.remove(0);
    }
}
