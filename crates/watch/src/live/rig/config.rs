//! The configuration of a rig's monitor.

use nalgebra::DMatrix;
use resight_core::Pose;

/// The monitoring of the relative poses of a rig's cameras.
#[derive(Debug, Clone)]
pub struct RigConfig {
    /// Poses of the cameras in the order of the session, and their joint covariance, 6 rows for each camera; none: learned.
    pub reference: Option<(Vec<Pose>, DMatrix<f64>)>,
    /// Frames within this time of each other belong to one frame set, seconds.
    pub sync_tolerance_s: f64,
}
