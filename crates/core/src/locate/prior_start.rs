//! Starts that priors give, and poses that only points and priors together determine.
//!
//! A pose prior is a start as it stands. Fewer than three points, or points on one line, have no closed form of their own: a
//! direction known in both frames leaves one rotation, which is tried all around; the translation then follows from the rays by
//! linear least squares. Whether a pose is determined is read off the information matrix, docs/math/priors.md eqs. (10), (11).

use crate::least_squares::PivotedPose;
use crate::locate::choose::{Minima, insert};
use crate::locate::prior::Prior;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations, refine_against};
use crate::{Error, Matrix6, Pose};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Turns tried about a known direction: a Gauss–Newton step reaches a quarter turn, so the two poses of two points are found
/// from several of them.
const TURNS: usize = 12;
/// Least eigenvalue of the information matrix scaled to a unit diagonal: below it what looks determined is rounding (a sum of
/// squares is exact to 1e-16, and 1e-10 is that of a direction known 1e-5 as well as the others).
const MIN_INFORMATION: f64 = 1e-10;

/// Whether priors may stand in for points.
pub(crate) fn may_hold(problem: &Problem) -> bool {
    !problem.seen.is_empty() && !problem.priors.is_empty()
}

/// Minima reached from the pose priors.
pub(crate) fn start_from_priors(problem: &Problem, minima: &mut Minima) {
    for prior in problem.priors {
        if let Prior::Pose { cam_from_target, .. } = prior
            && let Ok(found) = refine_against(cam_from_target, minima.first().map(|m| m.chi2), problem)
        {
            insert(minima, found);
        }
    }
}

/// Adds all minima of points that have no pose of their own.
///
/// # Errors
/// `DegenerateView` where points and priors together leave a direction free.
pub(crate) fn hold(problem: &Problem, minima: &mut Minima) -> Result<(), Error> {
    if problem.rows() < 6 {
        return Err(Error::DegenerateView { reason: TOO_FEW, metric: problem.rows() as f64, needed: 6.0 });
    }
    let mut refusal = Error::NoSolution { n_points: problem.seen.len() };
    for prior in problem.priors {
        each_start(prior, problem, |start| {
            if let Err(refused @ Error::DegenerateView { .. }) = determined(&start, problem, minima) {
                refusal = refused;
            }
        });
    }
    if minima.is_empty() { Err(refusal) } else { Ok(()) }
}

const TOO_FEW: &str =
    "points and priors together give fewer numbers than the six of a pose; add a point or a prior";
const FREE: &str =
    "points and priors together leave a direction of the pose free; add a point or a prior that fixes it";

/// Refines a start and keeps the minimum where the information matrix there has full rank.
pub(crate) fn determined(start: &Pose, problem: &Problem, minima: &mut Minima) -> Result<(), Error> {
    let found = refine_against(start, None, problem);
    let at = found.as_ref().map_or(start, |m| &m.cam_from_target);
    let metric = least_information(at, problem);
    if metric < MIN_INFORMATION {
        return Err(Error::DegenerateView { reason: FREE, metric, needed: MIN_INFORMATION });
    }
    insert(minima, found?);
    Ok(())
}

/// Least eigenvalue of the information matrix about the pivot, its diagonal scaled to 1, eq. (11).
fn least_information(cam_from_target: &Pose, problem: &Problem) -> f64 {
    let pivot = centroid(problem.seen);
    let place = PivotedPose::new(cam_from_target, &pivot);
    let Some(normal) = normal_equations(&place, &pivot, problem) else { return f64::INFINITY };
    let information = normal.information();
    let scale = information.diagonal().map(|x| 1.0 / x.sqrt());
    let scaled = Matrix6::from_fn(|i, j| information[(i, j)] * scale[i] * scale[j]);
    if scaled.sum().is_finite() { scaled.symmetric_eigenvalues().min() } else { 0.0 }
}

/// The starts one prior gives.
fn each_start(prior: &Prior, problem: &Problem, mut take: impl FnMut(Pose)) {
    let (in_target, in_cam) = match prior {
        Prior::Pose { cam_from_target, .. } => return take(*cam_from_target),
        Prior::Gravity { down_in_target, down_in_cam, .. } => (down_in_target, down_in_cam),
        Prior::Plane { normal_in_target, normal_in_cam, .. } => (normal_in_target, normal_in_cam),
        Prior::Height { .. } => return,
    };
    let axis = Unit::new_normalize(*in_cam);
    let first = turn_to(in_target, in_cam);
    for k in 0..TURNS {
        let angle_rad = core::f64::consts::TAU * k as f64 / TURNS as f64;
        let rotation = Rotation3::from_axis_angle(&axis, angle_rad).into_inner() * first;
        if let Some(translation) = translation(&rotation, problem) {
            take(Pose::new(rotation, translation));
        }
    }
}

/// A rotation that takes one unit vector to another.
fn turn_to(from: &Vector3<f64>, to: &Vector3<f64>) -> Matrix3<f64> {
    let frame = |z: &Vector3<f64>| {
        let x = z.cross(&Vector3::ith(z.iamin(), 1.0)).normalize();
        Matrix3::from_columns(&[x, z.cross(&x), *z])
    };
    frame(to) * frame(from).transpose()
}

/// Pull towards a metre along the ray, beside which every ray and height is heavy: what they leave free has a start too.
const PULL: f64 = 1e-6;

/// The translation that brings the turned points nearest to their rays and the camera to its heights, eq. (10).
fn translation(rotation: &Matrix3<f64>, problem: &Problem) -> Option<Vector3<f64>> {
    let (mut across, mut shift) = (Matrix3::zeros(), Vector3::zeros());
    for c in problem.seen {
        let (b, x) = (c.bearing.into_inner(), rotation * c.x_in_target);
        let projector = Matrix3::identity() - b * b.transpose();
        across += projector + Matrix3::identity() * PULL;
        shift += (b - x) * PULL - projector * x;
    }
    for prior in problem.priors {
        if let Prior::Height { normal_in_target, offset_m, height_m, .. }
        | Prior::Plane { normal_in_target, offset_m, height_m, .. } = prior
        {
            let normal = rotation * normal_in_target;
            across += normal * normal.transpose();
            shift -= normal * (height_m + offset_m);
        }
    }
    let found = across.cholesky()?.solve(&shift);
    found.sum().is_finite().then_some(found)
}
