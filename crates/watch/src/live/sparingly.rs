//! Counts that are reported at once, then together: an event with every frame would fill a disk and an inbox.

use std::time::{Duration, Instant};

/// Shortest interval between two reports.
const AGAIN: Duration = Duration::from_secs(60);

/// A count that is reported at intervals.
#[derive(Default)]
pub(super) struct Sparingly {
    untold: u64,
    reported: Option<Instant>,
}

impl Sparingly {
    pub fn add(&mut self, count: u64) {
        self.untold += count;
    }

    /// Returns the number to report now; at the end all that are not reported yet.
    pub fn due(&mut self, now: Instant, is_end: bool) -> Option<u64> {
        let is_due =
            is_end || self.reported.is_none_or(|reported| AGAIN <= now.saturating_duration_since(reported));
        if self.untold == 0 || !is_due {
            return None;
        }
        self.reported = Some(now);
        Some(std::mem::take(&mut self.untold))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hundred a second for two minutes and a half: four events, and none is lost.
    #[test]
    fn the_first_at_once_then_a_minute_together_and_the_rest_at_the_end() {
        let (mut count, began) = (Sparingly::default(), Instant::now());
        let mut reported = Vec::new();
        for i in 0..15_000 {
            count.add(1);
            reported.extend(count.due(began + Duration::from_millis(10 * i), false));
        }
        let end = began + Duration::from_secs(150);
        reported.extend(count.due(end, true));
        assert_eq!(reported, [1, 6000, 6000, 2999]);
        assert_eq!(count.due(end, true), None);
    }
}
