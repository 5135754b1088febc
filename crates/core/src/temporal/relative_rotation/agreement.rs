//! Which turn the most landmarks agree with: turns through pairs of landmarks, tried until another is unlikely to do better.

use super::RelativeRotationConfig;
use super::fit::Prepared;
use crate::Error;
use crate::solve::pure_rotation::{DirectionPair, pure_rotation};
use crate::statistics::SplitMix64;
use nalgebra::Matrix3;

/// Probability with which no better turn was missed.
const CONFIDENCE: f64 = 0.9999;
/// Samples drawn at least, unless `near` already has most landmarks.
const LEAST_SAMPLES: usize = 8;
/// A share of landmarks that agree with `near` which no other turn can beat by more than chance.
const NEAR_SHARE: f64 = 0.6;

/// The best turn found.
pub(super) struct Start {
    pub now_from_reference: Matrix3<f64>,
    pub agreeing: usize,
    pub samples: usize,
}

/// # Errors
/// `NoConsensus` where no pair of landmarks gives a rotation at all.
pub(super) fn agreement(
    all: &[Prepared],
    near: Option<&Matrix3<f64>>,
    config: &RelativeRotationConfig,
) -> Result<Start, Error> {
    let count = |r: &Matrix3<f64>| all.iter().filter(|l| agrees(l, r, config.threshold_px)).count();
    let mut best = near.map(|r| (*r, count(r)));
    let mut chance = SplitMix64::scattered(config.seed);
    let mut samples = 0;
    while samples < needed(best.map_or(0, |b| b.1), all.len(), near.is_some()).min(config.max_samples) {
        samples += 1;
        let Some(r) = through_pair(all, &mut chance, config.threshold_px) else { continue };
        let agreeing = count(&r);
        if best.is_none_or(|(_, most)| most < agreeing) {
            best = Some((r, agreeing));
        }
    }
    let none = Error::NoConsensus { best: 0, n: all.len(), needed: config.least, what: "landmarks", samples };
    best.map(|(now_from_reference, agreeing)| Start { now_from_reference, agreeing, samples }).ok_or(none)
}

fn agrees(landmark: &Prepared, r: &Matrix3<f64>, threshold_px: f64) -> bool {
    let off = landmark.now.into_inner() - r * landmark.in_reference.into_inner();
    off.norm_squared() * landmark.px_per_rad.powi(2) <= threshold_px * threshold_px
}

fn through_pair(all: &[Prepared], chance: &mut SplitMix64, threshold_px: f64) -> Option<Matrix3<f64>> {
    let (i, j) = (chance.below(all.len()), chance.below(all.len()));
    if i == j {
        return None;
    }
    let pair = [i, j].map(|i| DirectionPair {
        in_first: all[i].in_reference,
        in_second: all[i].now,
        sigma_rad: threshold_px / all[i].px_per_rad.max(1.0),
    });
    pure_rotation(&pair).ok().map(|rotation| rotation.second_from_first)
}

/// Pairs to draw so that one of two good landmarks is among them, with some to spare: a pair fits no better than its own noise.
fn needed(agreeing: usize, given: usize, has_near: bool) -> usize {
    let share = agreeing as f64 / given as f64;
    if has_near && NEAR_SHARE <= share {
        return 0;
    }
    let both = (share * share).clamp(1e-6, 1.0 - 1e-6);
    (((1.0 - CONFIDENCE).ln() / (1.0 - both).ln()).ceil() as usize).max(LEAST_SAMPLES)
}
