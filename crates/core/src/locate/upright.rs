//! `Method::Upright`: starts from two points and the vertical, then the cost of all points and priors.
//!
//! The vertical comes as `Prior::Gravity` (or the normal of a `Prior::Plane`), is taken as exact for the start and weighs by its sigma in the
//! refinement. Two points are enough: four pixels and two angles are six numbers.

use crate::locate::choose::{Minima, Minimum};
use crate::locate::prior::Prior;
use crate::locate::prior_start::determined;
use crate::locate::problem::Problem;
use crate::solve::upright_p2p::upright_p2p;
use crate::{Correspondence, Error, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Pairs of points that give starts.
const MAX_PAIRS: usize = 3;
/// More points than this are not all paired for a start; all take part in the refinement.
const MAX_PAIRED: usize = 16;

/// A direction known in both frames: target, camera.
type Vertical = [Unit<Vector3<f64>>; 2];

/// Returns the two-point poses of a few wide pairs.
pub(crate) struct Upright {
    starts: ArrayVec<Pose, { 4 * MAX_PAIRS }>,
    vertical: Vertical,
}

/// The poses from two points and the vertical.
///
/// # Errors
/// `WrongLayout` without a direction known in both frames; `TooFewPoints`; those of `upright_p2p` for the last pair tried where no
/// pair gives a pose.
pub(crate) fn upright(problem: &Problem) -> Result<Upright, Error> {
    let vertical = vertical(problem.priors).ok_or(NO_VERTICAL)?;
    if problem.seen.len() < 2 {
        return Err(Error::TooFewPoints { seen: problem.seen.len(), needed: 2 });
    }
    let mut refusal = Error::NoSolution { n_points: problem.seen.len() };
    let mut all = ArrayVec::new();
    for pair in wide_pairs(problem, &vertical[0]) {
        match starts(problem, pair, &vertical) {
            Ok(starts) => all.extend(starts),
            Err(refused) => refusal = refused,
        }
    }
    if all.is_empty() { Err(refusal) } else { Ok(Upright { starts: all, vertical }) }
}

impl Upright {
    /// Adds all minima reached.
    ///
    /// # Errors
    /// `DegenerateView` where points and priors leave a direction free, or two points determine too little.
    pub(crate) fn refine(&self, problem: &Problem, minima: &mut Minima) -> Result<(), Error> {
        let mut refusal = Error::NoSolution { n_points: problem.seen.len() };
        for start in &self.starts {
            if let Err(refused @ Error::DegenerateView { .. }) = determined(start, problem, minima) {
                refusal = refused;
            }
        }
        match (minima.is_empty(), problem.seen) {
            (true, _) => Err(refusal),
            (false, [a, b]) => minima.iter().try_for_each(|m| check_rotation([a, b], m, &self.vertical)),
            (false, _) => Ok(()),
        }
    }
}

/// Refuses two points near their double root or level with the camera, where no covariance describes the answer.
/// docs/math/upright_p2p.md eqs. (7), (8).
fn check_rotation(
    [a, b]: [&Correspondence; 2],
    minimum: &Minimum,
    [_, down_in_cam]: &Vertical,
) -> Result<(), Error> {
    let w = down_in_cam.into_inner();
    let chord = minimum.cam_from_target.rotation * (b.x_in_target - a.x_in_target);
    let level = chord - w * w.dot(&chord);
    let m = a.bearing.cross(&b.bearing).cross(&w).normalize();
    let variance = |from: usize, axis: &Vector3<f64>| {
        axis.dot(&(minimum.covariance.fixed_view::<3, 3>(from, from) * axis))
    };
    let metric = level.dot(&m).abs() / (level.norm() * variance(0, &w).sqrt());
    if !(MIN_TURN_SIGMA <= metric) {
        let reason = "the two turns about the vertical that fit nearly coincide, so that neither is well known; add a point or move";
        return Err(Error::DegenerateView { reason, metric, needed: MIN_TURN_SIGMA });
    }
    let nearest = [a, b].map(|c| (minimum.cam_from_target * c.x_in_target).norm());
    let metric = nearest[0].min(nearest[1]) / minimum.covariance.fixed_view::<3, 3>(3, 3).trace().sqrt();
    if !(MIN_DISTANCE_SIGMA <= metric) {
        let reason = "two points and the vertical leave the place open to a fifth of the distance; add a point or move";
        return Err(Error::DegenerateView { reason, metric, needed: MIN_DISTANCE_SIGMA });
    }
    Ok(())
}

/// Half the angle between the two rotations, in standard deviations of the rotation.
const MIN_TURN_SIGMA: f64 = 5.0;
/// Distance of the nearer point, in standard deviations of the place.
const MIN_DISTANCE_SIGMA: f64 = 5.0;

const NO_VERTICAL: Error = Error::WrongLayout {
    method: "upright",
    reason: "it needs the direction of gravity in the camera and in the target (a gravity prior)",
};

/// The direction known best.
fn vertical(priors: &[Prior]) -> Option<Vertical> {
    let known = |prior: &Prior| match prior {
        Prior::Gravity { down_in_target, down_in_cam, sigma_rad } => {
            Some((*sigma_rad, *down_in_target, *down_in_cam))
        }
        Prior::Plane { normal_in_target, normal_in_cam, sigma_rad, .. } => {
            Some((*sigma_rad, *normal_in_target, *normal_in_cam))
        }
        _ => None,
    };
    let best = priors.iter().filter_map(known).min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, in_target, in_cam)| [in_target, in_cam].map(Unit::new_normalize))
}

fn starts(problem: &Problem, [i, j]: [usize; 2], vertical: &Vertical) -> Result<ArrayVec<Pose, 4>, Error> {
    let (a, b) = (&problem.seen[i], &problem.seen[j]);
    // The solver speaks of its own two points; the caller knows them by other numbers.
    let renamed = |reason| match reason {
        Error::Coincident { where_, .. } => Error::Coincident { first: i, second: j, where_ },
        other => other,
    };
    let [in_target, in_cam] = vertical;
    upright_p2p(&[a.bearing, b.bearing], &[a.x_in_target, b.x_in_target], in_target, in_cam).map_err(renamed)
}

/// Returns the pairs that determine the rotation about the vertical best, those far apart across it.
fn wide_pairs(problem: &Problem, vertical: &Unit<Vector3<f64>>) -> ArrayVec<[usize; 2], MAX_PAIRS> {
    let n = problem.seen.len();
    let stride = n.div_ceil(MAX_PAIRED);
    let level = |i: usize, j: usize| {
        let chord = problem.seen[j].x_in_target - problem.seen[i].x_in_target;
        chord.cross(vertical).norm_squared()
    };
    let mut best = ArrayVec::<(f64, [usize; 2]), MAX_PAIRS>::new();
    let firsts = (0..n).step_by(stride);
    for [i, j] in firsts.flat_map(|i| (i + 1..n).step_by(stride).map(move |j| [i, j])) {
        let score = level(i, j);
        let place = best.iter().position(|(other, _)| *other < score).unwrap_or(best.len());
        if place < MAX_PAIRS {
            best.truncate(MAX_PAIRS - 1);
            best.insert(place, (score, [i, j]));
        }
    }
    best.into_iter().map(|(_, pair)| pair).collect()
}
