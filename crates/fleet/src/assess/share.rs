//! A motion of which the mean of a period holds only a share: the scatter of the rotations within the period says how large it is.
//!
//! Of the rows of a period a share s sees the new pose, at an angle θ from the old. Their mean is at an angle m, their mean resultant length is R:
//! s exp(iθ) + 1 − s = R exp(im), docs/math/fleet.md eq. (20).

use crate::state::{CameraState, Sums};
use resight::core::Vector6;
use resight::core::temporal::monitor::Reading;

/// A factor that is known no better than this, of itself, says only how large the motion is at least.
const VAGUE: f64 = 0.5;
/// So many rows are one: a pose of which the others know nothing, such as the second solution of a view.
const ONE_ROW: f64 = 1.5;

/// The whole motion from the share that a period holds.
pub(super) struct Whole {
    /// The motion over the mean of the period, and the standard deviation of that.
    pub factor: f64,
    pub factor_sigma: f64,
    /// Rows of the period.
    pub rows: f64,
}

impl Whole {
    /// What is not known from the scatter.
    pub fn is_vague(&self) -> bool {
        VAGUE * self.factor < self.factor_sigma
    }

    /// Whether a single row has the other pose, which is no motion.
    pub fn is_one_row(&self) -> bool {
        !self.is_vague() && self.rows < ONE_ROW * self.factor && 1.0 < self.rows
    }

    /// The share and its standard deviation.
    pub fn share(&self) -> (f64, f64) {
        (1.0 / self.factor, self.factor_sigma / self.factor.powi(2))
    }
}

/// From the motion `y` of the mean of the period of reading `at`, whose angle is known to `sigma_rad`; `events` are readings whose own scatter may
/// be that of motions.
pub(super) fn whole(
    readings: &[Reading],
    at: usize,
    events: &[usize],
    state: &CameraState,
    period_s: f64,
    (y, sigma_rad): (&Vector6, f64),
) -> Option<Whole> {
    let rotation = y.fixed_rows::<3>(0).into_owned();
    let angle = rotation.norm();
    let axis = rotation / angle.max(f64::MIN_POSITIVE);
    let sums = |i: usize| -> Option<&Sums> {
        let period = (readings[i].t_s / period_s).floor() as i64;
        let at = state.periods.binary_search_by_key(&period, |(known, _)| *known).ok()?;
        Some(&state.periods[at].1)
    };
    // Of sin²(θ/2) about the mean, unbiased.
    let scatter = |i: usize| {
        let sums = sums(i)?;
        let n = sums.n() as f64;
        Some(axis.dot(&(sums.scatter()? * axis)) * n / (n - 1.0).max(1.0))
    };
    let is_quiet = |i: &usize| events.iter().all(|event| 1 < event.abs_diff(*i));
    let mut others: Vec<f64> = (0..readings.len()).filter(is_quiet).filter_map(scatter).collect();
    others.sort_by(f64::total_cmp);
    let noise = others.get(others.len() / 2).copied()?;
    let rows = sums(at)?.n() as f64;
    let excess = scatter(at)? * (rows - 1.0) / rows - noise;
    let resultant = (1.0 - 2.0 * excess).clamp(0.0, 1.0);
    let share = (1.0 + resultant * (resultant - 2.0 * angle.cos())) / (2.0 * (1.0 - resultant * angle.cos()));
    let whole = (resultant * angle.sin()).atan2(resultant * angle.cos() - 1.0 + share);
    // In squares of angles: the variance of the scatter of rows, and what follows for θ = m + v/m.
    let (noise, excess) = (4.0 * noise, 4.0 * excess.max(0.0));
    let excess_sigma = ((2.0 * noise * noise + 4.0 * noise * excess) / rows).sqrt();
    let by_scatter = excess_sigma / (angle * angle);
    let by_mean = 2.0 * excess / (angle * angle) * sigma_rad / angle;
    let (factor, factor_sigma) = (whole / angle, by_scatter.hypot(by_mean));
    let is_known = factor.is_finite() && factor_sigma.is_finite();
    Some(match is_known && factor_sigma <= VAGUE * factor {
        true => Whole { factor: factor.max(1.0), factor_sigma, rows },
        false => Whole { factor: 1.0, factor_sigma: 1.0, rows },
    })
}

/// The angle of a motion's standard deviation along itself.
pub(super) fn angle_sigma(y: &Vector6, covariance: &resight::core::Matrix6) -> f64 {
    super::motion::length(&y.fixed_rows::<3>(0).into(), &covariance.fixed_view::<3, 3>(0, 0).into())[1]
}
