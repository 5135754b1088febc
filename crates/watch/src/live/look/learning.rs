//! The readings from which a reference is learned: how many, and of how many key frames of a video.
//!
//! A still scene in a compressed video has the same errors from one key frame to the next, where they change. What was learned between two key
//! frames therefore knows nothing of these errors.

use resight_core::temporal::monitor::learn::LEAST_READINGS;
use resight_core::temporal::monitor::{Reading, Unrest, Unsettled};

/// Key frames after the first reading: with two of them the errors have changed twice.
const KEY_FRAMES: u64 = 2;
/// Longest wait for them: two intervals of 250 frames, as x264 makes them, at five frames a second.
const LONGEST_S: f64 = 120.0;
const MOST_READINGS: usize = 3000;

/// Readings are tested at N, 2N, 4N and 8N: slow variations need a longer period, and tests at every reading would each add their own false
/// alarms.
const MOST_LOOKS: usize = 8;

/// The readings so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Learning {
    readings: Vec<Reading>,
    /// Number of key frames up to each reading; none where frames do not depend on each other.
    key_frames: Vec<Option<u64>>,
    /// Whether enough readings wait for key frames.
    is_waiting: bool,
}

impl Learning {
    /// Continues with the readings of another session.
    pub fn of(readings: Vec<(Reading, Option<u64>)>) -> Self {
        let (readings, key_frames) = readings.into_iter().unzip();
        Learning { readings, key_frames, is_waiting: false }
    }

    pub fn push(&mut self, reading: &Reading, key_frames: Option<u64>) {
        self.readings.push(*reading);
        self.key_frames.push(key_frames);
    }

    pub fn readings(&self) -> &[Reading] {
        &self.readings
    }

    /// Each reading with the number of key frames up to it.
    pub fn all(&self) -> impl Iterator<Item = (&Reading, Option<u64>)> {
        self.readings.iter().zip(self.key_frames.iter().copied())
    }

    pub fn take(&mut self) -> Vec<Reading> {
        std::mem::take(self).readings
    }

    /// Returns whether a test is due, of `needed` readings or a multiple; it is due once.
    pub fn is_due(&mut self, needed: usize) -> bool {
        self.is_waiting |= next_test(self.readings.len(), needed) <= self.readings.len();
        let is_due = self.is_waiting && (self.missed_key_frames().is_none() || self.is_long());
        self.is_waiting &= !is_due;
        is_due
    }

    /// Returns the number of readings at which the next test is due.
    pub fn needed(&self, needed: usize) -> usize {
        next_test(self.readings.len() + usize::from(self.is_waiting), needed)
    }

    /// Returns how many key frames there were after the first reading, where they are too few.
    pub fn missed_key_frames(&self) -> Option<u64> {
        let (first, last) = (self.key_frames.first()?.as_ref()?, self.key_frames.last()?.as_ref()?);
        Some(last.saturating_sub(*first)).filter(|seen| *seen < KEY_FRAMES)
    }

    fn is_long(&self) -> bool {
        let span_s = self.readings.last().zip(self.readings.first()).map_or(0.0, |(b, a)| b.t_s - a.t_s);
        LONGEST_S <= span_s || MOST_READINGS <= self.readings.len()
    }

    /// Discards the readings before a sudden motion; half of them in a continuing motion; none in a slow variation until the period is long.
    pub fn forget(&mut self, unsettled: &Unsettled, needed: usize) {
        let readings = self.readings.len();
        self.drain(match unsettled.unrest {
            Unrest::Step => unsettled.reading,
            Unrest::Wander if readings < MOST_LOOKS * needed => 0,
            Unrest::Ramp | Unrest::Wander => readings / 2,
        });
    }

    /// Discards the older half of readings that do not agree.
    pub fn forget_half(&mut self) {
        self.drain(self.readings.len() / 2);
    }

    fn drain(&mut self, forgotten: usize) {
        self.readings.drain(..forgotten);
        self.key_frames.drain(..forgotten);
    }

    /// Returns whether no reference can be learned because intrinsics or target are wrong.
    pub fn mostly_contradicts(&self) -> bool {
        let contradict = self.readings.iter().filter(|reading| !reading.is_consistent).count();
        LEAST_READINGS <= self.readings.len() && self.readings.len() < 2 * contradict
    }
}

/// Returns the number of readings at which the next test is due.
fn next_test(readings: usize, needed: usize) -> usize {
    (0..4).map(|doublings| needed << doublings).find(|test| readings <= *test).unwrap_or(readings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight_core::{Matrix6, Pose};

    fn reading(t_s: f64) -> Reading {
        Reading { t_s, a_from_b: Pose::identity(), covariance: Matrix6::identity(), is_consistent: true }
    }

    /// Number of readings after which a test of fifty is due.
    fn due_after(period_s: f64, key_frames: impl Fn(u64) -> Option<u64>) -> Vec<usize> {
        let mut learning = Learning::default();
        let is_due = |i: u64| {
            learning.push(&reading(period_s * i as f64), key_frames(i));
            learning.is_due(50).then_some(learning.readings().len())
        };
        (0..3500).filter_map(is_due).take(2).collect()
    }

    #[test]
    fn learning_spans_two_key_frames_after_its_first_reading() {
        assert_eq!(due_after(0.04, |_| None), [50, 100], "images of their own");
        assert_eq!(due_after(0.04, |i| Some(i + 1)), [50, 100], "each frame is a key frame");
        assert_eq!(due_after(0.04, |i| Some(1 + i / 250))[0], 501);
        assert_eq!(due_after(0.04, |i| Some(1 + (i + 100) / 250))[0], 401, "begun between two");
        assert_eq!(due_after(0.2, |i| Some(1 + i / 250))[0], 501, "at five frames a second");
    }

    #[test]
    fn a_video_with_a_single_key_frame_is_learned_all_the_same() {
        assert_eq!(due_after(0.2, |_| Some(1))[0], 601, "two minutes");
        assert_eq!(due_after(0.01, |_| Some(1))[0], MOST_READINGS);
        let mut learning = Learning::default();
        (0..60).for_each(|i| learning.push(&reading(f64::from(i)), Some(1)));
        assert_eq!(learning.missed_key_frames(), Some(0));
    }
}
