//! The rotation relative to the reference through a whole session, in few numbers: bins of time whose length doubles when there are too many.

use nalgebra::Vector3;

/// Number of bins of a trail: at most twice the number of columns of a terminal.
const BINS: usize = 512;
/// Width of a bin at the start, seconds.
const FIRST_WIDTH_S: f64 = 0.1;
/// A pause of more mean intervals than this between readings is a gap.
const GAP_INTERVALS: f64 = 3.0;

/// Mean turns of bins of time.
#[derive(Debug, Clone)]
pub struct Trail {
    first_s: Option<f64>,
    last_s: f64,
    width_s: f64,
    bins: Vec<Bin>,
    readings: u64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    sum_rad: Vector3<f64>,
    readings: u64,
}

impl Bin {
    fn join(self, other: Bin) -> Bin {
        Bin { sum_rad: self.sum_rad + other.sum_rad, readings: self.readings + other.readings }
    }

    fn angle_rad(&self) -> Option<f64> {
        (0 < self.readings).then(|| self.sum_rad.norm() / self.readings as f64)
    }
}

impl Default for Trail {
    fn default() -> Self {
        Trail::new()
    }
}

impl Trail {
    /// Nothing yet.
    pub fn new() -> Self {
        Trail { first_s: None, last_s: 0.0, width_s: FIRST_WIDTH_S, bins: Vec::new(), readings: 0 }
    }

    /// A rotation about x, y, z at a time; one of before the first is left out.
    pub fn push(&mut self, t_s: f64, rotation_rad: &Vector3<f64>) {
        let since_s = t_s - *self.first_s.get_or_insert(t_s);
        if !(0.0 <= since_s) || !rotation_rad.iter().all(|x| x.is_finite()) {
            return;
        }
        while BINS as f64 <= since_s / self.width_s {
            self.width_s *= 2.0;
            self.bins =
                self.bins.chunks(2).map(|pair| pair.iter().fold(Bin::default(), |a, b| a.join(*b))).collect();
        }
        let place = (since_s / self.width_s) as usize;
        if self.bins.len() <= place {
            self.bins.resize(place + 1, Bin::default());
        }
        self.bins[place] = self.bins[place].join(Bin { sum_rad: *rotation_rad, readings: 1 });
        (self.last_s, self.readings) = (self.last_s.max(t_s), self.readings + 1);
    }

    /// Time between the first and the last reading, seconds.
    pub fn span_s(&self) -> f64 {
        self.first_s.map_or(0.0, |first_s| (self.last_s - first_s).max(0.0))
    }

    /// Time of the first reading, seconds.
    pub fn first_s(&self) -> Option<f64> {
        self.first_s
    }

    /// Mean turn of the newest bin, radians.
    pub fn last_rad(&self) -> Option<f64> {
        self.bins.last().and_then(Bin::angle_rad)
    }

    /// Returns the mean rotation between two times, radians; `None` where there were no readings.
    pub fn mean_rad(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let place = |t_s: f64| Some(((t_s - self.first_s?) / self.width_s).max(0.0) as usize);
        if !self.first_s.is_some_and(|first_s| first_s < to_s) {
            return None;
        }
        self.column(place(from_s)?, place(to_s)?)
    }

    /// Returns mean rotations, radians, of `n` equal parts of the time up to `until_s`; `None` where there were no readings.
    pub fn columns(&self, n: usize, until_s: f64) -> Vec<Option<f64>> {
        let since_s = self.first_s.map_or(0.0, |first_s| until_s - first_s);
        let bins = self.bins.len().max((since_s / self.width_s) as usize);
        (0..n).map(|column| self.column(column * bins / n, (column + 1) * bins / n)).collect()
    }

    fn column(&self, from: usize, to: usize) -> Option<f64> {
        let bins = self.bins.iter().skip(from).take((to - from).max(1));
        bins.fold(Bin::default(), |a, b| a.join(*b)).angle_rad().or_else(|| self.carried(from))
    }

    /// The bin before a short pause: readings a second apart leave no gaps between them.
    fn carried(&self, place: usize) -> Option<f64> {
        let interval_s = self.span_s() / (self.readings.checked_sub(1).filter(|n| 0 < *n)? as f64);
        let reach = (GAP_INTERVALS * interval_s / self.width_s).ceil() as usize;
        (place.saturating_sub(reach)..place).rev().find_map(|before| self.bins.get(before)?.angle_rad())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trail(seconds: usize, period_s: f64, turn: impl Fn(f64) -> f64) -> Trail {
        let mut trail = Trail::new();
        for i in 0..(seconds as f64 / period_s) as usize {
            let t_s = i as f64 * period_s;
            trail.push(1e9 + t_s, &Vector3::new(0.0, turn(t_s), 0.0));
        }
        trail
    }

    #[test]
    fn a_step_in_the_middle_is_in_the_middle_for_any_length() {
        for (seconds, period_s) in [(60, 0.04), (100_000, 1.0), (3000, 7.0)] {
            let half_s = seconds as f64 / 2.0;
            let trail = trail(seconds, period_s, |t_s| if t_s < half_s { 0.001 } else { 0.009 });
            let columns = trail.columns(40, 0.0);
            assert!(columns.iter().all(Option::is_some), "{seconds} s: {columns:?}");
            let [early, late] =
                [0..18, 22..40].map(|part| columns[part].iter().flatten().sum::<f64>() / 18.0);
            assert!((early - 0.001).abs() < 1e-9 && (late - 0.009).abs() < 1e-9, "{early} {late}");
            assert!(trail.bins.len() <= BINS);
        }
    }

    #[test]
    fn blind_times_are_blank_and_clocks_that_step_back_are_left_out() {
        let mut trail = trail(100, 1.0, |_| 0.002);
        trail.push(1e9 + 300.0, &Vector3::new(0.0, 0.002, 0.0));
        trail.push(1e9 - 50.0, &Vector3::new(0.0, 9.0, 0.0));
        let columns = trail.columns(30, 0.0);
        assert_eq!(columns.iter().filter(|column| column.is_none()).count(), 18, "{columns:?}");
        assert!(columns[29].is_some_and(|angle| (angle - 0.002).abs() < 1e-12));
    }

    #[test]
    fn the_time_since_the_last_reading_is_blank() {
        let trail = trail(100, 1.0, |_| 0.002);
        let columns = trail.columns(20, 1e9 + 200.0);
        assert!(
            columns[..10].iter().all(Option::is_some) && columns[11..].iter().all(Option::is_none),
            "{columns:?}"
        );
    }

    #[test]
    fn turns_to_both_sides_cancel_within_a_bin() {
        let trail = trail(10, 0.01, |t_s| if (t_s * 100.0).round() % 2.0 == 0.0 { 0.01 } else { -0.01 });
        // A bin's ends may cut off one of two: 0.01 in some 200 readings.
        assert!(trail.columns(5, 0.0).iter().flatten().all(|angle| *angle < 2e-4));
    }
}
