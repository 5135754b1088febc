//! What is in doubt about the minima found: their covariances, whole, and what uncertain intrinsics explain of their residuals.

use crate::choose::{Hypothesis, Minima, Minimum, Others, insert, is_within_gate, sort};
use crate::curvature::{self, with_curvature};
use crate::intrinsics::Dependence;
use crate::least_squares::RIVAL_MARGIN_CHI2;
use crate::problem::Problem;
use crate::refine::{refine_against, residual_sums};
use crate::{Error, Matrix6};

/// From each χ² the part that uncertain intrinsics explain is taken, and the minima are put in order again.
pub(crate) fn allow_for_intrinsics(
    minima: &mut Minima,
    problem: &Problem,
    intrinsics: Option<&[f64]>,
) -> Result<(), Error> {
    let Some(given) = intrinsics else { return Ok(()) };
    let found = core::mem::take(minima);
    let lowest = found.first().map_or(0.0, |m| m.chi2);
    for m in &found {
        // Farther off the search ends early, for by the pixels' sigmas alone it cannot come near; here it may.
        let is_exact = m.chi2 - lowest < RIVAL_MARGIN_CHI2;
        let end = if is_exact { Ok(*m) } else { refine_against(&m.cam_from_target, None, problem) };
        insert(minima, end.unwrap_or(*m));
    }
    for m in minima.iter_mut() {
        m.chi2 -= Dependence::at(m, problem, given)?.explained_chi2(&m.covariance).min(m.chi2);
    }
    sort(minima);
    Ok(())
}

/// Whether the likelihood is bent at each of the first four minima; none where that is not known yet.
pub(crate) type Bends = [Option<bool>; 4];

/// What widens the covariance of a minimum beyond the pixels' share.
pub(crate) struct Doubts<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) intrinsics: Option<&'a [f64]>,
    pub(crate) noise_scale: f64,
}

impl Doubts<'_> {
    /// The covariance of a minimum, whole. Whether its likelihood is bent is found out where it is not known yet.
    pub(crate) fn covariance(&self, m: &Minimum, is_bent: Option<bool>) -> Result<Matrix6, Error> {
        let problem = self.problem;
        // The bend is that of the pixels' χ², without what intrinsics explain.
        let chi2 =
            if self.intrinsics.is_some() { residual_sums(&m.cam_from_target, problem).0 } else { m.chi2 };
        let m = &Minimum { chi2, ..*m };
        let is_bent = is_bent.unwrap_or_else(|| curvature::is_bent(m, problem));
        let covariance = if is_bent { with_curvature(m, problem) } else { m.covariance };
        let share = match self.intrinsics {
            Some(given) => Dependence::at(m, problem, given)?.share(&covariance),
            None => Matrix6::zeros(),
        };
        Ok((covariance + share) * self.noise_scale)
    }

    /// The minima after the first, those within the gate with their whole covariance.
    pub(crate) fn others(&self, minima: &Minima, weights: &[f64], bends: &Bends) -> Result<Others, Error> {
        let mut others = Others::default();
        let Some((best, rest)) = minima.split_first() else { return Ok(others) };
        let known = weights[1..].iter().zip(&bends[1..]);
        for ((place, m), (weight, is_bent)) in others.iter_mut().zip(rest).zip(known) {
            let delta_chi2 = m.chi2 - best.chi2;
            let is_rival = is_within_gate(delta_chi2, self.noise_scale);
            let covariance =
                if is_rival { self.covariance(m, *is_bent)? } else { m.covariance * self.noise_scale };
            let minimum = Minimum { covariance, ..*m };
            *place = Some(Hypothesis { minimum, delta_chi2, weight: *weight, is_rival });
        }
        Ok(others)
    }
}
