//! What both change detectors, that of a single pair and that of a rig, expect before they have seen anything: one prior, one set of names.
//!
//! They differ in what a reading is (a pose; the differences of several cameras' poses) and so in their filters, not in what they look for:
//! the same courses and sizes of a change, the same noise that may have grown, the same share of the evidence that goes to what chance
//! chose, the same outliers. docs/math/monitor.md sections 3, 7 and 9.
//!
//! ```text
//!   χ²_n, V  of a reading with n numbers: νᵀS⁻¹ν and ln |S|      L_f = −½ Σ (χ²/f + V + n ln f)     noise grown by f
//! ```

/// How a change continues.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionKind {
    /// A jump that stays.
    Step,
    /// A drift that continues; its size is per day.
    Ramp,
}

/// In this order everywhere.
pub(super) const COURSES: [MotionKind; 2] = [MotionKind::Step, MotionKind::Ramp];
/// Size looked for of each course, in standard deviations of a reading, of a drift per day. A change five times larger or smaller costs
/// about ln 5 of evidence.
pub(super) const SIZES: [f64; COURSES.len()] = [2.0, 30.0];
/// Sizes looked for beside noise that may follow a jump, in units of those, and their prior weights.
pub(super) const WIDER: [(f64, f64); 4] = [(1.0, 0.85), (12.0, 0.05), (150.0, 0.05), (2000.0, 0.05)];
/// Noise may have grown since an onset, in all coordinates at once: its variance by these factors.
pub(super) const GROWN: [f64; 3] = [1.5, 3.0, 9.0];
/// ln of how seldom that is at the very time of an onset; by the first factor the scale may err at any time.
const GROWS: [f64; GROWN.len()] = [0.0, -7.0, -7.0];
/// The models of the noise stand on a grid, and the noise between them: what the best of them may be worse by, a reading.
pub(super) const BETWEEN: f64 = 1e-3;
/// ln of what the size of a change costs of evidence besides its square, and of its prior weight: eq. (47).
const SIZE: f64 = 8.0;
/// The alarm chose its moment and its onset: its estimate errs by about twice what its covariance says.
pub(super) const CHOSEN: f64 = 4.0;
/// Surprising readings that agree with each other, so that they are more than outliers: a pose estimate flips once or twice, seldom three
/// times to the same place.
pub(super) const CONFIRM: usize = 3;
/// Of the time since an onset, the share from which on a gap in it is most of it.
pub(super) const GAP_SHARE: f64 = 0.9;
/// Readings over which the scale of the noise is measured.
pub(super) const SCALE_OVER: f64 = 200.0;
/// χ² of six degrees of freedom that one in 10⁴ exceeds: such readings do not take part in what is learned.
pub(super) const OUTLIER: f64 = 27.9;
/// The 50 % quantile of the same.
pub(super) const MEDIAN: f64 = 5.348;

/// L_f of each factor by which the noise may have grown, one reading of n numbers on.
pub(super) fn read_grown(grown: &mut [f64; GROWN.len()], chi2: f64, log_volume: f64, n: f64) {
    for (grown, factor) in grown.iter_mut().zip(GROWN) {
        *grown -= 0.5 * (chi2 / factor + log_volume + n * factor.ln());
    }
}

/// The most that noise which grew at an onset explains of what came after it, the odds of that growth included.
pub(super) fn most_grown(now: &[f64; GROWN.len()], then: &[f64]) -> f64 {
    let gained = now.iter().zip(then).zip(GROWS).map(|((now, then), log_prior)| now - then + log_prior);
    gained.fold(f64::NEG_INFINITY, f64::max)
}

/// ln R where errors scatter by this factor more than the model says.
pub(super) fn deflated(log_r: f64, factor: f64) -> f64 {
    (log_r + SIZE) / factor - SIZE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::chi_square::quantile;

    #[test]
    fn outliers_and_medians_are_those_of_chi_square() {
        assert!((OUTLIER - quantile(6, 1e-4)).abs() < 0.05, "{}", quantile(6, 1e-4));
        assert!((MEDIAN - quantile(6, 0.5)).abs() < 5e-4, "{}", quantile(6, 0.5));
    }

    /// Six numbers read together or one by one; noise that grew ninefold explains itself, but for the odds of it.
    #[test]
    fn grown_noise_is_counted_alike_by_both() {
        let (mut together, mut singly) = ([0.0; GROWN.len()], [0.0; GROWN.len()]);
        for _ in 0..50 {
            read_grown(&mut together, 54.0, -3.0, 6.0);
            (0..6).for_each(|_| read_grown(&mut singly, 9.0, -0.5, 1.0));
        }
        assert!(together.iter().zip(singly).all(|(a, b)| (a - b).abs() < 1e-9), "{together:?} {singly:?}");
        assert_eq!(most_grown(&together, &[0.0; GROWN.len()]), together[2] - 7.0);
    }
}
