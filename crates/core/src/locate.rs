//! The single-camera pipeline: correspondences in, one pose with covariance and ambiguity out.

use crate::choose::Ambiguity;
use crate::{Matrix6, Pose};

/// How a pose was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Decide from the configuration.
    Auto,
    /// The seed paper, literally (no refinement).
    Wang2004,
    /// Three collinear points and one off the line.
    LinePlusOne,
    /// Three points.
    P3p,
    /// Coplanar points.
    Planar,
    /// Any n ≥ 3 points.
    Sqpnp,
}

/// Does the residual agree with the stated sigmas?
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Consistency {
    /// As large as the sigmas say, or no redundancy to tell.
    Consistent,
    /// Far larger: wrong intrinsics, target or labels.
    Inconsistent {
        /// χ² over degrees of freedom.
        chi2_per_dof: f64,
        /// Index of the point with the largest normalised residual.
        worst_point: usize,
        /// Its residual, px.
        worst_px: f64,
    },
}

/// A pose, how sure, and whether another one fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// 2 n − 6.
    pub degrees_of_freedom: usize,
    /// How many correspondences took part.
    pub n_points: usize,
    /// The method that answered (never `Auto`).
    pub method: Method,
    /// Does another pose fit as well?
    pub ambiguity: Ambiguity,
    /// Does the residual fit the sigmas?
    pub consistency: Consistency,
}
