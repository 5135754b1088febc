//! The joint adjustment: first under a robust loss, then by maximum likelihood from the points that fit.
//!
//! docs/math/rig.md section 5.

use super::RigConfig;
use super::classify::{Parts, Residuals, parts, residuals, robust_variance};
use super::distance::add_distances;
use super::layout::Layout;
use super::sighted::{CAUCHY_SIGMAS, LocatedViews, enough};
use super::start::{UNOBSERVED_CHI2, best_of_body, best_of_target, check_joined, check_targets_joined};
use crate::least_squares::rig::{RigEquations, RigGraph, RigMinimum, RigPoses, minimize_rig};
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::accumulate::normal_equations;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
use crate::{Camera, Correspondence, Error, Point, Pose};
use std::borrow::Cow;

/// The minimum, and the points that took part.
#[derive(Clone)]
pub(super) struct Adjusted {
    pub(super) places: RigPoses,
    pub(super) equations: RigEquations,
    pub(super) graph: RigGraph,
    pub(super) parts: Parts,
    pub(super) residuals: Vec<Residuals>,
    /// Variance of the inner half of the points, in units of the stated one, at least 1: it widens the gate.
    pub(super) variance: f64,
    pub(super) steps: usize,
}

/// Largest number of rounds of selecting points; each lowers the truncated cost, two or three are usual.
const MAX_ROUNDS: usize = 20;
/// Largest number of times that targets with several poses are turned to another one.
const MAX_TURNS: usize = 3;
/// Tolerance of the rough minimum before the points are selected.
const ROUGH: f64 = 1e-4;

/// The points that take part, for each observation.
pub(super) type Active<'a> = Vec<Cow<'a, [Correspondence]>>;

struct Adjustment<'a> {
    layout: &'a Layout<'a>,
    located_views: &'a LocatedViews,
    config: &'a RigConfig<'a>,
    graph: RigGraph,
    places: RigPoses,
    /// The residuals at `places`.
    residuals: Vec<Residuals>,
    steps: usize,
}

/// Returns whether the solution is the minimum of a sum of squares; otherwise wrong points would bias the score of a lens.
pub(super) fn keeps_minimum(loss: Loss) -> bool {
    matches!(loss, Loss::Squared | Loss::Truncated { .. })
}

/// # Errors
/// `NotConverged`; `CamerasUnconnected` when only contradicting observations joined the cameras.
pub(super) fn adjust(
    layout: &Layout,
    located_views: &LocatedViews,
    places: RigPoses,
    config: &RigConfig,
) -> Result<Adjusted, Error> {
    let mut graph = layout.graph.clone();
    for (body, range) in layout.ranges().into_iter().enumerate() {
        graph.is_active[body] = range.into_iter().any(|i| located_views[i].is_ok());
    }
    let residuals = residuals(layout, &places, &graph.is_active);
    let mut adjustment = Adjustment { layout, located_views, config, graph, places, residuals, steps: 0 };
    adjustment.approach()?;
    adjustment.look_around();
    for _ in 0..MAX_TURNS {
        if !adjustment.look_at_targets() {
            break;
        }
        adjustment.approach()?;
        adjustment.look_around();
    }
    adjustment.settle()
}

impl<'a> Adjustment<'a> {
    fn move_to(&mut self, places: RigPoses) {
        self.places = places;
        self.residuals = residuals(self.layout, &self.places, &self.graph.is_active);
    }

    /// Returns the variance of the inner half of the points, in units of the stated one, at least 1.
    fn variance(&self) -> f64 {
        let n_active = self.graph.is_active.iter().filter(|a| **a).count();
        let unknown = 6 * (self.graph.n_blocks + n_active);
        robust_variance(&self.residuals, unknown).max(1.0)
    }

    /// Minimises Cauchy's loss, at first as wide as the initial residuals, then narrowed to the variance of the points' inner half. Some points
    /// of a large observation suffice: the remaining error vanishes in one step of the final adjustment.
    fn approach(&mut self) -> Result<(), Error> {
        let mut sigmas = f64::INFINITY;
        for _ in 0..MAX_ROUNDS {
            let next = CAUCHY_SIGMAS * self.variance().sqrt();
            if 0.8 * sigmas < next {
                break;
            }
            sigmas = next;
            let active: Active = self.layout.observations.iter().map(|s| enough(&s.seen)).collect();
            let found = self.minimize(&active, Loss::Cauchy { sigmas }, ROUGH)?;
            // A state in a flat valley is good enough as an initial value.
            self.move_to(found.state);
        }
        Ok(())
    }

    /// Replaces the pose of a body in a view where another one, suggested by an observation, fits better with the cameras found.
    fn look_around(&mut self) {
        let layout = self.layout;
        let targets = self.places.body_from_target.iter().zip(&layout.pivot_in_target);
        let body_from_target: Vec<Pose> = targets.map(|(place, pivot)| place.pose(pivot)).collect();
        let judged = self.parts(self.variance());
        let mut places = self.places.clone();
        let mut is_moved = false;
        for (body, range) in layout.ranges().into_iter().enumerate() {
            let pivot = &layout.graph.pivot_in_body[body];
            if !range.clone().any(|i| judged.rejected[i].is_some()) || !self.graph.is_active[body] {
                continue;
            }
            let present = self.places.rig_from_body[body].pose(pivot);
            let cam_from_rig = &self.places.cam_from_rig;
            let best = best_of_body(
                range,
                layout,
                self.located_views,
                cam_from_rig,
                &body_from_target,
                Some(present),
            );
            if let Some(best) = best.filter(|b| *b != present) {
                places.rig_from_body[body] = PivotedPose::new(&best, pivot);
                is_moved = true;
            }
        }
        if is_moved {
            self.move_to(places);
        }
    }

    /// Replaces the pose of a target on its body where another one, suggested by an observation, fits better with the cameras and bodies found, as
    /// for a tag that is first placed by the wrong one of its two poses. Returns whether there was any.
    fn look_at_targets(&mut self) -> bool {
        let layout = self.layout;
        let judged = self.parts(self.variance());
        let mut places = self.places.clone();
        let mut is_moved = false;
        for target in 0..layout.first_target.len() {
            let own = |i: &usize| layout.observations[*i].target == target;
            let own: Vec<usize> = (0..layout.observations.len()).filter(own).collect();
            let is_doubtful = own.iter().any(|i| judged.rejected[*i].is_some());
            if !is_doubtful || layout.graph.block_of_target[target].is_none() {
                continue;
            }
            let pivot = &layout.pivot_in_target[target];
            let present = self.places.body_from_target[target].pose(pivot);
            let rig_from_body = |i: usize| {
                let body = layout.graph.links[i].body;
                self.graph.is_active[body]
                    .then(|| self.places.rig_from_body[body].pose(&layout.graph.pivot_in_body[body]))
            };
            let cam_from_body: Vec<(usize, Pose)> = own
                .iter()
                .filter_map(|i| {
                    Some((*i, self.places.cam_from_rig[layout.observations[*i].camera] * rig_from_body(*i)?))
                })
                .collect();
            let best = best_of_target(&cam_from_body, layout, self.located_views, present);
            if best != present {
                places.body_from_target[target] = PivotedPose::new(&best, pivot);
                is_moved = true;
            }
        }
        if is_moved {
            self.move_to(places);
        }
        is_moved
    }

    /// Selects the points that take part under the configured loss.
    fn parts(&self, variance: f64) -> Parts {
        let gate_chi2 = match self.config.loss {
            Loss::Truncated { sigmas } => sigmas * sigmas * variance,
            _ => f64::INFINITY,
        };
        parts(&self.residuals, gate_chi2, self.layout, self.located_views, &self.graph.is_active)
    }

    /// Minimises over the points that take part, until that set no longer changes.
    fn settle(mut self) -> Result<Adjusted, Error> {
        let loss = settled_loss(self.config.loss);
        let variance = self.variance();
        let mut parts = self.parts(variance);
        for _ in 0..MAX_ROUNDS {
            self.graph.is_active.clone_from(&parts.is_active);
            check_joined(self.layout, |i| 0 < parts.n_used(i))?;
            check_targets_joined(self.layout, |i| 0 < parts.n_used(i))?;
            let found = self.minimize(&active(self.layout, &parts), loss, 0.0)?;
            if self.drop_undetermined(&found.equations, &mut parts) {
                continue;
            }
            if !found.is_minimum() {
                break;
            }
            self.move_to(found.state);
            let next = self.parts(variance);
            let is_settled = next.is_used == parts.is_used;
            parts = next;
            if is_settled {
                return Ok(self.adjusted(found.equations, parts, variance));
            }
        }
        Err(Error::NotConverged { steps: self.steps })
    }

    /// Removes bodies in views whose pose the remaining points do not determine; returns whether there were any.
    fn drop_undetermined(&self, equations: &RigEquations, parts: &mut Parts) -> bool {
        let undetermined = |body: &usize| parts.is_active[*body] && !equations.determines(*body);
        let bodies: Vec<usize> = (0..parts.is_active.len()).filter(undetermined).collect();
        if bodies.is_empty() {
            return false;
        }
        let ranges = self.layout.ranges();
        for body in bodies {
            parts.is_active[body] = false;
            parts.drop_body(ranges[body].clone(), self.located_views);
        }
        true
    }

    fn adjusted(self, equations: RigEquations, parts: Parts, variance: f64) -> Adjusted {
        let Adjustment { graph, places, residuals, steps, .. } = self;
        Adjusted { places, equations, graph, parts, residuals, variance, steps }
    }

    fn minimize(&mut self, active: &Active, loss: Loss, tolerance: f64) -> Result<RigMinimum, Error> {
        let (layout, graph, config) = (self.layout, &self.graph, self.config);
        let normal = |i: usize, place: &PivotedPose| {
            let problem = Problem { loss, ..Problem::new(&active[i], layout.camera(i)) };
            sums(place, &layout.pivot_in_target[layout.observations[i].target], &problem)
        };
        let evaluate = |places: &RigPoses| {
            let mut equations = RigEquations::new(places, graph, normal)?;
            add_distances(&mut equations, config.known_distances, places, graph);
            Some(equations)
        };
        let found = minimize_rig(self.places.clone(), graph, tolerance, evaluate);
        let found = found.ok_or(Error::NoSolution { n_points: active.iter().map(|a| a.len()).sum() })?;
        self.steps += found.steps;
        Ok(found)
    }
}

/// Returns the loss of the points that take part.
pub(super) fn settled_loss(configured: Loss) -> Loss {
    if let Loss::Truncated { .. } = configured { Loss::Squared } else { configured }
}

/// Returns the points that take part, borrowed where all of them do.
pub(super) fn active<'a>(layout: &Layout<'a>, parts: &Parts) -> Active<'a> {
    let of_observation = |(s, used): (&&'a super::Observation, &Vec<bool>)| {
        if used.iter().all(|u| *u) {
            return Cow::Borrowed(&s.seen[..]);
        }
        Cow::Owned(s.seen.iter().zip(used).filter(|(_, u)| **u).map(|(c, _)| *c).collect())
    };
    layout.observations.iter().zip(&parts.is_used).map(of_observation).collect()
}

/// Returns the sums of one observation. Under a robust loss a point that cannot be projected costs as much as one far off and has no gradient;
/// under the square such a point occurs only after a step that went too far.
fn sums(place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<NormalEquations> {
    let whole = normal_equations(place, pivot, problem);
    if whole.is_some() || problem.loss == Loss::Squared {
        return whole;
    }
    let mut sums = NormalEquations::zero();
    for c in problem.seen {
        match alone(c, problem.camera, problem.loss, place, pivot) {
            Some(one) => sums.merge(&one),
            None => sums.chi2 += problem.loss.at(UNOBSERVED_CHI2).0,
        }
    }
    Some(sums)
}

fn alone(
    c: &Correspondence,
    camera: &Camera,
    loss: Loss,
    place: &PivotedPose,
    pivot: &Point,
) -> Option<NormalEquations> {
    let problem = Problem { loss, ..Problem::new(core::slice::from_ref(c), camera) };
    normal_equations(place, pivot, &problem)
}
