//! The consistency of the graph: the rule of `consistency`, applied to the residuals and to the pairs that contradict the others.

use super::noise::Noise;
use super::snooping::as_normal;
use super::{PairResult, PoseGraph, SUSPICIOUS};
use crate::budget::{Accounted, ErrorSource, Warning};
use crate::locate::consistency::{FAR_ABOVE, is_inconsistent, loses_too_many};

/// Why a graph contradicts itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GraphFault {
    /// The residuals are far above the stated standard deviations.
    Noise,
    /// More pairs contradict the others than a few bad calibrations explain.
    Pairs,
    /// Most pairs of a camera contradict the others, or its pairs are at least twice as wrong as all others.
    Camera,
    /// Loops of pairs do not close: the standard deviations estimated from them are no longer those of a calibration.
    Loops,
}

/// Something that is said against the poses of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GraphWarning {
    /// The pairs contradict each other.
    Fault(GraphFault),
    /// A pair contradicts the others and took no part.
    LeftOut(usize),
    /// A pair took part although it may be the wrong one of a loop.
    Undecided(usize),
}

impl Warning for GraphWarning {
    fn accounted(&self) -> Accounted {
        match self {
            GraphWarning::Fault(
                GraphFault::Noise | GraphFault::Pairs | GraphFault::Camera | GraphFault::Loops,
            ) => Accounted::Status,
            GraphWarning::LeftOut(_) => Accounted::Nothing,
            GraphWarning::Undecided(_) => Accounted::Parts(&[ErrorSource::Residuals]),
        }
    }
}

impl super::PoseGraphSolution {
    /// Returns what is said against the poses.
    pub fn warnings(&self) -> Vec<GraphWarning> {
        let suspicious = self.pairs.iter().enumerate().filter(|(_, pair)| pair.is_suspicious);
        let of_pair = suspicious.map(|(i, pair)| match pair.is_used {
            true => GraphWarning::Undecided(i),
            false => GraphWarning::LeftOut(i),
        });
        self.verdict.fault.map(GraphWarning::Fault).into_iter().chain(of_pair).collect()
    }
}

/// Whether the answer is consistent.
#[derive(Debug, Clone, PartialEq)]
pub struct GraphVerdict {
    /// The contradiction; none where the pairs agree.
    pub fault: Option<GraphFault>,
    /// The camera whose pairs disagree most, where there is a fault.
    pub worst_camera: Option<usize>,
    /// The pair that disagrees most, where there is a fault.
    pub worst_pair: Option<usize>,
    /// One entry for each camera: whether its own pairs contradict the others.
    pub is_contradicted: Vec<bool>,
}

/// Limit of an estimated rotation sigma, because sigmas estimated from the pairs adapt to any error. Eleven cameras of a room have 0.0022 rad
/// with right files, 0.072 rad with pairs written in the wrong direction.
const LOOSE_RAD: f64 = 0.035;
/// Limit of an estimated translation sigma over the median distance of the pairs' cameras: 0.003 at most with right files.
const LOOSE_SHARE: f64 = 0.02;
/// A pair with less redundancy than this cannot be tested.
const LEAST_REDUNDANCY: f64 = 1e-3;

pub(super) fn verdict(
    graph: &PoseGraph,
    pairs: &[PairResult],
    noise: &Noise,
    (chi2, degrees_of_freedom): (f64, usize),
) -> GraphVerdict {
    let contradicted = |camera: usize| {
        let own = || checked(pairs).filter(|i| touches(graph, *i, camera));
        loses_too_many(own().filter(|i| !pairs[*i].is_used).count(), own().count())
            || is_noisier(graph, (pairs, noise), camera)
    };
    let is_contradicted: Vec<bool> = (0..graph.n_cameras).map(contradicted).collect();
    let n_suspicious = pairs.iter().filter(|pair| pair.is_suspicious).count();
    let fault = match () {
        () if is_loose(graph, noise) => Some(GraphFault::Loops),
        () if !noise.is_estimated() && is_inconsistent(chi2, degrees_of_freedom) => Some(GraphFault::Noise),
        () if loses_too_many(n_suspicious, checked(pairs).count()) => Some(GraphFault::Pairs),
        () if is_contradicted.iter().any(|c| *c) => Some(GraphFault::Camera),
        () => None,
    };
    let worst = |n: usize, by: &dyn Fn(usize) -> f64| (0..n).max_by(|a, b| by(*a).total_cmp(&by(*b)));
    let of_pair = |i: usize| size(&pairs[i], noise);
    let of_camera = |camera: usize| {
        let own = checked(pairs).filter(|i| touches(graph, *i, camera));
        let (sum, n) = own.fold((0.0, 0.0), |(sum, n), i| (sum + of_pair(i), n + 1.0));
        sum / f64::max(n, 1.0)
    };
    GraphVerdict {
        fault,
        worst_camera: fault.and_then(|_| worst(graph.n_cameras, &of_camera)),
        worst_pair: fault.and_then(|_| worst(pairs.len(), &of_pair)),
        is_contradicted,
    }
}

/// Returns whether the pairs of a camera disagree by at least twice as much as all others, and beyond chance: docs/math/pose_graph.md eq. (13).
/// Pairs of which one is wrong, but nothing shows which, do not count: the answer contains that doubt.
fn is_noisier(graph: &PoseGraph, (pairs, noise): (&[PairResult], &Noise), camera: usize) -> bool {
    let counted = (0..pairs.len()).filter(|i| pairs[*i].is_used && !pairs[*i].is_suspicious);
    let (own, others): (Vec<usize>, Vec<usize>) = counted.partition(|i| touches(graph, *i, camera));
    let sums = |of: &[usize]| {
        of.iter().fold((0.0, 0.0), |(squares, redundancy), i| {
            let r = pairs[*i].residual;
            let squared = noise.information(*i).map_or(0.0, |information| r.dot(&(information * r)));
            (squares + squared, redundancy + pairs[*i].redundancy)
        })
    };
    let ((own, n_own), (others, n_others)) = (sums(&own), sums(&others));
    if !(1.0 < n_own && 1.0 < n_others) {
        return false;
    }
    let ratio = own / n_own / (others.max(LEAST_CHI2) / n_others);
    FAR_ABOVE <= ratio && SUSPICIOUS < as_normal(ratio, [n_own, n_others])
}

/// Below this χ² others agree exactly, but for rounding.
const LEAST_CHI2: f64 = 1e-3;

fn touches(graph: &PoseGraph, pair: usize, camera: usize) -> bool {
    graph.pairs[pair].a == camera || graph.pairs[pair].b == camera
}

/// Returns the pairs that others check.
fn checked(pairs: &[PairResult]) -> impl Iterator<Item = usize> {
    (0..pairs.len()).filter(|i| LEAST_REDUNDANCY < pairs[*i].redundancy)
}

/// Returns the squared residual in units of the median pair's sigmas where pairs state errors; otherwise the disagreement with the others.
fn size(pair: &PairResult, noise: &Noise) -> f64 {
    let squared = |from: usize| pair.residual.fixed_rows::<3>(from).norm_squared();
    match noise.median_sigma() {
        Some(sigma) => squared(0) / sigma.sigma_rad.powi(2) + squared(3) / sigma.sigma_m.powi(2),
        None => pair.disagreement_sigma.unwrap_or(0.0),
    }
}

fn is_loose(graph: &PoseGraph, noise: &Noise) -> bool {
    let Some(sigma) = noise.median_sigma().filter(|_| noise.is_estimated()) else { return false };
    let mut lengths: Vec<f64> = graph.pairs.iter().map(|pair| pair.b_from_a.translation.norm()).collect();
    lengths.sort_by(f64::total_cmp);
    let middle = lengths.get(lengths.len() / 2).copied().unwrap_or(0.0);
    LOOSE_RAD < sigma.sigma_rad || LOOSE_SHARE * middle < sigma.sigma_m
}
