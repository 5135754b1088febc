//! Which relative pose the most pairs agree with: essential matrices through five pairs, tried until another is unlikely to do better.

use super::epipolar::{RelativePose, squared_residual};
use super::fit::is_behind;
use super::five_point::five_point;
use super::{BearingPair, TwoViewConfig, truncated};
use crate::Error;
use crate::robust::evidence::{Evidence, samples_for};
use crate::statistics::SplitMix64;
use nalgebra::{Matrix3, Vector3};

/// Probability with which no better pose was missed.
const CONFIDENCE: f64 = 0.999;
/// Probability that five good pairs lead to their pose: their own noise is in it.
const USABLE: f64 = 0.5;
/// Samples drawn at least: a second solution of a plane is found among them.
const LEAST_SAMPLES: usize = 40;
/// Samples give other poses than this, norm of the difference, or sine of the angle between directions: two solutions.
pub(super) const DIFFERENT: f64 = 0.1;
/// Five pairs with noise of their own predict the others worse than the final pose does: the search looks this many thresholds wide.
const WIDE: f64 = 1.5;
/// Largest expected number of essential matrices that as many random pairs would agree with.
const MAX_FALSE_ALARMS: f64 = 1e-3;
/// Ten essential matrices a sample at most.
const LN_CANDIDATES: f64 = core::f64::consts::LN_10;

/// The best relative pose found.
pub(super) struct Agreement {
    pub best: RelativePose,
    /// The best that differs from it.
    pub other: Option<RelativePose>,
    /// Pairs that must agree to exclude chance.
    pub needed: usize,
    pub samples: usize,
}

/// Best essential matrix and the best different one, with their costs.
#[derive(Default)]
struct Ranking {
    best: Option<(Matrix3<f64>, f64)>,
    other: Option<(Matrix3<f64>, f64)>,
}

impl Ranking {
    fn enter(&mut self, e: Matrix3<f64>, cost: f64) {
        let is_near = |with: &Option<(Matrix3<f64>, f64)>| with.is_some_and(|(old, _)| !differ(&old, &e));
        let is_better = |than: &Option<(Matrix3<f64>, f64)>| than.is_none_or(|(_, old)| cost < old);
        if is_better(&self.best) {
            if !is_near(&self.best) {
                self.other = self.best;
            }
            self.best = Some((e, cost));
            self.other = self.other.filter(|(old, _)| differ(old, &e));
        } else if !is_near(&self.best) && is_better(&self.other) {
            self.other = Some((e, cost));
        }
    }
}

/// Essential matrices are equal up to their sign.
fn differ(a: &Matrix3<f64>, b: &Matrix3<f64>) -> bool {
    let (a, b) = (a / a.norm(), b / b.norm());
    DIFFERENT < (a - b).norm().min((a + b).norm())
}

/// # Errors
/// `NoConsensus` where no five pairs give a pose, or no pose that more pairs agree with than chance explains.
pub(super) fn agreement(
    pairs: &[BearingPair],
    near: Option<Matrix3<f64>>,
    least: usize,
    config: &TwoViewConfig,
) -> Result<Agreement, Error> {
    let limit = (WIDE * config.threshold_sigmas).powi(2);
    let count = |e: &Matrix3<f64>| pairs.iter().filter(|pair| squared_residual(e, pair) <= limit).count();
    let mut ranking = Ranking::default();
    near.into_iter().for_each(|e| ranking.enter(e, truncated(pairs, &e, limit)));
    let (mut chance, mut samples, mut needed) =
        (SplitMix64::scattered(config.seed), 0, config.max_samples.max(1));
    while samples < needed {
        samples += 1;
        for e in five_point(&sample(pairs, &mut chance)) {
            ranking.enter(e, truncated(pairs, &e, limit));
        }
        let share = ranking.best.map_or(0.0, |(e, _)| count(&e) as f64 / pairs.len() as f64);
        let enough = samples_for(CONFIDENCE, USABLE * share.powi(5)).unwrap_or(usize::MAX);
        needed = enough.max(LEAST_SAMPLES).min(config.max_samples.max(1));
    }
    let refused = |best: usize, needed: usize| Error::NoConsensus {
        best,
        n: pairs.len(),
        needed,
        what: "pairs",
        samples,
    };
    let (e, _) = ranking.best.ok_or_else(|| refused(5, least))?;
    let needed = least.max(by_chance(pairs, &e, limit, samples));
    let best = in_front(pairs, &e, limit).ok_or_else(|| refused(5, needed))?;
    if count(&e) < needed {
        return Err(refused(count(&e), needed));
    }
    let other = ranking.other.and_then(|(e, _)| in_front(pairs, &e, limit));
    Ok(Agreement { best, other, needed, samples })
}

fn sample(pairs: &[BearingPair], chance: &mut SplitMix64) -> [(Vector3<f64>, Vector3<f64>); 5] {
    let mut drawn = [usize::MAX; 5];
    for k in 0..5 {
        let mut at = chance.below(pairs.len());
        while drawn[..k].contains(&at) {
            at = (at + 1) % pairs.len();
        }
        drawn[k] = at;
    }
    drawn.map(|i| (pairs[i].first.into_inner(), pairs[i].second.into_inner()))
}

/// Pairs that must agree so that chance is excluded: docs/math/robust.md eq. (6), with the share of shuffled pairs that agree.
fn by_chance(pairs: &[BearingPair], e: &Matrix3<f64>, limit: f64, samples: usize) -> usize {
    let n = pairs.len();
    let shuffled = |i: usize| BearingPair { second: pairs[(i + n / 2) % n].second, ..pairs[i] };
    let agreeing = (0..n).filter(|i| squared_residual(e, &shuffled(*i)) <= limit).count();
    let chance = (agreeing as f64 + 1.0) / (n as f64 + 1.0);
    let ln_poses = LN_CANDIDATES + (samples.max(1) as f64).ln();
    Evidence { n_units: n, n_used: 5, ln_poses, chance }.needed(MAX_FALSE_ALARMS.ln())
}

/// The one of the four poses of an essential matrix that has the most of the agreeing points in front of both cameras: eq. (8).
fn in_front(pairs: &[BearingPair], e: &Matrix3<f64>, limit: f64) -> Option<RelativePose> {
    let svd = e.try_svd(true, true, f64::EPSILON, 200)?;
    let (mut u, mut v_t) = (svd.u?, svd.v_t?);
    let least = svd.singular_values.imin();
    // The null direction last, both rotations proper.
    u.swap_columns(least, 2);
    v_t.swap_rows(least, 2);
    u *= u.determinant().signum();
    v_t *= v_t.determinant().signum();
    let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let t: Vector3<f64> = u.column(2).into();
    let agreeing: Vec<&BearingPair> =
        pairs.iter().filter(|pair| squared_residual(e, pair) <= limit).collect();
    let rotations = [u * w * v_t, u * w.transpose() * v_t];
    let poses = rotations.into_iter().flat_map(|r| [t, -t].map(|t| RelativePose { r, t }));
    let behind = |at: &RelativePose| agreeing.iter().filter(|pair| is_behind(pair, at)).count();
    poses.min_by_key(|at| behind(at))
}
