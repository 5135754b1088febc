//! From rows to a chain: which samples are in contact, what holds at each, where the minimisation starts.

use super::batch::{Prior, Problem};
use super::chain::Local;
use super::node::{Instrument, Node, Role};
use super::roles::{self, Costs};
use super::start::{self, Goal};
use crate::contact::ByLoad;
use crate::estimate::FREE_CHI2;
use crate::{HubContact, PlanarPose, Sample};
use nalgebra::Vector3;

/// Friction angles known to less than this do not help to find μ, radians.
const USEFUL_ANGLE_RAD: f64 = 0.05;
/// Below this the friction angle is not distinguished from none before smoothing, radians.
const SLIPPERY_RAD: f64 = 0.01;

/// A contact sample before smoothing.
#[derive(Debug, Clone)]
pub struct Observed {
    /// Its row.
    pub row: usize,
    /// Its load, whitened.
    pub measured: Vector3<f64>,
    /// Its contact taken alone.
    pub raw: Option<(HubContact, ByLoad)>,
    /// What holds there.
    pub role: Role,
    /// Probability that it is at the tip, or not, as `role` says.
    pub probability: f64,
}

/// Consecutive samples of one sweep in contact.
pub type Run = Vec<Observed>;

/// Whether a reading says that something is touched.
pub fn touched(with: &Instrument, sample: &Sample) -> bool {
    let whitened = sample.load.to_vector().component_div(&with.load_sigma);
    FREE_CHI2 < whitened.norm_squared() && is_number(sample)
}

/// A sample in contact, its role still open.
pub fn see(with: &Instrument, row: usize, sample: &Sample) -> Observed {
    let measured = sample.load.to_vector().component_div(&with.load_sigma);
    Observed { row, measured, raw: with.contact(&measured), role: Role::Slides(1.0), probability: 1.0 }
}

/// The runs of a record.
pub fn runs(with: &Instrument, samples: &[Sample]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut open = false;
    for (row, sample) in samples.iter().enumerate() {
        open &= 0 < row && samples[row - 1].sweep == sample.sweep;
        if !touched(with, sample) {
            open = false;
            continue;
        }
        if !open {
            runs.push(Run::new());
        }
        if let Some(run) = runs.last_mut() {
            run.push(see(with, row, sample));
        }
        open = true;
    }
    runs
}

/// A first value of the friction angle: the median of what the samples short of the tip say, each by its weight.
pub fn first_friction_rad(with: &Instrument, runs: &[Run]) -> f64 {
    let mut angles: Vec<(f64, f64)> = runs
        .iter()
        .flatten()
        .filter_map(|seen| seen.raw.as_ref())
        .filter(|(at, by)| at.s_m + 3.0 * by.row(3).norm() < with.rod.length_m)
        .map(|(at, by)| (at.friction_angle_rad.abs(), by.row(4).norm()))
        .filter(|(_, sigma)| *sigma < USEFUL_ANGLE_RAD)
        .map(|(angle, sigma)| (angle, 1.0 / sigma))
        .collect();
    angles.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * angles.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    for (angle, weight) in angles {
        sum += weight;
        if half <= sum {
            // The median of |noise| is 0.67 standard deviations, none of it friction.
            return if angle < SLIPPERY_RAD.max(1.5 / weight) { 0.0 } else { angle };
        }
    }
    0.0
}

/// Decides the role of every sample of a run.
pub fn assign_roles(with: &Instrument, run: &mut Run, shared_rad: f64) {
    let costs: Vec<Costs> = run.iter().map(|seen| roles::costs(with, &seen.raw, shared_rad, 0.0)).collect();
    for (seen, (role, probability)) in run.iter_mut().zip(roles::decide(&costs, shared_rad != 0.0)) {
        (seen.role, seen.probability) = (role, probability);
    }
}

/// Where along the whisker a sample touches, from the nearest sample of its run that says so.
fn position_m(with: &Instrument, run: &Run, index: usize) -> Option<f64> {
    let clear = |seen: &Observed| match &seen.raw {
        Some((at, by)) if by.row(3).norm() < start::WEAK * with.rod.length_m => Some(at.s_m),
        _ => None,
    };
    if clear(&run[index]).is_some() {
        return None;
    }
    let distance = |i: usize| i.abs_diff(index);
    let mut near: Vec<usize> = (0..run.len()).filter(|&i| clear(&run[i]).is_some()).collect();
    near.sort_by_key(|&i| distance(i));
    // Three of them: one alone may be off by its noise.
    let places: Vec<f64> = near.iter().take(3).filter_map(|&i| clear(&run[i])).collect();
    let mean = places.iter().sum::<f64>() / places.len().max(1) as f64;
    let s_m = if places.is_empty() { 0.6 * with.rod.length_m } else { mean };
    Some(s_m.min(0.98 * with.rod.length_m))
}

/// A starting value of the load of sample `index` of a run.
pub fn start_of(with: &Instrument, run: &Run, index: usize, shared_rad: f64) -> Option<Vector3<f64>> {
    let seen = &run[index];
    let goal = Goal { role: seen.role, shared_rad, s_m: position_m(with, run, index) };
    start::load(with, &seen.measured, &goal)
}

/// How far noise of the hub's pose moves a contact across the whisker, metres.
pub fn offset_sigma_m(with: &Instrument, whitened: &Vector3<f64>, fresh_angle: bool) -> f64 {
    let Some((at, _)) = with.contact(whitened) else { return with.xy_sigma_m.max(f64::MIN_POSITIVE) };
    let lever = at.x_in_hub.dot(&super::node::direction(at.theta_rad));
    let angle = if fresh_angle { with.angle_sigma_rad } else { with.angle_noise_rad };
    with.xy_sigma_m.hypot(angle * lever).max(1e-4 * super::envelope::FLOOR_M)
}

/// The node of a sample and its starting value; none where no load near the one read has a contact.
pub fn node(
    with: &Instrument,
    run: &Run,
    index: usize,
    hub: PlanarPose,
    fresh_angle: bool,
    shared_rad: f64,
) -> Option<(Node, Local)> {
    let seen = &run[index];
    let start = start_of(with, run, index, shared_rad)?;
    let offset_sigma_m = offset_sigma_m(with, &start, fresh_angle);
    let side = if start.z < 0.0 { -1.0 } else { 1.0 };
    let node = Node { hub, measured: seen.measured, side, role: seen.role, offset_sigma_m, fresh_angle };
    Some((node, start.push(0.0)))
}

/// The node of the moment of touch between the sample before a run and its first contact at `s_m`.
pub fn touch_node(with: &Instrument, before: PlanarPose, first: &Node, s_m: f64) -> (Node, Local) {
    let start = Local::new(0.0, (s_m / with.rod.length_m).clamp(0.02, 1.0) * 2.0 - 1.0, 0.0, 0.0);
    let node = Node { measured: Vector3::zeros(), role: Role::Touch { before }, ..*first };
    (node, start)
}

/// A chain of all runs, and the row and sample every node stands for (none of a touch or a sample left out).
pub struct Chained<'a> {
    /// The chain.
    pub problem: Problem<'a>,
    /// Run and sample within it of every node; none of a touch.
    pub place: Vec<Option<(usize, usize)>>,
}

/// Puts the runs into one chain.
pub fn chain<'a>(
    with: &'a Instrument,
    samples: &[Sample],
    runs: &[Run],
    prior: Prior,
    shared_rad: f64,
) -> Chained<'a> {
    let problem =
        Problem { with, nodes: Vec::new(), linked: Vec::new(), states: Vec::new(), shared_rad, prior };
    let mut out = Chained { problem, place: Vec::new() };
    for (number, run) in runs.iter().enumerate() {
        out.add_run(samples, number, run);
    }
    out
}

impl Chained<'_> {
    fn push(&mut self, node: Node, state: Local, place: Option<(usize, usize)>, linked: bool) {
        if let Some(last) = self.problem.linked.last_mut() {
            *last = linked;
        }
        self.problem.nodes.push(node);
        self.problem.states.push(state);
        self.problem.linked.push(false);
        self.place.push(place);
    }

    fn add_run(&mut self, samples: &[Sample], number: usize, run: &Run) {
        let (with, shared_rad) = (self.problem.with, self.problem.shared_rad);
        let mut linked = false;
        for index in 0..run.len() {
            let row = run[index].row;
            let fresh = fresh_angle(samples, row);
            let hub = samples[row].world_from_hub;
            let Some((node, state)) = self::node(with, run, index, hub, fresh, shared_rad) else {
                linked = false;
                continue;
            };
            if index == 0
                && let Some(before) = free_before(with, samples, row)
                && let Some((at, _)) = with.contact(&state.xyz())
            {
                let (touch, start) = touch_node(with, before, &node, at.s_m);
                self.push(touch, start, None, false);
                linked = true;
            }
            self.push(node, state, Some((number, index)), linked);
            linked = true;
        }
    }
}

/// Whether the reading of the hub's angle differs from a neighbour's in the same sweep.
fn fresh_angle(samples: &[Sample], row: usize) -> bool {
    let here = &samples[row];
    [row.wrapping_sub(1), row + 1].iter().filter_map(|&i| samples.get(i)).any(|other| {
        other.sweep == here.sweep && other.world_from_hub.angle_rad != here.world_from_hub.angle_rad
    })
}

/// The hub at the sample before `row`, where it belongs to the same sweep (and so touches nothing: a run starts here).
fn free_before(with: &Instrument, samples: &[Sample], row: usize) -> Option<PlanarPose> {
    let before = samples.get(row.checked_sub(1)?)?;
    let here = before.sweep == samples[row].sweep && is_number(before) && !touched(with, before);
    here.then_some(before.world_from_hub)
}

/// Whether load and pose are numbers.
pub fn is_number(sample: &Sample) -> bool {
    let pose = sample.world_from_hub;
    sample.load.is_finite() && [pose.x_m, pose.y_m, pose.angle_rad].iter().all(|v| v.is_finite())
}
