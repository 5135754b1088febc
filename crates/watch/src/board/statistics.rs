//! Rolling statistics over the last frames of a camera. Time is an input.

use nalgebra::Vector6;
use resight::core::Pose;
use std::collections::VecDeque;

/// The last few numbers.
#[derive(Debug, Clone)]
pub struct Rolling {
    values: VecDeque<f64>,
    capacity: usize,
}

impl Rolling {
    /// Remembers `capacity` numbers, at least one.
    pub fn new(capacity: usize) -> Self {
        Rolling { values: VecDeque::new(), capacity: capacity.max(1) }
    }

    /// Adds one; what is no number is left out.
    pub fn push(&mut self, value: f64) {
        if value.is_finite() {
            keep(&mut self.values, self.capacity, value);
        }
    }

    /// The newest.
    pub fn last(&self) -> Option<f64> {
        self.values.back().copied()
    }

    /// The quantile, 0 to 1, with linear interpolation between neighbours: 0.5 is the median.
    pub fn quantile(&self, at: f64) -> Option<f64> {
        let mut sorted: Vec<f64> = self.values.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let place = at.clamp(0.0, 1.0) * sorted.len().checked_sub(1)? as f64;
        let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
        Some(low + (high - low) * place.fract())
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.values.clear();
    }
}

/// Arrivals remembered: about a second of a camera's frames.
const ARRIVALS: usize = 32;
/// After this many mean intervals without an arrival the rate is zero.
const SILENT_AFTER: f64 = 3.0;
/// A network pauses for as long now and then, seconds.
const LEAST_PATIENCE_S: f64 = 2.0;

/// The rate of arrivals.
#[derive(Debug, Clone, Default)]
pub struct Rate {
    arrivals_s: VecDeque<f64>,
}

impl Rate {
    /// Something arrived. Times do not decrease.
    pub fn push(&mut self, now_s: f64) {
        keep(&mut self.arrivals_s, ARRIVALS, now_s);
    }

    /// Arrivals a second over the last few; 0 when they stopped, none before the second.
    pub fn per_s(&self, now_s: f64) -> Option<f64> {
        let (first_s, last_s) = (self.arrivals_s.front()?, self.arrivals_s.back()?);
        let intervals = (self.arrivals_s.len() - 1) as f64;
        let span_s = last_s - first_s;
        if intervals < 1.0 || !(0.0 < span_s) {
            return None;
        }
        let silent_s = now_s - last_s;
        Some(if SILENT_AFTER * (span_s / intervals).max(0.1) < silent_s { 0.0 } else { intervals / span_s })
    }

    /// Without a frame for longer than this, seconds, something is wrong: a few of the intervals between frames, and two seconds at least.
    pub fn patience_s(&self) -> f64 {
        let ends = self.arrivals_s.front().zip(self.arrivals_s.back());
        let intervals = self.arrivals_s.len().saturating_sub(1).max(1) as f64;
        let interval_s = ends.map_or(0.0, |(first_s, last_s)| (last_s - first_s) / intervals);
        (SILENT_AFTER * interval_s).max(LEAST_PATIENCE_S)
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.arrivals_s.clear();
    }
}

/// The last few poses: how far they scatter.
#[derive(Debug, Clone)]
pub struct Spread {
    poses: VecDeque<Pose>,
    capacity: usize,
}

/// Steps towards the mean on SE(3); each leaves the square of the scatter, so that three serve far beyond any camera's noise.
const MEAN_STEPS: usize = 3;

impl Spread {
    /// Remembers `capacity` poses, at least two.
    pub fn new(capacity: usize) -> Self {
        Spread { poses: VecDeque::new(), capacity: capacity.max(2) }
    }

    /// Adds one.
    pub fn push(&mut self, a_from_b: Pose) {
        keep(&mut self.poses, self.capacity, a_from_b);
    }

    /// Returns whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Poses remembered.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Returns the standard deviations of the small left motions from the mean pose, `[rotation_rad; translation_m]` in frame a, with (n − 1) as
    /// for a sample; `None` for fewer than two poses.
    pub fn sigma(&self) -> Option<Vector6<f64>> {
        let freedom = self.poses.len().checked_sub(1).filter(|n| 0 < *n)? as f64;
        let mut mean = *self.poses.back()?;
        for _ in 0..MEAN_STEPS {
            mean = Pose::exp(&(self.motions(&mean).sum::<Vector6<f64>>() / self.poses.len() as f64)) * mean;
        }
        let squares: Vector6<f64> = self.motions(&mean).map(|y| y.component_mul(&y)).sum();
        Some((squares / freedom).map(f64::sqrt))
    }

    fn motions(&self, mean: &Pose) -> impl Iterator<Item = Vector6<f64>> {
        let back = mean.inverse();
        self.poses.iter().map(move |pose| (*pose * back).log())
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.poses.clear();
    }
}

fn keep<T>(values: &mut VecDeque<T>, capacity: usize, value: T) {
    if values.len() == capacity {
        values.pop_front();
    }
    values.push_back(value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::statistics::SplitMix64;

    #[test]
    fn quantiles_lie_between_neighbours_and_old_numbers_are_forgotten() {
        let mut rolling = Rolling::new(5);
        assert_eq!((rolling.last(), rolling.quantile(0.5)), (None, None));
        [900.0, 4.0, 1.0, f64::NAN, 3.0, 5.0, 2.0].into_iter().for_each(|value| rolling.push(value));
        assert_eq!(rolling.last(), Some(2.0));
        assert_eq!([0.0, 0.5, 1.0].map(|at| rolling.quantile(at)), [Some(1.0), Some(3.0), Some(5.0)]);
        assert_eq!(rolling.quantile(0.9), Some(4.6));
        rolling.clear();
        assert_eq!(rolling.quantile(0.5), None);
    }

    #[test]
    fn a_rate_is_that_of_the_last_arrivals_and_falls_to_zero() {
        let mut rate = Rate::default();
        (0..100).for_each(|i| rate.push(f64::from(i)));
        (0..100).for_each(|i| rate.push(100.0 + f64::from(i) / 30.0));
        let now_s = 100.0 + 99.0 / 30.0;
        assert!((rate.per_s(now_s).expect("a rate") - 30.0).abs() < 1e-9);
        assert_eq!(rate.per_s(now_s + 1.0), Some(0.0));
        assert_eq!(rate.patience_s(), LEAST_PATIENCE_S);
    }

    /// Uniform errors of half-width w have the standard deviation w/√3. That of 4000 is known to about 1 %.
    #[test]
    fn the_spread_on_se3_is_the_one_that_went_in() {
        let widths = Vector6::new(0.01, 0.002, 0.03, 0.004, 0.05, 0.006);
        let a_from_b = Pose::exp(&Vector6::new(2.0, -0.9, 1.4, 3.0, -2.0, 5.0));
        let (mut random, mut spread) = (SplitMix64::new(7), Spread::new(4000));
        for _ in 0..5000 {
            let error = widths.map(|w| w * (2.0 * random.uniform() - 1.0));
            spread.push(Pose::exp(&error) * a_from_b);
        }
        let sigma = spread.sigma().expect("poses");
        assert_eq!(spread.len(), 4000);
        for i in 0..6 {
            let truth = widths[i] / 3.0_f64.sqrt();
            assert!((sigma[i] / truth - 1.0).abs() < 0.05, "axis {i}: {} for {truth}", sigma[i]);
        }
    }

    #[test]
    fn one_pose_has_no_spread_and_equal_ones_have_none_at_all() {
        let mut spread = Spread::new(10);
        let a_from_b = Pose::exp(&Vector6::new(0.3, 0.2, 0.1, 1.0, 2.0, 3.0));
        spread.push(a_from_b);
        assert_eq!(spread.sigma(), None);
        spread.push(a_from_b);
        assert!(spread.sigma().expect("two poses").norm() < 1e-12);
    }
}
