//! Motions after the first: the camera is compared with where it was last reported to be, for as many motions as there are.
//!
//! Each has its own onset and its own size, measured from where the test knew the camera to be just before it, as the first one is from where
//! it was before that. docs/math/monitor.md sections 4 and 10.

use super::between;
use super::drift::Again;
use super::milestones::{Milestone, Milestones};
use crate::Vector6;
use crate::temporal::snapshot::numbers;

/// The motions of a camera since it was last where it was.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motions {
    /// How many.
    number: u32,
    /// When the first began, seconds.
    first_began_s: f64,
    /// The level before the last one.
    from: Milestone,
    /// The level by the test since the last alarm.
    since: Milestones,
}

impl Motions {
    /// None so far.
    pub fn none(home: Milestone) -> Self {
        Motions { number: 0, first_began_s: home.t_s, from: home, since: Milestones::from(home) }
    }

    /// One more, from `from` to `found`.
    pub fn add(&mut self, began_s: f64, from: Milestone, found: Milestone) {
        if self.number == 0 {
            self.first_began_s = began_s;
        }
        (self.number, self.from) = (self.number.saturating_add(1), from);
        self.goes_on(found);
    }

    /// The last motion continues: its present size is reported.
    pub fn goes_on(&mut self, found: Milestone) {
        self.since = Milestones::from(found);
    }

    pub fn note(&mut self, level: Milestone) {
        self.since.push(level);
    }

    /// The level before the last one.
    pub fn from(&self) -> &Milestone {
        &self.from
    }

    /// The last motion alone, as far as `to`.
    pub fn last(&self, to: &Milestone) -> Vector6 {
        between(&self.from.motion, &to.motion)
    }

    /// The level before a further motion that begins then.
    pub fn before(&self, onset_s: f64) -> Milestone {
        self.since.before(onset_s)
    }

    /// The report of the last one, where it is not the first.
    pub fn again(&self, now: &Milestone) -> Option<Again> {
        (1 < self.number).then(|| Again {
            number: self.number,
            first_began_s: self.first_began_s,
            old_from_new: between(&self.from.motion, &now.motion),
            covariance: now.covariance + self.from.covariance,
        })
    }

    /// Whether there is a place that it is compared with: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        self.since.is_sound()
    }
}

numbers!(Motions { number, first_began_s, from, since });
