//! Clocks: when the fleet as a whole was seen, and which camera's times cannot be.

use crate::state::{CameraState, MOST_PERIODS};

/// When most cameras were seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FleetSpan {
    span_s: Option<(f64, f64)>,
    /// Seconds of a period.
    pub(super) period_s: f64,
}

/// Cameras of which one in so many may begin earlier, or end later, than the fleet.
const ONE_IN: usize = 20;
/// Periods by which a camera may be off the fleet before its clock is blamed.
const OFF_PERIODS: f64 = 4.0;
/// Rows of a period over those of the middle one: more were taken at twice the rate, or at a time that was there before.
const TWICE: f64 = 1.6;
/// Periods with too many rows, at least.
const FEWEST: usize = 2;

impl FleetSpan {
    /// One that is known.
    pub(super) fn new(span_s: Option<(f64, f64)>, period_s: f64) -> Self {
        FleetSpan { span_s, period_s }
    }

    /// Of all cameras together, by the first and last time of each; clocks that are off by years are too few to matter.
    pub fn of(cameras: impl Iterator<Item = (f64, f64)>, period_s: f64) -> Self {
        let (mut first, mut last): (Vec<f64>, Vec<f64>) = cameras.unzip();
        first.sort_by(f64::total_cmp);
        last.sort_by(f64::total_cmp);
        // The middle one of all stands for a fleet whose cameras begin and end together.
        let begin = first.get(first.len() / ONE_IN);
        let end = last.get((last.len() - last.len() / ONE_IN).saturating_sub(1));
        FleetSpan { span_s: begin.copied().zip(end.copied()), period_s }
    }

    /// From where most cameras begin to where most end, seconds.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        self.span_s
    }

    /// How long before the end of the fleet a camera was last seen, seconds.
    pub(super) fn silent_s(&self, camera: &CameraState) -> Option<f64> {
        let ((_, end), (_, last)) = (self.span_s?, camera.span_s?);
        Some(end - last)
    }

    /// What is wrong with a camera's times, in a sentence.
    pub(super) fn fault(&self, camera: &CameraState) -> Option<String> {
        let rows = camera.rows();
        if 0 < rows && rows < 2 * camera.without_time {
            return Some(format!("{} of {rows} rows state no time that is a number", camera.without_time));
        }
        let ((begin, end), (first, last)) = (self.span_s?, camera.span_s?);
        let off_s = OFF_PERIODS * self.period_s;
        if MOST_PERIODS <= camera.periods.len() {
            return Some(format!(
                "its times are spread over {:.1} days, which no fleet is",
                (last - first) / 86_400.0
            ));
        }
        if end + off_s < last || first < begin - off_s {
            let (far, which) = if end + off_s < last {
                (last - end, "after the others end")
            } else {
                (begin - first, "before the others begin")
            };
            return Some(format!("its times lie up to {} {which}; set its clock", duration(far)));
        }
        self.doubled(camera)
    }

    /// Times that came twice: a clock that was set back, or stood still.
    fn doubled(&self, camera: &CameraState) -> Option<String> {
        let mut rows: Vec<u64> = camera.periods.iter().map(|(_, sums)| sums.n).collect();
        rows.sort_unstable();
        let middle = *rows.get(rows.len() / 2)? as f64;
        let all: u64 = rows.iter().sum();
        let most = *rows.last()?;
        let (begin, end) = self.span_s?;
        let stands = 2 * most > all && 20.0 * self.period_s < end - begin && rows.len() <= 2;
        if stands {
            return Some(format!(
                "{most} of {all} rows lie within {}: its clock stands still",
                duration(self.period_s)
            ));
        }
        let doubled: Vec<i64> = camera
            .periods
            .iter()
            .filter(|(_, sums)| TWICE * middle < sums.n as f64)
            .map(|(period, _)| *period)
            .collect();
        let (first, n) = (*doubled.first()?, doubled.len());
        (FEWEST <= n).then(|| {
            format!(
                "{} hold too many rows, from time {:.0} s on: its clock was set back",
                duration(n as f64 * self.period_s),
                first as f64 * self.period_s
            )
        })
    }
}

/// In the largest unit of which there is one.
pub(super) fn duration(s: f64) -> String {
    match s {
        s if 172_800.0 <= s => format!("{:.1} days", s / 86_400.0),
        s if 7200.0 <= s => format!("{:.1} h", s / 3600.0),
        s if 120.0 <= s => format!("{:.0} min", s / 60.0),
        s => format!("{s:.0} s"),
    }
}
