//! Means of periods as readings of the change detector.

use super::AssessConfig;
use crate::state::CameraState;
use resight::core::temporal::monitor::learn::{LEAST_READINGS, LearnConfig, learn, unsettled};
use resight::core::temporal::monitor::{
    Detectable, Drift, Monitor, MonitorConfig, Reading, Unrest, Unsettled,
};
use resight::core::{Matrix6, Pose, Vector6};
use serde::Serialize;

/// How far a camera moved, and when.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motion {
    /// `step` or `ramp`.
    pub kind: &'static str,
    /// When it began, seconds.
    pub since_s: f64,
    /// How uncertain that is, seconds.
    pub since_sigma_s: f64,
    /// χ² of the motion with six degrees of freedom.
    pub chi2: f64,
    /// Where the camera now is in its own old frame, about x right, y down, z forward, degrees.
    pub rotation_deg: [f64; 3],
    /// Their standard deviations.
    pub rotation_sigma_deg: [f64; 3],
    /// Along the same axes, metres.
    pub translation_m: [f64; 3],
    /// Their standard deviations.
    pub translation_sigma_m: [f64; 3],
    /// The rotation if it only rotated about its own centre, which such a motion is mostly; none where it shifted too.
    pub rotation_alone_deg: Option<[f64; 3]>,
}

/// What the readings of a camera come to.
pub(super) struct Course {
    /// None: too few readings.
    pub reference: Option<(Pose, Matrix6)>,
    pub motion: Option<Motion>,
    /// To and fro, by more than the errors of a period.
    pub wander: Option<Vector6>,
    pub detectable: Option<Detectable>,
    pub readings: usize,
}

/// Of a change of variance between neighbours: the median of χ² with six degrees of freedom.
const MEDIAN: f64 = 5.348_120_627;
/// Readings on either side of a step whose means are the poses before and after it: few, so that slow errors are those of its time.
const NEIGHBOURS: usize = 3;
/// Scales of the noise that are believed.
const SCALES: (f64, f64) = (1e-4, 1e12);

pub(super) fn course(state: &CameraState, period_s: f64, config: &AssessConfig) -> Course {
    let readings = readings(state, period_s, config.least_rows);
    let nothing =
        Course { reference: None, motion: None, wander: None, detectable: None, readings: readings.len() };
    if readings.len() < LEAST_READINGS {
        return nothing;
    }
    let correlated = config.correlated(period_s);
    match unsettled(&readings, &correlated) {
        Some(Unsettled { unrest: Unrest::Wander, drift, .. }) => {
            Course { wander: Some(drift.old_from_new), ..steady(&readings, &correlated, period_s, config) }
        }
        Some(found) => {
            let first = found.reading.clamp(1, readings.len() - 1);
            let before = mean(&readings[..first - usize::from(1 < first)]);
            let within = instant(&found, &readings, first, state, period_s);
            Course { reference: before, motion: Some(motion(&found, within, period_s)), ..nothing }
        }
        None => steady(&readings, &correlated, period_s, config),
    }
}

/// The pose of the whole record, and what would have been found.
fn steady(readings: &[Reading], correlated: &LearnConfig, period_s: f64, config: &AssessConfig) -> Course {
    let learned = learn(readings, correlated).ok();
    let promise = learned.as_ref().and_then(|reference| {
        let alarms = MonitorConfig {
            decision_period_s: period_s,
            stale_after_s: 10.0 * period_s,
            ..MonitorConfig::default()
        };
        let mut monitor = Monitor::new(reference, &alarms, readings.last()?.t_s).ok()?;
        monitor.measure_noise(readings);
        monitor.detectable(f64::from(config.promise_periods) * period_s)
    });
    Course {
        reference: learned.map(|reference| (reference.a_from_b, reference.noise.reference)),
        motion: None,
        wander: None,
        detectable: promise,
        readings: readings.len(),
    }
}

/// The mean of each period, with the stated covariance of a row divided by the rows and widened by what neighbouring periods differ:
/// docs/math/fleet.md eqs. (6), (7).
pub(super) fn readings(state: &CameraState, period_s: f64, least_rows: u64) -> Vec<Reading> {
    let Some(stated) = state.covariance() else { return Vec::new() };
    let means = state.periods.iter().filter(|(_, sums)| least_rows <= sums.n);
    let mut readings: Vec<Reading> = means
        .filter_map(|(period, sums)| {
            Some(Reading {
                t_s: (*period as f64 + 0.5) * period_s,
                a_from_b: sums.mean()?,
                covariance: stated / sums.n as f64,
                is_consistent: true,
            })
        })
        .collect();
    let scale = scale(&readings).clamp(SCALES.0, SCALES.1);
    readings.iter_mut().for_each(|reading| reading.covariance *= scale);
    readings
}

/// By how much neighbours differ more than their covariances say, robustly: a step is one difference of many.
fn scale(readings: &[Reading]) -> f64 {
    let chi2 = |pair: &[Reading]| {
        let y = (pair[0].a_from_b * pair[1].a_from_b.inverse()).log();
        let factor = (pair[0].covariance + pair[1].covariance).cholesky()?;
        Some(y.dot(&factor.solve(&y)))
    };
    let mut all: Vec<f64> = readings.windows(2).filter_map(chi2).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).map_or(1.0, |median| median / MEDIAN)
}

/// The mean of some readings, with its covariance if nothing lasts from one to the next.
fn mean(readings: &[Reading]) -> Option<(Pose, Matrix6)> {
    let first = readings.first()?.a_from_b;
    let n = readings.len() as f64;
    let sum: Vector6 = readings.iter().map(|reading| (first * reading.a_from_b.inverse()).log()).sum();
    let covariance: Matrix6 = readings.iter().map(|reading| reading.covariance).sum();
    Some((Pose::exp(&(-sum / n)) * first, covariance / (n * n)))
}

/// A period amid which a step fell is a mean of both poses, whose share of the new one says when: docs/math/fleet.md eq. (8). Time and its
/// standard deviation, seconds; none where the periods are no neighbours or the share is none.
fn instant(
    found: &Unsettled,
    readings: &[Reading],
    first: usize,
    state: &CameraState,
    period_s: f64,
) -> Option<(f64, f64)> {
    let last = &readings[first - 1];
    let is_neighbour = readings[first].t_s - last.t_s < 1.5 * period_s;
    if found.unrest != Unrest::Step || !is_neighbour {
        return None;
    }
    let period = (last.t_s / period_s).floor() as i64;
    let at = state.periods.binary_search_by_key(&period, |(known, _)| *known).ok()?;
    let rows = state.periods[at].1.n as f64;
    let (before, _) = mean(&readings[(first - 1).saturating_sub(NEIGHBOURS)..first - 1])?;
    let (after, _) = mean(&readings[first..readings.len().min(first + NEIGHBOURS)])?;
    let to = |pose: &Pose| (before * pose.inverse()).log();
    let (whole, part) = (to(&after), to(&last.a_from_b));
    let weighed = last.covariance.cholesky()?.solve(&whole);
    let (size, share) = (weighed.dot(&whole), weighed.dot(&part) / weighed.dot(&whole));
    // Of a step that fell between the periods the share is none but for noise, and the time is their border.
    let is_share = (-0.1..=1.0).contains(&share) && 25.0 < size;
    let variance = (1.0 + 1.0 / NEIGHBOURS as f64) / size + 1.0 / (3.0 * rows * rows) + 1e-4;
    is_share.then(|| (last.t_s + (0.5 - share.max(0.0)) * period_s, period_s * variance.sqrt()))
}

fn motion(found: &Unsettled, within: Option<(f64, f64)>, period_s: f64) -> Motion {
    let drift: &Drift = &found.drift;
    let coarse = (drift.began_s - 0.75 * period_s, drift.began_sigma_s.hypot(0.4 * period_s));
    let (since_s, since_sigma_s) = within.unwrap_or(coarse);
    let y = drift.old_from_new;
    let chi2 = drift.covariance.cholesky().map_or(0.0, |factor| y.dot(&factor.solve(&y)));
    let sigma = |i: usize| drift.covariance[(i, i)].max(0.0).sqrt();
    let alone = drift.pure_rotation().map(|(rotation, _)| rotation.map(f64::to_degrees).into());
    Motion {
        kind: if found.unrest == Unrest::Step { "step" } else { "ramp" },
        since_s,
        since_sigma_s,
        chi2,
        rotation_deg: [0, 1, 2].map(|i| y[i].to_degrees()),
        rotation_sigma_deg: [0, 1, 2].map(|i| sigma(i).to_degrees()),
        translation_m: [3, 4, 5].map(|i| y[i]),
        translation_sigma_m: [3, 4, 5].map(sigma),
        rotation_alone_deg: alone,
    }
}
