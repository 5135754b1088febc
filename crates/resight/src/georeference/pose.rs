//! A pose against the Earth: position, heading, tilt and roll with their standard deviations.

use super::earth::LocalFrame;
use super::system::{CoordinateSystem, Zone};
use crate::answer::georeference::{GeoreferencedPose, OriginObject};
use crate::core::{Matrix6, Pose, Vector6};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{PI, TAU};

/// Central differences err by h² (truncation) and ε/h (rounding).
const STEP_RAD: f64 = 6e-6;
/// An angle with a larger standard deviation is not determined.
const LARGEST_SIGMA_RAD: f64 = 1.0;

/// Angles of a camera against east, north and up; none where the direction that they are of is vertical.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Angles {
    heading_rad: f64,
    tilt_rad: f64,
    roll_rad: f64,
    image_up_heading_rad: f64,
}

impl Angles {
    /// Of cam_from_enu, georeference.md eqs. (5) to (8).
    fn of(cam_from_enu: &Matrix3<f64>) -> Self {
        let enu = |row: usize| Vector3::from(cam_from_enu.row(row).transpose());
        let (right, down, axis) = (enu(0), enu(1), enu(2));
        Angles {
            heading_rad: axis.x.atan2(axis.y),
            tilt_rad: (-axis.z).atan2(axis.x.hypot(axis.y)),
            roll_rad: (-right.z).atan2(-down.z),
            image_up_heading_rad: (-down.x).atan2(-down.y),
        }
    }

    fn list(&self) -> [f64; 4] {
        [self.heading_rad, self.tilt_rad, self.roll_rad, self.image_up_heading_rad]
    }
}

/// The smallest angle from one direction to another.
fn difference(a: f64, b: f64) -> f64 {
    (a - b + PI).rem_euclid(TAU) - PI
}

/// Returns the pose against the Earth of a camera that was solved in a local frame, with the standard deviations that follow from its covariance.
pub fn georeferenced_pose(
    frame: &LocalFrame,
    cam_from_local: &Pose,
    covariance: &Matrix6,
) -> GeoreferencedPose {
    let at = cam_from_local.origin();
    let enu_from_local = frame.enu_from_local(&at);
    let enu_from_cam = enu_from_local * cam_from_local.rotation.transpose();
    let cam_from_enu = enu_from_cam.transpose();
    let covariance_cam = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let position = enu_from_cam * covariance_cam * cam_from_enu;
    let sigma_m = position.diagonal().map(|x| x.max(0.0).sqrt());
    let angles = Angles::of(&cam_from_enu);
    let sigmas = angle_sigmas(&cam_from_enu, covariance);
    let known = |i: usize| Some(angles.list()[i].rem_euclid(TAU)).filter(|_| sigmas[i] < LARGEST_SIGMA_RAD);
    let sigma = |i: usize| Some(sigmas[i]).filter(|sigma| *sigma < LARGEST_SIGMA_RAD);
    let geographic = frame.geographic(&at);
    let grid_m = frame.grid_m(&at);
    let origin = match (frame.origin(), frame.grid_origin_m().unwrap_or_default()) {
        (Some(place), _) => OriginObject::Place(place),
        (None, [easting_m, northing_m, height_m]) => OriginObject::Grid { easting_m, northing_m, height_m },
    };
    GeoreferencedPose {
        coordinate_system: frame.system.clone(),
        north: if geographic.is_some() { "true" } else { "grid" },
        origin,
        lat_deg: geographic.map(|g| g.lat_deg),
        lon_deg: geographic.map(|g| g.lon_deg),
        height_m: geographic.map_or_else(|| grid_m.map_or(at.z, |m| m[2]), |g| g.height_m),
        easting_m: grid_m.map(|m| m[0]),
        northing_m: grid_m.map(|m| m[1]),
        east_sigma_m: sigma_m.x,
        north_sigma_m: sigma_m.y,
        height_sigma_m: sigma_m.z,
        position_covariance_m2: [0, 1, 2].map(|i| [0, 1, 2].map(|j| position[(i, j)])),
        heading_rad: known(0),
        heading_sigma_rad: sigma(0),
        tilt_rad: angles.tilt_rad,
        tilt_sigma_rad: sigmas[1],
        roll_rad: sigma(2).map(|_| angles.roll_rad),
        roll_sigma_rad: sigma(2),
        image_up_heading_rad: known(3),
        image_up_heading_sigma_rad: sigma(3),
        grid_convergence_rad: match (&frame.system, &geographic) {
            (CoordinateSystem::Utm(zone), Some(here)) => convergence_rad(*zone, here),
            _ => None,
        },
    }
}

fn convergence_rad(zone: Zone, here: &super::earth::Geographic) -> Option<f64> {
    super::earth::Utm::new(zone)?.convergence_rad(here)
}

/// Standard deviations of the angles by central differences, georeference.md eq. (9).
fn angle_sigmas(cam_from_enu: &Matrix3<f64>, covariance: &Matrix6) -> [f64; 4] {
    let rotation = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let stepped = |axis: usize, step: f64| {
        let small = Pose::exp(&Vector6::ith(axis, step)).rotation;
        Angles::of(&(small * cam_from_enu)).list()
    };
    let columns = [0, 1, 2].map(|axis| (stepped(axis, STEP_RAD), stepped(axis, -STEP_RAD)));
    [0, 1, 2, 3].map(|i| {
        let gradient = Vector3::from(columns.map(|(a, b)| difference(a[i], b[i]) / (2.0 * STEP_RAD)));
        (gradient.transpose() * rotation * gradient)[0].max(0.0).sqrt()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that looks to the north-east and 30° down, its image upright; then rolled clockwise by 10°.
    #[test]
    fn angles_have_the_signs_that_are_documented() {
        let (heading, tilt) = (45_f64.to_radians(), 30_f64.to_radians());
        let axis = Vector3::new(heading.sin() * tilt.cos(), heading.cos() * tilt.cos(), -tilt.sin());
        let right = Vector3::new(heading.cos(), -heading.sin(), 0.0);
        let down = axis.cross(&right);
        let upright = Matrix3::from_rows(&[right.transpose(), down.transpose(), axis.transpose()]);
        let roll = Pose::exp(&Vector6::ith(2, -10_f64.to_radians())).rotation;
        for (rotation, roll) in [(upright, 0.0), (roll * upright, 10_f64.to_radians())] {
            let found = Angles::of(&rotation);
            let expected = [heading, tilt, roll];
            for (a, b) in found.list().into_iter().zip(expected) {
                assert!(difference(a, b).abs() < 1e-12, "{found:?}");
            }
        }
        // Rolled clockwise as seen from behind, the right side of the image is lower.
        assert!((roll * upright)[(0, 2)] < 0.0);
        assert!(difference(Angles::of(&upright).image_up_heading_rad, heading).abs() < 1e-12);
    }
}
