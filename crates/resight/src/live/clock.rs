//! The clock of a source's frames, kept going forward: a camera's clock may be set back, a file's date may be wrong, and whoever
//! waits for a time that has been would be deaf until then.
//!
//! ```text
//!   t = capture time + offset     Δ = t − t of the last frame     e = when a frame is expected after the last one
//!   −1 s ≤ Δ < 0    disorder: the frame is left out
//!   Δ < −1 s, or t − e > 1 h, or an earlier step undone: the clock was set; the offset is chosen anew so that t = e
//! ```
//! The monotonic clock of this machine says e where frames come at their own pace. A recording is read as fast as it goes: there e is one
//! period after the last frame, and a leap forward is a pause.

/// Frames that come in disorder by less than this are left out; a clock that went back further was set, seconds.
const DISORDER_S: f64 = 1.0;
/// A leap forward beyond this is no late frame, seconds.
const LEAP_S: f64 = 3600.0;

/// The clock of one source.
#[derive(Debug, Default)]
pub(super) struct CaptureClock {
    /// Added to capture times since the clock was set, seconds.
    offset_s: f64,
    last: Option<Last>,
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

impl CaptureClock {
    /// For a frame that arrived at `arrived_s` of the monotonic clock; `at_own_pace` where it was waited for.
    pub fn stamp(&mut self, capture_s: f64, arrived_s: f64, at_own_pace: bool) -> Stamp {
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
        self.last = Some(Last { t_s: now_s, arrived_s, period_s: now_s - last.t_s });
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
            let told = stamps(&[100.0, 101.0, -3498.0, -3497.0, -3496.0], at_own_pace);
            let step = Stamp::Stepped { t_s: 102.0, step_s: -3600.0 };
            assert_eq!(told, [at(100.0), at(101.0), step, at(103.0), at(104.0)], "{at_own_pace}");
        }
    }

    #[test]
    fn a_step_that_is_undone_leaves_no_trace() {
        for step_s in [-1800.0, -7200.0] {
            let told = stamps(&[100.0, 101.0, 102.0 + step_s, 103.0, 104.0], true);
            let there = Stamp::Stepped { t_s: 102.0, step_s };
            let back = Stamp::Stepped { t_s: 103.0, step_s: -step_s };
            assert_eq!(told, [at(100.0), at(101.0), there, back, at(104.0)]);
        }
    }

    #[test]
    fn small_disorder_is_left_out() {
        let told = stamps(&[10.0, 11.0, 10.5, 11.0, 12.0], true);
        let late = Stamp::Late { t_s: 11.0, by_s: 0.5 };
        assert_eq!(told, [at(10.0), at(11.0), late, at(11.0), at(12.0)]);
    }

    /// Two hours forward: of a camera that sends all the time its clock was set, in a recording there was a pause.
    #[test]
    fn a_leap_forward_is_told_from_a_pause() {
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
}
