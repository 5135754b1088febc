//! The clock of a source's frames, kept going forward: a camera's clock may be set back, a file's date may be wrong, and whoever
//! waits for a time that has been would be deaf until then.
//!
//! ```text
//!   t = capture time + offset     Δ = t − t of the last frame     e = when a frame is expected after the last one
//!   −1 s ≤ Δ < 0    disorder: the frame is left out
//!   Δ < −1 s, or t − e > 1 h, or an earlier step undone: the clock was set; the offset is chosen anew so that t = e
//! ```
//! The monotonic clock of this machine says e where frames come at their own pace. A recording is read as fast as it goes: there e is one
//! period after the last frame, and a leap forward is a pause, unless the next frame says that only the time of one was wrong.

/// Frames that come in disorder by less than this are left out; a clock that went back further was set, seconds.
const DISORDER_S: f64 = 1.0;
/// A leap forward beyond this is no late frame, seconds.
const LEAP_S: f64 = 3600.0;
/// Between frames of a recording of which only one has been seen, seconds.
const UNKNOWN_PERIOD_S: f64 = 1.0;

/// The clock of one source.
#[derive(Debug, Default)]
pub(super) struct CaptureClock {
    /// Added to capture times since the clock was set, seconds.
    offset_s: f64,
    last: Option<Last>,
    /// Frames without a time of their own since the last that had one.
    untimed: u32,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    t_s: f64,
    arrived_s: f64,
    period_s: f64,
}

/// When a frame was taken, by the clock that only goes forward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stamp {
    /// Seconds.
    At { t_s: f64 },
    /// After the clock was set by `step_s`.
    Stepped { t_s: f64, step_s: f64 },
    /// Before the last frame, by so much; that one was taken at `t_s`.
    Late { t_s: f64, by_s: f64 },
}

impl Last {
    /// The longest gap after it that is no leap, seconds.
    fn gap_s(&self) -> f64 {
        self.period_s + self.period_s.max(DISORDER_S)
    }
}

impl CaptureClock {
    /// Goes on from a frame taken at `last_s`, `ago_s` ago: a clock that was set in between is found out.
    pub fn after(last_s: f64, ago_s: f64) -> Self {
        let last = Last { t_s: last_s, arrived_s: -ago_s, period_s: 0.0 };
        CaptureClock { last: Some(last), ..CaptureClock::default() }
    }

    /// Whether a frame of a recording comes so long after the last that its time may be wrong: the next one tells.
    pub fn is_implausible(&self, capture_s: f64) -> bool {
        self.last.is_some_and(|last| last.gap_s() < capture_s + self.offset_s - last.t_s)
    }

    /// Whether a frame continues from before a doubtful one, so that the time of that one was wrong.
    pub fn refutes(&self, capture_s: f64, doubtful_s: f64) -> bool {
        let is_after = |last: Last| last.t_s - DISORDER_S <= capture_s + self.offset_s;
        self.last.is_some_and(is_after) && capture_s < doubtful_s - DISORDER_S
    }

    /// When a frame was taken that could not be read. Its time may be another clock's (the file's date for the image's), so it is
    /// believed only where it is near, and changes nothing. What is seen of no frame is stale for longer and longer, so time continues.
    pub fn guess(&mut self, capture_s: f64, arrived_s: f64, at_own_pace: bool) -> f64 {
        let Some(last) = self.last else { return if capture_s.is_finite() { capture_s } else { 0.0 } };
        self.untimed += 1;
        let period_s = if 0.0 < last.period_s { last.period_s } else { UNKNOWN_PERIOD_S };
        let elapsed_s =
            if at_own_pace { arrived_s - last.arrived_s } else { period_s * f64::from(self.untimed) };
        let t_s = capture_s + self.offset_s;
        let is_near = (last.t_s..=last.t_s + elapsed_s + last.gap_s()).contains(&t_s);
        if is_near { t_s } else { last.t_s + elapsed_s }
    }

    /// For a frame that arrived at `arrived_s` of the monotonic clock; `at_own_pace` where it was waited for.
    pub fn stamp(&mut self, capture_s: f64, arrived_s: f64, at_own_pace: bool) -> Stamp {
        self.untimed = 0;
        let Some(last) = self.last else {
            self.last = Some(Last { t_s: capture_s, arrived_s, period_s: 0.0 });
            return Stamp::At { t_s: capture_s };
        };
        let elapsed_s = if at_own_pace { arrived_s - last.arrived_s } else { last.period_s };
        let expected_s = last.t_s + elapsed_s;
        let t_s = capture_s + self.offset_s;
        let delta_s = t_s - last.t_s;
        let is_set = delta_s < -DISORDER_S
            || (at_own_pace && LEAP_S < t_s - expected_s)
            || (DISORDER_S < delta_s && self.is_undone(capture_s, expected_s));
        if !is_set && delta_s < 0.0 {
            return Stamp::Late { t_s: last.t_s, by_s: -delta_s };
        }
        let now_s = if is_set { expected_s } else { t_s };
        // A pause is not how far frames are apart.
        let is_pause = 0.0 < last.period_s && last.gap_s() < now_s - last.t_s;
        let period_s = if is_pause { last.period_s } else { now_s - last.t_s };
        self.last = Some(Last { t_s: now_s, arrived_s, period_s });
        if !is_set {
            return Stamp::At { t_s };
        }
        self.offset_s = expected_s - capture_s;
        Stamp::Stepped { t_s: expected_s, step_s: t_s - expected_s }
    }

    /// Whether the clock was set earlier, and without that the time would be right again.
    fn is_undone(&self, capture_s: f64, expected_s: f64) -> bool {
        self.offset_s != 0.0 && (capture_s - expected_s).abs() <= DISORDER_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stamps of frames at capture times, one a second by the monotonic clock.
    fn stamps(capture_s: &[f64], at_own_pace: bool) -> Vec<Stamp> {
        let mut clock = CaptureClock::default();
        let stamp = |(i, capture_s): (usize, &f64)| clock.stamp(*capture_s, i as f64, at_own_pace);
        capture_s.iter().enumerate().map(stamp).collect()
    }

    fn at(t_s: f64) -> Stamp {
        Stamp::At { t_s }
    }

    #[test]
    fn an_hour_back_is_said_and_time_goes_on() {
        for at_own_pace in [true, false] {
            let reported = stamps(&[100.0, 101.0, -3498.0, -3497.0, -3496.0], at_own_pace);
            let step = Stamp::Stepped { t_s: 102.0, step_s: -3600.0 };
            assert_eq!(reported, [at(100.0), at(101.0), step, at(103.0), at(104.0)], "{at_own_pace}");
        }
    }

    #[test]
    fn a_step_that_is_undone_leaves_no_trace() {
        for step_s in [-1800.0, -7200.0] {
            let reported = stamps(&[100.0, 101.0, 102.0 + step_s, 103.0, 104.0], true);
            let there = Stamp::Stepped { t_s: 102.0, step_s };
            let back = Stamp::Stepped { t_s: 103.0, step_s: -step_s };
            assert_eq!(reported, [at(100.0), at(101.0), there, back, at(104.0)]);
        }
    }

    #[test]
    fn small_disorder_is_left_out() {
        let reported = stamps(&[10.0, 11.0, 10.5, 11.0, 12.0], true);
        let late = Stamp::Late { t_s: 11.0, by_s: 0.5 };
        assert_eq!(reported, [at(10.0), at(11.0), late, at(11.0), at(12.0)]);
    }

    /// Two hours forward: of a camera that sends all the time its clock was set, in a recording there was a pause.
    #[test]
    fn a_leap_forward_is_reported_from_a_pause() {
        let frames = [10.0, 11.0, 7212.0, 7213.0];
        let step = Stamp::Stepped { t_s: 12.0, step_s: 7200.0 };
        assert_eq!(stamps(&frames, true), [at(10.0), at(11.0), step, at(13.0)]);
        assert_eq!(stamps(&frames, false), frames.map(at));
    }

    /// A camera that was unplugged for two hours comes back with the right time.
    #[test]
    fn a_long_absence_is_no_step() {
        let mut clock = CaptureClock::default();
        clock.stamp(10.0, 0.0, true);
        assert_eq!(clock.stamp(7210.5, 7200.0, true), at(7210.5));
    }

    /// Switched off for a day: the clock of a camera that then is an hour behind, or has none yet, was set.
    #[test]
    fn a_restart_finds_a_clock_that_was_set() {
        let day_s = 86_400.0;
        let stamp = |capture_s| CaptureClock::after(1e9, day_s).stamp(capture_s, 2.0, true);
        assert_eq!(stamp(1e9 + day_s + 1.5), at(1e9 + day_s + 1.5));
        for capture_s in [1e9 - 3600.0, 30.0, 2e9] {
            let Stamp::Stepped { t_s, .. } = stamp(capture_s) else { panic!("{:?}", stamp(capture_s)) };
            assert_eq!(t_s, 1e9 + day_s + 2.0);
        }
    }

    /// Ten frames a second; one has a time of a thousand years.
    #[test]
    fn one_wrong_time_is_reported_from_a_pause() {
        let mut clock = CaptureClock::default();
        for i in 0..10 {
            let t_s = 0.1 * f64::from(i);
            assert!(!clock.is_implausible(t_s));
            clock.stamp(t_s, 0.0, false);
        }
        assert!(clock.is_implausible(1.7e12) && clock.is_implausible(3.0) && !clock.is_implausible(1.5));
        assert!(clock.refutes(1.1, 1.7e12), "the next frame continues from before");
        assert!(!clock.refutes(1.7e12 + 0.1, 1.7e12), "a pause");
        assert!(!clock.refutes(-500.0, 1.7e12), "a clock that was set back");
        // After a pause frames are as far apart as before.
        clock.stamp(500.0, 0.0, false);
        let Stamp::Stepped { t_s, .. } = clock.stamp(10.0, 0.0, false) else { panic!("set back") };
        assert!((t_s - 500.1).abs() < 1e-9, "{t_s}");
    }

    /// A torn image has the date of its file, hours after the clock of the images; or its own time. Neither moves the clock.
    #[test]
    fn what_cannot_be_read_does_not_set_the_clock() {
        let mut clock = CaptureClock::default();
        (0..3).for_each(|i| assert_eq!(clock.stamp(f64::from(i), 0.0, false), at(f64::from(i))));
        let guesses: Vec<f64> = (0..3).map(|_| clock.guess(7200.0, 0.0, false)).collect();
        assert_eq!(guesses, [3.0, 4.0, 5.0], "time continues");
        assert_eq!(clock.guess(6.25, 0.0, false), 6.25);
        assert_eq!(clock.stamp(7.0, 0.0, false), at(7.0));
        let mut live = CaptureClock::default();
        live.stamp(100.0, 0.0, true);
        assert_eq!((live.guess(-5.0, 8.0, true), live.guess(107.9, 8.0, true)), (108.0, 107.9));
        assert_eq!(live.stamp(109.0, 9.0, true), at(109.0));
    }
}
