//! Counts of durations by size.

/// Upper bounds of the buckets, seconds: 1, 2, 5 in each decade, from a decision (µs) to a camera that is far behind (s).
pub const BOUNDS_S: [f64; 21] = [
    1e-6, 2e-6, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5,
    1.0, 2.0, 5.0,
];

/// A histogram of durations.
#[derive(Debug, Clone, Default)]
pub struct Histogram {
    /// Number of durations between each bound and the one before.
    counts: [u64; BOUNDS_S.len()],
    count: u64,
    sum_s: f64,
}

impl Histogram {
    /// Adds a duration, seconds.
    pub fn add(&mut self, duration_s: f64) {
        if !duration_s.is_finite() {
            return;
        }
        if let Some(bucket) = BOUNDS_S.iter().position(|bound_s| duration_s <= *bound_s) {
            self.counts[bucket] += 1;
        }
        self.count += 1;
        self.sum_s += duration_s;
    }

    /// Returns for each bound the number of durations up to it.
    pub fn cumulative(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        BOUNDS_S.iter().zip(&self.counts).scan(0, |below, (bound_s, count)| {
            *below += count;
            Some((*bound_s, *below))
        })
    }

    /// Returns the number of durations.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns their sum, seconds.
    pub fn sum_s(&self) -> f64 {
        self.sum_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_duration_is_in_the_bucket_of_its_bound() {
        let mut histogram = Histogram::default();
        for duration_s in [0.0, 1e-6, 1.5e-6, 5.0, 6.0, f64::NAN] {
            histogram.add(duration_s);
        }
        let cumulative: Vec<u64> = histogram.cumulative().map(|(_, count)| count).collect();
        assert_eq!((cumulative[0], cumulative[1], cumulative[19], cumulative[20]), (2, 3, 3, 4));
        assert_eq!((histogram.count(), histogram.sum_s()), (5, 11.0000025));
    }
}
