//! Means of periods as readings.

use crate::state::CameraState;
use resight::core::temporal::monitor::Reading;
use resight::core::{Matrix6, Pose, Vector6};

/// Of a change of variance between neighbours: the median of χ² with six degrees of freedom.
const MEDIAN: f64 = 5.348_120_627;
/// Scales of the noise that are believed.
const SCALES: (f64, f64) = (1e-4, 1e12);

/// The mean of each period, with the stated covariance of a row divided by the rows and widened by what neighbouring periods differ:
/// docs/math/fleet.md eqs. (6), (7).
pub(super) fn readings(state: &CameraState, period_s: f64, least_rows: u64) -> Vec<Reading> {
    let Some(stated) = state.covariance() else { return Vec::new() };
    let means = state.periods.iter().filter(|(_, sums)| least_rows <= sums.n());
    let mut readings: Vec<Reading> = means
        .filter_map(|(period, sums)| {
            Some(Reading {
                t_s: (*period as f64 + 0.5) * period_s,
                a_from_b: sums.mean()?,
                covariance: stated / sums.n() as f64,
                is_consistent: true,
            })
        })
        .collect();
    let scale = scale(&readings).clamp(SCALES.0, SCALES.1);
    readings.iter_mut().for_each(|reading| reading.covariance *= scale);
    readings
}

/// The middle of what each reading is a mean over, seconds: the first and the last period of a record are not full.
pub(super) fn times(readings: &[Reading], state: &CameraState, period_s: f64) -> Vec<f64> {
    let (begin_s, end_s) = state.span_s.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    let middle = |t_s: f64| {
        let from_s = (t_s / period_s).floor() * period_s;
        0.5 * (from_s.max(begin_s) + (from_s + period_s).min(end_s))
    };
    readings.iter().map(|reading| middle(reading.t_s)).collect()
}

/// By how much neighbours differ more than their covariances say, robustly: a step is one difference of many.
fn scale(readings: &[Reading]) -> f64 {
    let chi2 = |pair: &[Reading]| {
        let y = motion(&pair[0].a_from_b, &pair[1].a_from_b);
        let factor = (pair[0].covariance + pair[1].covariance).cholesky()?;
        Some(y.dot(&factor.solve(&y)))
    };
    let mut all: Vec<f64> = readings.windows(2).filter_map(chi2).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).map_or(1.0, |median| median / MEDIAN)
}

/// Returns the camera of the second pose in its own frame of the first, `[rotation_rad; translation_m]`.
pub(super) fn motion(from: &Pose, to: &Pose) -> Vector6 {
    (*from * to.inverse()).log()
}

/// The mean of some readings, with its covariance if nothing lasts from one to the next.
pub(super) fn mean(readings: &[Reading]) -> Option<(Pose, Matrix6)> {
    let first = readings.first()?.a_from_b;
    let n = readings.len() as f64;
    let sum: Vector6 = readings.iter().map(|reading| motion(&first, &reading.a_from_b)).sum();
    let covariance: Matrix6 = readings.iter().map(|reading| reading.covariance).sum();
    Some((Pose::exp(&(-sum / n)) * first, covariance / (n * n)))
}
