//! What is kept of one camera.

use super::sums::Sums;
use crate::answers::of_triangle;
use crate::batch::SolvedRows;
use resight::core::Matrix6;
use resight::core::statistics::random::mixed;
use resight::report::verdict::Status;

/// Periods kept of a camera; of more, a random choice that is the same whatever the order: a clock that runs wild must not fill the memory.
pub const MOST_PERIODS: usize = 4096;
/// Rows kept of a camera with their covariances, a random choice that is the same whatever the order.
pub const SAMPLES: usize = 9;

/// Periods that are made room for at a time: a day of quarters of an hour, so that a fleet's memory is not left in pieces that fit nothing.
const MORE_PERIODS: usize = 100;

/// What is kept of a single row.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// What chose it: smaller stays.
    pub(super) key: u64,
    /// Its time, seconds, as bits.
    pub(super) time: u64,
    /// Upper triangle, row by row, of the covariance of its pose, `[rotation_rad; translation_m]`, camera frame.
    pub covariance: [f64; 21],
}

/// Counts, times, sums over periods and a few rows of one camera.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraState {
    /// Rows of each status: ok, ambiguous, degenerate, inconsistent, implausible, anything else.
    pub counts: [u64; 6],
    /// Rows that state no time.
    pub without_time: u64,
    /// Poses too far from the target to be summed.
    pub too_far: u64,
    /// First and last time of a row, seconds.
    pub span_s: Option<(f64, f64)>,
    /// Sums of the rows that are `ok`, and counts of all, by the number of their period, rising.
    pub periods: Vec<(i64, Sums)>,
    /// Some rows that are `ok`.
    pub samples: Vec<Sample>,
}

impl CameraState {
    /// Adds a row.
    pub(super) fn add(&mut self, rows: &SolvedRows, row: usize, period_s: f64) {
        let status = rows.answers.status[row];
        self.counts[kind(status)] += 1;
        let time_s = rows.time_s[row];
        if !time_s.is_finite() {
            self.without_time += 1;
            return;
        }
        self.span_s = span(self.span_s, Some((time_s, time_s)));
        // A clock may say anything: the period is a whole number whatever the time is.
        let sums = self.period((time_s / period_s).floor() as i64);
        sums.count();
        let number = |i: usize| rows.answers.numbers[i][row];
        let quaternion = [number(0), number(1), number(2), number(3)];
        let translation = [number(4), number(5), number(6)];
        let is_ok = status == Status::Ok;
        let is_summed = is_ok && sums.add(quaternion, translation);
        self.limit_periods();
        self.too_far += u64::from(is_ok && !is_summed);
        if !is_summed {
            return;
        }
        let key = mixed(mixed(time_s.to_bits()) ^ translation[0].to_bits());
        let is_full = SAMPLES <= self.samples.len();
        if !is_full || self.samples.last().is_some_and(|last| key <= last.key) {
            self.sample(rows, row, key);
        }
    }

    fn sample(&mut self, rows: &SolvedRows, row: usize, key: u64) {
        let covariance = rows.answers.covariance_triangle(row);
        self.take(Sample { key, time: rows.time_s[row].to_bits(), covariance });
    }

    /// The sums of a period. Rows mostly come in the order of time: the last one is looked at first.
    fn period(&mut self, period: i64) -> &mut Sums {
        let at = match self.periods.last() {
            Some((last, _)) if *last == period => self.periods.len() - 1,
            _ => match self.periods.binary_search_by_key(&period, |(known, _)| *known) {
                Ok(at) => at,
                Err(at) => {
                    // Room that is not used is no memory yet.
                    if self.periods.len() == self.periods.capacity() {
                        self.periods.reserve_exact(MORE_PERIODS);
                    }
                    self.periods.insert(at, (period, Sums::default()));
                    at
                }
            },
        };
        &mut self.periods[at].1
    }

    /// Keeps the periods whose mixed number is smallest: whichever are kept in the end were kept in every part, with all their rows.
    fn limit_periods(&mut self) {
        while MOST_PERIODS < self.periods.len() {
            let largest = (0..self.periods.len()).max_by_key(|i| mixed(self.periods[*i].0 as u64));
            if let Some(largest) = largest {
                self.periods.remove(largest);
            }
        }
    }

    /// Keeps a row if its key is among the smallest. Rows that are equal in every bit count once.
    fn take(&mut self, sample: Sample) {
        match self.samples.binary_search_by(|known| order(known, &sample)) {
            Ok(_) => {}
            Err(at) => {
                self.samples.truncate(SAMPLES - usize::from(at < SAMPLES));
                if at < SAMPLES {
                    self.samples.reserve_exact(SAMPLES - self.samples.len());
                    self.samples.insert(at, sample);
                }
            }
        }
    }

    /// Of both.
    pub fn merge(&mut self, other: &CameraState) {
        for (mine, theirs) in self.counts.iter_mut().zip(other.counts) {
            *mine += theirs;
        }
        self.without_time += other.without_time;
        self.too_far += other.too_far;
        self.span_s = span(self.span_s, other.span_s);
        for (period, sums) in &other.periods {
            self.period(*period).merge(sums);
        }
        self.limit_periods();
        other.samples.iter().for_each(|sample| self.take(sample.clone()));
    }

    /// All rows.
    pub fn rows(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Rows that are `ok`.
    pub fn ok(&self) -> u64 {
        self.counts[0]
    }

    /// The stated covariance of a single row: that of the kept row whose determinant is the middle one.
    pub fn covariance(&self) -> Option<Matrix6> {
        let all = self.samples.iter().map(|sample| of_triangle(&sample.covariance));
        let mut by_size: Vec<(f64, Matrix6)> = all.map(|matrix| (matrix.determinant(), matrix)).collect();
        by_size.sort_by(|a, b| a.0.total_cmp(&b.0));
        by_size.get(by_size.len() / 2).map(|(_, matrix)| *matrix)
    }
}

/// Where a status is counted.
pub(super) fn kind(status: Status) -> usize {
    match status {
        Status::Ok => 0,
        Status::Ambiguous => 1,
        Status::Degenerate => 2,
        Status::Inconsistent => 3,
        Status::Implausible => 4,
        _ => 5,
    }
}

/// From the earlier beginning to the later end.
fn span(a: Option<(f64, f64)>, b: Option<(f64, f64)>) -> Option<(f64, f64)> {
    let (Some(a), Some(b)) = (a, b) else { return a.or(b) };
    let earlier = if a.0.total_cmp(&b.0).is_le() { a.0 } else { b.0 };
    let later = if a.1.total_cmp(&b.1).is_ge() { a.1 } else { b.1 };
    Some((earlier, later))
}

/// By key, then by every bit.
fn order(a: &Sample, b: &Sample) -> std::cmp::Ordering {
    let by_covariance = || a.covariance.map(f64::to_bits).cmp(&b.covariance.map(f64::to_bits));
    a.key.cmp(&b.key).then(a.time.cmp(&b.time)).then_with(by_covariance)
}
