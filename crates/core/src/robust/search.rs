//! The search for the pose that the most correspondences agree with: docs/math/robust.md sections 2–4.

use super::Config;
use super::evidence::{Evidence, confidence, ln_triples, samples_for};
use super::order::shuffled;
use super::sampling::{Groups, Sampler, chance_of_good};
use super::sights::{ObservationBlocks, Wald};
use crate::least_squares::{PivotedPose, minimize_pose};
use crate::solve::p3p::p3p;
use crate::statistics::SplitMix64;
use crate::{Camera, Correspondence, Error, Pose};

/// Three points with noise of their own predict the others worse than the final pose does: the search looks this many
/// thresholds wide. Evidence: docs/math/robust.md, table 1.
const WIDE: f64 = 3.0;
/// Points that give a pose.
const SAMPLE: usize = 3;
/// Share of a consensus that a good sample's own pose must have within the wide limit to be followed up.
const RECALL: f64 = 0.5;
/// Probability that a sample of good points leads to their consensus: docs/math/robust.md, table 1.
const USABLE: f64 = 0.7;
/// Poses polished in a row without a better one end the search: as many as polish this many points, and at least `LEAST_VAIN`. A threshold
/// below the noise makes every sample promising, and each leads to a place of its own: docs/math/robust.md section 4.
const VAIN_POINTS: usize = 2_000_000;
const LEAST_VAIN: usize = 200;
/// Pairs of different points looked at to see what the layout of the image gives for nothing.
const SHUFFLED_PAIRS: usize = 4000;

/// What the search found.
pub(super) struct Found {
    pub cam_from_target: Pose,
    pub n_samples: usize,
    pub confidence: f64,
    pub evidence: Evidence,
    /// Units needed to rule out chance.
    pub needed: usize,
}

/// A pose and the points that agree with it.
struct Agreement {
    cam_from_target: Pose,
    /// By point, in the order of chance; points of a group that does not agree as a whole are out.
    is_in: Vec<bool>,
    n_units: usize,
    /// Truncated cost.
    cost: f64,
    chance_per_sample: f64,
    evidence: Evidence,
}

struct Search<'a> {
    config: &'a Config<'a>,
    blocks_of_observations: ObservationBlocks,
    groups: Option<Groups>,
    evidence: Evidence,
    needed: usize,
    best: Option<Agreement>,
    /// The largest that is not more than chance.
    refused: Option<Agreement>,
    /// Poses polished since the last that was better.
    n_vain: usize,
}

/// The best consensus of `seen`; `NoConsensus` when none is more than chance.
pub(super) fn search(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<Found, Error> {
    let order = shuffled(seen, config.seed);
    let groups = config.groups.map(|labels| Groups::new(labels, &order));
    let evidence = evidence(seen, groups.as_ref(), config.threshold_px);
    let needed = evidence.needed(config.max_false_alarms.ln());
    let blocks_of_observations = ObservationBlocks::new(seen, &order, camera);
    let mut search = Search {
        config,
        blocks_of_observations,
        groups,
        evidence,
        needed,
        best: None,
        refused: None,
        n_vain: 0,
    };
    let n_samples = search.run(seen, &order);
    match search.best {
        Some(best) => Ok(Found {
            cam_from_target: best.cam_from_target,
            n_samples,
            confidence: confidence(best.chance_per_sample, n_samples),
            evidence: best.evidence,
            needed: best.evidence.needed(config.max_false_alarms.ln()),
        }),
        None => Err(search.refusal(n_samples)),
    }
}

/// What is counted.
pub(super) fn what(config: &Config) -> &'static str {
    if config.groups.is_some() { "groups" } else { "points" }
}

/// The chance of a pixel anywhere in the box of all pixels to fall within the wide limit, eqs. (4)–(6).
fn evidence(seen: &[Correspondence], groups: Option<&Groups>, threshold_px: f64) -> Evidence {
    let extent = |axis: usize| {
        let values = || seen.iter().map(|c| c.pixel[axis]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    let (side_u, side_v) = (extent(0) + 2.0 * threshold_px, extent(1) + 2.0 * threshold_px);
    let disc = core::f64::consts::PI * (WIDE * threshold_px).powi(2);
    let chance = (disc / (side_u * side_v)).min(1.0);
    let whole = groups.filter(|g| g.all_are_whole());
    Evidence {
        n_units: groups.map_or(seen.len(), |g| g.members.len()),
        n_used: if whole.is_some() { 1 } else { 3 },
        ln_poses: 4f64.ln() + whole.map_or_else(|| ln_triples(seen.len()), |g| (g.members.len() as f64).ln()),
        chance,
    }
}

impl Search<'_> {
    /// Draws samples until enough; returns how many.
    fn run(&mut self, seen: &[Correspondence], order: &[u32]) -> usize {
        let mut chance = SplitMix64::scattered(self.config.seed);
        let mut sampler = Sampler::new(seen.len(), self.groups.as_ref());
        let mut test = self.test(1);
        // Few points make few triples, and those share their points' noise: none is spared before there is an answer.
        let mut enough = if sampler.is_listed() { self.config.max_samples } else { self.enough() };
        let limit = self.wide_limit();
        let most_vain = (VAIN_POINTS / seen.len()).max(LEAST_VAIN);
        let mut n_samples = 0;
        while n_samples < enough && self.n_vain < most_vain {
            let Some(sample) = sampler.next(&mut chance, self.groups.as_ref()) else { break };
            n_samples += 1;
            if self.best.is_none() && n_samples.is_power_of_two() {
                test = self.test(n_samples);
            }
            if self.is_known(&sample) {
                continue; // It would lead back to where the search has been.
            }
            let rows = sample.map(|at| &seen[order[at] as usize]);
            for candidate in p3p(&rows.map(|c| c.bearing), &rows.map(|c| c.x_in_target)) {
                let first_block = chance.below(self.blocks_of_observations.n_blocks());
                let count = self.blocks_of_observations.count(&candidate, limit, first_block, &test);
                if count.is_some_and(|count| self.is_promising(count)) && self.follow(&candidate, rows[0]) {
                    (test, enough) = (self.test(n_samples), self.enough());
                }
            }
        }
        n_samples
    }

    /// Says how near the largest came, and what it would have needed.
    fn refusal(&self, samples: usize) -> Error {
        let (best, needed) = match &self.refused {
            Some(refused) => (refused.n_units, refused.evidence.needed(self.config.max_false_alarms.ln())),
            None => (self.evidence.n_used.min(self.evidence.n_units), self.needed),
        };
        Error::NoConsensus { best, n: self.evidence.n_units, needed, what: what(self.config), samples }
    }

    fn wide_limit(&self) -> f64 {
        (WIDE * self.config.threshold_px).powi(2)
    }

    fn is_known(&self, sample: &[usize; 3]) -> bool {
        let is_inside = |known: &Agreement| sample.iter().all(|at| known.is_in[*at]);
        self.best.as_ref().is_some_and(is_inside) || self.refused.as_ref().is_some_and(is_inside)
    }

    /// Points a good pose agrees with, at least: those of the best, or as many as can be more than chance.
    fn least_points(&self) -> f64 {
        let n_points = self.best.as_ref().map(|b| b.is_in.iter().filter(|is_in| **is_in).count());
        n_points.unwrap_or(self.needed.max(4)) as f64
    }

    /// Whether a sample's own pose is worth polishing. Its own three points always agree, so another must.
    fn is_promising(&self, count: usize) -> bool {
        SAMPLE < count && RECALL * self.least_points() <= count as f64
    }

    /// Eq. (8): a good pose against one that agrees with a point now and then. Before anything is found, good means a share that
    /// would be met once in as many samples as have been drawn: a larger one would have been met.
    fn test(&self, n_samples: usize) -> Wald {
        let n = self.blocks_of_observations.n_points() as f64;
        let unmet = if self.best.is_none() { (n_samples as f64).powf(-1.0 / 3.0) } else { 0.0 };
        let good = (RECALL * (self.least_points() / n).max(unmet)).clamp(1e-6, 0.9);
        Wald::new(good, (2.0 * self.evidence.chance).max(good / 20.0).min(0.5 * good))
    }

    /// Samples after which no larger consensus than the best, or, before the first, none large enough to count, is likely to have
    /// been missed, eq. (9).
    fn enough(&self) -> usize {
        let chance = self.best.as_ref().map_or_else(|| self.chance_of_least(), |best| best.chance_per_sample);
        let max = self.config.max_samples;
        samples_for(self.config.confidence, chance).map_or(max, |n| n.min(max))
    }

    /// The chance of a sample to come from the smallest consensus that counts; 1 when there are too few points for any.
    fn chance_of_least(&self) -> f64 {
        let whole = self.groups.as_ref().is_some_and(Groups::all_are_whole);
        let n_single = if whole { 0 } else { self.needed };
        match self.needed <= self.evidence.n_units {
            true => USABLE * chance_of_good(self.needed, self.evidence.n_units, n_single),
            false => 1.0,
        }
    }

    /// Polishes a candidate; whether it became the best.
    fn follow(&mut self, candidate: &Pose, about: &Correspondence) -> bool {
        self.n_vain += 1;
        let Some((cam_from_target, cost)) = self.polished(candidate, about) else { return false };
        if self.best.as_ref().is_some_and(|best| best.cost <= cost) {
            return false;
        }
        let found = self.agreement(cam_from_target, cost);
        if self.config.max_false_alarms.ln() < found.evidence.ln_false_alarms(found.n_units) {
            if self.refused.as_ref().is_none_or(|refused| refused.n_units < found.n_units) {
                self.refused = Some(found);
            }
            return false;
        }
        self.best = Some(found);
        self.n_vain = 0;
        true
    }

    /// The minimum of the truncated cost, first with the wide limit, then with the stated one, eq. (10).
    fn polished(&self, candidate: &Pose, about: &Correspondence) -> Option<(Pose, f64)> {
        let pivot = about.x_in_target;
        let descend = |start: PivotedPose, limit_squared: f64| {
            minimize_pose(start, None, |place| {
                self.blocks_of_observations.normal_equations(place, &pivot, limit_squared)
            })
        };
        let wide = descend(PivotedPose::new(candidate, &pivot), self.wide_limit())?;
        let narrow = descend(wide.state, self.config.threshold_px.powi(2))?;
        Some((narrow.state.pose(&pivot), narrow.equations.chi2))
    }

    fn agreement(&self, cam_from_target: Pose, cost: f64) -> Agreement {
        let mut is_in =
            self.blocks_of_observations.within(&cam_from_target, self.config.threshold_px.powi(2));
        let (n_units, n_single) = match &self.groups {
            None => {
                let n = is_in.iter().filter(|is_in| **is_in).count();
                (n, n)
            }
            Some(groups) => keep_whole(groups, &mut is_in),
        };
        let is_same_unit = |i: usize, j: usize| match &self.groups {
            Some(groups) => groups.of[i] == groups.of[j],
            None => i == j,
        };
        let limit = self.wide_limit();
        let others = self.blocks_of_observations.chance_of_others(
            &cam_from_target,
            limit,
            SHUFFLED_PAIRS,
            is_same_unit,
        );
        let evidence = Evidence { chance: self.evidence.chance.max(others), ..self.evidence };
        let chance_per_sample = USABLE * chance_of_good(n_units, evidence.n_units, n_single);
        Agreement { cam_from_target, is_in, n_units, cost, chance_per_sample, evidence }
    }
}

/// Takes the points of broken groups out; returns how many groups are left and how many of those are single points.
fn keep_whole(groups: &Groups, is_in: &mut [bool]) -> (usize, usize) {
    let (mut n_whole, mut n_single) = (0, 0);
    for members in &groups.members {
        let whole = members.iter().all(|at| is_in[*at as usize]);
        members.iter().for_each(|at| is_in[*at as usize] = whole);
        n_whole += usize::from(whole);
        n_single += usize::from(whole && members.len() == 1);
    }
    (n_whole, n_single)
}
