//! Tests whether all views are of one camera. Views of two cameras, or of one before and after its zoom changed, contradict each other: two
//! groups fit far better separately than together. docs/math/intrinsics.md section 8.
//!
//!   S, s  a view's information and score at the common answer   ·   gain  by how much χ² falls when a group has an answer of its own

use super::adjust::Fit;
use super::blocks::alone;
use super::scatter::scores;
use crate::least_squares::shared::Reduced;
use crate::statistics::chi_square::{quantile, tail};
use nalgebra::{DMatrix, DVector};

/// Two groups of views that contradict each other.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoGroups {
    /// Views of the first group, as numbered in the input.
    pub first: Vec<usize>,
    /// Views of the second group.
    pub second: Vec<usize>,
    /// Whether the second group follows the first: zoom, focus or camera were changed in between.
    pub in_sequence: bool,
    /// Residual variance of the common answer divided by that of two answers.
    pub times: f64,
}

/// Least reduction of the variance by two answers before the views are called contradictory: views of one camera with a bent board reach 1.3.
pub const LEAST_TIMES: f64 = 1.6;
/// Probability of such a split among all that are compared.
const CHANCE: f64 = 1e-6;
/// Probability that views of one camera seem to contradict each other.
const WITHIN: f64 = 0.01;
/// Largest number of rounds in which views are reassigned to the group that fits them better.
const MAX_ROUNDS: usize = 20;
/// Least number of views in a group.
const LEAST_VIEWS: usize = 2;

/// Returns the split that reduces χ² most, if it exceeds chance.
pub(super) fn two_groups(fit: &Fit) -> Option<TwoGroups> {
    let inverse = fit.reduced()?.information.cholesky()?.inverse();
    let by_view = scores(fit, &inverse);
    if by_view.len() != fit.seen.len() || by_view.len() < 2 * LEAST_VIEWS {
        return None;
    }
    let (n, k) = (by_view.len(), inverse.nrows());
    // Ridge: a group may leave a direction open, and then agrees with all views in it.
    let ridge: DMatrix<f64> = inverse.clone().try_inverse()? * 1e-3;
    let judge = Judge { by_view: &by_view, ridge: &ridge };
    let cuts = (LEAST_VIEWS..=n - LEAST_VIEWS).map(|at| (0..n).map(|i| i < at).collect::<Vec<bool>>());
    let sequences = cuts.map(|split| (judge.gain(&split), split, true));
    let starts = judge.starts(&inverse).into_iter().map(|split| judge.settled(split));
    let mixed = starts.map(|split| (judge.gain(&split), split, false));
    let (gain, split, in_sequence) = sequences.chain(mixed).filter(|(_, split, _)| is_fair(split)).fold(
        (0.0, Vec::new(), false),
        // A cut in the sequence is the simpler explanation: another split must be better by its freedom of choice.
        |best, next| if best.0 + if next.2 { 0.0 } else { 2.0 * n as f64 } < next.0 { next } else { best },
    );
    let (chi2, degrees) = (fit.chi2(), fit.degrees_of_freedom());
    let left = (chi2 - gain).max(1e-12 * chi2) / degrees.saturating_sub(k).max(1) as f64;
    let times = chi2 / degrees.max(1) as f64 / left;
    let tried = if in_sequence { n as f64 } else { 2f64.powi(n.min(1000) as i32) };
    let is_beyond_chance = tail(k, gain / left) * tried < CHANCE;
    if split.is_empty()
        || !is_beyond_chance
        || !(LEAST_TIMES <= times || judge.explains(&split, &inverse, left))
    {
        return None;
    }
    let views =
        |side: bool| fit.seen.iter().zip(&split).filter(|(_, s)| **s == side).map(|(v, _)| v.view).collect();
    Some(TwoGroups { first: views(true), second: views(false), in_sequence, times })
}

fn is_fair(split: &[bool]) -> bool {
    let n = split.iter().filter(|side| **side).count();
    LEAST_VIEWS <= n && LEAST_VIEWS <= split.len() - n
}

struct Judge<'a> {
    by_view: &'a [Reduced],
    ridge: &'a DMatrix<f64>,
}

impl Judge<'_> {
    /// Returns information and score of one side.
    fn side(&self, split: &[bool], side: bool) -> (DMatrix<f64>, DVector<f64>) {
        let k = self.ridge.nrows();
        let members = self.by_view.iter().zip(split).filter(|(_, s)| **s == side);
        members.fold((DMatrix::zeros(k, k), DVector::zeros(k)), |(information, score), (one, _)| {
            (information + &one.information, score + &one.gradient)
        })
    }

    /// Returns the difference between a side's own answer and the common one.
    fn offset(&self, split: &[bool], side: bool) -> DVector<f64> {
        let (information, score) = self.side(split, side);
        (information + self.ridge).cholesky().map_or_else(|| DVector::zeros(score.len()), |c| c.solve(&score))
    }

    /// Returns Σ over both sides of 2 sᵀδ − δᵀSδ.
    fn gain(&self, split: &[bool]) -> f64 {
        let of_side = |side: bool| {
            let (information, score) = self.side(split, side);
            let offset = self.offset(split, side);
            2.0 * score.dot(&offset) - offset.dot(&(information * &offset))
        };
        of_side(true) + of_side(false)
    }

    /// Returns whether views contradict each other, but not within the groups.
    fn explains(&self, split: &[bool], inverse: &DMatrix<f64>, noise: f64) -> bool {
        let Some(factor) = inverse.clone().cholesky().map(|c| c.l()) else { return false };
        let offsets = [self.offset(split, false), self.offset(split, true)];
        let nothing = DVector::zeros(inverse.nrows());
        let contradiction = |offset: &dyn Fn(usize) -> DVector<f64>| {
            self.by_view.iter().enumerate().fold((0.0, 0usize), |(chi2, rank), (i, one)| {
                let gradient = &one.gradient - &one.information * offset(i);
                let (own, seen) = alone(
                    &Reduced { information: one.information.clone(), gradient },
                    &factor,
                    self.by_view.len(),
                );
                (chi2 + own, rank + seen)
            })
        };
        let (before, rank) = contradiction(&|_| nothing.clone());
        let (after, _) = contradiction(&|i| offsets[usize::from(split[i])].clone());
        let k = inverse.nrows();
        let limit = |k: usize| noise * quantile(rank.saturating_sub(k).max(1), WITHIN);
        limit(k) < before && after < limit(2 * k)
    }

    /// Splits by the sign of each view's score along the most significant directions: P^½ s.
    fn starts(&self, inverse: &DMatrix<f64>) -> Vec<Vec<bool>> {
        let Some(factor) = inverse.clone().cholesky().map(|c| c.l()) else { return Vec::new() };
        let whitened: Vec<DVector<f64>> =
            self.by_view.iter().map(|one| factor.transpose() * &one.gradient).collect();
        let k = inverse.nrows();
        let sum = whitened.iter().fold(DMatrix::zeros(k, k), |sum, y| sum + y * y.transpose());
        if !sum.iter().all(|x| x.is_finite()) {
            return Vec::new();
        }
        let eigen = sum.symmetric_eigen();
        let mut order: Vec<usize> = (0..k).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let split = |i: &usize| whitened.iter().map(|y| 0.0 < eigen.eigenvectors.column(*i).dot(y)).collect();
        order.iter().take(3).map(split).collect()
    }

    /// Reassigns views to the side whose answer fits them better, until nothing changes.
    fn settled(&self, mut split: Vec<bool>) -> Vec<bool> {
        for _ in 0..MAX_ROUNDS {
            let offsets = [self.offset(&split, false), self.offset(&split, true)];
            let suits = |one: &Reduced, side: usize| {
                2.0 * one.gradient.dot(&offsets[side])
                    - offsets[side].dot(&(&one.information * &offsets[side]))
            };
            let next: Vec<bool> = self.by_view.iter().map(|one| suits(one, 0) < suits(one, 1)).collect();
            if next == split || !is_fair(&next) {
                break;
            }
            split = next;
        }
        split
    }
}
