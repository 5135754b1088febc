//! Finds the views that agree, and a start: closed forms of three views each, and the one with which most views agree.
//!
//! Least trimmed squares (P. J. Rousseeuw and K. Van Driessen, "Computing LTS regression for large data sets", 2006), then a test of every view
//! against the prediction from the others. docs/math/hand_eye.md section 5.

use super::closed_form::{Parallel, ViewCandidate, closed_forms};
use super::cost::{Fit, Level, besides, fit, nearest, spread};
use super::motions::are_parallel;
use super::noise::{Variances, assume, from_middle, is_open, nominal, reml, rows};
use super::views::{Known, Poses, centre};
use super::{HandEyeConfig, Height};
use crate::Error;
use crate::statistics::SplitMix64;
use nalgebra::DMatrix;

/// The views that agree, with their candidates.
pub(super) struct Consensus {
    pub poses: Poses,
    /// The candidate of each view; `None` where it contradicts the others.
    pub candidate: Vec<Option<usize>>,
}

impl Consensus {
    /// Returns pairs of view and candidate.
    pub fn used(&self) -> Vec<(usize, usize)> {
        self.candidate.iter().enumerate().filter_map(|(view, c)| c.map(|c| (view, c))).collect()
    }
}

/// Number of triples tried: with half of the views wrong and two candidates in each of the others, one in 64 is right, and all 600 are wrong
/// with a probability of 8e-5.
const MAX_TRIPLES: usize = 600;
/// Number of views on which a triple is tested.
const MAX_TRIED: usize = 60;
/// Number of triples that enter the trimmed fit.
const FINALISTS: usize = 5;
/// Number of rounds of fitting the best half and selecting it again.
const TRIMMING_ROUNDS: usize = 4;
/// χ² with six degrees of freedom that a good view exceeds once in ten thousand.
const GATE_CHI2: f64 = 27.86;
/// Median of χ² with six degrees of freedom.
const MEDIAN_CHI2: f64 = 5.348;
/// Number of rounds of including and excluding views.
const MAX_ROUNDS: usize = 20;
/// Seed of the triples: the same views give the same answer.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// Returns X, Z and the views that agree; where the gripper's noise is unknown, it is estimated from these views.
///
/// # Errors
/// `NotConverged` when no triple leads to an answer.
pub(super) fn consensus(known: &mut [Known], config: &HandEyeConfig) -> Result<Consensus, Error> {
    assume(known, &nominal(known));
    let best = started(known, config)?;
    agreeing(known, best, config)
}

/// Returns the best half of the views, from triples.
fn started(known: &[Known], config: &HandEyeConfig) -> Result<Fit, Error> {
    let parallel = parallel(known, config);
    let mut found: Vec<(f64, Poses)> = Vec::new();
    for triple in triples(known) {
        let station = |(view, candidate): (usize, usize)| ViewCandidate {
            cam_from_target: known[view].candidates[candidate].cam_from_target,
            carrier_from_holder: known[view].carrier_from_holder,
        };
        for poses in closed_forms(&triple.map(station), parallel.as_ref()) {
            let score = trimmed(&distances(known, &poses, known.len().div_ceil(MAX_TRIED)));
            let at = found.partition_point(|(better, _)| *better <= score);
            if at < FINALISTS && score.is_finite() {
                found.insert(at, (score, poses));
                found.truncate(FINALISTS);
            }
        }
    }
    let concentrated = found.iter().filter_map(|(_, poses)| concentrated(known, poses, config).ok());
    let best = concentrated.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or(Error::NotConverged { steps: 0 })?;
    Ok(best.1)
}

/// Returns the settings for triples if all rotations have one axis.
fn parallel(known: &[Known], config: &HandEyeConfig) -> Option<Parallel> {
    let height = config.height.filter(|_| are_parallel(known))?;
    let height_m = centre(known).height_m(&height.direction_in_carrier.normalize(), height.height_m);
    Some(Parallel { height: Height { height_m, ..height } })
}

/// Returns χ² of each view (every `stride`-th) with the candidate that agrees best, in ascending order.
fn distances(known: &[Known], poses: &Poses, stride: usize) -> Vec<(f64, usize, usize)> {
    let distance = |view: usize| {
        let (candidate, chi2) = nearest(&known[view], poses);
        (chi2, view, candidate)
    };
    let mut all: Vec<_> = (0..known.len()).step_by(stride.max(1)).map(distance).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all
}

/// Returns the number of views in the trimmed fit: slightly more than half.
fn majority(n: usize) -> usize {
    n.min((n + 3) / 2)
}

/// Returns χ² of the worst view of the better half.
fn trimmed(sorted: &[(f64, usize, usize)]) -> f64 {
    sorted.get(majority(sorted.len()).saturating_sub(1)).map_or(f64::INFINITY, |d| d.0)
}

/// Alternates between fitting the best half and selecting it.
fn concentrated(known: &[Known], start: &Poses, config: &HandEyeConfig) -> Result<(f64, Fit), Error> {
    let mut poses = *start;
    for round in 1.. {
        let best = distances(known, &poses, 1);
        let used = best[..majority(known.len())]
            .iter()
            .map(|(_, view, candidate)| (*view, *candidate))
            .collect::<Vec<_>>();
        let fit = fit(&poses, known, &used, config, Level::Poses)?;
        poses = fit.poses;
        if TRIMMING_ROUNDS <= round {
            return Ok((trimmed(&distances(known, &poses, 1)), fit));
        }
    }
    Err(Error::NotConverged { steps: 0 })
}

/// Includes every view that agrees with the others, until nothing changes. Where the gripper's noise is unknown, it is first estimated from the
/// middle residuals, then from the views that agree.
fn agreeing(known: &mut [Known], start: Fit, config: &HandEyeConfig) -> Result<Consensus, Error> {
    let mut best = start;
    if is_open(known) {
        let theta = middle_noise(known, &best.poses);
        assume(known, &theta);
        best = concentrated(known, &best.poses, config)?.1;
    }
    let in_fit: Vec<usize> =
        distances(known, &best.poses, 1)[..majority(known.len())].iter().map(|d| d.1).collect();
    let mut candidate: Vec<Option<usize>> = (0..known.len())
        .map(|view| in_fit.contains(&view).then(|| nearest(&known[view], &best.poses).0))
        .collect();
    for round in 0..MAX_ROUNDS {
        let is_rough = is_open(known) && round < ROUGH_ROUNDS;
        if is_rough {
            let theta = middle_noise(known, &best.poses);
            assume(known, &theta);
        }
        let scale = f64::max(1.0, trimmed(&distances(known, &best.poses, 1)) / MEDIAN_CHI2);
        let outside = match is_open(known) {
            true => gate_outside(candidate.iter().flatten().count()),
            false => GATE_CHI2,
        };
        let agrees = |view: usize| {
            agrees(&known[view], &best, candidate[view].is_some(), [scale * GATE_CHI2, scale * outside])
        };
        let now: Vec<Option<usize>> = (0..known.len()).map(agrees).collect();
        let is_settled = now == candidate && !is_rough;
        candidate = now;
        let consensus = Consensus { poses: best.poses, candidate: candidate.clone() };
        if is_settled || consensus.used().len() < 3 {
            return Ok(consensus);
        }
        let is_next_rough = round + 1 < ROUGH_ROUNDS;
        best = match is_open(known) && !is_next_rough {
            true => fit_with_noise(&best.poses, known, &consensus.used(), config)?.0,
            false => fit(&best.poses, known, &consensus.used(), config, Level::Poses)?,
        };
    }
    Ok(Consensus { poses: best.poses, candidate })
}

/// Number of rounds in which the middle residuals estimate the gripper's noise.
const ROUGH_ROUNDS: usize = 3;

fn middle_noise(known: &[Known], poses: &Poses) -> Variances {
    from_middle(known, poses, |view| nearest(view, poses).0, majority(known.len()).saturating_sub(1))
}

/// Returns the limit for a view that did not take part in estimating the noise, eq. (17): a variance from few views is uncertain, and χ² becomes
/// an F.
fn gate_outside(n_used: usize) -> f64 {
    let redundancy = f64::max(3.0, 3.0 * n_used as f64 - 6.0);
    redundancy * (GATE_CHI2 / redundancy).exp_m1()
}

/// Number of rounds that alternate between X, Z and the gripper's noise: each changes the other to second order.
const NOISE_ROUNDS: usize = 12;
/// The noise has converged when no variance changes by more than this share of the largest of its kind.
const SETTLED_NOISE: f64 = 1e-4;

/// Returns the minimum over the views used, with the gripper's noise estimated from them (stored in `known`) where it is unknown.
pub(super) fn fit_with_noise(
    start: &Poses,
    known: &mut [Known],
    used: &[(usize, usize)],
    config: &HandEyeConfig,
) -> Result<(Fit, Option<Variances>), Error> {
    let mut best = fit(start, known, used, config, Level::Poses)?;
    if !is_open(known) {
        return Ok((best, None));
    }
    let candidate_of = |view: &Known| nearest(view, &best.poses).0;
    let mut theta = from_middle(known, &best.poses, candidate_of, known.len() / 2);
    for round in 1..=NOISE_ROUNDS {
        let rows = rows(&best.poses, known, used, None);
        let found = reml(&rows, &besides(&best.poses, known, config), &theta);
        let now = found.ok_or(Error::NotConverged { steps: round })?.variances;
        let change = |k: usize| (now[k] - theta[k]).abs() <= SETTLED_NOISE * f64::max(now[k], theta[k]);
        let is_settled = (0..now.len()).all(change);
        theta = now;
        assume(known, &theta);
        best = fit(&best.poses, known, used, config, Level::Poses)?;
        if is_settled {
            break;
        }
    }
    Ok((best, Some(theta)))
}

/// Returns the candidate of a view that agrees with the fit. A view that took no part is compared with the prediction from the others, whose
/// uncertainty is included.
fn agrees(view: &Known, fit: &Fit, took_part: bool, [inside, outside]: [f64; 2]) -> Option<usize> {
    let (candidate, chi2) = nearest(view, &fit.poses);
    if took_part {
        return (chi2 <= inside).then_some(candidate);
    }
    let own = spread(view, candidate, &fit.poses);
    let mut by = DMatrix::zeros(6, 12);
    by.fixed_view_mut::<6, 6>(0, 0).fill_with_identity();
    let carried = (fit.poses.cam_from_carrier * view.carrier_from_holder).adjoint();
    by.fixed_view_mut::<6, 6>(0, 6).copy_from(&carried);
    let total = &by * &fit.covariance * by.transpose() + own;
    let measured = view.candidates[candidate].cam_from_target;
    let r = (measured * fit.poses.cam_from_target(view).inverse()).log();
    let chi2 = r.dot(&total.cholesky()?.solve(&r)) + view.candidates[candidate].delta_chi2;
    (chi2 <= outside).then_some(candidate)
}

/// Returns all triples of views with all their candidates if they are few, else seeded random ones.
fn triples(known: &[Known]) -> Vec<[(usize, usize); 3]> {
    let all: Vec<(usize, usize)> =
        known.iter().enumerate().flat_map(|(v, k)| (0..k.candidates.len()).map(move |c| (v, c))).collect();
    let n = all.len();
    let mut triples = Vec::new();
    if n * n.saturating_sub(1) * n.saturating_sub(2) / 6 <= MAX_TRIPLES {
        for (i, a) in all.iter().enumerate() {
            for (j, b) in all[..i].iter().enumerate() {
                triples.extend(all[..j].iter().map(|c| [*a, *b, *c]).filter(are_different));
            }
        }
        return triples;
    }
    let mut random = SplitMix64::new(SEED);
    while triples.len() < MAX_TRIPLES {
        let triple = [0; 3].map(|_| {
            let view = random.below(known.len());
            (view, random.below(known[view].candidates.len()))
        });
        if are_different(&triple) {
            triples.push(triple);
        }
    }
    triples
}

fn are_different(triple: &[(usize, usize); 3]) -> bool {
    let [a, b, c] = triple.map(|(view, _)| view);
    a != b && b != c && a != c
}
