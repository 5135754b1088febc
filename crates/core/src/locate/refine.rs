//! One pose: reprojection residual, Jacobian, covariance. Maximum likelihood for independent Gaussian pixel errors.
//!
//! The residuals and their derivatives are summed in `accumulate`, the steps taken in `least_squares`.
//! Derivation: docs/math/refine.md eqs. (1)–(3).

use crate::least_squares::{Ending, PivotedPose, PoseMinimum, minimize_pose};
pub(crate) use crate::locate::accumulate::{
    accumulate_pinhole, centroid, held_jacobian, information, log_determinant, normal_equations,
    residual_sums, weighed_residual, whitened_residual, whitening,
};
use crate::locate::choose::Minimum;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
use crate::locate::reweight::minimize_reweighted;
use crate::locate::sandwich::sandwich;
use crate::{Camera, Correspondence, Error, Lens, Point, Pose};
use nalgebra::Vector2;

/// The points leave a direction free, to rounding.
pub(crate) const UNDETERMINED: Error = Error::DegenerateView {
    reason: "these points leave a direction of the pose undetermined; add points away from the others",
    metric: 0.0,
    needed: f64::MIN_POSITIVE,
};

/// Sigmas, coordinates or intrinsics so far apart that their squares leave the range of numbers.
pub(crate) const OVERFLOW: Error = Error::DegenerateView {
    reason: "coordinates, sigmas and camera differ by so many orders of magnitude that the answer overflows; check their units",
    metric: f64::INFINITY,
    needed: f64::MAX,
};

/// A minimum that holds no number, or a covariance that is none, is no answer.
fn checked(found: Minimum) -> Result<Minimum, Error> {
    if found.is_finite() { Ok(found) } else { Err(OVERFLOW) }
}

/// Refines `start` to the nearest minimum of the reprojection error, with its covariance; no priors, squared loss.
///
/// `Error::NotConverged` when no minimum is reached, `Error::NoSolution` when the start has points outside the camera's
/// field, `Error::DegenerateView` when the points do not determine the pose to first order, or numbers overflow.
pub fn refine(start: &Pose, seen: &[Correspondence], camera: &Camera) -> Result<Minimum, Error> {
    checked(refine_against(start, None, &Problem::new(seen, camera))?)
}

/// Refines `start` to the nearest minimum of a problem's whole cost: points under their loss, and priors. With a loss other than the
/// square the covariance is the sandwich of docs/math/refine.md eqs. (20)–(22).
///
/// # Errors
/// Those of [`refine`] and of [`Problem::check`].
pub fn refine_problem(start: &Pose, problem: &Problem) -> Result<Minimum, Error> {
    problem.check()?;
    checked(refine_against(start, None, problem)?)
}

/// As `refine_problem`, for a minimum that will be compared with a second solution of known χ²: it may end early
/// where it stays far above the second solution.
#[inline]
pub(crate) fn refine_against(
    start: &Pose,
    alternative_chi2: Option<f64>,
    problem: &Problem,
) -> Result<Minimum, Error> {
    refined(start, alternative_chi2, problem, false)
}

/// As `refine_against`; where no minimum is reached, the lowest place that was.
#[cold]
pub(crate) fn refine_to_the_end(
    start: &Pose,
    alternative_chi2: Option<f64>,
    problem: &Problem,
) -> Result<Minimum, Error> {
    checked(refined(start, alternative_chi2, problem, true)?)
}

fn refined(
    start: &Pose,
    alternative_chi2: Option<f64>,
    problem: &Problem,
    any_end: bool,
) -> Result<Minimum, Error> {
    let pivot = centroid(problem.seen);
    let start = PivotedPose::new(start, &pivot);
    let found = match &problem.camera.lens {
        _ if problem.has_uncertain_points() => &minimize_uncertain(start, &pivot, problem),
        Lens::Pinhole(model) if problem.is_points_alone() => {
            &minimize_pose(start, alternative_chi2, |place| {
                accumulate_pinhole(place, &pivot, problem.seen, model)
            })
        }
        _ => &minimize_any(start, alternative_chi2, &pivot, problem),
    };
    match found {
        Some(solution) if any_end || solution.is_minimum() => minimum_of(solution, &pivot, problem),
        Some(solution) => Err(Error::NotConverged { steps: solution.steps }),
        None => Err(Error::NoSolution { n_points: problem.seen.len() }),
    }
}

/// The minimum where the loop ended, with its covariance. By reference: a solution is 400 bytes, and the loop ends here often.
#[inline(always)]
fn minimum_of(solution: &PoseMinimum, pivot: &Point, problem: &Problem) -> Result<Minimum, Error> {
    let covariance = match problem.loss {
        Loss::Squared => solution.equations.covariance_at_camera(&solution.state.pivot_in_cam),
        _ => sandwich(&solution.state, pivot, &solution.equations, problem),
    };
    let covariance = covariance.ok_or(UNDETERMINED)?;
    let cam_from_target = solution.state.pose(pivot);
    let (chi2, rms_px) = residual_sums(&cam_from_target, problem);
    let log_determinant = log_determinant(&cam_from_target, problem);
    Ok(Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant })
}

/// A pose as a minimum, with its covariance there.
pub(crate) fn minimum_at(cam_from_target: &Pose, problem: &Problem) -> Result<Minimum, Error> {
    let pivot = centroid(problem.seen);
    let state = PivotedPose::new(cam_from_target, &pivot);
    let equations = normal_equations(&state, &pivot, &problem.held_at(cam_from_target))
        .ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
    minimum_of(&PoseMinimum { state, equations, steps: 0, ending: Ending::Converged }, &pivot, problem)
}

/// Any lens, priors and losses. Apart from the loop of the usual case, which then compiles as one piece and keeps the normal
/// equations in place.
#[inline(never)]
fn minimize_any(
    mut start: PivotedPose,
    alternative_chi2: Option<f64>,
    pivot: &Point,
    problem: &Problem,
) -> Option<PoseMinimum> {
    let descend = |start: PivotedPose, alternative_chi2: Option<f64>, problem: &Problem| {
        minimize_pose(start, alternative_chi2, |place| normal_equations(place, pivot, problem))
    };
    if let Loss::Truncated { sigmas } = problem.loss {
        // It sees nothing from a start farther off than its threshold: Cauchy's of the same size leads it there.
        start = descend(start, None, &Problem { loss: Loss::Cauchy { sigmas }, ..*problem })?.state;
    }
    // Every digit of a loss counts: its sandwich needs the minimum itself.
    descend(start, alternative_chi2.filter(|_| problem.loss == Loss::Squared), problem)
}

/// As `minimize_any`, where the weights of points depend on the pose.
#[inline(never)]
fn minimize_uncertain(mut start: PivotedPose, pivot: &Point, problem: &Problem) -> Option<PoseMinimum> {
    let descend = |start: PivotedPose, problem: &Problem| {
        minimize_reweighted(start, pivot, |place, at| normal_equations(place, pivot, &problem.held_at(at)))
    };
    if let Loss::Truncated { sigmas } = problem.loss {
        start = descend(start, &Problem { loss: Loss::Cauchy { sigmas }, ..*problem })?.state;
    }
    descend(start, problem)
}

/// Residual of one correspondence, observed − predicted, px; none outside the camera's field.
pub fn residual_px(cam_from_target: &Pose, c: &Correspondence, camera: &Camera) -> Option<Vector2<f64>> {
    Some(c.pixel - camera.project(&(cam_from_target * &c.x_in_target))?)
}
