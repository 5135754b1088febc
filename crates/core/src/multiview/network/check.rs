//! Refuses numbers that cannot be right, naming the constraint.

use super::{Constraint, NetworkCamera, NetworkProblem, Plane};
use crate::locate::prior::Prior;
use crate::pose::{ROTATION_TOLERANCE, off_rotation};
use crate::{Error, Pose};

/// Returns whether a number is a standard deviation: its variance and the inverse of the variance must be finite too.
fn is_sigma(s: f64) -> bool {
    0.0 < s && (s * s).is_normal() && (s * s).recip().is_normal()
}

const POSITIVE: &str = "a standard deviation must be positive and finite";
/// Variance of a pixel below which it is no measurement (1e-12 px).
const LEAST_VARIANCE_PX2: f64 = 1e-24;
/// Largest deviation from length 1 of a unit vector given in decimals.
const UNIT_TOLERANCE: f64 = 1e-6;

fn check_pose(index: usize, cam_from_world: &Pose) -> Result<(), Error> {
    let off = off_rotation(&cam_from_world.rotation);
    let is_right = off <= ROTATION_TOLERANCE && cam_from_world.translation.sum().is_finite();
    let (what, needed) = ("cam_from_world", "R Rᵀ must be the identity, det R positive, t finite");
    if is_right {
        Ok(())
    } else {
        Err(Error::InvalidConstraint { constraint: index, what, seen: off, needed })
    }
}

impl Constraint {
    fn check_numbers(&self, index: usize) -> Result<(), Error> {
        let refuse =
            |what, seen, needed| Err(Error::InvalidConstraint { constraint: index, what, seen, needed });
        let finite = "it must be finite";
        match self {
            Constraint::ImagePoint { pixel, .. } if !pixel.sum().is_finite() => {
                refuse("pixel", pixel.sum(), finite)
            }
            Constraint::ImagePoint { covariance_px2, .. } => {
                let least = covariance_px2.least_variance_px2();
                let is_right = LEAST_VARIANCE_PX2 < least && least.is_finite();
                let needed = "it must be positive and finite";
                if is_right {
                    Ok(())
                } else {
                    refuse("the least variance of the pixel, px²,", least, needed)
                }
            }
            Constraint::Place { x_in_world, .. } if !x_in_world.sum().is_finite() => {
                refuse("x_in_world", x_in_world.sum(), finite)
            }
            Constraint::Place { sigma_m, .. } => {
                match sigma_m.iter().find(|s| **s != 0.0 && !is_sigma(**s)) {
                    Some(seen) => refuse("sigma_m", *seen, "it must be 0 (exact) or positive and finite"),
                    None => Ok(()),
                }
            }
            Constraint::Distance { distance_m, .. } if !(0.0 < *distance_m && distance_m.is_finite()) => {
                refuse("distance_m", *distance_m, "a distance must be positive and finite")
            }
            Constraint::Distance { sigma_m, .. } | Constraint::OnPlane { sigma_m, .. }
                if !is_sigma(*sigma_m) =>
            {
                refuse("sigma_m", *sigma_m, POSITIVE)
            }
            Constraint::Upright { sigma_rad, .. } | Constraint::Gravity { sigma_rad, .. }
                if !is_sigma(*sigma_rad) =>
            {
                refuse("sigma_rad", *sigma_rad, POSITIVE)
            }
            Constraint::Gravity { down_in_cam, .. }
                if !((down_in_cam.norm() - 1.0).abs() < UNIT_TOLERANCE) =>
            {
                refuse("down_in_cam", down_in_cam.norm(), "a direction must be a unit vector")
            }
            Constraint::Pose { cam_from_world, covariance: Some(covariance), .. } => {
                Prior::Pose { cam_from_target: *cam_from_world, covariance: *covariance }.check(index)
            }
            Constraint::Pose { cam_from_world, .. } => check_pose(index, cam_from_world),
            _ => Ok(()),
        }
    }
}

impl NetworkProblem<'_> {
    /// Checks that every number is possible for its kind.
    pub(super) fn check(&self) -> Result<(), Error> {
        for (index, camera) in self.camera_of_photo.iter().enumerate() {
            if self.cameras.len() <= *camera {
                let needed = "each photograph needs a camera of the list";
                return Err(Error::InvalidSetting { setting: "camera_of_photo", seen: index as f64, needed });
            }
        }
        for camera in self.cameras {
            camera.check()?;
        }
        for plane in self.planes {
            if let Plane::Known { normal_in_world, offset_m } = plane {
                let length = normal_in_world.norm();
                if !((length - 1.0).abs() < 1e-6 && offset_m.is_finite()) {
                    let needed = "a plane has a unit normal and a finite offset";
                    return Err(Error::InvalidSetting { setting: "normal_in_world", seen: length, needed });
                }
            }
        }
        self.constraints
            .iter()
            .enumerate()
            .try_for_each(|(index, constraint)| self.check_constraint(index, constraint))
    }

    fn check_constraint(&self, index: usize, constraint: &Constraint) -> Result<(), Error> {
        let refuse =
            |what, seen, needed| Err(Error::InvalidConstraint { constraint: index, what, seen, needed });
        let points = constraint.points();
        if let Some(p) = points.iter().flatten().find(|p| self.n_points <= **p) {
            return refuse("point", *p as f64, "it must be below n_points");
        }
        if constraint.photo().is_some_and(|photo| self.camera_of_photo.len() <= photo) {
            return refuse(
                "photo",
                constraint.photo().unwrap_or(0) as f64,
                "it must be one of camera_of_photo",
            );
        }
        if constraint.plane().is_some_and(|plane| self.planes.len() <= plane) {
            return refuse("plane", constraint.plane().unwrap_or(0) as f64, "it must be one of planes");
        }
        if points[0].is_some() && points[0] == points[1] {
            return refuse(
                "the second point",
                points[0].unwrap_or(0) as f64,
                "it must differ from the first",
            );
        }
        constraint.check_numbers(index)
    }
}

impl NetworkCamera<'_> {
    fn check(&self) -> Result<(), Error> {
        let Some(covariance) = self.intrinsics_covariance else { return Ok(()) };
        let n = self.camera.parameters().len();
        let refuse = |parameter, seen, needed| Err(Error::InvalidCamera { parameter, seen, needed });
        if covariance.len() != n * n {
            let needed = "give its n × n covariance, n the number of parameters";
            return refuse("intrinsics covariance size", covariance.len() as f64, needed);
        }
        match covariance.iter().enumerate().find(|(i, x)| !x.is_finite() || (i % (n + 1) == 0 && **x < 0.0)) {
            Some((_, seen)) => refuse("intrinsics covariance", *seen, "finite numbers, no variance negative"),
            None => Ok(()),
        }
    }
}
