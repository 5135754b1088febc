//! The motions of a camera from its steps: their time, and the change from the pose before to the pose after.

use super::amid::Amid;
use super::evidence::{Record, means};
use super::motion::Motion;
use super::ramps::Slow;
use super::readings::{mean, motion};
use super::share::{self, Whole};
use crate::state::CameraState;
use nalgebra::{DMatrix, dvector};
use resight::core::temporal::monitor::{Drift, Reading, Unrest, Unsettled};
use resight::core::{Matrix6, Pose, Vector6};
use std::ops::Range;

/// Steps that belong together: a period amid which a step fell lies between both poses, and a single period off is one event.
pub(super) fn groups(record: &Record, steps: &[usize]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for step in steps {
        match groups.last_mut() {
            Some(group) if group.len() == 1 && group[0] + 1 == *step && *step < record.len() => {
                group.push(*step)
            }
            _ => groups.push(vec![*step]),
        }
    }
    groups
}

/// The course of a camera that moved.
pub(super) struct Moved {
    /// The pose before any motion.
    pub reference: (Pose, Matrix6),
    /// The motions in order of time.
    pub events: Vec<Motion>,
    /// The motion from the beginning to the end, where there is more than one.
    pub now: Option<(Vector6, Matrix6)>,
    /// The same, however many there are.
    pub end: (Vector6, Matrix6),
}

/// One event: it separates the readings before it from those after it.
struct Border {
    before_end: usize,
    after_begin: usize,
    /// A single reading that lies on neither side nor between them.
    excursion: Option<usize>,
}

impl Border {
    /// Readings from `begin` on before the event, and after it up to `end`. The two that may be means of both poses are left out where others
    /// remain.
    fn sides(&self, begin: usize, end: usize) -> (Range<usize>, Range<usize>) {
        let is_plain = self.before_end == self.after_begin;
        let spared = |n: usize| usize::from(is_plain && 1 < n);
        let (before, after) = (self.before_end - begin, end - self.after_begin);
        (begin..self.before_end - spared(before), self.after_begin + spared(after)..end)
    }
}

/// Of each coordinate the mean before and after, and whether the reading between them is a mean of both.
fn border(record: &Record, group: &[usize], all: &[usize]) -> Border {
    let first = group[0];
    let Some(last) = group.get(1).copied() else {
        return Border { before_end: first, after_begin: first, excursion: None };
    };
    let of = |values: &[f64]| {
        let at = all.iter().position(|step| *step == first).unwrap_or(0);
        let means = means(values, all);
        [means[at], values[first], means[at + 2]]
    };
    let [mut whole, mut part] = [Vector6::zeros(); 2];
    for (i, series) in record.series[..6].iter().enumerate() {
        let [before, between, after] = of(&series.values);
        (whole[i], part[i]) = (after - before, between - before);
    }
    let share = part.dot(&whole) / whole.norm_squared().max(f64::MIN_POSITIVE);
    let rest = (part - whole * share).norm();
    let is_between = (-0.1..1.1).contains(&share) && rest < 0.1 * whole.norm() + 5.0;
    Border { before_end: first, after_begin: last, excursion: (!is_between).then_some(first) }
}

/// Returns the course with these events; `None` where a pose or a covariance is invalid.
pub(super) fn reported(
    record: &Record,
    groups: &[Vec<usize>],
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
    slow: Option<&Slow>,
) -> Option<Moved> {
    let all: Vec<usize> = groups.iter().flatten().copied().collect();
    let amid = Amid::of(&record.series, &all, slow.map(Slow::uncertain));
    let borders: Vec<Border> = groups.iter().map(|group| border(record, group, &all)).collect();
    let mut events = Vec::new();
    let mut total = Matrix6::zeros();
    // What the mean of a last period that holds both poses lacks of the later one.
    let mut lacking = (Vector6::zeros(), Matrix6::zeros());
    for (k, border) in borders.iter().enumerate() {
        let begin = if k == 0 { 0 } else { borders[k - 1].after_begin };
        let end = borders.get(k + 1).map_or(readings.len(), |next| next.before_end);
        let (old, new) = match border.excursion {
            Some(at) => (begin..border.before_end, at..at + 1),
            None => border.sides(begin, end),
        };
        let (y, covariance) = size(record, readings, old, new, &amid)?;
        let is_single_after = border.excursion.is_none() && end - border.after_begin == 1;
        let kind = match border.excursion {
            Some(_) => "excursion",
            None if is_single_after && end == readings.len() => "pending",
            None => "step",
        };
        // A side that is a single period may be a mean of both poses itself.
        let is_single_before = border.before_end - begin == 1 && 0 < begin;
        let single = border
            .excursion
            .or(is_single_after.then_some(border.after_begin))
            .or(is_single_before.then_some(begin));
        let of_share = single.and_then(|at| {
            share::whole(readings, at, &all, state, period_s, (&y, share::angle_sigma(&y, &covariance)))
        });
        let is_single_row = kind != "step" && of_share.as_ref().is_some_and(Whole::is_one_row);
        if is_single_row {
            continue;
        }
        let mut when = when(record, border, &all, readings, state, period_s);
        if let (Some(whole), "pending", 0) = (&of_share, kind, border.after_begin - border.before_end) {
            when = last_instant(whole, readings, state, period_s).unwrap_or(when);
            lacking = (y * (whole.factor - 1.0), y * y.transpose() * whole.factor_sigma.powi(2));
        }
        let event = match of_share {
            Some(whole) => by_share(kind, when, (y, covariance), &whole),
            None => Motion::new(kind, when, y, covariance),
        };
        if border.excursion.is_none() {
            total += covariance;
        }
        events.push(event);
    }
    if events.is_empty() {
        return None;
    }
    let first = mean(&readings[borders.first()?.sides(0, readings.len()).0])?;
    let last = mean(&readings[borders.last()?.sides(0, readings.len()).1])?;
    let end = (motion(&first.0, &last.0) + lacking.0, total + first.1 + last.1 + lacking.1);
    let now = (1 < events.len()).then_some(end);
    Some(Moved { reference: first, events, now, end })
}

/// A motion of which a period holds a share, as large as the scatter of that period says. Its evidence is that of the mean.
fn by_share(
    kind: &'static str,
    when: (f64, f64),
    (y, covariance): (Vector6, Matrix6),
    whole: &Whole,
) -> Motion {
    let seen = Motion::new(kind, when, y, covariance);
    if whole.is_vague() {
        let each = |sizes: [f64; 3], sigmas: [f64; 3]| [0, 1, 2].map(|i| sizes[i].hypot(sigmas[i]));
        let vague = |[size, sigma]: [f64; 2]| [size, size.hypot(sigma)];
        return Motion {
            is_at_least: true,
            rotation_sigma_deg: each(seen.rotation_deg, seen.rotation_sigma_deg),
            translation_sigma_m: each(seen.translation_m, seen.translation_sigma_m),
            angle_deg: vague(seen.angle_deg),
            shift_m: vague(seen.shift_m),
            ..seen
        };
    }
    let uncertain = covariance * whole.factor.powi(2) + y * y.transpose() * whole.factor_sigma.powi(2);
    let motion = Motion::new(kind, when, y * whole.factor, uncertain);
    Motion { chi2: seen.chi2, ..motion }
}

/// When a motion fell of which the last period holds a share.
fn last_instant(
    whole: &Whole,
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
) -> Option<(f64, f64)> {
    let begin_s = (readings.last()?.t_s / period_s).floor() * period_s;
    // The last period may end with the record.
    let length_s = (state.span_s?.1 - begin_s).clamp(0.0, period_s);
    let (share, sigma) = whole.share();
    let variance = sigma.powi(2) + 1.0 / (3.0 * whole.rows * whole.rows) + 1e-4;
    (!whole.is_vague()).then(|| (begin_s + (1.0 - share) * length_s, length_s * variance.sqrt()))
}
/// Readings on either side that the size of a motion rests on, so that slow errors are those of its time.
const NEAR: usize = 48;

/// From the pose before to the pose after, by least squares amid the errors of the whitened coordinates, eq. (16).
fn size(
    record: &Record,
    readings: &[Reading],
    old: Range<usize>,
    new: Range<usize>,
    amid: &Amid,
) -> Option<(Vector6, Matrix6)> {
    let old = old.start.max(old.end.saturating_sub(NEAR))..old.end;
    let new = new.start..new.end.min(new.start + NEAR);
    let is_new: Vec<bool> = old.clone().map(|_| false).chain(new.clone().map(|_| true)).collect();
    let used: Vec<usize> = old.clone().chain(new).collect();
    // About the last reading before, so that motions on either side are small or that of the event.
    let about = readings[old.end.checked_sub(1)?].a_from_b;
    let whitened_from_motion = record.motion_from_whitened.try_inverse()?;
    let y: Vec<Vector6> =
        used.iter().map(|i| whitened_from_motion * motion(&about, &readings[*i].a_from_b)).collect();
    let columns = DMatrix::from_fn(used.len(), 2, |i, k| f64::from(u8::from(is_new[i] == (k == 1))));
    let squares = amid.fit(&used, &columns)?;
    let (mut means, mut variances) = ([Vector6::zeros(); 2], Vector6::zeros());
    for axis in 0..6 {
        let values = DMatrix::from_fn(used.len(), 1, |i, _| y[i][axis]);
        let solved = squares.coefficients(axis, &values)?;
        (means[0][axis], means[1][axis]) = (solved[0], solved[1]);
        variances[axis] = squares.variance(axis, &dvector![-1.0, 1.0])?;
    }
    let [before, after] = means.map(|m| Pose::exp(&-(record.motion_from_whitened * m)) * about);
    let root = record.motion_from_whitened;
    Some((motion(&before, &after), root * Matrix6::from_diagonal(&variances) * root.transpose()))
}

/// Readings on either side of a step whose means are the poses before and after it.
const NEIGHBOURS: usize = 3;
/// Readings about a step that may have been the first after it.
const ONSETS: usize = 12;

/// When an event fell, seconds, and how uncertain that is: the share of the new pose in the period amid which it fell says so, eq. (8); where the
/// noise hides that, the readings that may have been the first after it.
fn when(
    record: &Record,
    border: &Border,
    all: &[usize],
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
) -> (f64, f64) {
    let begin_of = |i: usize| {
        let (last, next) = (readings[i - 1].t_s, readings[i].t_s);
        // Somewhere in the gap, where there is one.
        (0.5 * (last + next), (next - last) / 12_f64.sqrt())
    };
    let onsets = record.onsets(all, border.before_end, ONSETS);
    let time_s: f64 = onsets.iter().map(|(i, p)| p * begin_of(*i).0).sum();
    let spread: f64 =
        onsets.iter().map(|(i, p)| p * ((begin_of(*i).0 - time_s).powi(2) + begin_of(*i).1.powi(2))).sum();
    let coarse = (time_s, spread.sqrt());
    if border.excursion.is_some() || period_s < spread.sqrt() {
        return coarse;
    }
    instant(readings, border, state, period_s).unwrap_or(coarse)
}

/// Returns the share of the new pose in the two periods about a step; `None` where there is a gap, or where noise hides it.
fn instant(readings: &[Reading], border: &Border, state: &CameraState, period_s: f64) -> Option<(f64, f64)> {
    // The two readings that may be means of both poses: the one before a step and the first after, or the one between.
    let (first, last) = match border.after_begin - border.before_end {
        0 => (border.before_end - 1, border.after_begin),
        _ => (border.before_end, border.before_end),
    };
    let is_gapless = readings[first.saturating_sub(1)..(last + 2).min(readings.len())]
        .windows(2)
        .all(|pair| pair[1].t_s - pair[0].t_s < 1.5 * period_s);
    let (before, _) = mean(&readings[first.saturating_sub(NEIGHBOURS)..first])?;
    let (after, _) = mean(readings.get(last + 1..(last + 1 + NEIGHBOURS).min(readings.len()))?)?;
    let whole = motion(&before, &after);
    let weighed = readings[last].covariance.cholesky()?.solve(&whole);
    let size = weighed.dot(&whole);
    let share = |i: usize| weighed.dot(&motion(&before, &readings[i].a_from_b)) / size;
    let shares: f64 = (first..=last).map(share).map(|share| share.clamp(0.0, 1.0)).sum();
    let is_share = (first..=last).map(share).all(|share| (-0.1..=1.1).contains(&share));
    if !(is_gapless && is_share && 25.0 < size) {
        return None;
    }
    let rows = (first..=last).filter_map(|i| {
        let period = (readings[i].t_s / period_s).floor() as i64;
        let at = state.periods.binary_search_by_key(&period, |(known, _)| *known).ok()?;
        Some(state.periods[at].1.n() as f64)
    });
    let rows = rows.fold(f64::INFINITY, f64::min);
    let n = (last - first + 1) as f64;
    let variance = n * (1.0 + 1.0 / NEIGHBOURS as f64) / size + 1.0 / (3.0 * rows * rows) + 1e-4;
    Some((readings[last].t_s + (0.5 - shares) * period_s, period_s * variance.sqrt()))
}

/// The event of the test of a single motion.
pub(super) fn of_single(
    found: &Unsettled,
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
) -> Motion {
    let drift: &Drift = &found.drift;
    let first = found.reading.clamp(1, readings.len() - 1);
    let border = Border { before_end: first, after_begin: first, excursion: None };
    let is_step = found.unrest == Unrest::Step;
    let within = if is_step { instant(readings, &border, state, period_s) } else { None };
    // A mean of a period is dated by its middle and not by an instant: where in it a motion began is known to 0.4 of it, in place of the whole interval.
    let spread_s = (drift.began_sigma_s.powi(2) - period_s * period_s).max(0.0).sqrt();
    let coarse = (drift.began_s - 0.75 * period_s, spread_s.hypot(0.4 * period_s));
    let kind = if is_step { "step" } else { "ramp" };
    Motion::new(kind, within.unwrap_or(coarse), drift.old_from_new, drift.covariance)
}
