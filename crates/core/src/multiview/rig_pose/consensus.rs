//! The pose of a rig with which the most points agree, when many may be wrong: samples of three rays of any cameras.
//!
//! sample three → generalised P3P → count → enough samples? → is it more than chance? → `locate_rig` on the points that agree, until that set no
//! longer changes. The evidence is that of docs/math/robust.md sections 2 and 3, with up to eight poses for a sample.

use super::check::check_views;
use super::{RigAmbiguity, RigPoseEstimate, RigView, locate_rig};
use crate::locate::refine::residual_px;
use crate::robust::evidence::{Evidence, confidence, ln_triples, samples_for};
use crate::solve::gp3p::{Ray, gp3p};
use crate::statistics::SplitMix64;
use crate::{Correspondence, Error, Pose};
use nalgebra::Unit;

/// A point: the index of its view, and its index in the view.
pub type RigPoint = (usize, usize);

/// The result of the search.
#[derive(Debug, Clone, PartialEq)]
pub struct RigConsensus {
    /// The estimate of `locate_rig` on the points that agree; its indices are those of the points given, its covariance is divided by
    /// `truncation`.
    pub estimate: RigPoseEstimate,
    /// Points that agree with the pose to within the threshold, ascending.
    pub inliers: Vec<RigPoint>,
    /// Number of samples drawn.
    pub n_samples: usize,
    /// Probability that no larger consensus was missed.
    pub confidence: f64,
    /// log₁₀ of the expected number of poses that as many random points would agree with.
    pub log10_false_alarms: f64,
    /// Share of the good points' squared residual below the threshold: docs/math/robust.md eq. (14).
    pub truncation: f64,
}

const CONFIDENCE: f64 = 0.9999;
const MAX_SAMPLES: usize = 50_000;
const MAX_FALSE_ALARMS: f64 = 1e-3;
/// Share of the samples of good points that find their consensus in spite of noise.
const GOOD_SAMPLES: f64 = 0.5;
/// Largest number of poses for three rays.
const MOST_POSES: f64 = 8.0;
/// Largest number of rounds of locating and selecting the points that agree.
const MAX_ROUNDS: usize = 30;

struct Search<'a> {
    views: &'a [RigView<'a>],
    points: Vec<RigPoint>,
    threshold_px: f64,
}

/// Finds the pose with which the most points agree to within `threshold_px`. The same input gives the same result.
///
/// # Errors
/// `NoConsensus` where too few agree to rule out chance, `InvalidSetting` for an invalid threshold, and those of [`locate_rig`] on the points
/// that agree.
pub fn rig_consensus(views: &[RigView], threshold_px: f64) -> Result<RigConsensus, Error> {
    check_views(views)?;
    if !(0.0 < threshold_px && threshold_px.is_finite()) {
        let (setting, needed) = ("threshold_px", "it must be positive");
        return Err(Error::InvalidSetting { setting, seen: threshold_px, needed });
    }
    let of_view =
        |(view, v): (usize, &RigView)| (0..v.seen.len()).map(move |point| (view, point)).collect::<Vec<_>>();
    let points: Vec<RigPoint> = views.iter().enumerate().flat_map(of_view).collect();
    if points.len() < 3 {
        return Err(Error::TooFewPoints { seen: points.len(), needed: 3 });
    }
    let search = Search { views, points, threshold_px };
    let (inliers, n_samples) = search.sampled();
    search.settled(inliers, n_samples)
}

impl Search<'_> {
    fn seen(&self, (view, point): RigPoint) -> &Correspondence {
        &self.views[view].seen[point]
    }

    fn ray(&self, point: RigPoint) -> Ray {
        let cam_from_rig = &self.views[point.0].cam_from_rig;
        Ray {
            origin_in_rig: cam_from_rig.origin(),
            bearing_in_rig: Unit::new_unchecked(cam_from_rig.rotation.tr_mul(&self.seen(point).bearing)),
        }
    }

    /// Returns the points within the threshold of a pose, and the truncated sum of their squared distances.
    fn agreeing(&self, rig_from_target: &Pose) -> (Vec<RigPoint>, f64) {
        let limit = self.threshold_px * self.threshold_px;
        let (mut inliers, mut cost) = (Vec::new(), 0.0);
        for point in &self.points {
            let view = &self.views[point.0];
            let cam_from_target = view.cam_from_rig * *rig_from_target;
            let off = residual_px(&cam_from_target, self.seen(*point), view.camera)
                .map_or(limit, |e| e.norm_squared());
            if off < limit {
                inliers.push(*point);
            }
            cost += off.min(limit);
        }
        (inliers, cost)
    }

    /// Returns the best consensus of the samples, and the number of samples drawn.
    fn sampled(&self) -> (Vec<RigPoint>, usize) {
        let n = self.points.len();
        let mut chance = SplitMix64::new(0);
        let (mut best, mut least, mut wanted, mut drawn) = (Vec::new(), f64::INFINITY, MAX_SAMPLES, 0);
        while drawn < wanted {
            drawn += 1;
            let triple = distinct(&mut chance, n).map(|i| self.points[i]);
            let (rays, places) = (triple.map(|p| self.ray(p)), triple.map(|p| self.seen(p).x_in_target));
            for pose in gp3p(&rays, &places) {
                let (inliers, cost) = self.agreeing(&pose);
                if cost < least {
                    (best, least) = (inliers, cost);
                    let good = GOOD_SAMPLES * share_of_triples(best.len(), n);
                    wanted =
                        samples_for(CONFIDENCE, good).map_or(MAX_SAMPLES, |needed| needed.min(MAX_SAMPLES));
                }
            }
        }
        (best, drawn)
    }

    /// Returns the evidence against chance: a point agrees with a wrong pose where it is in the disc of the threshold by accident.
    fn evidence(&self) -> Evidence {
        let of_view = |view: &RigView| {
            let (low, high) =
                view.seen.iter().fold(([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]), |(low, high), c| {
                    ([0, 1].map(|i| low[i].min(c.pixel[i])), [0, 1].map(|i| high[i].max(c.pixel[i])))
                });
            let side = |i: usize| (high[i] - low[i]).max(2.0 * self.threshold_px);
            let seen = side(0) * side(1);
            let area = view.camera.size.map_or(seen, |s| f64::from(s.width_px) * f64::from(s.height_px));
            core::f64::consts::PI * self.threshold_px * self.threshold_px / area.max(f64::MIN_POSITIVE)
        };
        let used = self.views.iter().filter(|view| !view.seen.is_empty());
        let n_units = self.points.len();
        Evidence {
            n_units,
            n_used: 3,
            ln_poses: ln_triples(n_units) + MOST_POSES.ln(),
            chance: used.map(of_view).fold(0.0, f64::max).min(1.0),
        }
    }

    /// Solves by least squares on the points that agree, until that set no longer changes.
    fn settled(&self, mut inliers: Vec<RigPoint>, n_samples: usize) -> Result<RigConsensus, Error> {
        let (evidence, n) = (self.evidence(), self.points.len());
        let needed = evidence.needed(MAX_FALSE_ALARMS.ln());
        for _ in 0..MAX_ROUNDS {
            if inliers.len() < needed {
                let best = inliers.len();
                return Err(Error::NoConsensus { best, n, needed, what: "points", samples: n_samples });
            }
            let chosen: Vec<Vec<Correspondence>> = (0..self.views.len())
                .map(|view| inliers.iter().filter(|p| p.0 == view).map(|p| *self.seen(*p)).collect())
                .collect();
            let views: Vec<RigView> =
                self.views.iter().zip(&chosen).map(|(view, seen)| RigView { seen, ..*view }).collect();
            let mut estimate = locate_rig(&views)?;
            let (next, _) = self.agreeing(&estimate.rig_from_target);
            if next == inliers {
                let truncation = self.truncation(&inliers);
                widen(&mut estimate, truncation, &inliers);
                let ln_false_alarms = evidence.ln_false_alarms(inliers.len());
                return Ok(RigConsensus {
                    confidence: confidence(GOOD_SAMPLES * share_of_triples(inliers.len(), n), n_samples),
                    log10_false_alarms: ln_false_alarms / core::f64::consts::LN_10,
                    estimate,
                    inliers,
                    n_samples,
                    truncation,
                });
            }
            inliers = next;
        }
        Err(Error::NotConverged { steps: MAX_ROUNDS })
    }

    /// Returns the truncation factor as in `robust::settle`.
    fn truncation(&self, inliers: &[RigPoint]) -> f64 {
        let (mut kept, mut all) = (0.0, 0.0);
        for point in inliers {
            let sigma_px = self.seen(*point).sigma_px;
            let (weight, t) = (1.0 / (sigma_px * sigma_px), 0.5 * (self.threshold_px / sigma_px).powi(2));
            // t e⁻ᵗ/(1 − e⁻ᵗ) = t/(eᵗ − 1); it vanishes for a wide threshold and is 1 − t/2 for a narrow one.
            kept += weight * if t < 1e-8 { 0.5 * t } else { 1.0 - t / t.exp_m1() };
            all += weight;
        }
        kept / all
    }
}

/// Corrects the estimate for the residuals beyond the threshold, which are missing; indices become those of all points.
fn widen(estimate: &mut RigPoseEstimate, truncation: f64, inliers: &[RigPoint]) {
    estimate.covariance /= truncation;
    if let RigAmbiguity::Ambiguous { other, .. } = &mut estimate.ambiguity {
        other.covariance /= truncation;
    }
    if let super::RigConsistency::Inconsistent { worst_camera, worst_point, .. } = &mut estimate.consistency {
        let of_camera = inliers.iter().filter(|p| p.0 == *worst_camera);
        *worst_point = of_camera.map(|p| p.1).nth(*worst_point).unwrap_or(*worst_point);
    }
}

/// Returns the share of the triples of n that consist of the m good ones.
fn share_of_triples(m: usize, n: usize) -> f64 {
    let of = |k: usize| (k as f64) * (k as f64 - 1.0).max(0.0) * (k as f64 - 2.0).max(0.0);
    of(m) / of(n).max(1.0)
}

fn distinct(chance: &mut SplitMix64, n: usize) -> [usize; 3] {
    let (a, b, c) = (chance.below(n), chance.below(n - 1), chance.below(n - 2));
    let b = if a <= b { b + 1 } else { b };
    let (low, high) = (a.min(b), a.max(b));
    let c = if low <= c { c + 1 } else { c };
    [a, b, if high <= c { c + 1 } else { c }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_points_are_distinct_and_all_triples_come() {
        let mut chance = SplitMix64::new(3);
        let mut counts = std::collections::BTreeMap::new();
        for _ in 0..6000 {
            let mut triple = distinct(&mut chance, 5);
            triple.sort_unstable();
            assert!(triple[0] < triple[1] && triple[1] < triple[2] && triple[2] < 5, "{triple:?}");
            *counts.entry(triple).or_insert(0) += 1;
        }
        assert!(counts.len() == 10 && counts.values().all(|n| (500..700).contains(n)), "{counts:?}");
    }
}
