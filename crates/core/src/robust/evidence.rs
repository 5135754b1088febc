//! How many points may agree by chance, and how many samples are enough: docs/math/robust.md sections 2 and 3.

/// What chance could do: the count of poses tried, the points that test them, the chance of each to agree.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Evidence {
    /// Independent units: points, or groups that stand and fall together.
    pub n_units: usize,
    /// Units a sample takes, which agree by construction.
    pub n_used: usize,
    /// ln of the number of poses that samples can give.
    pub ln_poses: f64,
    /// Chance of a unit to agree with a pose it has no part in.
    pub chance: f64,
}

impl Evidence {
    /// ln of the expected number of poses with at least `n_agreeing` units among random labels, eq. (6).
    pub(crate) fn ln_false_alarms(&self, n_agreeing: usize) -> f64 {
        let (n, k) = (self.n_units.saturating_sub(self.n_used), n_agreeing.saturating_sub(self.n_used));
        self.ln_poses + ln_tail(n, k, self.chance)
    }

    /// The least number of units with fewer false alarms than that; more than there are when none is enough.
    pub(crate) fn needed(&self, ln_max: f64) -> usize {
        let enough = |m: &usize| self.ln_false_alarms(*m) <= ln_max;
        (self.n_used + 1..=self.n_units).find(enough).unwrap_or(self.n_units + 1)
    }
}

/// ln of Chernoff's bound on P[Bin(n, p) ≥ k], eq. (5).
fn ln_tail(n: usize, k: usize, p: f64) -> f64 {
    // A single far point makes the image as large as numbers go, and the chance zero: the bound stays a number.
    let (n, k, p) = (n as f64, k as f64, p.max(f64::MIN_POSITIVE));
    if k <= n * p || 1.0 <= p {
        return 0.0;
    }
    let misses = n - k;
    let of_misses = if 0.0 < misses { misses * (misses / (n * (1.0 - p))).ln() } else { 0.0 };
    -(k * (k / (n * p)).ln() + of_misses)
}

/// ln of the number of triples of n.
pub(crate) fn ln_triples(n: usize) -> f64 {
    let n = n as f64;
    (n * (n - 1.0) * (n - 2.0) / 6.0).max(1.0).ln()
}

/// Confidence that a consensus that a sample hits with probability `chance_per_sample` has been hit, eq. (9).
pub(crate) fn confidence(chance_per_sample: f64, n_samples: usize) -> f64 {
    1.0 - (n_samples as f64 * (-chance_per_sample).ln_1p()).exp()
}

/// The number of samples for a confidence; none when no number is enough.
pub(crate) fn samples_for(confidence: f64, chance_per_sample: f64) -> Option<usize> {
    let n = (1.0 - confidence).ln() / (-chance_per_sample).ln_1p();
    (0.0 < chance_per_sample && n < 1e15).then(|| n.max(1.0).ceil() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P[Bin(n, p) ≥ k], term by term.
    fn tail(n: usize, k: usize, p: f64) -> f64 {
        let mut term = (1.0 - p).powi(n as i32);
        let mut sum = 0.0;
        for j in 0..=n {
            sum += if k <= j { term } else { 0.0 };
            term *= (n - j) as f64 / (j + 1) as f64 * p / (1.0 - p);
        }
        sum
    }

    /// A bound, and not a loose one: within a factor of 30 wherever it is used.
    #[test]
    fn chernoff_bounds_the_tail() {
        for (n, p) in [(3, 4e-4), (20, 1e-2), (300, 4e-4), (300, 0.1)] {
            for k in 1..=n.min(60) {
                let (bound, exact) = (ln_tail(n, k, p), tail(n, k, p).ln());
                assert!(exact <= bound + 1e-9, "{n} {k} {p}: {exact} {bound}");
                assert!(bound < exact + 30f64.ln(), "{n} {k} {p}: {exact} {bound}");
            }
        }
        assert_eq!((ln_tail(10, 0, 0.5), ln_tail(10, 10, 1.0)), (0.0, 0.0));
    }

    #[test]
    fn samples_reach_the_confidence_they_are_for() {
        for (wanted, chance) in [(0.99, 0.125), (0.9999, 0.008), (0.999, 1e-6), (0.5, 0.9)] {
            let n = samples_for(wanted, chance).expect("a number");
            assert!(wanted <= confidence(chance, n) + 1e-12, "{wanted} {chance}");
            assert!(confidence(chance, n - 1) < wanted + 1e-12, "{wanted} {chance}");
        }
        assert_eq!(samples_for(0.99, 0.0), None);
        assert_eq!(samples_for(0.99, 1.0), Some(1));
    }
}
