//! The capture times of a stream's frames: its own stamps, related to the clock of this machine.
//!
//! ```text
//!   capture = stamp + offset     offset = the smallest (arrival − stamp) so far, forgotten slowly
//! ```
//! Between capture and arrival there is a varying delay. The frame with the least delay gives the best estimate of the offset, and no frame can
//! arrive before its capture. Frames that a server kept back arrive in a burst on connection: the first frames have the largest delay. Times
//! increase as long as the stamps do. The shortest delay cannot be known: capture times are late by it.
//!
//! A stream without stamps (Motion JPEG over HTTP, bare H.264) has the times of arrival. So has one whose stamps do not keep pace with this
//! machine's clock: where every frame of `JUDGED_S` arrives `BEHIND_S` later than its stamp allows, they count frames, not time.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Largest rate of the offset: crystals of cameras are off by less, seconds per second.
const FORGOTTEN: f64 = 2e-4;

/// No network delays all frames by this much more than before, seconds,
const BEHIND_S: f64 = 2.0;
/// for so long, seconds,
const JUDGED_S: f64 = 10.0;
/// and so many of them.
const JUDGED_FRAMES: u32 = 10;

/// The clock of one connection.
#[derive(Debug)]
pub(super) struct StreamClock {
    started: Instant,
    /// Seconds since 1970 at the start; later steps of the machine's clock must not affect the times.
    started_s: f64,
    /// Offset, and when it was last confirmed.
    offset: Option<(f64, f64)>,
    last_s: f64,
    /// Start of the delay of the stamps, and number of frames since then.
    behind: Option<(f64, u32)>,
    /// Whether the stamps proved to be no times.
    is_refuted: bool,
}

impl StreamClock {
    /// Ties this instant to the wall clock.
    pub fn started(started: Instant) -> Self {
        let started_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
        StreamClock { started, started_s, offset: None, last_s: started_s, behind: None, is_refuted: false }
    }

    /// Returns the capture time of a frame, seconds since 1970. For a frame without a stamp it is the arrival.
    pub fn capture_s(&mut self, stamp_s: Option<f64>, arrived: Instant) -> f64 {
        let arrived_s = self.started_s + arrived.saturating_duration_since(self.started).as_secs_f64();
        let tied_s = stamp_s.map(|stamp_s| self.tied(stamp_s, arrived_s));
        self.is_refuted |= tied_s.is_some_and(|tied_s| self.is_behind(tied_s, arrived_s));
        self.last_s = tied_s.filter(|_| !self.is_refuted).unwrap_or(arrived_s);
        self.last_s
    }

    /// Returns whether all frames have arrived too late for their stamps, for too long.
    fn is_behind(&mut self, tied_s: f64, arrived_s: f64) -> bool {
        if arrived_s - tied_s < BEHIND_S {
            self.behind = None;
            return false;
        }
        let (since_s, frames) = self.behind.unwrap_or((arrived_s, 0));
        self.behind = Some((since_s, frames + 1));
        JUDGED_S <= arrived_s - since_s && JUDGED_FRAMES <= frames + 1
    }

    /// Returns the time of the last frame.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    fn tied(&mut self, stamp_s: f64, arrived_s: f64) -> f64 {
        let seen = arrived_s - stamp_s;
        let offset = match self.offset {
            Some((offset, at_s)) => seen.min(offset + FORGOTTEN * (arrived_s - at_s)),
            None => seen,
        };
        self.offset = Some((offset, arrived_s));
        stamp_s + offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Returns capture times since the start for stamps and arrivals.
    fn times(frames: impl IntoIterator<Item = (f64, f64)>) -> Vec<f64> {
        let start = Instant::now();
        let mut clock = StreamClock::started(start);
        let begun_s = clock.last_s();
        let time = |(stamp_s, arrived_s)| {
            clock.capture_s(Some(stamp_s), start + Duration::from_secs_f64(arrived_s)) - begun_s
        };
        frames.into_iter().map(time).collect()
    }

    /// 30 frames a second, each delayed by 0.1 s and something between 0 and 0.2 s: intervals between captures are those between stamps.
    #[test]
    fn delays_that_vary_do_not_reach_the_capture_time() {
        let delay = |i: u32| 0.1 + f64::from(i * 7919 % 100) / 500.0;
        let times = times((0..900).map(|i| (f64::from(i) / 30.0, f64::from(i) / 30.0 + delay(i))));
        for pair in times[200..].windows(2) {
            assert!((pair[1] - pair[0] - 1.0 / 30.0).abs() < 5e-3, "{pair:?}");
        }
        let errors = times.iter().enumerate().skip(200).map(|(i, t)| (t - i as f64 / 30.0 - 0.1).abs());
        assert!(errors.fold(0.0, f64::max) < 6e-3);
    }

    /// Two seconds kept back by the server arrive at once.
    #[test]
    fn a_burst_at_the_start_is_no_future() {
        let kept = (0..60).map(|i| (f64::from(i) / 30.0, 0.5 + f64::from(i) * 1e-4));
        let live = (60..120).map(|i| (f64::from(i) / 30.0, 0.506 + f64::from(i - 59) / 30.0));
        let frames: Vec<_> = kept.chain(live).collect();
        let times = times(frames.clone());
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "time goes forward");
        for (time, (_, arrived_s)) in times.iter().zip(&frames) {
            // Seconds since 1970 come in steps of 0.24 µs.
            assert!(*time <= arrived_s + 1e-6, "{time} after its arrival at {arrived_s}");
        }
        assert!((times[119] - frames[119].1).abs() < 1e-3);
    }

    /// Stamps that count 25 frames a second where 5, 12 or 24 arrive: the times soon are those of the arrivals, and were never late by more than
    /// the test takes.
    #[test]
    fn stamps_that_do_not_keep_pace_are_no_times() {
        for (rate_hz, judged_s) in [(5.0, 13.0), (12.0, 15.0), (24.0, 62.0)] {
            let frames: Vec<_> = (0..2000).map(|i| (f64::from(i) / 25.0, f64::from(i) / rate_hz)).collect();
            let late =
                times(frames.clone()).into_iter().zip(&frames).map(|(t_s, (_, at_s))| (at_s, at_s - t_s));
            for (at_s, late_s) in late {
                let most_s = if judged_s < *at_s { 1e-6 } else { BEHIND_S + JUDGED_S };
                assert!(late_s < most_s, "{rate_hz} a second: {late_s} s late at {at_s} s");
            }
        }
    }

    /// A network that stops for eight seconds and then delivers everything: the stamps remain the times.
    #[test]
    fn a_stall_refutes_no_stamps() {
        let arrival = |t_s: f64| if (20.0..28.0).contains(&t_s) { 28.0 } else { t_s };
        let stamps = (0..1500).map(|i| f64::from(i) / 30.0);
        let times = times(stamps.clone().map(|t_s| (t_s, arrival(t_s))));
        for (t_s, stamp_s) in times.iter().zip(stamps) {
            assert!((t_s - stamp_s).abs() < 0.02, "{t_s} for {stamp_s}");
        }
    }

    /// A camera's crystal that is slow or fast by 100 parts in a million, for an hour.
    #[test]
    fn a_crystal_that_is_off_is_followed() {
        for off in [-1e-4, 1e-4] {
            let times = times((0..3600).map(|i| (f64::from(i) * (1.0 + off), f64::from(i) + 0.05)));
            assert!((times[3599] - 3599.05).abs() < 1e-3, "{off}: {}", times[3599]);
        }
    }
}
