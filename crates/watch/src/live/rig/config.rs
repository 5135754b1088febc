//! What a rig is watched by.

use nalgebra::DMatrix;
use resight_core::Pose;

/// How the relations among the cameras of a rig are watched.
#[derive(Debug, Clone)]
pub struct RigConfig {
    /// Where the cameras are, in the order of the session, and the covariance of all of them together, 6 rows a camera; none: learned.
    pub reference: Option<(Vec<Pose>, DMatrix<f64>)>,
    /// Frames of this time belong to one frame set, seconds.
    pub sync_tolerance_s: f64,
}
