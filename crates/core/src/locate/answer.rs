//! The last line of `locate`: which minimum is the pose, how uncertain, and whether it agrees with the stated noise.

use super::PoseEstimate;
use super::choose::{Ambiguity, Choice, Others, choose as of_minima};
use super::classify::{Allowed, View};
use super::consistency::{Consistency, consistency, noise_of};
use super::method::Method;
use super::minima::Found;
use super::multi_start::weakness_of_alternatives;
use super::posterior::{lead_with_the_most_probable, merge, weights};
use super::refine::OVERFLOW;
use super::uncertainty::{Doubts, Whole, allow_for_common, check_known};
use crate::Error;

/// Returns the most probable of the minima, and whether a second solution stands beside it.
pub(crate) fn choose(view: &View, mut found: Found) -> Result<PoseEstimate, Error> {
    conclude(view, &mut found)
}

/// The answer that the minima found amount to.
pub(crate) fn conclude(view: &View, found: &mut Found) -> Result<PoseEstimate, Error> {
    let View { problem, geometry, method, allowed: Allowed { common, shared_errors } } = *view;
    let Found { minima, weakness, bends, refusal } = found;
    if let Some(refusal) = refusal.take() {
        return Err(refusal);
    }
    let problem = &problem;
    allow_for_common(minima, problem, &common)?;
    let degrees_of_freedom = problem.degrees_of_freedom();
    let noise_scale = minima.first().map_or(1.0, |m| noise_of(m, problem));
    merge(minima, bends, noise_scale);
    let lowest = *minima.first().ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
    let mut weights = weights(minima, noise_scale);
    let gate = view.gate_chi2();
    lead_with_the_most_probable(minima, &mut weights, bends, noise_scale, gate);
    let choice = of_minima(minima, problem.seen.len(), noise_scale, gate)?;
    let doubts = Doubts { problem, common, noise_scale, lowest, shared_errors, gate };
    let others = doubts.others(minima, &weights, bends)?;
    let best = choice.best;
    let Whole { covariance, shared_error_px } = doubts.covariance(best, bends[0])?;
    let ambiguity = ambiguity(&choice, &others);
    let consistency = consistency(&lowest, problem); // Where the best fit contradicts the sigmas, every pose does.
    let is_finite = best.is_finite_with(&covariance) && ambiguity.is_finite() && consistency.is_finite();
    if !is_finite {
        return Err(OVERFLOW);
    }
    let is_ok = matches!(ambiguity, Ambiguity::Unique { .. }) && consistency == Consistency::Consistent;
    if is_ok && method != Method::Wang2004 {
        check_known(&best.cam_from_target, &covariance, problem)?;
    }
    // Made where it is returned: it is 2 kB.
    Ok(PoseEstimate {
        cam_from_target: best.cam_from_target,
        covariance,
        rms_px: best.rms_px,
        chi2: best.chi2,
        shared_error_px,
        log_determinant: best.log_determinant,
        delta_chi2: best.cost_above(&lowest, noise_scale),
        degrees_of_freedom,
        n_points: problem.seen.len(),
        method,
        ambiguity,
        probability: weights.first().copied().unwrap_or(1.0),
        others,
        consistency,
        weakness: weakness.or_else(|| weakness_of_alternatives(&view.configuration(), &choice, problem)),
        geometry,
    })
}

fn ambiguity(choice: &Choice, others: &Others) -> Ambiguity {
    match (choice.alternative, choice.ratio, &others[0]) {
        (Some(_), Some(ratio), Some(other)) => Ambiguity::Ambiguous { ratio, other: other.minimum },
        (_, ratio, _) => Ambiguity::Unique { ratio },
    }
}
