//! Where a run of contacts passes from mid-whisker to the tip, or back. Each sample alone knows its arc length to a millimetre;
//! the smoothed neighbours know better. Borders are tried a few samples to either side and judged by the sum of squares and by
//! what no outline can do; what remains undecided widens the covariance.
//!
//! Derivation: docs/math/whisker_sweep.md, section 6.

use super::batch::{Prior, Problem, Smoothed};
use super::node::{Role, direction, left_of};
use super::start::{self, Goal};
use nalgebra::{Matrix3, Vector3};
use std::ops::Range;

/// By how many samples a border is moved at a time.
const SHIFTS: [usize; 4] = [1, 2, 4, 8];
/// A run may end at the tip where its last contact is within this share of the length of it.
pub const NEAR_TIP: f64 = 0.02;
/// Contacts this far from a border are judged, and compared with as many again to either side.
const REACH: usize = 12;
/// What a contact outside of its neighbours' tangents counts at most: an object that is not convex does that rightly.
const OUTSIDE_AT_MOST: f64 = 25.0;
/// A border is moved for this much in χ²; less is doubt, and could move it to and fro.
const BETTER: f64 = 0.5;
/// Alternatives that fit worse by this much in χ² are no alternatives: odds of 1 to 3 000.
const NO_ALTERNATIVE: f64 = 16.0;

/// What a border left undecided means for one node.
#[derive(Debug, Clone, Copy)]
pub struct Undecided {
    /// Mean square of `[x, y, θ]` about the better answer, m², m·rad, rad².
    pub spread: Matrix3<f64>,
    /// Probability that the node's role is right.
    pub probability: f64,
}

/// Nodes `changed` take `role`.
#[derive(Debug, Clone)]
struct Change {
    changed: Range<usize>,
    role: Role,
}

/// A stretch of linked nodes cut out of a chain.
struct Trial<'a> {
    part: Problem<'a>,
    smoothed: Smoothed,
    cost: f64,
}

/// Moves one border to where it fits better; whether one was moved. The chain is to be minimised again after.
pub fn improve(problem: &mut Problem, now: &Smoothed) -> bool {
    for change in changes(problem, now) {
        let stretch = stretch(problem, change.changed.start);
        let Some(as_is) = trial(problem, now, &stretch, None) else { continue };
        let Some(moved) = trial(problem, now, &stretch, Some(&change)) else { continue };
        if moved.cost < as_is.cost - BETTER {
            problem.nodes[stretch.clone()].copy_from_slice(&moved.part.nodes);
            problem.states[stretch].copy_from_slice(&moved.part.states);
            return true;
        }
    }
    false
}

/// What the borders leave undecided, node by node, eq. (18).
pub fn undecided(problem: &Problem, now: &Smoothed) -> Vec<Undecided> {
    let mut undecided = vec![Undecided { spread: Matrix3::zeros(), probability: 1.0 }; problem.nodes.len()];
    for change in changes(problem, now) {
        let stretch = stretch(problem, change.changed.start);
        let Some(as_is) = trial(problem, now, &stretch, None) else { continue };
        let Some(moved) = trial(problem, now, &stretch, Some(&change)) else { continue };
        let worse = (moved.cost - as_is.cost).max(0.0);
        if NO_ALTERNATIVE < worse {
            continue;
        }
        let odds = (-0.5 * worse).exp();
        let share = odds / (1.0 + odds);
        for (k, i) in stretch.clone().enumerate() {
            let (a, b) = (&as_is.smoothed.linear[k], &moved.smoothed.linear[k]);
            let turn = match (&a.contact, &b.contact) {
                (Some((a, _)), Some((b, _))) => b.theta_rad - a.theta_rad,
                _ => 0.0,
            };
            let off = (b.x - a.x).push(turn);
            undecided[i].spread += off * off.transpose() * share;
        }
        for i in change.changed {
            undecided[i].probability *= 1.0 - share;
        }
    }
    undecided
}

fn is_tip(role: &Role) -> bool {
    *role == Role::Tip
}

fn is_touch(role: &Role) -> bool {
    matches!(role, Role::Touch { .. })
}

/// The linked nodes around `node`, without a touch.
fn stretch(problem: &Problem, node: usize) -> Range<usize> {
    let (mut first, mut end) = (node, node + 1);
    while 0 < first
        && problem.linked[first - 1]
        && !is_touch(&problem.nodes[first - 1].role)
        && node - first < 3 * REACH
    {
        first -= 1;
    }
    while end < problem.nodes.len() && problem.linked[end - 1] && end - node < 3 * REACH {
        end += 1;
    }
    first..end
}

/// Every change worth a trial.
fn changes(problem: &Problem, now: &Smoothed) -> Vec<Change> {
    let mut out = Vec::new();
    let role = |i: usize| problem.nodes[i].role;
    for i in 0..problem.nodes.len() {
        let linked = problem.linked[i] && i + 1 < problem.nodes.len();
        if is_touch(&role(i)) {
            continue;
        }
        let stretch = stretch(problem, i);
        if linked && is_tip(&role(i)) != is_tip(&role(i + 1)) {
            for shift in SHIFTS {
                out.push(Change {
                    changed: (i + 1).saturating_sub(shift).max(stretch.start)..i + 1,
                    role: role(i + 1),
                });
                out.push(Change { changed: i + 1..(i + 1 + shift).min(stretch.end), role: role(i) });
            }
        }
        let ends = i == stretch.start || i + 1 == stretch.end;
        if ends && !is_tip(&role(i)) && near_tip(problem, now, i) {
            out.push(Change { changed: i..i + 1, role: Role::Tip });
        }
        if ends && is_tip(&role(i)) {
            out.push(Change { changed: i..i + 1, role: neighbour_mid(problem, i) });
        }
    }
    out
}

/// The role of the nearest node between clamp and tip of the same stretch.
fn neighbour_mid(problem: &Problem, i: usize) -> Role {
    let mut mids: Vec<usize> = stretch(problem, i).filter(|&j| !is_tip(&problem.nodes[j].role)).collect();
    mids.sort_by_key(|&j| j.abs_diff(i));
    mids.first().map_or(Role::Slides(1.0), |&j| problem.nodes[j].role)
}

fn near_tip(problem: &Problem, now: &Smoothed, i: usize) -> bool {
    let length = problem.with.rod.length_m;
    now.linear[i].contact.as_ref().is_some_and(|(at, _)| (at.s_m - length).abs() < NEAR_TIP * length)
}

/// A stretch minimised by itself, the friction angle as the whole chain knows it.
fn trial<'a>(
    problem: &Problem<'a>,
    now: &Smoothed,
    stretch: &Range<usize>,
    change: Option<&Change>,
) -> Option<Trial<'a>> {
    let sigma_rad = now.solution.shared_variance.sqrt();
    let mut part = Problem {
        with: problem.with,
        nodes: problem.nodes[stretch.clone()].to_vec(),
        linked: problem.linked[stretch.clone()].to_vec(),
        states: problem.states[stretch.clone()].to_vec(),
        shared_rad: problem.shared_rad,
        prior: Prior { angle_rad: problem.shared_rad, sigma_rad },
    };
    if let Some(change) = change {
        for i in change.changed.clone() {
            let k = i.checked_sub(stretch.start)?;
            part.nodes[k].role = change.role;
            let goal = Goal { role: change.role, shared_rad: part.shared_rad, s_m: None };
            part.states[k] = start::load(problem.with, &part.nodes[k].measured, &goal)?.push(0.0);
        }
    }
    let smoothed = part.minimise()?;
    let cost = smoothed.chi2 + beyond(&part, &smoothed) + outside(&part, &smoothed);
    Some(Trial { part, smoothed, cost })
}

/// χ² of contacts between clamp and tip that lie beyond the tip.
fn beyond(part: &Problem, smoothed: &Smoothed) -> f64 {
    let length = part.with.rod.length_m;
    let square = |i: usize| {
        let (at, by) = smoothed.linear[i].contact.as_ref()?;
        let by = by.row(3).transpose().push(0.0);
        let variance = by.dot(&(smoothed.solution.covariances[i] * by));
        (!is_tip(&part.nodes[i].role))
            .then(|| (at.s_m - length).max(0.0).powi(2) / variance.max(f64::MIN_POSITIVE))
    };
    (0..part.nodes.len()).filter_map(square).sum()
}

/// χ² of contacts that lie on the whisker's side of another contact's tangent, eq. (17): no convex object does.
fn outside(part: &Problem, smoothed: &Smoothed) -> f64 {
    let count = part.nodes.len();
    let worst = |i: usize| {
        (i.saturating_sub(3 * REACH)..(i + 3 * REACH).min(count))
            .map(|j| {
                let (here, there) = (&smoothed.linear[i], &smoothed.linear[j]);
                let out = left_of(direction(there.alpha_rad)) * part.nodes[j].side;
                let sigma = part.nodes[i].offset_sigma_m.hypot(part.nodes[j].offset_sigma_m);
                out.dot(&(here.x - there.x)).max(0.0) / sigma
            })
            .fold(0.0, f64::max)
    };
    (0..count).map(|i| worst(i).powi(2).min(OUTSIDE_AT_MOST)).fold(0.0, f64::max)
}

impl Undecided {
    /// No doubt at all.
    pub fn none() -> Self {
        Undecided { spread: Matrix3::zeros(), probability: 1.0 }
    }

    /// Mean square along a direction of `[x, y, θ]`.
    pub fn along(&self, by: &Vector3<f64>) -> f64 {
        by.dot(&(self.spread * by))
    }
}
