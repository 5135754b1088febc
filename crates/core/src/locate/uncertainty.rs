//! The full covariances of the minima found, and the part of their residuals that uncertain intrinsics and scales explain.

use crate::budget::{Budget, ErrorSource, excess};
use crate::least_squares::ALTERNATIVE_MARGIN_CHI2;
use crate::locate::choose::{Hypothesis, Minima, Minimum, Others, insert, is_within_gate, sort};
use crate::locate::common::{Common, Dependence};
use crate::locate::curvature::{self, Bends, along_the_ridge, range_share};
use crate::locate::parts::of_observations;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, refine_against, residual_sums};
use crate::locate::shared_error::SharedError;
use crate::pose::symmetric;
use crate::{Error, Matrix6, Pose};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Subtracts from each χ² the part that uncertain intrinsics and scales explain, and sorts the minima again.
pub(crate) fn allow_for_common(minima: &mut Minima, problem: &Problem, common: &Common) -> Result<(), Error> {
    if common.is_exact() {
        return Ok(());
    }
    let found = core::mem::take(minima);
    let lowest = found.first().map_or(0.0, |m| m.chi2);
    for m in &found {
        // Farther off the search ends early, for by the pixels' sigmas alone it cannot come near; here it may.
        let is_exact = m.chi2 - lowest < ALTERNATIVE_MARGIN_CHI2;
        let end = if is_exact { Ok(*m) } else { refine_against(&m.cam_from_target, None, problem) };
        insert(minima, end.unwrap_or(*m));
    }
    for m in minima.iter_mut() {
        let (explained, log_determinant) = Dependence::at(m, problem, common)?.explained(&m.covariance);
        m.chi2 -= explained.min(m.chi2);
        m.log_determinant += log_determinant;
    }
    sort(minima);
    Ok(())
}

/// Largest standard deviation of a rotation, radians, that a covariance of small motions still describes.
const MAX_ROTATION_SIGMA_RAD: f64 = 1.0;
/// Distance from the camera in standard deviations of a point, nearer than which its spread in the image is not even roughly that of
/// the first order.
const MIN_DISTANCE_SIGMAS: f64 = 5.0;

/// Refuses a single pose that its covariance does not describe.
///
/// # Errors
/// `DegenerateView` where the rotation is uncertain by a radian, or a point is nearer to the camera than five of its standard deviations.
pub(crate) fn check_known(
    cam_from_target: &Pose,
    covariance: &Matrix6,
    problem: &Problem,
) -> Result<(), Error> {
    let metric = (0..3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt();
    if MAX_ROTATION_SIGMA_RAD < metric {
        let reason = "the standard deviation of the rotation is more than a radian; add points away from the others or move closer";
        return Err(Error::DegenerateView { reason, metric, needed: MAX_ROTATION_SIGMA_RAD });
    }
    for c in problem.seen.iter().filter(|c| c.sigma_m != 0.0) {
        let metric = (*cam_from_target * c.x_in_target).norm() / c.sigma_m;
        if metric < MIN_DISTANCE_SIGMAS {
            let reason = "a point is nearer to the camera than five of its own standard deviations; survey it better or move away";
            return Err(Error::DegenerateView { reason, metric, needed: MIN_DISTANCE_SIGMAS });
        }
    }
    Ok(())
}

/// Causes that widen the covariance of a minimum beyond the share of the pixels.
pub(crate) struct Doubts<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) common: Common<'a>,
    pub(crate) noise_scale: f64,
    /// The lowest of the minima, which need not be the first.
    pub(crate) lowest: Minimum,
    /// Whether errors that all points share are looked for.
    pub(crate) shared_errors: bool,
    /// The gate of exact points.
    pub(crate) gate: f64,
}

/// The full covariance.
pub(crate) struct Whole {
    pub(crate) covariance: Matrix6,
    /// What the points share along one axis of the image, root mean square, pixels; 0 where nothing shows.
    pub(crate) shared_error_px: f64,
}

impl Doubts<'_> {
    /// Returns the full covariance of a minimum, testing first whether its likelihood is bent where that is not known.
    pub(crate) fn covariance(&self, m: &Minimum, is_bent: Option<bool>) -> Result<Whole, Error> {
        let (m, [near, covariance]) = self.along_the_ridge(m, is_bent);
        let share = match self.common.is_exact() {
            true => Matrix6::zeros(),
            false => Dependence::at(&m, self.problem, &self.common)?.share(&near),
        };
        let independent = symmetric(&((covariance + share) * self.noise_scale));
        Ok(match self.shared(&m) {
            Some(shared) => Whole {
                covariance: independent + shared.excess(&independent, &covariance, &share),
                shared_error_px: shared.amplitude_px,
            },
            None => Whole { covariance: independent, shared_error_px: 0.0 },
        })
    }

    /// Returns the parts of the full covariance of a minimum.
    pub(crate) fn budget(&self, m: &Minimum) -> Result<Budget, Error> {
        let mut budget = of_observations(m, self.problem)?;
        let (m, [near, covariance]) = self.along_the_ridge(m, None);
        budget
            .add(ErrorSource::Bend, &excess(&covariance, &m.covariance).unwrap_or(covariance - m.covariance));
        let [lens, scale] = match self.common.is_exact() {
            true => [Matrix6::zeros(); 2],
            false => Dependence::at(&m, self.problem, &self.common)?.shares(&near),
        };
        budget.add(ErrorSource::Lens, &lens);
        budget.add(ErrorSource::Target, &scale);
        let share = lens + scale;
        let stated = covariance + share;
        budget.add(ErrorSource::Residuals, &(stated * (self.noise_scale - 1.0)));
        if let Some(shared) = self.shared(&m) {
            let independent = symmetric(&(stated * self.noise_scale));
            budget.add(ErrorSource::SharedInView, &shared.excess(&independent, &covariance, &share));
        }
        Ok(budget)
    }

    /// Returns the minimum with the χ² of its pixels, and its covariance near it and as far as the ridge reaches.
    fn along_the_ridge(&self, m: &Minimum, is_bent: Option<bool>) -> (Minimum, [Matrix6; 2]) {
        // The bend is that of the pixels' χ², without what common parameters explain.
        let is_exact = self.common.is_exact();
        let chi2 = if is_exact { m.chi2 } else { residual_sums(&m.cam_from_target, self.problem).0 };
        let m = Minimum { chi2, ..*m };
        let cost = &self.problem.held_at(&m.cam_from_target);
        let is_bent = is_bent.unwrap_or_else(|| curvature::is_bent(&m, cost));
        // What the pose answers to a common parameter is that of the neighbourhood, not of what the ridge reaches.
        let straight = || [m.covariance, m.covariance + range_share(&m, &centroid(self.problem.seen))];
        let covariances = if is_bent { along_the_ridge(&m, cost) } else { straight() };
        (m, covariances)
    }

    fn shared(&self, m: &Minimum) -> Option<SharedError> {
        self.shared_errors.then(|| SharedError::at(m, self.problem)).flatten()
    }

    /// Returns the minima after the first; those within the gate have their full covariance.
    pub(crate) fn others(&self, minima: &Minima, weights: &[f64], bends: &Bends) -> Result<Others, Error> {
        let mut others = Others::default();
        let Some((_, rest)) = minima.split_first() else { return Ok(others) };
        let known = weights[1..].iter().zip(&bends[1..]);
        for (i, ((place, m), (probability, is_bent))) in others.iter_mut().zip(rest).zip(known).enumerate() {
            let delta_chi2 = m.cost_above(&self.lowest, self.noise_scale);
            let is_alternative = is_within_gate(m, &self.lowest, self.noise_scale, self.gate);
            let covariance = if is_alternative {
                self.covariance(m, *is_bent)?.covariance
            } else {
                m.covariance * self.noise_scale
            };
            let minimum = Minimum { covariance, ..*m };
            let numbers = covariance.sum() + m.chi2 + m.rms_px + delta_chi2 + probability;
            // A pose of which nothing is known is no alternative; the next to the answer decides whether that is the only one.
            let is_needed = is_alternative && i == 0;
            if !is_needed && !numbers.is_finite() {
                continue;
            }
            *place = Some(Hypothesis { minimum, delta_chi2, probability: *probability, is_alternative });
        }
        Ok(others)
    }
}
