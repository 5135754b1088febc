//! Checks before anything is solved: whether the numbers describe a rig, and whether its points determine a pose.

use super::RigView;
use super::cost::RigCost;
use super::starts::Extents;
use super::uncertain_lens;
use crate::covariance::is_covariance;
use crate::solve::configuration::{MIN_WIDTH, check_numbers};
use crate::{Error, Matrix6};
use nalgebra::Matrix3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Largest entry of RᵀR − 1 accepted: a matrix written with six digits.
const MAX_ROTATION_DEFECT: f64 = 1e-5;

/// Checks every number of every camera.
pub(crate) fn check_views(views: &[RigView]) -> Result<(), Error> {
    if views.is_empty() {
        return Err(Error::EmptyRig);
    }
    for (camera, view) in views.iter().enumerate() {
        let invalid = |what, seen, needed| Err(Error::InvalidRig { camera, what, seen, needed });
        let place = &view.cam_from_rig;
        if let Some(&seen) = place.rotation.iter().chain(&place.translation).find(|x| !x.is_finite()) {
            return invalid("an entry of cam_from_rig", seen, "it must be a finite number");
        }
        let defect = (place.rotation.transpose() * place.rotation - Matrix3::identity()).amax();
        if MAX_ROTATION_DEFECT < defect {
            let what = "the largest entry of RᵀR − 1 of cam_from_rig";
            return invalid(what, defect, "it must be below 1e-5: give a rotation matrix");
        }
        let determinant = place.rotation.determinant();
        if determinant < 0.0 {
            let needed =
                "it must be 1: a mirrored frame is no rotation; check the order and signs of the axes";
            return invalid("the determinant of cam_from_rig", determinant, needed);
        }
        if let Some(covariance) = &view.cam_from_rig_covariance {
            check_covariance(camera, covariance)?;
        }
        uncertain_lens::check(view)?;
        check_numbers(view.seen).map_err(|error| in_camera(camera, error))?;
    }
    Ok(())
}

fn check_covariance(camera: usize, covariance: &Matrix6) -> Result<(), Error> {
    let what = "an entry of cam_from_rig_covariance";
    let invalid = |seen, needed| Err(Error::InvalidRig { camera, what, seen, needed });
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return invalid(seen, "it must be a finite number");
    }
    if let Some(&seen) = covariance.diagonal().iter().find(|x| **x < 0.0) {
        return invalid(seen, "no variance can be negative");
    }
    // A correlation above 1 belongs to no covariance.
    for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let (entry, mirrored) = (covariance[(i, j)], covariance[(j, i)]);
        let most = (covariance[(i, i)] * covariance[(j, j)]).sqrt() * (1.0 + 1e-9);
        if most < entry.abs() || 1e-9 * most < (entry - mirrored).abs() {
            return invalid(entry, "the matrix must be symmetric, without correlations above 1");
        }
    }
    if !is_covariance(covariance) {
        let least = covariance.symmetric_eigenvalues().min();
        return invalid(
            least,
            "no combination of its entries may have a negative variance (least eigenvalue)",
        );
    }
    Ok(())
}

/// Adds the camera's name to an error.
fn in_camera(camera: usize, error: Error) -> Error {
    match error {
        Error::NotFinite { what, index: point } => {
            Error::InvalidRigPoint { camera, point, what, needed: "must be a finite number" }
        }
        Error::NotPositive { index: point, .. } => {
            Error::InvalidRigPoint { camera, point, what: "sigma", needed: "must be positive" }
        }
        other => other,
    }
}

/// Checks that there are enough points, and that they are not on a line, about which the rig could rotate without any visible change.
pub(crate) fn check_points(cost: &RigCost) -> Result<Extents, Error> {
    let (seen, needed) = (cost.n_points(), 3);
    if seen < needed {
        return Err(Error::TooFewPoints { seen, needed });
    }
    let coordinates = cost.points().map(|(_, c)| c.x_in_target.amax()).fold(0.0, f64::max);
    let extents = Extents::new(cost).ok_or(Error::TooFewPoints { seen, needed })?;
    let least = MIN_WIDTH.max(8.0 * f64::EPSILON * coordinates / extents.length);
    if !(least * extents.length < extents.width) {
        let ratio = if 0.0 < extents.length { extents.width / extents.length } else { 0.0 };
        return Err(Error::Collinear { ratio, needed: least });
    }
    Ok(extents)
}
