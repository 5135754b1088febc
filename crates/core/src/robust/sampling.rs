//! Which three points next, and how likely three good ones are: docs/math/robust.md section 3.

use crate::statistics::SplitMix64;

/// Up to this many points every triple is listed (2,024 of them) and drawn without repetition; listing more takes longer than using a few.
const MAX_LISTED: usize = 24;

/// Points that stand and fall together, by place in the order of chance.
pub(super) struct Groups {
    /// The group of each point.
    pub of: Vec<u32>,
    /// The points of each group.
    pub members: Vec<Vec<u32>>,
}

impl Groups {
    /// Groups numbered by their first point in the order of chance, so that neither rows nor labels have a say.
    pub(super) fn new(labels: &[u32], order: &[u32]) -> Self {
        let mut sorted: Vec<(u32, u32)> =
            (0..).zip(order).map(|(at, row)| (labels[*row as usize], at)).collect();
        sorted.sort_unstable();
        let mut members: Vec<Vec<u32>> = sorted
            .chunk_by(|a, b| a.0 == b.0)
            .map(|group| group.iter().map(|(_, at)| *at).collect())
            .collect();
        members.sort_unstable();
        let mut of = vec![0; order.len()];
        for (group, points) in (0..).zip(&members) {
            points.iter().for_each(|at| of[*at as usize] = group);
        }
        Groups { of, members }
    }

    /// Whether every group has three points or more: a pose of its own.
    pub(super) fn all_are_whole(&self) -> bool {
        self.members.iter().all(|points| 3 <= points.len())
    }
}

/// Draws samples.
pub(super) enum Sampler {
    /// Every triple once: those not yet drawn stand at the end.
    Listed { triples: Vec<[u8; 3]>, drawn: usize },
    /// Any three of n.
    Free { n: usize },
    /// Two groups that have three points together, or three single points.
    Grouped,
}

impl Sampler {
    pub(super) fn new(n: usize, groups: Option<&Groups>) -> Self {
        if groups.is_some() {
            return Sampler::Grouped;
        }
        if MAX_LISTED < n {
            return Sampler::Free { n };
        }
        let n = n as u8;
        let triples = (0..n).flat_map(|i| (i + 1..n).flat_map(move |j| (j + 1..n).map(move |k| [i, j, k])));
        Sampler::Listed { triples: triples.collect(), drawn: 0 }
    }

    /// Whether every triple comes once.
    pub(super) fn is_listed(&self) -> bool {
        matches!(self, Sampler::Listed { .. })
    }

    /// The next three points; none when every triple has been drawn.
    #[inline]
    pub(super) fn next(&mut self, chance: &mut SplitMix64, groups: Option<&Groups>) -> Option<[usize; 3]> {
        match (self, groups) {
            (Sampler::Listed { triples, drawn }, _) => {
                let left = triples.len() - *drawn;
                let at = *drawn + if 0 < left { chance.below(left) } else { return None };
                triples.swap(*drawn, at);
                *drawn += 1;
                Some(triples[*drawn - 1].map(usize::from))
            }
            (Sampler::Grouped, Some(groups)) => Some(from_groups(chance, groups)),
            (Sampler::Free { n }, _) => Some(distinct(chance, *n)),
            (Sampler::Grouped, None) => None,
        }
    }
}

/// Three different numbers below n.
#[inline]
fn distinct(chance: &mut SplitMix64, n: usize) -> [usize; 3] {
    let i = chance.below(n);
    let (j, k) = (chance.below(n - 1), chance.below(n - 2));
    let j = if j < i { j } else { j + 1 };
    let (low, high) = (i.min(j), i.max(j));
    let k = if k < low { k } else { k + 1 };
    let k = if k < high { k } else { k + 1 };
    [i, j, k]
}

/// Two points of one group and one of another, where either has two; else of three groups. A single group gives three of its own.
fn from_groups(chance: &mut SplitMix64, groups: &Groups) -> [usize; 3] {
    let members = |group: usize| &groups.members[group];
    let any =
        |chance: &mut SplitMix64, group: usize| members(group)[chance.below(members(group).len())] as usize;
    let n = groups.members.len();
    if n < 3 {
        let all = distinct(chance, groups.of.len());
        return all; // One or two groups: any three points.
    }
    let [a, b, c] = distinct(chance, n);
    let (a, b) = if members(a).len() < members(b).len() { (b, a) } else { (a, b) };
    if members(a).len() == 1 {
        return [any(chance, a), any(chance, b), any(chance, c)];
    }
    let points = members(a);
    let first = chance.below(points.len());
    let second = chance.below(points.len() - 1);
    let second = if second < first { second } else { second + 1 };
    [points[first] as usize, points[second] as usize, any(chance, b)]
}

/// The chance that a sample is all good when `n_good` units of `n` are, `n_good_single` of them (of `n_single`) points without
/// company. Two units are enough unless both are single, eq. (12); without groups all are.
pub(super) fn chance_of_good(n_good: usize, n: usize, n_good_single: usize) -> f64 {
    let [g, n, s] = [n_good, n, n_good_single].map(|x| x as f64);
    if n < 3.0 {
        return if n <= g { 1.0 } else { 0.0 };
    }
    let pairs = n * (n - 1.0);
    let two_are_enough = (g * (g - 1.0) - s * (s - 1.0)) / pairs;
    two_are_enough + s * (s - 1.0) / pairs * (g - 2.0).max(0.0) / (n - 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triple_is_listed_once() {
        let (mut chance, mut sampler) = (SplitMix64::scattered(3), Sampler::new(9, None));
        let mut seen = std::collections::HashSet::new();
        while let Some(triple) = sampler.next(&mut chance, None) {
            assert!(triple[0] < triple[1] && triple[1] < triple[2] && triple[2] < 9);
            assert!(seen.insert(triple));
        }
        assert_eq!(seen.len(), 84);
    }

    /// Drawn triples have three different members, each point a third of 3/n as often (five standard deviations).
    #[test]
    fn free_triples_are_distinct_and_even() {
        let (mut chance, mut counts) = (SplitMix64::scattered(4), [0usize; 5]);
        for _ in 0..50_000 {
            let [i, j, k] = distinct(&mut chance, 5);
            assert!(i != j && j != k && i != k);
            [i, j, k].iter().for_each(|p| counts[*p] += 1);
        }
        let sigma = (50_000.0f64 * 0.6 * 0.4).sqrt();
        assert!(counts.iter().all(|c| (*c as f64 - 30_000.0).abs() < 5.0 * sigma), "{counts:?}");
    }

    /// The formula against the frequency of draws, groups of every size (five standard deviations).
    #[test]
    fn good_samples_come_as_often_as_computed() {
        let labels = [0, 0, 0, 0, 1, 1, 2, 3, 4, 5, 5, 5, 6, 7];
        let order: Vec<u32> = (0..14).collect();
        let groups = Groups::new(&labels, &order);
        assert_eq!(groups.members.len(), 8);
        for good in [[true; 8], [true, false, true, true, true, false, true, false]] {
            let is_good = |p: usize| good[labels[p] as usize];
            let singles = [2, 3, 4, 6, 7].iter().filter(|g| good[**g]).count();
            let expected = chance_of_good(good.iter().filter(|g| **g).count(), 8, singles);
            let mut chance = SplitMix64::scattered(5);
            let hits = (0..100_000)
                .filter(|_| from_groups(&mut chance, &groups).iter().all(|p| is_good(*p)))
                .count();
            let sigma = (expected * (1.0 - expected) / 1e5).sqrt();
            assert!((hits as f64 / 1e5 - expected).abs() <= 5.0 * sigma + 1e-12, "{hits} {expected}");
        }
    }
}
