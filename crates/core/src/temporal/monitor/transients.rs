//! Motions that came back by themselves: a sun spot on half of a tag, a lorry in front of the mast, rain, the key frames of a video.
//!
//! By the pose alone they are motions until they end. When two have come back, one that is no larger is reported only when it has
//! lasted for twice as long as they did: docs/math/monitor.md eqs. (43) and (43a).

use super::axis::DAY_S;
use super::priors::OUTLIER;
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};

/// One may be a hand that put the camera back.
const SOME: u64 = 2;
/// How much longer, and larger, than those before it one may be.
const MARGIN: f64 = 2.0;
/// After this time without one they are over, seconds.
pub(super) const FORGOTTEN_S: f64 = 10.0 * DAY_S;
/// A change that lasts longer was a motion, and the camera was put back.
pub(super) const LONGEST_S: f64 = 3600.0;

/// Motions that ended by themselves, of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Recurring {
    count: u64,
    longest_s: f64,
    /// Of the largest, χ² with the covariance of a reading.
    largest: f64,
    last_s: f64,
}

/// Of those within an hour, and of those that the error of one reading explains, within a day.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Transients {
    brief: Recurring,
    small: Recurring,
}

/// What is known of motions that come back by themselves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    pub count: u64,
    /// χ² up to which a motion is held, and for how long.
    pub largest: f64,
    pub held_s: f64,
}

impl Transients {
    /// One lasted from `began_s` to `ended_s`, by a motion of this size.
    pub fn add(&mut self, began_s: f64, ended_s: f64, size: f64) {
        if ended_s - began_s <= LONGEST_S {
            self.brief.add(began_s, ended_s, size);
        }
        self.add_small(began_s, ended_s, size);
    }

    /// One ended in another motion that does not continue it: it counts where the error of one reading explains it.
    pub fn add_small(&mut self, began_s: f64, ended_s: f64, size: f64) {
        if ended_s - began_s <= DAY_S && size < OUTLIER {
            // What a reading's error explains is held however small those before it were.
            self.small.add(began_s, ended_s, size.max(OUTLIER / (MARGIN * MARGIN)));
        }
    }

    /// Until when a motion of this size that is found at `t_s` may be another one.
    pub fn may_last_until(&self, t_s: f64, size: f64) -> Option<f64> {
        let like_it = [&self.brief, &self.small].into_iter().filter_map(|kind| kind.known(t_s));
        like_it.filter(|known| size <= known.largest).map(|known| t_s + known.held_s).reduce(f64::max)
    }

    /// How many there were of late.
    pub fn count(&self, t_s: f64) -> u64 {
        let of = |kind: &Recurring| if t_s <= kind.last_s + FORGOTTEN_S { kind.count } else { 0 };
        of(&self.brief).max(of(&self.small))
    }

    /// What is known of all of them.
    pub fn known(&self, t_s: f64) -> Option<Known> {
        let both = |a: Known, b: Known| Known {
            count: a.count.max(b.count),
            largest: a.largest.max(b.largest),
            held_s: a.held_s.max(b.held_s),
        };
        [&self.brief, &self.small].into_iter().filter_map(|kind| kind.known(t_s)).reduce(both)
    }
}

impl Recurring {
    fn add(&mut self, began_s: f64, ended_s: f64, size: f64) {
        if self.last_s + FORGOTTEN_S < ended_s {
            *self = Recurring::default();
        }
        self.count += 1;
        self.longest_s = self.longest_s.max(ended_s - began_s);
        self.largest = self.largest.max(size);
        self.last_s = ended_s;
    }

    fn known(&self, t_s: f64) -> Option<Known> {
        let (largest, held_s) = (MARGIN * MARGIN * self.largest, MARGIN * self.longest_s);
        let are_known = SOME <= self.count && t_s <= self.last_s + FORGOTTEN_S;
        are_known.then_some(Known { count: self.count, largest, held_s })
    }
}

/// χ² of a motion with the covariance of a reading.
pub(super) fn size(motion: &Vector6, reading: &Matrix6) -> f64 {
    reading.cholesky().map_or(f64::INFINITY, |factor| motion.dot(&factor.solve(motion)))
}

numbers!(Recurring { count, longest_s, largest, last_s });
numbers!(Transients { brief, small });

#[cfg(test)]
mod tests {
    use super::Transients;

    #[test]
    fn two_that_came_back_let_a_third_wait() {
        let mut seen = Transients::default();
        seen.add(100.0, 400.0, 9.0);
        assert_eq!(seen.may_last_until(1000.0, 9.0), None, "one may be a hand");
        seen.add(2000.0, 2200.0, 4.0);
        assert_eq!(seen.may_last_until(5000.0, 36.0), Some(5600.0));
        assert_eq!(seen.may_last_until(5000.0, 37.0), None, "larger than twice the largest");
        assert_eq!(seen.may_last_until(2200.0 + 11.0 * 86_400.0, 4.0), None, "long ago");
    }

    #[test]
    fn small_ones_are_known_for_a_day_and_large_ones_stay_motions() {
        let mut seen = Transients::default();
        (0..2).for_each(|i| seen.add(1e5 * f64::from(i), 1e5 * f64::from(i) + 40_000.0, 9.0));
        assert_eq!(seen.may_last_until(2e5, 36.0), Some(280_000.0));
        assert_eq!(seen.may_last_until(2e5, 37.0), None);
        (0..2).for_each(|_| seen.add_small(2e5, 2.001e5, 30.0));
        assert_eq!(seen.may_last_until(3e5, 37.0), None, "more than the error of a reading");
        (0..2).for_each(|_| seen.add(3e5, 3.05e5, 900.0));
        assert_eq!(seen.may_last_until(4e5, 37.0), None, "put back after hours");
        assert_eq!(seen.known(4e5).map(|known| known.count), Some(2));
    }
}
