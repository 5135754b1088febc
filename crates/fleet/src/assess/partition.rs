//! Finds the steps of the mean of readings: the best partition for a penalty per step, by dynamic programming.
//!
//! The penalty follows from the stated rate of false alarms; what lasts from reading to reading makes partitions of white noise too fine, so
//! that those of larger and larger noise are candidates, among which the evidence decides: docs/math/fleet.md eqs. (13), (14).

use resight::core::Vector6;

/// Exceeded by χ² with six degrees of freedom once in 5·10⁷: one of the 100 places of a day, once in 500,000 days.
const PENALTY: f64 = 47.0;
/// Factor by which the noise grows from candidate to candidate.
const GROWTH: f64 = 3.0;
/// A larger number of steps is not due to motions of a camera on a mast.
pub(super) const MOST: usize = 24;

/// Sets of steps, each the first readings after them, from many to few. `whitened` have unit covariance where `weights` are one.
pub(super) fn candidates(whitened: &[Vector6], weights: &[f64]) -> Vec<Vec<usize>> {
    let costs = Costs::new(whitened, weights);
    let mut found: Vec<Vec<usize>> = Vec::new();
    let mut penalty = PENALTY;
    loop {
        let steps = partition(&costs, penalty);
        if steps.is_empty() || !penalty.is_finite() {
            return found;
        }
        if steps.len() <= MOST && found.last() != Some(&steps) {
            found.push(steps);
        }
        penalty *= GROWTH;
    }
}

/// The first readings after the steps of the partition whose cost and penalties together are least.
fn partition(costs: &Costs, penalty: f64) -> Vec<usize> {
    let n = costs.len();
    let mut best = vec![-penalty; n + 1];
    let mut begins = vec![0; n + 1];
    let mut kept = vec![0];
    for end in 1..=n {
        let total = |begin: usize| best[begin] + costs.of(begin, end) + penalty;
        let all: Vec<(usize, f64)> = kept.iter().map(|begin| (*begin, total(*begin))).collect();
        let least = all.iter().min_by(|a, b| a.1.total_cmp(&b.1)).copied().unwrap_or((0, f64::INFINITY));
        (begins[end], best[end]) = least;
        // A start that is worse by more than the penalty of a step never becomes the best (Killick, Fearnhead and Eckley, 2012).
        kept = all
            .into_iter()
            .filter(|(_, cost)| *cost <= best[end] + penalty)
            .map(|(begin, _)| begin)
            .collect();
        kept.push(end);
    }
    let mut steps = Vec::new();
    let mut end = n;
    while 0 < begins[end] {
        end = begins[end];
        steps.push(end);
    }
    steps.reverse();
    steps
}

/// Sums from which the scatter of any stretch of readings follows.
struct Costs {
    weights: Vec<f64>,
    sums: Vec<Vector6>,
    squares: Vec<f64>,
}

impl Costs {
    fn new(whitened: &[Vector6], weights: &[f64]) -> Self {
        let (mut w, mut s, mut q) = (vec![0.0], vec![Vector6::zeros()], vec![0.0]);
        // About a reading in the middle, for the sake of rounding.
        let middle = whitened.get(whitened.len() / 2).copied().unwrap_or_default();
        for (i, (y, weight)) in whitened.iter().zip(weights).enumerate() {
            let y = y - middle;
            w.push(w[i] + weight);
            s.push(s[i] + y * *weight);
            q.push(q[i] + weight * y.norm_squared());
        }
        Costs { weights: w, sums: s, squares: q }
    }

    fn len(&self) -> usize {
        self.weights.len() - 1
    }

    /// Σ w |y − mean|².
    fn of(&self, begin: usize, end: usize) -> f64 {
        let weight = self.weights[end] - self.weights[begin];
        let sum = self.sums[end] - self.sums[begin];
        (self.squares[end] - self.squares[begin] - sum.norm_squared() / weight.max(f64::MIN_POSITIVE))
            .max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two steps in white noise, one of them near the end, are found where they are; noise alone has none.
    #[test]
    fn steps_are_found_where_they_are() {
        let noise = |i: usize, k: usize| ((i * 7919 + k * 104_729) % 1000) as f64 / 290.0 - 1.72;
        let at = |i: usize| Vector6::from_fn(|k, _| noise(i, k));
        let quiet: Vec<Vector6> = (0..96).map(at).collect();
        let weights = vec![1.0; 96];
        assert!(candidates(&quiet, &weights).is_empty());
        let moved: Vec<Vector6> =
            (0..96).map(|i| at(i) + Vector6::x() * if (30..92).contains(&i) { 30.0 } else { 0.0 }).collect();
        assert_eq!(candidates(&moved, &weights)[0], [30, 92]);
    }
}
