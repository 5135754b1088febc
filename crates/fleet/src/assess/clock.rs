//! Tests clocks: the period of the fleet as a whole, and the cameras whose times are impossible.

use crate::state::{CameraState, MOST_PERIODS};
use crate::words::{duration, utc};

/// The period in which most cameras were seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FleetSpan {
    span_s: Option<(f64, f64)>,
    /// Seconds of a period.
    pub(super) period_s: f64,
}

/// One in this many cameras may begin earlier, or end later, than the fleet; of fewer cameras those that are off by all of their times are left
/// out.
const ONE_IN: usize = 20;
/// Periods by which a camera may be off the fleet before its clock is blamed.
const OFF_PERIODS: f64 = 4.0;
/// For a camera with a correct clock, times that occur twice are falsely reported in at most one of this many records.
const FALSE_ALARM_PROBABILITY: f64 = 1e-6;
/// Rows of a period over those of the middle one of the others, in the mean over times that came twice.
const TWICE: f64 = 1.6;
/// Periods with too many rows, at least.
const FEWEST: usize = 2;
/// Rows of a period over those that the camera takes: more of them were taken while its clock stood still.
const STANDS: f64 = 5.0;
/// With fewer rows the clock is not tested.
const LEAST_ROWS: u64 = 5;
/// No camera takes more images a second.
const MOST_PER_S: f64 = 1e4;
/// Times beyond this, the year 5138 in seconds, are of 1973 and later in milliseconds, microseconds or nanoseconds.
const LATEST_S: f64 = 1e11;

impl FleetSpan {
    /// One that is known.
    pub(super) fn new(span_s: Option<(f64, f64)>, period_s: f64) -> Self {
        FleetSpan { span_s, period_s }
    }

    /// Computes the period from the first and last time of each camera, without times that are no seconds and, of a few cameras, without those
    /// whose clocks are off.
    pub fn of(cameras: impl Iterator<Item = (f64, f64)>, period_s: f64) -> Self {
        let all: Vec<(f64, f64)> = cameras.collect();
        let in_seconds: Vec<(f64, f64)> = all
            .iter()
            .filter(|(first, last)| unit_of_time(*first).or(unit_of_time(*last)).is_none())
            .copied()
            .collect();
        let spans = if in_seconds.is_empty() { all } else { in_seconds };
        let spans = if spans.len() < ONE_IN { at_one_time(spans, OFF_PERIODS * period_s) } else { spans };
        let (mut first, mut last): (Vec<f64>, Vec<f64>) = spans.into_iter().unzip();
        first.sort_by(f64::total_cmp);
        last.sort_by(f64::total_cmp);
        // The median represents a fleet whose cameras begin and end together.
        let begin = first.get(first.len() / ONE_IN);
        let end = last.get((last.len() - last.len() / ONE_IN).saturating_sub(1));
        FleetSpan { span_s: begin.copied().zip(end.copied()), period_s }
    }

    /// Returns the period from where most cameras begin to where most end, seconds.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        self.span_s
    }

    /// Returns how long before the end of the fleet a camera was last seen, seconds.
    pub(super) fn silent_s(&self, camera: &CameraState) -> Option<f64> {
        let ((_, end), (_, last)) = (self.span_s?, camera.span_s?);
        Some(end - last)
    }

    /// Describes in a sentence what is wrong with a camera's times.
    pub(super) fn fault(&self, camera: &CameraState) -> Option<String> {
        let rows = camera.rows();
        if 0 < rows && rows < 2 * camera.without_time {
            return Some(format!("{} of {rows} rows state no time that is a number", camera.without_time));
        }
        let ((begin, end), (first, last)) = (self.span_s?, camera.span_s?);
        if let Some(remark) = unit_of_time(last) {
            return Some(format!("its times are about {last:.3e} s: {remark}"));
        }
        let timed = rows - camera.without_time;
        if LEAST_ROWS <= timed && last - first < timed as f64 / MOST_PER_S {
            return Some(format!(
                "all {timed} rows state one time, {}: its clock does not advance",
                utc(first)
            ));
        }
        let off_s = OFF_PERIODS * self.period_s;
        if MOST_PERIODS <= camera.periods.len() {
            return Some(format!("its times are spread over {}, which no fleet is", duration(last - first)));
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

    /// Times that came twice: a clock that was set back, or stood still. Rows that are lost make periods with fewer rows than the camera
    /// takes, never more: docs/math/fleet.md eq. (18).
    fn doubled(&self, camera: &CameraState) -> Option<String> {
        let counts: Vec<(i64, u64)> =
            camera.periods.iter().map(|(period, sums)| (*period, sums.rows())).collect();
        let taken = taken(&counts)?;
        let time = |period: i64| utc(period as f64 * self.period_s);
        let (stood, most) = counts.iter().max_by_key(|(_, n)| *n)?;
        if STANDS * taken < *most as f64 && 20 < *most {
            return Some(format!(
                "{most} rows at {}, others have {taken:.0} in {}: its clock stood still",
                time(*stood),
                duration(self.period_s)
            ));
        }
        let (begin, end) = doubled_run(&counts, taken)?;
        Some(format!(
            "{} hold {:.1} times the rows of others, from {} on: its clock was set back",
            duration((end - begin + 1) as f64 * self.period_s),
            mean_rows(&counts, begin, end) / taken,
            time(begin)
        ))
    }
}

/// Without the cameras that both begin and end later, or earlier, than the middle one by more than `off_s`, and without those that reach beyond
/// it by more than its length: such clocks are ahead or behind. A camera that outlives the others, or is new, stays.
fn at_one_time(spans: Vec<(f64, f64)>, off_s: f64) -> Vec<(f64, f64)> {
    let middle = |of: fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = spans.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let (Some(begin), Some(end)) = (middle(|span| span.0), middle(|span| span.1)) else { return spans };
    let beyond_s = off_s.max(end - begin);
    let is_ahead = |(first, last): &(f64, f64)| {
        end + beyond_s < *last || (begin + off_s < *first && end + off_s < *last)
    };
    let is_behind = |(first, last): &(f64, f64)| {
        *first < begin - beyond_s || (*first < begin - off_s && *last < end - off_s)
    };
    // Of two that differ neither is in the majority.
    let is_off = |span: &(f64, f64)| 2 < spans.len() && (is_ahead(span) || is_behind(span));
    spans.iter().filter(|span| !is_off(span)).copied().collect()
}

/// Rows that a camera takes in a period in which none is lost: more than those of three quarters of its periods.
fn taken(counts: &[(i64, u64)]) -> Option<f64> {
    let mut rows: Vec<u64> = counts.iter().map(|(_, n)| *n).collect();
    rows.sort_unstable();
    rows.get(3 * rows.len() / 4).map(|n| (*n as f64).max(1.0))
}

/// Returns the first and last period of times that occur twice, from their evidence in Poisson counts of twice the rate; `None` where chance
/// explains them, or where other periods have more rows than the camera takes, too: then its rate differs from `taken`.
fn doubled_run(counts: &[(i64, u64)], taken: f64) -> Option<(i64, i64)> {
    let (mut best, mut run) = ((0.0, 0, 0), (0.0, 0, 0));
    let mut next = None;
    for (period, rows) in counts {
        let missed = next.map_or(0.0, |next: i64| period.saturating_sub(next) as f64);
        let evidence = *rows as f64 * 2_f64.ln() - taken;
        let before: f64 = run.0 - missed * taken;
        run = if before <= 0.0 { (evidence, *period, *period) } else { (before + evidence, run.1, *period) };
        if best.0 < run.0 {
            best = run;
        }
        next = Some(period + 1);
    }
    let (evidence, begin, end) = best;
    let is_certain = (counts.len() as f64 / FALSE_ALARM_PROBABILITY).ln() < evidence;
    let is_long = FEWEST as i64 <= end - begin + 1;
    let others = counts.iter().filter(|(period, _)| *period < begin - 1 || end + 1 < *period);
    let mut others: Vec<u64> = others.map(|(_, rows)| *rows).collect();
    others.sort_unstable();
    let high = others.iter().filter(|rows| taken + 4.0 * taken.sqrt() < **rows as f64).count();
    let middle = *others.get(others.len() / 2)? as f64;
    let is_twice = TWICE * middle < mean_rows(counts, begin, end) && high <= 1 + others.len() / 50;
    (is_certain && is_long && is_twice).then_some((begin, end))
}

fn mean_rows(counts: &[(i64, u64)], begin: i64, end: i64) -> f64 {
    let rows: u64 = counts.iter().filter(|(period, _)| (begin..=end).contains(period)).map(|(_, n)| n).sum();
    rows as f64 / (end - begin + 1) as f64
}

/// Returns the remark on a time that is not a number of seconds.
pub fn unit_of_time(time_s: f64) -> Option<String> {
    let (divisor, unit) = match time_s.abs() {
        t if t < LATEST_S => return None,
        t if t < 1e3 * LATEST_S => (1e3, "milliseconds"),
        t if t < 1e6 * LATEST_S => (1e6, "microseconds"),
        _ => (1e9, "nanoseconds"),
    };
    Some(format!("are they in {unit}? Then divide by {divisor:.0} ({})", utc(time_s / divisor)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::statistics::random::SplitMix64;

    /// Whatever one clock says, a fleet of three and more has the period of the others; one that outlives the others is no wrong clock.
    #[test]
    fn one_clock_does_not_move_the_period_of_a_fleet() {
        let (begin, end) = (1.78e9, 1.78e9 + 86_400.0);
        let year_s = 3.15e7;
        for n in 2..40 {
            for wrong in [
                (1e3 * begin, 1e3 * end),
                (1e6 * begin, 1e6 * end),
                (begin, 1e3 * end),
                (begin + year_s, end + year_s),
                (begin - year_s, end - year_s),
                (begin, end + year_s),
                (begin + 7200.0, end + 7200.0),
                (begin - 7200.0, end - 7200.0),
            ] {
                let spans = (0..n).map(|i| (begin + i as f64, end + i as f64)).chain([wrong]);
                let (first, last) = FleetSpan::of(spans, 900.0).span_s().expect("a period");
                let is_near = (first - begin).abs() < 60.0 && (last - end).abs() < 60.0;
                assert!(is_near, "{n} cameras and {wrong:?}: {first} to {last}");
            }
            let died = (0..n).map(|i| (begin, end - 3600.0 * (2 + i % 9) as f64)).chain([(begin, end)]);
            assert!(19 <= n || FleetSpan::of(died, 900.0).span_s() == Some((begin, end)));
        }
        let in_milliseconds = [(1e3 * begin, 1e3 * end); 3].into_iter();
        assert_eq!(FleetSpan::of(in_milliseconds, 900.0).span_s(), Some((1e3 * begin, 1e3 * end)));
    }

    /// Random loss of rows never makes a clock; times that came twice do, also amid the loss.
    #[test]
    fn lost_rows_are_no_clock() {
        let mut rng = SplitMix64::scattered(3);
        for kept in [1.0, 0.7, 0.3, 0.1] {
            let (mut false_alarms, mut found) = (0, 0);
            for _ in 0..2000 {
                let mut of = |n: usize| (0..n).filter(|_| rng.uniform() < kept).count() as u64;
                let counts: Vec<(i64, u64)> = (0..96).map(|period| (period, of(90))).collect();
                let is_twice = |period: i64| (30..46).contains(&period);
                let twice: Vec<(i64, u64)> =
                    (0..80).map(|period| (period, of(if is_twice(period) { 180 } else { 90 }))).collect();
                let run = |counts: &[(i64, u64)]| taken(counts).and_then(|taken| doubled_run(counts, taken));
                false_alarms += usize::from(run(&counts).is_some());
                found += usize::from(run(&twice).is_some_and(|(begin, end)| begin < 40 && 36 < end));
            }
            // Twice as many of 27 rows a period are found nine times in ten at least; of nine they are too few to be sure.
            let least = if kept < 0.2 { 0 } else { 1800 };
            assert!(false_alarms == 0 && least <= found, "{kept} kept: {false_alarms} false, {found} found");
        }
    }
}
