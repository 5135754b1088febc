//! The report of a promise: at the start of a session that begins with a reference, and where it has changed.

use crate::live::Promise;
use resight_core::temporal::monitor::Unpromised;
use std::mem::{Discriminant, discriminant};

/// Interval of the checks, and smallest interval between two reports, seconds of capture time.
const LOOKED_EVERY_S: f64 = 60.0;
const SAID_EVERY_S: f64 = 3600.0;
/// Factor by which the detectable motion must change to be reported.
const OTHER: f64 = 2.0;

/// The promise that was reported last.
#[derive(Debug, Default)]
pub(super) struct Promises {
    looked_s: Option<f64>,
    said_s: Option<f64>,
    /// The largest rotation that may remain undetected, radians; whether it was reported because it had grown.
    rotation_rad: Option<f64>,
    has_grown: bool,
    /// The errors for which no rate is promised, and whether motions are held.
    terms: Terms,
    /// All terms that were reported so far.
    told: Terms,
    /// Whether the next promise is reported though it has not changed.
    is_first: bool,
}

/// For what no rate of false alarms is promised.
#[derive(Debug, Default, Clone, PartialEq)]
struct Terms {
    unpromised: Vec<Discriminant<Unpromised>>,
    holds: bool,
}

impl Terms {
    /// That hours were not watched yet is reported with the reference.
    fn of(promise: &Promise) -> Self {
        let is_news = |of: &&Unpromised| !matches!(of, Unpromised::UnwatchedHours { .. });
        let unpromised = promise.unpromised.iter().filter(is_news).map(discriminant).collect();
        Terms { unpromised, holds: promise.held.is_some() }
    }

    fn has_more_than(&self, other: &Terms) -> bool {
        self.unpromised.iter().any(|kind| !other.unpromised.contains(kind)) || (self.holds && !other.holds)
    }
}

impl Promises {
    /// Lets the next promise be reported: nothing was learned with which it would have been.
    pub fn begin(&mut self) {
        (self.is_first, self.looked_s) = (true, None);
    }

    pub fn is_due(&mut self, t_s: f64) -> bool {
        let is_due = self.looked_s.is_none_or(|looked_s| looked_s + LOOKED_EVERY_S <= t_s);
        if is_due {
            self.looked_s = Some(t_s);
        }
        is_due
    }

    /// Returns whether the promise is the first one, or differs from the last: it is worse, or as good again as before it became worse, or it is for other
    /// errors, or begins or ceases to hold motions. An improvement with every reading is not reported.
    pub fn is_news(&mut self, promise: &Promise, t_s: f64) -> bool {
        let now = promise.detectable.rotation_rad.into_iter().fold(0.0, f64::max);
        let before = *self.rotation_rad.get_or_insert(now);
        let is_worse = OTHER * before < now;
        let is_better = self.has_grown && OTHER * now < before;
        let terms = Terms::of(promise);
        let is_first = std::mem::take(&mut self.is_first);
        if !(is_first || is_worse || is_better || terms != self.terms) {
            self.rotation_rad = Some(if self.has_grown { before } else { before.min(now) });
            return false;
        }
        let is_soon = self.said_s.is_some_and(|said_s| t_s < said_s + SAID_EVERY_S);
        if is_soon && !is_first && !terms.has_more_than(&self.told) {
            return false;
        }
        (self.said_s, self.rotation_rad, self.has_grown) = (Some(t_s), Some(now), is_worse);
        self.told.unpromised.extend(&terms.unpromised);
        self.told.holds |= terms.holds;
        self.terms = terms;
        true
    }
}
