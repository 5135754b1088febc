//! A pose with what is known of its covariance, as JSON.

use resight::answer::pose::{TransformObject, rows};
use resight::core::{Matrix6, Pose};
use resight::report::words::sigmas;
use serde::Serialize;

/// `cam_from_rig` and its inverse; covariance and sigmas null where nothing is known.
#[derive(Serialize)]
pub struct PlacedObject {
    cam_from_rig: TransformObject,
    rig_from_cam: TransformObject,
    covariance: Option<[[f64; 6]; 6]>,
    sigma_rad: Option<[f64; 3]>,
    sigma_m: Option<[f64; 3]>,
}

impl PlacedObject {
    /// From the pose and the covariance of its small left motion.
    pub fn of(cam_from_rig: &Pose, covariance: Option<&Matrix6>) -> Self {
        let sigma = covariance.map(sigmas);
        PlacedObject {
            cam_from_rig: (*cam_from_rig).into(),
            rig_from_cam: cam_from_rig.inverse().into(),
            covariance: covariance.map(rows),
            sigma_rad: sigma.map(|s| s.0),
            sigma_m: sigma.map(|s| s.1),
        }
    }
}

/// A pose under a name of its own, with its covariance.
#[derive(Serialize)]
pub struct KnownObject {
    #[serde(flatten)]
    pose: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
}

impl KnownObject {
    /// From the pose and the covariance of its small left motion.
    pub fn of(b_from_a: &Pose, covariance: &Matrix6) -> Self {
        let (sigma_rad, sigma_m) = sigmas(covariance);
        KnownObject { pose: (*b_from_a).into(), covariance: rows(covariance), sigma_rad, sigma_m }
    }
}
