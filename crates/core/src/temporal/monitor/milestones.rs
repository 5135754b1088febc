//! Where a camera was known to be before a change: the filters' level at times gone by, closer together the more recent.
//!
//! The reference errs, by as much as the readings that it was learned from. That error is no motion: as readings come it is known better
//! and better, and a motion is measured from where the camera was known to be just before it began. docs/math/monitor.md eq. (45).

use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};
use arrayvec::ArrayVec;

/// Times kept.
const KEPT: usize = 24;

/// Where it was known to be.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Milestone {
    pub t_s: f64,
    /// From the pose of the reference, `[rotation_rad; translation_m]`.
    pub motion: Vector6,
    pub covariance: Matrix6,
    /// For how long it was observed, seconds.
    pub over_s: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Milestones {
    kept: Box<ArrayVec<Milestone, { KEPT + 1 }>>,
}

impl Milestones {
    pub fn from(start: Milestone) -> Self {
        let mut kept: Box<ArrayVec<_, _>> = Box::default();
        kept.push(start);
        Milestones { kept }
    }

    pub fn push(&mut self, now: Milestone) {
        if self.kept.len() == KEPT {
            let closeness = |i: &usize| {
                let span_s = self.kept[i + 1].t_s - self.kept[i - 1].t_s;
                span_s / (now.t_s - self.kept[*i].t_s).max(f64::MIN_POSITIVE)
            };
            let gone = (1..KEPT - 1).min_by(|a, b| closeness(a).total_cmp(&closeness(b)));
            if let Some(gone) = gone {
                self.kept.remove(gone);
            }
        }
        self.kept.push(now);
    }

    /// The last one before `onset_s`; of an onset before all of them the first.
    pub fn before(&self, onset_s: f64) -> Milestone {
        *self.kept.iter().rev().find(|milestone| milestone.t_s < onset_s).unwrap_or(&self.kept[0])
    }

    /// Whether there is a first one: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        !self.kept.is_empty()
    }
}

numbers!(Milestone { t_s, motion, covariance, over_s });
numbers!(Milestones { kept });

#[cfg(test)]
mod tests {
    use super::*;

    /// A week of decisions: an onset a tenth of its age before which nothing is kept would be measured from too long ago.
    #[test]
    fn there_is_one_shortly_before_any_onset() {
        let at = |t_s| Milestone {
            t_s,
            motion: Vector6::repeat(t_s),
            covariance: Matrix6::identity(),
            over_s: t_s,
        };
        let mut milestones = Milestones::from(at(0.0));
        for t_s in 1..=604_800 {
            milestones.push(at(f64::from(t_s)));
        }
        for age_s in [10.0, 100.0, 1e3, 1e4, 1e5] {
            let onset_s = 604_800.0 - age_s;
            let before_s = milestones.before(onset_s).t_s;
            assert!(before_s < onset_s && onset_s - before_s < 5.0 * age_s, "{age_s}: {before_s}");
        }
        assert_eq!(milestones.before(-1.0).t_s, 0.0);
    }
}
