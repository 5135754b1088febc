//! When the frames of a stream were taken: its own stamps, tied to the clock of this machine.
//!
//! ```text
//!   capture = stamp + offset     offset = the smallest (arrival − stamp) so far, forgotten slowly
//! ```
//! Between capture and arrival lies a delay that varies; the frame that was delayed least says most about the offset, and no frame can
//! arrive before it was taken. What a server had kept back comes in a burst on connection: the first frames are delayed most. Times
//! go forward as long as the stamps do. The shortest delay of all cannot be known: capture is late by that much.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// How fast the offset may rise: crystals of cameras are off by less, seconds per second.
const FORGOTTEN: f64 = 2e-4;

/// The clock of one connection.
#[derive(Debug)]
pub(super) struct StreamClock {
    started: Instant,
    /// Seconds since 1970 at the start: what a step of the machine's clock changes later must not look like time.
    started_s: f64,
    /// Offset, and when it was last seen to hold.
    offset: Option<(f64, f64)>,
    last_s: f64,
}

impl StreamClock {
    /// Ties this instant to the wall clock.
    pub fn started(started: Instant) -> Self {
        let started_s = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
        StreamClock { started, started_s, offset: None, last_s: started_s }
    }

    /// When a frame was taken, seconds since 1970. A frame without a stamp was taken when it arrived.
    pub fn capture_s(&mut self, stamp_s: Option<f64>, arrived: Instant) -> f64 {
        let arrived_s = self.started_s + arrived.saturating_duration_since(self.started).as_secs_f64();
        self.last_s = match stamp_s {
            Some(stamp_s) => self.tied(stamp_s, arrived_s),
            None => arrived_s,
        };
        self.last_s
    }

    /// Time of the last frame.
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

    /// Capture times since the start for stamps and arrivals.
    fn times(frames: impl IntoIterator<Item = (f64, f64)>) -> Vec<f64> {
        let start = Instant::now();
        let mut clock = StreamClock::started(start);
        let begun_s = clock.last_s();
        let time = |(stamp_s, arrived_s)| {
            clock.capture_s(Some(stamp_s), start + Duration::from_secs_f64(arrived_s)) - begun_s
        };
        frames.into_iter().map(time).collect()
    }

    /// 30 frames a second, each delayed by 0.1 s and something between 0 and 0.2 s: seconds between captures are those between stamps.
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

    /// Two seconds kept back by the server come at once.
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

    /// A camera's crystal that is slow or fast by 100 parts in a million, for an hour.
    #[test]
    fn a_crystal_that_is_off_is_followed() {
        for off in [-1e-4, 1e-4] {
            let times = times((0..3600).map(|i| (f64::from(i) * (1.0 + off), f64::from(i) + 0.05)));
            assert!((times[3599] - 3599.05).abs() < 1e-3, "{off}: {}", times[3599]);
        }
    }
}
