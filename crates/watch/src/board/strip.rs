//! A stretch of time in few parts: the gravest state of each, and how far the camera was rotated from its reference.

use crate::outputs::said::BY_SEVERITY;
use std::collections::BTreeMap;

/// A part of the time.
#[derive(Debug, Clone, PartialEq)]
pub struct StripBin {
    /// Where it begins, seconds of capture.
    pub from_s: f64,
    /// The gravest state in it; none where nothing was watched.
    pub state: Option<&'static str>,
    /// How far the camera was rotated from what is its reference now, radians; none without a reading.
    pub rotation_rad: Option<f64>,
}

/// The parts of a stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Seconds of capture.
    pub from_s: f64,
    /// Seconds of capture; later.
    pub to_s: f64,
    /// At least one.
    pub bins: usize,
}

impl Stretch {
    /// Begin and end of a part.
    pub fn bin_s(&self, bin: usize) -> (f64, f64) {
        let width_s = (self.to_s - self.from_s) / self.bins as f64;
        (self.from_s + width_s * bin as f64, self.from_s + width_s * (bin + 1) as f64)
    }

    /// The gravest state of each part, of changes in order of time: when, of which target, to what. A state lasts until the next one of its
    /// target; what was changed before the stretch counts.
    pub fn gravest<'a>(
        &self,
        changes: impl IntoIterator<Item = (f64, &'a str, &'a str)>,
    ) -> Vec<Option<&'static str>> {
        let mut now: BTreeMap<&str, usize> = BTreeMap::new();
        let mut changes = changes.into_iter().filter_map(|(t_s, target, word)| {
            Some((t_s, target, BY_SEVERITY.iter().position(|known| *known == word)?))
        });
        let mut next = changes.next();
        let mut states = Vec::with_capacity(self.bins);
        for bin in 0..self.bins {
            let (begin_s, end_s) = self.bin_s(bin);
            let mut worst = None;
            while let Some((t_s, target, rank)) = next.filter(|(t_s, _, _)| *t_s < end_s) {
                if begin_s < t_s {
                    worst = worst.max(now.values().max().copied());
                }
                now.insert(target, rank);
                next = changes.next();
            }
            worst = worst.max(now.values().max().copied());
            states.push(worst.and_then(|rank| BY_SEVERITY.get(rank)).copied());
        }
        states
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Stretch = Stretch { from_s: 1000.0, to_s: 4600.0, bins: 6 };

    #[test]
    fn a_part_is_as_grave_as_its_gravest_moment() {
        let changes = [
            (10.0, "tag", "learning"),
            (20.0, "tag", "steady"),
            (1900.0, "tag", "checking"),
            (1901.0, "tag", "drifted"),
            (1902.0, "tag", "steady"),
            (4000.0, "tag", "stale"),
        ];
        let states = HOUR.gravest(changes);
        let words = ["steady", "drifted", "steady", "steady", "steady", "stale"];
        assert_eq!(states, words.map(Some), "{states:?}");
    }

    #[test]
    fn the_gravest_of_several_targets_counts_and_nothing_is_said_of_before() {
        let states = HOUR.gravest([
            (2300.0, "door", "steady"),
            (2900.0, "wall", "drifted"),
            (3500.0, "door", "steady"),
        ]);
        let words = [None, None, Some("steady"), Some("drifted"), Some("drifted"), Some("drifted")];
        assert_eq!(states, words);
    }
}
