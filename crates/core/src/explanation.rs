//! Explanations of what was observed, weighed against each other, and the rule by which one of them matters to the answer.
//!
//! A verdict is about the answer: an explanation other than the input as stated makes it inconsistent where it moves a pose by more than the stated
//! covariance, or than the user tolerates instead. Derivation: docs/math/explanations.md.

use crate::{Error, Matrix6, Vector6};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SMatrix, SVector};

/// An explanation of the observations, weighed against the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighed<K> {
    /// What is supposed.
    pub what: K,
    /// Natural logarithm of its odds against the input as stated.
    pub log_odds: f64,
    /// Its probability among all that were tried.
    pub probability: f64,
    /// By how much each pose of the answer moves under it, `[rotation_rad; translation_m]`: zero for the input as stated.
    pub motions: Vec<Vector6>,
}

impl<K> Weighed<K> {
    /// An explanation that is not yet weighed against others.
    pub(crate) fn new(what: K, log_odds: f64, motions: Vec<Vector6>) -> Self {
        Weighed { what, log_odds, probability: 0.0, motions }
    }

    /// Returns whether it is worth listing.
    pub fn is_probable(&self) -> bool {
        LEAST_PROBABILITY < self.probability
    }

    /// Weighs explanations against each other, the most probable first.
    pub(crate) fn weigh(all: &mut [Self]) {
        let log_odds: Vec<f64> = all.iter().map(|one| one.log_odds).collect();
        for (one, probability) in all.iter_mut().zip(probabilities(&log_odds)) {
            one.probability = probability;
        }
        all.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    }
}

/// The differences between two answers that do not matter to their user.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerance {
    /// Largest rotation that does not matter, rad; none: what the stated covariance allows.
    pub rotation_rad: Option<f64>,
    /// Largest translation that does not matter, m; none: what the stated covariance allows.
    pub translation_m: Option<f64>,
}

/// The 99 % quantiles of χ² with three and with six degrees of freedom: a smaller motion is within the stated covariance.
const WITHIN_CHI2: [f64; 2] = [11.34, 16.81];
/// Explanations that are less probable are not listed.
const LEAST_PROBABILITY: f64 = 0.1;

impl Tolerance {
    /// Returns whether the user states one.
    pub fn is_stated(&self) -> bool {
        self.rotation_rad.is_some() || self.translation_m.is_some()
    }

    /// Returns whether a motion matters: whether it is beyond the tolerance or, where none is stated, beyond the covariance. eqs. (5), (6).
    pub fn is_exceeded(&self, motion: &Vector6, covariance: &Matrix6) -> bool {
        let [three, six] = WITHIN_CHI2;
        if !self.is_stated() {
            return is_beyond(motion, covariance, six);
        }
        let part = |at: usize, most: Option<f64>| {
            let own = motion.fixed_rows::<3>(at).into_owned();
            match most {
                Some(most) => most < own.norm(),
                None => is_beyond(&own, &covariance.fixed_view::<3, 3>(at, at).into_owned(), three),
            }
        };
        part(0, self.rotation_rad) || part(3, self.translation_m)
    }

    /// Refuses what is no tolerance.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let named =
            [("tolerance of rotation", self.rotation_rad), ("tolerance of translation", self.translation_m)];
        for (setting, most) in named {
            if let Some(seen) = most.filter(|most| !(0.0 <= *most && most.is_finite())) {
                return Err(Error::InvalidSetting {
                    setting,
                    seen,
                    needed: "it must be 0 or more, and finite",
                });
            }
        }
        Ok(())
    }
}

fn is_beyond<const N: usize>(
    motion: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
    within_chi2: f64,
) -> bool {
    motion.norm_squared() != 0.0
        && covariance.cholesky().is_none_or(|c| within_chi2 < motion.dot(&c.solve(motion)))
}

/// Returns the probability of each explanation from the logarithms of its odds, eq. (1).
pub(crate) fn probabilities(log_odds: &[f64]) -> Vec<f64> {
    let most = log_odds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let part = |log_odds: &f64| (log_odds - most).exp();
    let sum: f64 = log_odds.iter().map(part).sum();
    log_odds.iter().map(|one| part(one) / sum).collect()
}

/// An estimate of parameters that are zero as stated.
pub(crate) struct Estimate {
    pub(crate) value: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    /// Degrees of freedom of the covariance.
    pub(crate) degrees_of_freedom: f64,
}

impl Estimate {
    /// Returns the logarithm of how much more probable the estimate is where the parameters have this prior covariance, eqs. (2), (3), and what they are
    /// expected to be then.
    pub(crate) fn with_prior(&self, prior: &DMatrix<f64>) -> Option<(f64, DVector<f64>)> {
        let (n, nu) = (self.value.len() as f64, self.degrees_of_freedom);
        let without = self.covariance.clone().cholesky()?;
        let with = (&self.covariance + prior).cholesky()?;
        let log_density = |factor: &Cholesky<f64, Dyn>| {
            let half_log_determinant: f64 = factor.l_dirty().diagonal().map(f64::ln).sum();
            let chi2 = self.value.dot(&factor.solve(&self.value));
            -half_log_determinant - 0.5 * (nu + n) * (chi2 / nu).ln_1p()
        };
        let gain = log_density(&with) - log_density(&without);
        gain.is_finite().then(|| (gain, prior * with.solve(&self.value)))
    }
}
