//! Determines the motions that the readings of a camera show.

use super::AssessConfig;
use super::events::{self, Moved};
use super::evidence::{Course as Steps, FALSE_ALARM_PROBABILITY, Record};
use super::motion::Motion;
use super::partition::candidates;
use super::ramps::{self, Slow};
use super::readings::{mean, motion, readings, times};
use crate::state::CameraState;
use resight::core::temporal::monitor::learn::{LEAST_READINGS, LearnConfig, learn, unsettled};
use resight::core::temporal::monitor::{Detectable, Monitor, MonitorConfig, Reading, Unrest, Unsettled};
use resight::core::{Matrix6, Pose, Vector6};

/// The result for the readings of a camera.
pub(super) struct Course {
    /// The pose before any motion, or that of the whole record; `None` with too few readings.
    pub reference: Option<(Pose, Matrix6)>,
    /// The motions in order of time.
    pub events: Vec<Motion>,
    /// The final pose of the camera in its own initial frame, `[rotation_rad; translation_m]`, where more than one motion is reported.
    pub now: Option<(Vector6, Matrix6)>,
    pub unrest: Option<Wander>,
    pub detectable: Option<Detectable>,
    pub readings: usize,
}

/// A change that is neither a step nor a ramp.
pub(super) enum Wander {
    /// To and fro, by more than the errors of a period: from the first quarter to the last. Steps that are likelier than an error that
    /// lasts, but not beyond doubt.
    ToAndFro { by: Vector6, likely: Vec<Motion> },
    /// So many readings are farther from the mean than the motion that would have been found: the farthest, and when it was.
    Off { readings: usize, farthest: Vector6, t_s: f64 },
}

pub(super) fn course(state: &CameraState, period_s: f64, config: &AssessConfig) -> Course {
    let readings = readings(state, period_s, config.least_rows);
    let nothing = Course {
        reference: None,
        events: Vec::new(),
        now: None,
        unrest: None,
        detectable: None,
        readings: readings.len(),
    };
    if readings.len() < LEAST_READINGS {
        return nothing;
    }
    let correlated = config.correlated(period_s);
    let single = unsettled(&readings, &correlated);
    let steps = |rate: f64| several(&readings, state, period_s, &correlated, single.as_ref(), rate);
    if let Some(Moved { reference, events, now, .. }) = steps(FALSE_ALARM_PROBABILITY) {
        return Course { reference: Some(reference), events, now, ..nothing };
    }
    match single {
        Some(Unsettled { unrest: Unrest::Wander, drift, .. }) => Course {
            unrest: Some(Wander::ToAndFro {
                by: drift.old_from_new,
                likely: steps(LIKELY).map_or_else(Vec::new, |moved| moved.events),
            }),
            ..steady(&readings, &correlated, period_s, config)
        },
        Some(found) => {
            let first = found.reading.clamp(1, readings.len() - 1);
            let before = mean(&readings[..first - usize::from(1 < first)]);
            let moved = single_motion(&found, &readings, &correlated, state, period_s);
            let (before, reported, now) = match moved {
                Some(Moved { reference, events, now, .. }) => (Some(reference), events, now),
                None => (before, vec![events::of_single(&found, &readings, state, period_s)], None),
            };
            // A ramp whose ends do not differ is not reported as continuing.
            match reported.iter().all(|event| event.chi2 < LEAST_CHI2) {
                true => Course {
                    unrest: Some(Wander::ToAndFro { by: found.drift.old_from_new, likely: Vec::new() }),
                    ..steady(&readings, &correlated, period_s, config)
                },
                false => Course { reference: before, events: reported, now, ..nothing },
            }
        }
        None => steady(&readings, &correlated, period_s, config),
    }
}

/// Exceeded by χ² with six degrees of freedom once in a thousand.
const LEAST_CHI2: f64 = 22.458;

/// Of cameras that wander, at most one in twenty is falsely reported to have likely steps.
const LIKELY: f64 = 0.05;

/// Steps whose evidence is beyond that of a probability of false alarms, each of its own; none where there is none, or where a single ramp is likelier.
fn several(
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
    config: &LearnConfig,
    single: Option<&Unsettled>,
    false_alarms: f64,
) -> Option<Moved> {
    let t_s = times(readings, state, period_s);
    let record = Record::new(readings, &t_s, config)?;
    let sets = record.steps(false_alarms)?;
    let steps = Steps { steps: record.best(&sets), ramp: None };
    let slow = ramps::best(&record, &sets, period_s).filter(|slow| record.log_posterior(&steps) < slow.1);
    if let Some((Steps { steps: beside, ramp: Some(ramp) }, _)) = slow {
        let is_ramp = single.is_some_and(|found| found.unrest == Unrest::Ramp) && beside.is_empty();
        if is_ramp || record.is_certain_ramp(&beside, &ramp, false_alarms) {
            let slow = ramps::fit(&record, &beside, &ramp, period_s)?;
            return slowly(&record, &beside, slow, readings, state, period_s, config);
        }
        // Likelier than steps, but not beyond doubt: the test of a single motion decides.
        if beside.is_empty() && t_s.last().is_some_and(|last_s| *last_s < ramp.to_s) {
            return None;
        }
    }
    let groups = record.certain(events::groups(&record, &steps.steps), 1);
    events::reported(&record, &groups, readings, state, period_s, None)
}

/// Readings about the step of the test of a single motion, which may be the first after it.
const NEAR: usize = 2;

/// The motion that the test of a single motion found, as a step or as a ramp, perhaps with steps beside it, whichever is likelier.
fn single_motion(
    found: &Unsettled,
    readings: &[Reading],
    config: &LearnConfig,
    state: &CameraState,
    period_s: f64,
) -> Option<Moved> {
    let t_s = times(readings, state, period_s);
    let record = Record::new(readings, &t_s, config)?;
    let near = found.reading.saturating_sub(NEAR).max(1)..(found.reading + NEAR + 1).min(readings.len());
    let steps: Vec<Vec<usize>> = near.map(|first| vec![first]).collect();
    let step = Steps { steps: record.best(&steps), ramp: None };
    let sets: Vec<Vec<usize>> =
        [step.steps.clone()].into_iter().chain(candidates(record.whitened(), record.weights())).collect();
    let likelier = ramps::best(&record, &sets, period_s).filter(|slow| record.log_posterior(&step) < slow.1);
    if let Some((Steps { steps: beside, ramp: Some(ramp) }, _)) = likelier
        && record.is_certain_ramp(&beside, &ramp, FALSE_ALARM_PROBABILITY)
    {
        let slow = ramps::fit(&record, &beside, &ramp, period_s)?;
        return slowly(&record, &beside, slow, readings, state, period_s, config);
    }
    if found.unrest == Unrest::Ramp {
        let slow = ramps::fit(&record, &[], &ramps::likeliest(&record, &[], period_s)?, period_s)?;
        return slowly(&record, &[], slow, readings, state, period_s, config);
    }
    let mut moved = events::reported(&record, &[step.steps], readings, state, period_s, None)?;
    let event = moved.events.pop().filter(Motion::is_confirmed)?;
    let Motion { since_s, since_sigma_s, .. } = events::of_single(found, readings, state, period_s);
    Some(Moved { events: vec![Motion { since_s, since_sigma_s, ..event }], now: None, ..moved })
}

/// A slow motion, and the steps that are left without it.
fn slowly(
    record: &Record,
    beside: &[usize],
    slow: Slow,
    readings: &[Reading],
    state: &CameraState,
    period_s: f64,
    config: &LearnConfig,
) -> Option<Moved> {
    let left = slow.removed(readings, record.t_s());
    let rest = Record::new(&left, record.t_s(), config)?;
    let groups = rest.certain(events::groups(&rest, beside), 0);
    if groups.is_empty() {
        let slow = match beside.is_empty() {
            true => slow,
            false => ramps::fit(record, &[], &slow.ramp, period_s)?,
        };
        let reference = mean(&slow.removed(readings, record.t_s()))?;
        return Some(Moved {
            reference,
            events: vec![slow.event()],
            now: None,
            end: (slow.motion, slow.covariance),
        });
    }
    let mut moved = events::reported(&rest, &groups, &left, state, period_s, Some(&slow))?;
    moved.events.push(slow.event());
    moved.events.sort_by(|a, b| a.since_s.total_cmp(&b.since_s));
    let (y, covariance) = moved.end;
    let end = (y + slow.motion, covariance + slow.covariance);
    Some(Moved { now: Some(end), end, ..moved })
}

/// Returns the pose of the whole record, and the motion that would have been found.
fn steady(readings: &[Reading], correlated: &LearnConfig, period_s: f64, config: &AssessConfig) -> Course {
    let learned = learn(readings, correlated).ok();
    let detectable = learned.as_ref().and_then(|reference| {
        let alarms = MonitorConfig {
            decision_period_s: period_s,
            stale_after_s: 10.0 * period_s,
            ..MonitorConfig::default()
        };
        let mut monitor = Monitor::new(reference, &alarms, readings.last()?.t_s).ok()?;
        monitor.measure_noise(readings);
        monitor.detectable(f64::from(config.promise_periods) * period_s)
    });
    let reference = learned.map(|reference| (reference.a_from_b, reference.noise.reference));
    let unrest = reference.and_then(|(mean, _)| {
        contradiction(readings, &mean, detectable.as_ref()?, config.promise_periods as usize)
    });
    Course { reference, events: Vec::new(), now: None, unrest, detectable, readings: readings.len() }
}

/// Standard deviations that may be added to a motion that would have been found.
const NOISE: f64 = 5.0;

/// Readings, or means of as many as a motion that would have been found lasts, that are farther off than it: a camera with such readings is not
/// reported to have stayed. See docs/math/fleet.md eq. (17).
fn contradiction(readings: &[Reading], mean: &Pose, found: &Detectable, periods: usize) -> Option<Wander> {
    let limit = |i: usize| if i < 3 { found.rotation_rad[i] } else { found.translation_m[i - 3] };
    let y: Vec<Vector6> = readings.iter().map(|reading| motion(mean, &reading.a_from_b)).collect();
    let n = readings.len();
    let typical: Matrix6 = readings.iter().map(|reading| reading.covariance).sum::<Matrix6>() / n as f64;
    let information = typical.try_inverse()?;
    let alone = |y: &Vector6, i: usize| (information * y)[i] / information[(i, i)];
    let periods = periods.clamp(1, n);
    let mut off = vec![false; n];
    let mut farthest = (1.0, Vector6::zeros(), 0.0);
    for (length, is_alone) in [(1, false), (periods, true)] {
        for first in 0..=n - length {
            let mean = y[first..first + length].iter().sum::<Vector6>() / length as f64;
            let of = |i: usize| match is_alone {
                true => {
                    alone(&mean, i).abs() / (limit(i) + NOISE / (information[(i, i)] * length as f64).sqrt())
                }
                false => mean[i].abs() / (limit(i) + NOISE * typical[(i, i)].max(0.0).sqrt()),
            };
            let excess = (0..6).map(of).fold(0.0, f64::max);
            if 1.0 < excess {
                off[first..first + length].fill(true);
            }
            if farthest.0 < excess {
                farthest = (excess, mean, 0.5 * (readings[first].t_s + readings[first + length - 1].t_s));
            }
        }
    }
    let (_, farthest, t_s) = farthest;
    let readings = off.into_iter().filter(|is_off| *is_off).count();
    (0 < readings).then_some(Wander::Off { readings, farthest, t_s })
}
