//! Many estimates of one pose, some of them wrong: the one on which the most agree, and the mean of those.

use super::sighted::sharpness;
use crate::{Matrix6, Pose, Vector6};

/// One estimate of a pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vote {
    /// Group of the vote, a body in one view: the votes of one group exclude each other.
    pub(super) group: usize,
    pub(super) b_from_a: Pose,
    /// Covariance of its small left motion.
    pub(super) covariance: Matrix6,
    /// Probability that it is the right one of its group.
    pub(super) probability: f64,
}

/// Two estimates agree when their squared difference is below this 99.9 % quantile of χ² with six degrees of freedom.
const AGREES_CHI2: f64 = 22.46;
/// Number of estimates tried as the centre of a group of agreeing ones, the sharpest first: with half of them wrong, the probability that all
/// are wrong is 10⁻⁵.
const CENTRES: usize = 16;
/// Number of groups that are used because they are the sharpest, and about that of further ones spread over all.
const GROUPS: usize = 64;

/// Returns the pose on which the most groups agree, averaged over them.
pub(super) fn agreed(votes: &[Vote]) -> Option<Pose> {
    let votes = thinned(votes);
    let support = |centre: &Vote| support(centre, &votes);
    let scored = votes.iter().take(CENTRES).map(|v| (support(v), v));
    let (_, best) = scored.fold(None, |best: Option<(f64, &Vote)>, next| match best {
        Some(b) if next.0 <= b.0 => Some(b),
        _ => Some(next),
    })?;
    let mut pose = best.b_from_a;
    for _ in 0..3 {
        pose = averaged(&Vote { b_from_a: pose, ..*best }, &votes);
    }
    Some(pose)
}

/// Returns the sharpest groups and some of the others, ordered by sharpness; votes of a group stay together.
fn thinned(votes: &[Vote]) -> Vec<Vote> {
    let mut ranked: Vec<(f64, &Vote)> =
        votes.iter().filter_map(|v| Some((sharpness(&v.covariance)? + v.probability.ln(), v))).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut groups: Vec<usize> = Vec::new();
    for (_, v) in &ranked {
        if !groups.contains(&v.group) {
            groups.push(v.group);
        }
        if groups.len() == GROUPS {
            break;
        }
    }
    let stride = ranked.len().div_ceil(GROUPS).max(1);
    groups.extend(ranked.iter().step_by(stride).map(|(_, v)| v.group));
    groups.sort_unstable();
    ranked.retain(|(_, v)| groups.binary_search(&v.group).is_ok());
    ranked.into_iter().map(|(_, v)| *v).collect()
}

/// Returns the squared difference of two estimates in units of their covariances, and the difference as a motion.
fn difference(vote: &Vote, centre: &Vote, covariance: &Matrix6) -> Option<(f64, Vector6)> {
    let motion = (vote.b_from_a * centre.b_from_a.inverse()).log();
    let chi2 = motion.dot(&covariance.cholesky()?.solve(&motion));
    chi2.is_finite().then_some((chi2, motion))
}

/// Returns the sum over groups of the agreement of the best vote of each.
fn support(centre: &Vote, votes: &[Vote]) -> f64 {
    let mut best: Vec<(usize, f64)> = Vec::with_capacity(votes.len());
    for v in votes {
        let Some((chi2, _)) = difference(v, centre, &(v.covariance + centre.covariance)) else { continue };
        let agreement = v.probability * (1.0 - chi2 / AGREES_CHI2).max(0.0);
        match best.iter_mut().find(|b| b.0 == v.group) {
            Some(b) => b.1 = b.1.max(agreement),
            None => best.push((v.group, agreement)),
        }
    }
    best.iter().map(|b| b.1).sum()
}

/// Returns the mean of the votes that agree, weighted by their information, after one step; the centre where none does.
fn averaged(centre: &Vote, votes: &[Vote]) -> Pose {
    let (mut information, mut pull) = (Matrix6::zeros(), Vector6::zeros());
    for v in votes {
        let Some((_, motion)) =
            difference(v, centre, &(v.covariance + centre.covariance)).filter(|d| d.0 < AGREES_CHI2)
        else {
            continue;
        };
        if let Some(own) = v.covariance.cholesky() {
            let own = own.inverse() * v.probability;
            information += own;
            pull += own * motion;
        }
    }
    let step = information.cholesky().map(|c| c.solve(&pull));
    step.filter(|s| s.sum().is_finite()).map_or(centre.b_from_a, |s| centre.b_from_a.moved(&s))
}
