//! Motions that came back by themselves: a sun spot on half of a tag, a lorry in front of the mast.
//!
//! By the pose alone they are motions until they end. When two have come back, one that is no larger is reported only when it has
//! lasted for longer than they did: docs/math/monitor.md eq. (43).

use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};

/// One may be a hand that put the camera back.
const SOME: u64 = 2;
/// How much longer, and larger, than those before it one may be.
const MARGIN: f64 = 2.0;
/// After this time without one they are over, seconds.
const FORGOTTEN_S: f64 = 10.0 * super::axis::DAY_S;
/// A change that lasts longer was a motion, and the camera was put back.
const LONGEST_S: f64 = 3600.0;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Transients {
    count: u64,
    longest_s: f64,
    /// Of the largest, χ² with the covariance of a reading.
    largest: f64,
    last_s: f64,
}

impl Transients {
    /// One lasted from `began_s` to `ended_s`, by a motion of this size.
    pub fn add(&mut self, began_s: f64, ended_s: f64, size: f64) {
        if LONGEST_S < ended_s - began_s {
            return;
        }
        if self.last_s + FORGOTTEN_S < ended_s {
            *self = Transients::default();
        }
        self.count += 1;
        self.longest_s = self.longest_s.max(ended_s - began_s);
        self.largest = self.largest.max(size);
        self.last_s = ended_s;
    }

    /// Until when a motion of this size that began at `began_s` may be another one.
    pub fn may_last_until(&self, began_s: f64, size: f64) -> Option<f64> {
        let is_like_them = size <= MARGIN * MARGIN * self.largest;
        let are_known = SOME <= self.count && began_s <= self.last_s + FORGOTTEN_S;
        (is_like_them && are_known).then_some(began_s + MARGIN * self.longest_s)
    }
}

/// χ² of a motion with the covariance of a reading.
pub(super) fn size(motion: &Vector6, reading: &Matrix6) -> f64 {
    reading.cholesky().map_or(f64::INFINITY, |factor| motion.dot(&factor.solve(motion)))
}

numbers!(Transients { count, longest_s, largest, last_s });

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
}
