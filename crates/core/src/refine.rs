//! One pose: reprojection residual, Jacobian, covariance. Maximum likelihood for independent Gaussian pixel errors.
//!
//! The residuals and their derivatives are summed in `accumulate`, the steps taken in `least_squares`.
//! Derivation: docs/math/refine.md eqs. (1)–(3).

pub(crate) use crate::accumulate::{
    information, normal_equations, residual_sums, whitened_residual, whitening,
};
use crate::choose::Minimum;
use crate::least_squares::{PivotedPose, minimize};
use crate::loss::Loss;
use crate::problem::Problem;
use crate::sandwich::sandwich;
use crate::{Camera, Correspondence, Error, Point, Pose};
use nalgebra::Vector2;

/// The points leave a direction free, to rounding.
pub(crate) const UNDETERMINED: Error = Error::DegenerateView {
    reason: "these points leave a direction of the pose undetermined; add points away from the others",
    metric: 0.0,
    needed: f64::MIN_POSITIVE,
};

/// Refines `start` to the nearest minimum of the reprojection error, with its covariance; no priors, squared loss.
///
/// `Error::NotConverged` when no minimum is reached, `Error::NoSolution` when the start has points outside the camera's
/// field, `Error::DegenerateView` when the points do not determine the pose to first order.
pub fn refine(start: &Pose, seen: &[Correspondence], camera: &Camera) -> Result<Minimum, Error> {
    refine_against(start, None, &Problem::new(seen, camera))
}

/// Refines `start` to the nearest minimum of a problem's whole cost: points under their loss, and priors. With a loss other than the
/// square the covariance is the sandwich of docs/math/refine.md eqs. (20)–(22).
///
/// # Errors
/// Those of [`refine`].
pub fn refine_problem(start: &Pose, problem: &Problem) -> Result<Minimum, Error> {
    refine_against(start, None, problem)
}

/// As `refine_problem`, for a minimum that will be compared with a rival of known χ²: it may end early
/// where it stays far above the rival.
pub(crate) fn refine_against(
    start: &Pose,
    rival_chi2: Option<f64>,
    problem: &Problem,
) -> Result<Minimum, Error> {
    let pivot = centroid(problem.seen);
    let start = eased_in(PivotedPose::new(start, &pivot), &pivot, problem);
    let solution = minimize(start, rival_chi2, |place| normal_equations(place, &pivot, problem))
        .ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
    if !solution.converged {
        return Err(Error::NotConverged { steps: solution.steps });
    }
    let covariance = match problem.loss {
        Loss::Squared => solution.normal.covariance_at_camera(&solution.place.pivot_in_cam),
        _ => sandwich(&solution.place, &pivot, &solution.normal, problem),
    }
    .ok_or(UNDETERMINED)?;
    let cam_from_target = solution.place.pose(&pivot);
    let (chi2, rms_px) = residual_sums(&cam_from_target, problem);
    Ok(Minimum { cam_from_target, covariance, chi2, rms_px })
}

/// A truncated loss sees nothing from a start farther off than its threshold: Cauchy's of the same size leads it there.
fn eased_in(start: PivotedPose, pivot: &Point, problem: &Problem) -> PivotedPose {
    let Loss::Truncated { sigmas } = problem.loss else { return start };
    let smooth = Problem { loss: Loss::Cauchy { sigmas }, ..*problem };
    minimize(start, None, |place| normal_equations(place, pivot, &smooth)).map_or(start, |s| s.place)
}

/// Residual of one correspondence, observed − predicted, px; none outside the camera's field.
pub fn residual_px(cam_from_target: &Pose, c: &Correspondence, camera: &Camera) -> Option<Vector2<f64>> {
    Some(c.pixel - camera.project(&(cam_from_target * &c.x_in_target))?)
}

/// The mean of the target points: the pivot of the refinement.
pub(crate) fn centroid(seen: &[Correspondence]) -> Point {
    seen.iter().map(|c| c.x_in_target).sum::<Point>() / seen.len().max(1) as f64
}
