//! The observations in canonical order, checked, and the unknowns on which each of them depends.
//!
//! Everything after this file works in the order view, body, camera, target. Sums are taken in this order, so that the answer is bit for bit
//! independent of the order of the input.

use super::{Observation, RigConfig, RigProblem};
use crate::least_squares::rig::{RigGraph, RigLink};
use crate::solve::configuration::check_numbers;
use crate::{Camera, Error, Point};

/// A rig problem, checked and in canonical order.
pub(super) struct Layout<'a> {
    pub(super) problem: &'a RigProblem<'a>,
    pub(super) reference: usize,
    /// In canonical order.
    pub(super) observations: Vec<&'a Observation>,
    /// The index of each of them in the input.
    pub(super) given_at: Vec<usize>,
    /// View and body of every body in a view.
    pub(super) bodies: Vec<(usize, usize)>,
    /// The first target on the body of each target; its frame is the body's.
    pub(super) first_target: Vec<usize>,
    /// Mean of the observed points of each target, target frame: the pivot of its small motions.
    pub(super) pivot_in_target: Vec<Point>,
    pub(super) graph: RigGraph,
}

impl<'a> Layout<'a> {
    pub(super) fn new(problem: &'a RigProblem<'a>, config: &RigConfig) -> Result<Self, Error> {
        check(problem, config)?;
        let (observations, given_at) = in_order(problem);
        let first_target = first_targets(problem.body_of_target);
        let pivot_in_target = pivots(&observations, problem.body_of_target.len());
        let (bodies, links) = links(&observations, problem.body_of_target);
        let is_seen = seen_targets(&observations, problem.body_of_target.len());
        check_targets(&is_seen, &first_target, problem.body_of_target)?;
        let n_cameras = problem.cameras.len();
        let mut blocks = 0..;
        let block_of_camera =
            (0..n_cameras).map(|c| if c == config.reference { None } else { blocks.next() }).collect();
        let is_free = |t: usize| is_seen[t] && first_target[t] != t;
        let block_of_target =
            (0..is_seen.len()).map(|t| if is_free(t) { blocks.next() } else { None }).collect();
        let first_of = |link: usize| pivot_in_target[first_target[observations[link].target]];
        let pivot_in_body = first_links(&links, bodies.len()).into_iter().map(first_of).collect();
        let is_active = vec![true; bodies.len()];
        let n_blocks = blocks.start;
        let graph = RigGraph { links, block_of_camera, block_of_target, n_blocks, pivot_in_body, is_active };
        let reference = config.reference;
        Ok(Layout {
            problem,
            reference,
            observations,
            given_at,
            bodies,
            first_target,
            pivot_in_target,
            graph,
        })
    }

    /// Returns the camera of an observation.
    pub(super) fn camera(&self, link: usize) -> &'a Camera {
        &self.problem.cameras[self.observations[link].camera]
    }

    /// Returns the observations of each body in each view, as ranges of canonical indices.
    pub(super) fn ranges(&self) -> Vec<core::ops::Range<usize>> {
        let mut ranges: Vec<core::ops::Range<usize>> = Vec::with_capacity(self.bodies.len());
        for (i, link) in self.graph.links.iter().enumerate() {
            match ranges.get_mut(link.body) {
                Some(range) => range.end = i + 1,
                None => ranges.push(i..i + 1),
            }
        }
        ranges
    }
}

fn check(problem: &RigProblem, config: &RigConfig) -> Result<(), Error> {
    config.loss.check()?;
    config.tolerance.check()?;
    let n_cameras = problem.cameras.len();
    if n_cameras == 0 || problem.observations.iter().all(|s| s.seen.is_empty()) {
        return Err(Error::EmptyRig);
    }
    if n_cameras <= config.reference {
        let (seen, needed) = (config.reference as f64, "it must be the index of a camera, counted from 0");
        return Err(Error::InvalidSetting { setting: "reference", seen, needed });
    }
    for (observation, s) in problem.observations.iter().enumerate() {
        let bounds = [
            ("camera", s.camera, n_cameras),
            ("view", s.view, problem.n_views),
            ("target", s.target, problem.body_of_target.len()),
        ];
        for (what, seen, n) in bounds {
            if n <= seen {
                return Err(Error::NoSuchIndex { observation, what, seen, n });
            }
        }
        let named = |reason| {
            let (camera, view, target) = (s.camera, s.view, s.target);
            Error::InvalidObservation { camera, view, target, reason: Box::new(reason) }
        };
        check_numbers(&s.seen).map_err(named)?;
    }
    check_distances(config, n_cameras)
}

fn check_distances(config: &RigConfig, n_cameras: usize) -> Result<(), Error> {
    let refused = |seen, needed| Err(Error::InvalidSetting { setting: "known_distances", seen, needed });
    for known in config.known_distances {
        if n_cameras <= known.a.max(known.b) || known.a == known.b {
            return refused(known.a.max(known.b) as f64, "it must name two different cameras");
        }
        if !(0.0 < known.distance_m && known.distance_m.is_finite()) {
            return refused(known.distance_m, "a distance must be positive");
        }
        if !(0.0 < known.sigma_m && (known.sigma_m * known.sigma_m).is_normal()) {
            return refused(known.sigma_m, "the standard deviation of a distance must be positive");
        }
    }
    Ok(())
}

/// Returns the observations with points, by view, body, camera, target; equal ones by their contents.
fn in_order<'a>(problem: &'a RigProblem<'a>) -> (Vec<&'a Observation>, Vec<usize>) {
    let mut order: Vec<usize> = (0..problem.observations.len()).collect();
    order.retain(|i| !problem.observations[*i].seen.is_empty());
    let key = |i: usize| {
        let s = &problem.observations[i];
        (s.view, problem.body_of_target[s.target], s.camera, s.target)
    };
    let by_contents =
        |a: usize, b: usize| contents(&problem.observations[a]).cmp(contents(&problem.observations[b]));
    order.sort_by(|a, b| key(*a).cmp(&key(*b)).then_with(|| by_contents(*a, *b)));
    (order.iter().map(|i| &problem.observations[*i]).collect(), order)
}

fn contents(s: &Observation) -> impl Iterator<Item = u64> + '_ {
    let numbers = |c: &crate::Correspondence| {
        let (x, u) = (c.x_in_target, c.pixel);
        [x.x, x.y, x.z, u.x, u.y, c.sigma_px, c.sigma_m].map(f64::to_bits)
    };
    s.seen.iter().flat_map(numbers)
}

/// Returns the lowest target of the same body, for each target.
fn first_targets(body_of_target: &[usize]) -> Vec<usize> {
    let mut firsts: Vec<(usize, usize)> = body_of_target.iter().copied().zip(0..).collect();
    firsts.sort_unstable();
    firsts.dedup_by_key(|(body, _)| *body);
    let first = |body: &usize| firsts.binary_search_by_key(body, |f| f.0).map_or(0, |i| firsts[i].1);
    body_of_target.iter().map(first).collect()
}

fn pivots(observations: &[&Observation], n_targets: usize) -> Vec<Point> {
    let mut sums = vec![(Point::zeros(), 0.0); n_targets];
    for s in observations {
        let sum = &mut sums[s.target];
        sum.0 += s.seen.iter().map(|c| c.x_in_target).sum::<Point>();
        sum.1 += s.seen.len() as f64;
    }
    sums.into_iter().map(|(sum, n)| sum / f64::max(n, 1.0)).collect()
}

fn links(observations: &[&Observation], body_of_target: &[usize]) -> (Vec<(usize, usize)>, Vec<RigLink>) {
    let mut bodies: Vec<(usize, usize)> = Vec::new();
    let mut links = Vec::with_capacity(observations.len());
    for s in observations {
        let body = (s.view, body_of_target[s.target]);
        if bodies.last() != Some(&body) {
            bodies.push(body);
        }
        links.push(RigLink { camera: s.camera, target: s.target, body: bodies.len() - 1 });
    }
    (bodies, links)
}

/// Returns the first observation of each body in a view.
fn first_links(links: &[RigLink], n_bodies: usize) -> Vec<usize> {
    let mut firsts = Vec::with_capacity(n_bodies);
    for (i, link) in links.iter().enumerate() {
        if link.body == firsts.len() {
            firsts.push(i);
        }
    }
    firsts
}

fn seen_targets(observations: &[&Observation], n_targets: usize) -> Vec<bool> {
    let mut is_seen = vec![false; n_targets];
    observations.iter().for_each(|s| is_seen[s.target] = true);
    is_seen
}

/// Refuses a body of several targets of which one is not observed, because its pose would be undetermined.
fn check_targets(is_seen: &[bool], first_target: &[usize], body_of_target: &[usize]) -> Result<(), Error> {
    for target in 0..is_seen.len() {
        let others = (0..is_seen.len()).any(|t| first_target[t] == first_target[target] && is_seen[t]);
        if !is_seen[target] && others {
            return Err(Error::TargetUnconnected { target, body: body_of_target[target] });
        }
    }
    Ok(())
}
