//! What is known about a pose besides points: explicit factors of its likelihood.
//!
//! Each prior is a few residuals, observed − predicted over its own standard deviations, that join the points' in one cost. So
//! χ², covariance, ambiguity and consistency speak of points and priors alike.

use crate::pose::{ROTATION_TOLERANCE, off_rotation};
use crate::{Error, Matrix6, Pose};
use nalgebra::Vector3;

/// Something measured or known about the pose of the camera, with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // A pose prior holds its covariance; a box would put a heap into the single-pose path.
pub enum Prior {
    /// The pose itself, as a last frame, a motion model or another sensor gives it.
    Pose {
        /// The pose expected.
        cam_from_target: Pose,
        /// Covariance of its small left motion `[rotation_rad; translation_m]`, camera frame; positive definite.
        covariance: Matrix6,
    },
    /// A direction known in both frames, most often down: an accelerometer at rest and a levelled target. Two residuals.
    Gravity {
        /// The direction in the target frame, a unit vector.
        down_in_target: Vector3<f64>,
        /// The direction measured in the camera frame, a unit vector.
        down_in_cam: Vector3<f64>,
        /// Standard deviation of the measured direction about each axis across it.
        sigma_rad: f64,
    },
    /// How far the camera centre is from a plane of the target frame. One residual.
    Height {
        /// The plane's unit normal n: points with n · x = `offset_m`.
        normal_in_target: Vector3<f64>,
        /// The plane's place along its normal.
        offset_m: f64,
        /// Signed distance of the camera centre from the plane, positive on the side the normal points to.
        height_m: f64,
        /// Standard deviation of `height_m`.
        sigma_m: f64,
    },
    /// A plane known in both frames, such as the road under a vehicle. Three residuals.
    Plane {
        /// The plane's unit normal n: points with n · x = `offset_m`.
        normal_in_target: Vector3<f64>,
        /// The plane's place along its normal.
        offset_m: f64,
        /// The same normal measured in the camera frame, a unit vector.
        normal_in_cam: Vector3<f64>,
        /// Signed distance of the camera centre from the plane, positive on the side the normal points to.
        height_m: f64,
        /// Standard deviation of the normal about each axis across it.
        sigma_rad: f64,
        /// Standard deviation of `height_m`.
        sigma_m: f64,
    },
}

/// A unit vector given in decimals is one to this; what is farther off was meant otherwise.
const UNIT_TOLERANCE: f64 = 1e-6;

impl Prior {
    /// How many residuals it adds.
    pub fn rows(&self) -> usize {
        match self {
            Prior::Pose { .. } => 6,
            Prior::Gravity { .. } => 2,
            Prior::Height { .. } => 1,
            Prior::Plane { .. } => 3,
        }
    }

    /// Whether the numbers can be what they are said to be; `index` names the prior in the error, counted from 0.
    ///
    /// # Errors
    /// `InvalidPrior` for a number that is not finite, a direction that is not a unit vector, a standard deviation that is not
    /// positive, a rotation that is none or a covariance that is not positive definite.
    pub fn check(&self, index: usize) -> Result<(), Error> {
        match self {
            Prior::Pose { cam_from_target, covariance } => check_pose(index, cam_from_target, covariance),
            Prior::Gravity { down_in_target, down_in_cam, sigma_rad } => {
                check_unit(index, "down_in_target", down_in_target)?;
                check_unit(index, "down_in_cam", down_in_cam)?;
                check_sigma(index, "sigma_rad", *sigma_rad)
            }
            Prior::Height { normal_in_target, offset_m, height_m, sigma_m } => {
                check_unit(index, "normal_in_target", normal_in_target)?;
                check_finite(index, "offset_m", *offset_m)?;
                check_finite(index, "height_m", *height_m)?;
                check_sigma(index, "sigma_m", *sigma_m)
            }
            Prior::Plane { normal_in_target, offset_m, normal_in_cam, height_m, sigma_rad, sigma_m } => {
                check_unit(index, "normal_in_target", normal_in_target)?;
                check_unit(index, "normal_in_cam", normal_in_cam)?;
                check_finite(index, "offset_m", *offset_m)?;
                check_finite(index, "height_m", *height_m)?;
                check_sigma(index, "sigma_rad", *sigma_rad)?;
                check_sigma(index, "sigma_m", *sigma_m)
            }
        }
    }
}

fn refuse(prior: usize, parameter: &'static str, seen: f64, needed: &'static str) -> Result<(), Error> {
    Err(Error::InvalidPrior { prior, parameter, seen, needed })
}

fn check_finite(index: usize, parameter: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() { Ok(()) } else { refuse(index, parameter, seen, "it must be finite") }
}

fn check_sigma(index: usize, parameter: &'static str, seen: f64) -> Result<(), Error> {
    // The variance and its inverse must be numbers too.
    let usable = 0.0 < seen && (seen * seen).is_normal() && (seen * seen).recip().is_normal();
    if usable {
        Ok(())
    } else {
        refuse(index, parameter, seen, "a standard deviation must be positive and finite")
    }
}

fn check_unit(index: usize, parameter: &'static str, direction: &Vector3<f64>) -> Result<(), Error> {
    let length = direction.norm();
    let is_unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
    if is_unit {
        Ok(())
    } else {
        refuse(index, parameter, length, "a direction must be a unit vector: divide it by its length")
    }
}

fn check_pose(index: usize, cam_from_target: &Pose, covariance: &Matrix6) -> Result<(), Error> {
    let (r, t) = (&cam_from_target.rotation, &cam_from_target.translation);
    check_finite(index, "cam_from_target", r.sum() + t.sum())?;
    let off = off_rotation(r);
    if !(off <= ROTATION_TOLERANCE) {
        return refuse(index, "cam_from_target", off, "R Rᵀ must be the identity and det R positive");
    }
    check_finite(index, "covariance", covariance.sum())?;
    let skew = (covariance - covariance.transpose()).amax();
    if !(skew <= UNIT_TOLERANCE * covariance.amax()) {
        return refuse(index, "covariance", skew, "it must be symmetric");
    }
    let factor = covariance.cholesky().and_then(|c| c.l().try_inverse()).filter(|l| l.sum().is_finite());
    match factor {
        Some(_) => Ok(()),
        None => {
            let least = covariance.symmetric_eigenvalues().min();
            refuse(
                index,
                "covariance",
                least,
                "its least eigenvalue must be positive; a direction not known gets a large variance",
            )
        }
    }
}
