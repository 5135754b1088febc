//! Poses at which the camera seemed to be for hours and which it left by itself, no farther away than the error of a reading explains: an
//! infrared filter that is off at night.
//!
//! A motion to such a pose again is no news; a larger one is, however often it comes. docs/math/monitor.md section 9.

use super::priors::OUTLIER;
use super::transients;
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};
use arrayvec::ArrayVec;

/// As many are kept; the one that was left longest ago goes first.
const KEPT: usize = 4;
/// How much longer than before one may last.
const MARGIN: f64 = 2.0;
/// χ² of what two motions to one pose differ by, as a share of that of the motion.
const SAME: f64 = 0.25;

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Regime {
    motion: Vector6,
    longest_s: f64,
    last_s: f64,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Regimes {
    kept: Box<ArrayVec<Regime, KEPT>>,
}

impl Regimes {
    /// One lasted from `began_s` to `ended_s`, at a motion from the reference; `reading` is the covariance of a reading.
    pub fn add(&mut self, (began_s, ended_s): (f64, f64), motion: &Vector6, reading: &Matrix6) {
        if OUTLIER <= transients::size(motion, reading) {
            return;
        }
        let lasted_s = ended_s - began_s;
        let Some(known) = self.kept.iter_mut().find(|known| known.is_at(motion, reading)) else {
            if self.kept.is_full() {
                let oldest = (0..KEPT).min_by(|a, b| self.kept[*a].last_s.total_cmp(&self.kept[*b].last_s));
                oldest.map(|oldest| self.kept.remove(oldest));
            }
            return self.kept.push(Regime { motion: *motion, longest_s: lasted_s, last_s: ended_s });
        };
        (known.longest_s, known.last_s) = (known.longest_s.max(lasted_s), ended_s);
    }

    /// Until when a motion that began at `began_s` may be one of them again.
    pub fn may_last_until(&self, began_s: f64, motion: &Vector6, reading: &Matrix6) -> Option<f64> {
        let at = self.kept.iter().filter(|known| known.is_recent(began_s) && known.is_at(motion, reading));
        at.map(|known| began_s + MARGIN * known.longest_s).reduce(f64::max)
    }
}

impl Regime {
    fn is_at(&self, motion: &Vector6, reading: &Matrix6) -> bool {
        transients::size(&(motion - self.motion), reading) < SAME * transients::size(&self.motion, reading)
    }

    fn is_recent(&self, t_s: f64) -> bool {
        t_s <= self.last_s + transients::FORGOTTEN_S
    }
}

numbers!(Regime { motion, longest_s, last_s });
numbers!(Regimes { kept });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_pose_again_waits_and_another_does_not() {
        let (mut seen, reading) = (Regimes::default(), Matrix6::identity());
        let night = Vector6::ith(1, 4.0);
        assert_eq!(seen.may_last_until(90_000.0, &night, &reading), None);
        seen.add((20_000.0, 60_000.0), &night, &reading);
        assert_eq!(seen.may_last_until(90_000.0, &(1.1 * night), &reading), Some(170_000.0));
        for other in [Vector6::ith(0, 4.0), -night, 2.0 * night, 0.4 * night] {
            assert_eq!(seen.may_last_until(90_000.0, &other, &reading), None, "{other}");
        }
        assert_eq!(seen.may_last_until(60_000.0 + 11.0 * 86_400.0, &night, &reading), None, "long ago");
        seen.add((0.0, 40_000.0), &Vector6::ith(0, 6.0), &reading);
        assert_eq!(seen.kept.len(), 1, "more than the error of a reading is not kept");
        for direction in 0..6 {
            seen.add((0.0, 40_000.0), &Vector6::ith(direction, 5.0), &reading);
        }
        assert_eq!(seen.kept.len(), KEPT);
    }
}
