//! The pairs that contradict the others: each is compared with the prediction of the rest, and the worst is left out, until all agree.
//!
//! Paper: W. Baarda, "A testing procedure for use in geodetic networks", 1968, with the variance estimated from the others.
//! Derivation: docs/math/pose_graph.md eqs. (8)–(11).

use super::equations::{Adjustment, Weights, adjust, covariance_at, linearised};
use super::noise::{Noise, median};
use super::{PairResult, PoseGraph, SUSPICIOUS};
use crate::locate::loss::Loss;
use crate::{Error, Matrix6, Pose};
use nalgebra::{DMatrix, DVector};

/// The answer, its noise, and the result of each pair.
pub(super) struct Settled {
    pub adjustment: Adjustment,
    pub noise: Noise,
    pub pairs: Vec<PairResult>,
    /// What it adds to the covariance that one of several pairs is wrong and nothing tells which, 6 rows for each camera.
    pub undecided: DMatrix<f64>,
}

/// 95 % quantile of χ² with six degrees of freedom: the threshold of the loss of the first adjustment.
const CHI2_6_95: f64 = 12.59;
/// Median of χ² with six degrees of freedom.
const MEDIAN_CHI2_6: f64 = 5.348;
/// Redundancy below which a pair is a bridge; rounding leaves far less.
const LEAST_REDUNDANCY: f64 = 1e-3;
/// Where the others agree exactly, their χ² is rounding; χ² with six degrees of freedom is below this twice in 10¹¹.
const LEAST_CHI2: f64 = 1e-3;
/// Rounds of adjusting and estimating the sigmas; each gains a digit or more.
const MAX_ROUNDS: usize = 50;
/// The sigmas have converged when χ² over its degrees of freedom is 1 to within this.
const SETTLED: f64 = 1e-9;

/// Where rotations or translations keep less of the redundancy than this, the other kind has begun to explain their residuals (a rotation of a
/// camera closes a loop's translations), and a variance would converge to zero: from then on one factor scales both. A single loop gives each a
/// half.
const LEAST_SHARE: f64 = 0.25;

/// Finds the joint solution: first under a loss that limits the influence of wrong pairs, then without those that contradict the rest.
pub(super) fn settle(
    graph: &PoseGraph,
    reference_camera: usize,
    start: Vec<Pose>,
    noise: Noise,
) -> Result<Settled, Error> {
    let all = vec![true; graph.pairs.len()];
    let scale = robust_scale(graph, &start, &noise)?;
    let loss = Loss::Cauchy { sigmas: (CHI2_6_95 * scale).sqrt() };
    let mut poses = adjust(graph, reference_camera, start, &weights(&noise, &all, loss)?.as_ref())?.poses;
    let (mut used, mut unsure) = (all, vec![false; graph.pairs.len()]);
    for _ in 0..4 * graph.pairs.len() + 1 {
        let (adjustment, settled) = adjusted(graph, reference_camera, poses, noise.clone(), &used)?;
        let mut pairs = results(graph, &adjustment, &settled, &used)?;
        let returning = innocent(&pairs, &used);
        let leaving = worst(&pairs, |i| used[i] && !unsure[i] && removable(graph, &used, i));
        match (leaving, returning) {
            (Some(at), _) => match duplicates(graph, &used, at) {
                alone if alone.is_empty() => (used[at], unsure) = (false, vec![false; used.len()]),
                several => several.into_iter().chain([at]).for_each(|i| unsure[i] = true),
            },
            (None, Some(at)) => (used[at], unsure) = (true, vec![false; used.len()]),
            (None, None) => {
                pairs.iter_mut().zip(&unsure).for_each(|(pair, unsure)| pair.is_suspicious |= unsure);
                let undecided = undecided(graph, reference_camera, &adjustment, &settled, (&used, &unsure))?;
                return Ok(Settled { adjustment, noise: settled, pairs, undecided });
            }
        }
        poses = adjustment.poses;
    }
    Err(Error::NotConverged { steps: 4 * graph.pairs.len() })
}

/// Returns the pairs that only the same loops check, so that any of them may cause a misclosure: without either pair the cameras stay connected,
/// without both they do not.
fn duplicates(graph: &PoseGraph, used: &[bool], of: usize) -> Vec<usize> {
    let mut without = used.to_vec();
    without[of] = false;
    let is_duplicate =
        |i: &usize| without[*i] && removable(graph, used, *i) && !removable(graph, &without, *i);
    (0..used.len()).filter(is_duplicate).collect()
}

/// Returns what the covariance gains where one of the pairs `unsure` is wrong, each with the same probability: docs/math/budget.md eq. (18).
fn undecided(
    graph: &PoseGraph,
    reference_camera: usize,
    adjustment: &Adjustment,
    noise: &Noise,
    (used, unsure): (&[bool], &[bool]),
) -> Result<DMatrix<f64>, Error> {
    let poses = &adjustment.poses;
    let mut gain = DMatrix::zeros(6 * graph.n_cameras, 6 * graph.n_cameras);
    let suspects: Vec<usize> = (0..used.len()).filter(|i| used[*i] && unsure[*i]).collect();
    let share = 1.0 / suspects.len().max(1) as f64;
    // All covariances are those at the answer, so that each exceeds that of all pairs.
    let at_answer = |used: &[bool]| -> Result<DMatrix<f64>, Error> {
        covariance_at(graph, reference_camera, poses, &weights(noise, used, Loss::Squared)?.as_ref())
    };
    for suspect in &suspects {
        let without: Vec<bool> = used.iter().enumerate().map(|(i, used)| *used && i != *suspect).collect();
        let own = weights(noise, &without, Loss::Squared)?;
        let other = adjust(graph, reference_camera, poses.clone(), &own.as_ref())?;
        let moves = other.poses.iter().zip(poses).map(|(there, here)| (*there * here.inverse()).log());
        let moved = DVector::from_iterator(gain.nrows(), moves.flat_map(<[f64; 6]>::from));
        gain += (at_answer(&without)? - at_answer(used)? + &moved * moved.transpose()) * share;
    }
    Ok(gain)
}

/// Information matrices and a loss.
struct OwnWeights(Vec<Option<Matrix6>>, Loss);

impl OwnWeights {
    fn as_ref(&self) -> Weights<'_> {
        Weights { information: &self.0, loss: self.1 }
    }
}

fn weights(noise: &Noise, used: &[bool], loss: Loss) -> Result<OwnWeights, Error> {
    let one = |(i, used): (usize, &bool)| used.then(|| noise.information(i)).transpose();
    Ok(OwnWeights(used.iter().enumerate().map(one).collect::<Result<_, _>>()?, loss))
}

/// Returns the factor by which the median squared residual exceeds the stated one; at least 1.
fn robust_scale(graph: &PoseGraph, poses: &[Pose], noise: &Noise) -> Result<f64, Error> {
    let mut squares = Vec::new();
    for i in 0..graph.pairs.len() {
        let r = linearised(graph, i, poses).residual;
        squares.push(r.dot(&(noise.information(i)? * r)));
    }
    Ok(f64::max(1.0, median(squares) / MEDIAN_CHI2_6))
}

/// Returns the minimum over the pairs used, with sigmas re-estimated until they agree with the residuals.
fn adjusted(
    graph: &PoseGraph,
    reference_camera: usize,
    mut poses: Vec<Pose>,
    mut noise: Noise,
    used: &[bool],
) -> Result<(Adjustment, Noise), Error> {
    let mut is_one_factor = false;
    for _ in 0..MAX_ROUNDS {
        let adjustment =
            adjust(graph, reference_camera, poses, &weights(&noise, used, Loss::Squared)?.as_ref())?;
        if !noise.is_estimated() {
            return Ok((adjustment, noise));
        }
        let (turn, shift) = shares(graph, &adjustment, &noise, used)?;
        is_one_factor |= turn.1.min(shift.1) < LEAST_SHARE * (turn.1 + shift.1);
        let both = (turn.0 + shift.0, turn.1 + shift.1);
        let (turn, shift) = if is_one_factor { (both, both) } else { (turn, shift) };
        let off = |(squares, redundancy): (f64, f64)| (squares - redundancy).abs() / redundancy.max(1e-3);
        if both.1 < LEAST_REDUNDANCY || off(turn).max(off(shift)) < SETTLED {
            return Ok((adjustment, noise));
        }
        noise = noise.re_estimated(turn, shift);
        poses = adjustment.poses;
    }
    let adjustment = adjust(graph, reference_camera, poses, &weights(&noise, used, Loss::Squared)?.as_ref())?;
    Ok((adjustment, noise))
}

/// Sum of squares and redundancy of rotations, then of translations, over the pairs used.
type Shares = ((f64, f64), (f64, f64));

fn shares(graph: &PoseGraph, adjustment: &Adjustment, noise: &Noise, used: &[bool]) -> Result<Shares, Error> {
    let ((mut turn, mut turn_redundancy), (mut shift, mut shift_redundancy)) = ((0.0, 0.0), (0.0, 0.0));
    for i in (0..used.len()).filter(|i| used[*i]) {
        let r = linearised(graph, i, &adjustment.poses).residual;
        let information = noise.information(i)?;
        let share = predicted_covariance(graph, i, adjustment) * information;
        let weighted = (information * r).component_mul(&r);
        turn += weighted.fixed_rows::<3>(0).sum();
        shift += weighted.fixed_rows::<3>(3).sum();
        turn_redundancy += (0..3).map(|k| 1.0 - share[(k, k)]).sum::<f64>();
        shift_redundancy += (3..6).map(|k| 1.0 - share[(k, k)]).sum::<f64>();
    }
    Ok(((turn, turn_redundancy), (shift, shift_redundancy)))
}

/// Returns Q = J P Jᵀ: the covariance of the prediction of a pair, eq. (8).
fn predicted_covariance(graph: &PoseGraph, index: usize, adjustment: &Adjustment) -> Matrix6 {
    let pair = &graph.pairs[index];
    let l = linearised(graph, index, &adjustment.poses);
    let p: &DMatrix<f64> = &adjustment.covariance;
    let block = |i: usize, j: usize| -> Matrix6 { p.fixed_view::<6, 6>(6 * i, 6 * j).into_owned() };
    let cross = l.by_a * block(pair.a, pair.b) * l.by_b.transpose();
    l.by_a * block(pair.a, pair.a) * l.by_a.transpose()
        + l.by_b * block(pair.b, pair.b) * l.by_b.transpose()
        + cross
        + cross.transpose()
}

/// Returns residual, redundancy and disagreement of every pair.
fn results(
    graph: &PoseGraph,
    adjustment: &Adjustment,
    noise: &Noise,
    used: &[bool],
) -> Result<Vec<PairResult>, Error> {
    let n_used = used.iter().filter(|used| **used).count();
    let degrees_of_freedom = 6.0 * (n_used as f64 - graph.n_cameras as f64 + 1.0);
    let result = |(index, &used): (usize, &bool)| {
        let residual = linearised(graph, index, &adjustment.poses).residual;
        let (own, predicted) = (noise.covariance(index), predicted_covariance(graph, index, adjustment));
        let redundancy = if used { 6.0 - (predicted * noise.information(index)?).trace() } else { 6.0 };
        // The residual of a pair used is smaller than its error, because the pair attracts the solution; the residual of another pair is larger.
        let expected = if used { own - predicted } else { own + predicted };
        let testable = LEAST_REDUNDANCY < redundancy;
        let distance = expected.cholesky().filter(|_| testable).map(|c| residual.dot(&c.solve(&residual)));
        let others = if used {
            (adjustment.chi2, degrees_of_freedom, 1.0)
        } else {
            (adjustment.chi2, degrees_of_freedom, 0.0)
        };
        let disagreement_sigma = distance.and_then(|distance| disagreement(distance, others));
        Ok(PairResult { residual, redundancy, disagreement_sigma, is_used: used, is_suspicious: !used })
    };
    used.iter().enumerate().map(result).collect()
}

/// Returns the pair's squared distance from the others relative to the others' own χ² (without the share of the pair where it took part), as a
/// normal number: Paulson's transformation of F with 6 and n degrees of freedom, eqs. (10)–(11). None where the others have no redundancy of
/// their own.
fn disagreement(distance: f64, (chi2, degrees_of_freedom, own_share): (f64, f64, f64)) -> Option<f64> {
    let n = degrees_of_freedom - 6.0 * own_share;
    if n < 5.5 {
        return None;
    }
    let rest = (chi2 - distance * own_share).max(LEAST_CHI2);
    Some(as_normal((distance / 6.0) / (rest / n), [6.0, n]))
}

/// Returns a ratio of two variances with so many degrees of freedom as a normal number, by Paulson's transformation, eq. (11).
pub(super) fn as_normal(ratio: f64, [n_own, n_others]: [f64; 2]) -> f64 {
    let root = ratio.cbrt();
    let (own, others) = (2.0 / (9.0 * n_own), 2.0 / (9.0 * n_others));
    ((1.0 - others) * root - (1.0 - own)) / (others * root * root + own).sqrt()
}

/// Returns the pair that disagrees most among some, if its disagreement is too large.
fn worst(pairs: &[PairResult], among: impl Fn(usize) -> bool) -> Option<usize> {
    let far = |i: &usize| pairs[*i].disagreement_sigma.is_some_and(|d| SUSPICIOUS < d) && among(*i);
    let by = |i: &usize, j: &usize| {
        let d = |i: usize| pairs[i].disagreement_sigma.unwrap_or(0.0);
        d(*i).total_cmp(&d(*j))
    };
    (0..pairs.len()).filter(far).max_by(by)
}

/// Returns a pair left out that agrees after all once a worse one is left out; its limit is well below the gate, so that no pair alternates for
/// ever.
fn innocent(pairs: &[PairResult], used: &[bool]) -> Option<usize> {
    (0..pairs.len()).find(|i| !used[*i] && pairs[*i].disagreement_sigma.is_some_and(|d| d < 0.5 * SUSPICIOUS))
}

/// Returns whether the cameras stay connected without this pair.
fn removable(graph: &PoseGraph, used: &[bool], without: usize) -> bool {
    let kept =
        graph.pairs.iter().enumerate().filter(|(i, _)| used[*i] && *i != without).map(|(_, p)| p.clone());
    let kept: Vec<_> = kept.collect();
    super::groups(&PoseGraph { n_cameras: graph.n_cameras, pairs: &kept }).len() == 1
}
