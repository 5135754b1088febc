//! The number of recent frames per second.

/// Period of the mean, seconds.
const RATE_OVER_S: u64 = 10;

/// Frames of the last seconds, second by second.
#[derive(Debug, Clone, Default)]
pub struct Rate {
    /// The frames of the seconds `last`, `last` − 1, …, each at its number modulo the length.
    frames: [u32; RATE_OVER_S as usize + 1],
    last: u64,
}

impl Rate {
    /// Counts a frame in this second of the session.
    pub fn count(&mut self, second: u64) {
        self.forget_until(second);
        self.frames[(second % (RATE_OVER_S + 1)) as usize] += 1;
    }

    /// Clears the counts of the seconds up to this one: seconds without a frame count too.
    fn forget_until(&mut self, second: u64) {
        let first = (self.last + 1).max(second.saturating_sub(RATE_OVER_S));
        for passed in first..=second {
            self.frames[(passed % (RATE_OVER_S + 1)) as usize] = 0;
        }
        self.last = self.last.max(second);
    }

    /// Returns frames per second, without the second that is not over yet.
    pub fn hz(&self, second: u64) -> f64 {
        let mut now = self.clone();
        now.forget_until(second);
        now.frames[(second % (RATE_OVER_S + 1)) as usize] = 0;
        let over_s = second.clamp(1, RATE_OVER_S) as f64;
        f64::from(now.frames.iter().sum::<u32>()) / over_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_ten_whole_seconds() {
        let mut rate = Rate::default();
        for second in 0..20 {
            (0..30).for_each(|_| rate.count(second));
        }
        assert_eq!(
            (rate.hz(20), rate.hz(25), rate.hz(29), rate.hz(30), rate.hz(1000)),
            (30.0, 15.0, 3.0, 0.0, 0.0)
        );
        let mut young = Rate::default();
        (0..4).for_each(|_| young.count(0));
        assert_eq!((young.hz(0), young.hz(1), young.hz(2)), (0.0, 4.0, 2.0));
    }
}
