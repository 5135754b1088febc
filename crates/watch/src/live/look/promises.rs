//! When a promise has become another one: noise that is not what it was is said once.

use crate::live::Promise;

/// How often it is looked at, seconds of capture time, and how often another one is said at most.
const LOOKED_EVERY_S: f64 = 60.0;
const SAID_EVERY_S: f64 = 3600.0;
/// By which factor the motion that is found must be another.
const OTHER: f64 = 2.0;

/// The motion that was promised last.
#[derive(Debug, Default)]
pub(super) struct Promises {
    looked_s: Option<f64>,
    said_s: Option<f64>,
    /// The largest rotation that may go unseen, radians; whether it was said because it had grown.
    rotation_rad: Option<f64>,
    has_grown: bool,
}

impl Promises {
    pub fn is_due(&mut self, t_s: f64) -> bool {
        let is_due = self.looked_s.is_none_or(|looked_s| looked_s + LOOKED_EVERY_S <= t_s);
        if is_due {
            self.looked_s = Some(t_s);
        }
        is_due
    }

    /// Whether this is another promise than the last one: worse, or as good again as it was before that. That it becomes better with
    /// every reading is none.
    pub fn is_news(&mut self, promise: &Promise, t_s: f64) -> bool {
        let now = promise.detectable.rotation_rad.into_iter().fold(0.0, f64::max);
        let before = *self.rotation_rad.get_or_insert(now);
        let is_worse = OTHER * before < now;
        let is_better = self.has_grown && OTHER * now < before;
        if !(is_worse || is_better) {
            self.rotation_rad = Some(if self.has_grown { before } else { before.min(now) });
            return false;
        }
        if self.said_s.is_some_and(|said_s| t_s < said_s + SAID_EVERY_S) {
            return false;
        }
        (self.said_s, self.rotation_rad, self.has_grown) = (Some(t_s), Some(now), is_worse);
        true
    }
}
