//! The relative pose of maximum likelihood over the pairs that agree, and how uncertain it is: docs/math/two_view.md sections 3 and 4.

use super::epipolar::{EpipolarRow, RelativePose, squared_residual};
use super::{BearingPair, TwoViewConfig};
use crate::Error;
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use nalgebra::{Matrix3, Matrix5, Vector5};

/// Rounds of selection and minimisation; the selection settles within three.
const ROUNDS: usize = 3;
/// Residual, in units of the robust scatter, that one good pair in a thousand exceeds.
pub(super) const GATE: f64 = 3.290_527;
/// Share of χ² that the gate leaves: docs/math/two_view.md eq. (10).
const KEPT: f64 = 0.988_293;
/// Median of χ² with one degree of freedom.
const MEDIAN_OF_ONE: f64 = 0.454_936;
/// Corners are not known better than half of what is stated.
const LEAST_NOISE_FACTOR: f64 = 0.25;
/// A bearing nearer to the translation than this many of its standard deviations has no direction about it.
const NEAR_EPIPOLE: f64 = 10.0;
/// Share of the information that must be more than the noise along epipolar lines, in the worst direction: docs/math/two_view.md eq. (13).
const LEAST_PARALLAX: f64 = 0.5;
/// Mean square of the parallax, in variances, below which it may be noise: eq. (18). Noise alone has one, give or take √(2/n).
const LEAST_PARALLAX_SQUARE: f64 = 4.0;
/// Standard deviation of the direction of translation beyond which a covariance does not describe it, radians.
const MAX_DIRECTION_SIGMA_RAD: f64 = 0.3;

/// The minimum.
pub(super) struct Fit {
    pub at: RelativePose,
    /// By number in the input.
    pub used: Vec<usize>,
    chi2: f64,
}

impl Fit {
    /// # Errors
    /// `DegenerateView` where fewer than six pairs are left or no minimum is found.
    pub fn of(pairs: &[BearingPair], start: &RelativePose, config: &TwoViewConfig) -> Result<Self, Error> {
        let mut fit = Fit { at: *start, used: agreeing(pairs, start, config), chi2: 0.0 };
        for _ in 0..ROUNDS {
            let used = &fit.used;
            if used.len() < 6 {
                return Err(no_parallax(0.0));
            }
            let minimum = minimize_dense(
                fit.at,
                |at| equations(pairs, used, at),
                |at, step| at.moved(&Vector5::from_iterator(step.iter().copied())),
            );
            let minimum = minimum.filter(|found| found.is_minimum()).ok_or_else(|| no_parallax(0.0))?;
            let used = agreeing(pairs, &minimum.state, config);
            let is_settled = used == fit.used;
            fit = Fit { at: minimum.state, used, chi2: minimum.equations.chi2 };
            if is_settled {
                break;
            }
        }
        let e = fit.at.essential();
        fit.chi2 = fit.used.iter().map(|i| squared_residual(&e, &pairs[*i])).sum();
        Ok(fit)
    }

    fn freedom(&self) -> f64 {
        (self.used.len() as f64 - 5.0).max(1.0)
    }

    /// s², eq. (9).
    pub fn noise_factor(&self) -> f64 {
        (self.chi2 / (KEPT * self.freedom())).max(LEAST_NOISE_FACTOR)
    }

    /// Eq. (12).
    ///
    /// # Errors
    /// `DegenerateView` without parallax, or where the pairs lie too close together.
    pub fn covariance(&self, pairs: &[BearingPair]) -> Result<Matrix5<f64>, Error> {
        let s2 = self.noise_factor();
        let (mut h, mut noise, mut parallax) = (Matrix5::zeros(), Matrix5::zeros(), 0.0);
        for row in self.used.iter().filter_map(|i| EpipolarRow::new(&self.at, &pairs[*i])) {
            h += row.by_step * row.by_step.transpose();
            parallax += row.parallax / (s2 * self.used.len() as f64);
            let mut of_row = noise.fixed_view_mut::<2, 2>(3, 3);
            of_row += row.noise * s2;
        }
        let signal: Matrix5<f64> = h - noise;
        let root = h.cholesky().ok_or_else(|| no_parallax(0.0))?;
        let inverse_root = root.l().try_inverse().ok_or_else(|| no_parallax(0.0))?;
        let share = (inverse_root * signal * inverse_root.transpose()).symmetric_eigenvalues().min();
        if !(LEAST_PARALLAX <= share && LEAST_PARALLAX_SQUARE <= parallax) {
            return Err(no_parallax(share));
        }
        let curvature = signal.cholesky().ok_or_else(|| no_parallax(share))?.inverse();
        let widened = s2 * self.freedom() / (self.freedom() - 2.0).max(1.0);
        let covariance = curvature * h * curvature * widened;
        let worst = covariance.fixed_view::<2, 2>(3, 3).symmetric_eigenvalues().max().sqrt();
        match worst < MAX_DIRECTION_SIGMA_RAD && covariance.sum().is_finite() {
            true => Ok((covariance + covariance.transpose()) * 0.5),
            false => Err(no_parallax(share)),
        }
    }
}

fn equations(pairs: &[BearingPair], used: &[usize], at: &RelativePose) -> Option<DenseEquations> {
    let mut equations = DenseEquations::new(5);
    for row in used.iter().filter_map(|i| EpipolarRow::new(at, &pairs[*i])) {
        let entries: [(usize, f64); 5] = core::array::from_fn(|k| (k, row.by_step[k]));
        equations.add(-row.residual, &entries);
    }
    Some(equations)
}

/// Those within the threshold and within the gate of the robust scatter, away from the epipole and in front of both cameras.
fn agreeing(pairs: &[BearingPair], at: &RelativePose, config: &TwoViewConfig) -> Vec<usize> {
    let e = at.essential();
    let limit = config.threshold_sigmas.powi(2);
    let usable = |(i, pair): (usize, &BearingPair)| {
        let square = squared_residual(&e, pair);
        (square <= limit && is_usable(pair, at, &e)).then_some((i, square))
    };
    let near: Vec<(usize, f64)> = pairs.iter().enumerate().filter_map(usable).collect();
    let mut squares: Vec<f64> = near.iter().map(|(_, square)| *square).collect();
    squares.sort_unstable_by(f64::total_cmp);
    let Some(median) = squares.get(squares.len() / 2) else { return Vec::new() };
    let gate = GATE * GATE * (median / MEDIAN_OF_ONE).max(LEAST_NOISE_FACTOR);
    near.into_iter().filter(|(_, square)| *square <= gate).map(|(i, _)| i).collect()
}

fn is_usable(pair: &BearingPair, at: &RelativePose, e: &Matrix3<f64>) -> bool {
    let sigma = pair.sigma_first_rad.hypot(pair.sigma_second_rad);
    let is_away = NEAR_EPIPOLE * sigma < (e * pair.first.into_inner()).norm();
    is_away && !is_behind(pair, at)
}

/// Standard deviations of a parallax that puts a point behind a camera, beyond which it is no distant point.
const BEHIND: f64 = 3.0;

/// Whether the rays meet behind a camera, by more than the noise of a distant point explains.
pub(super) fn is_behind(pair: &BearingPair, at: &RelativePose) -> bool {
    let (y, b) = (at.r * pair.first.into_inner(), pair.second.into_inner());
    let sigma = pair.sigma_first_rad.hypot(pair.sigma_second_rad);
    let is_parallel = y.cross(&b).norm() < BEHIND * sigma && 0.0 < y.dot(&b);
    let [first, second] = at.scaled_depths(pair);
    !is_parallel && (first <= 0.0 || second <= 0.0)
}

fn no_parallax(metric: f64) -> Error {
    let reason = "the pairs do not determine a direction of translation: the camera only rotated or stood still, or the points that agree lie too \
                  close together; use views farther apart";
    Error::DegenerateView { reason, metric, needed: LEAST_PARALLAX }
}
