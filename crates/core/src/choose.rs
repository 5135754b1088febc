//! Among refined minima: which is the pose, and does another explain the pixels as well?

use crate::{Matrix6, Pose};

/// A local minimum of the reprojection error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum {
    /// The pose.
    pub cam_from_target: Pose,
    /// Covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Root mean square distance between observed and projected points, px (mean over points, not coordinates).
    pub rms_px: f64,
}

/// Whether another pose explains the pixels as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ambiguity {
    /// No other minimum within the gate. `ratio` = residual sum of squares of the nearest other minimum over this one's;
    /// none when there is no other minimum.
    Unique {
        /// See above.
        ratio: Option<f64>,
    },
    /// Two poses fit: χ² of the other is less than the gate above this one's.
    Ambiguous {
        /// Residual sum of squares of the other over the first.
        ratio: f64,
        /// The other pose.
        other: Minimum,
    },
}
