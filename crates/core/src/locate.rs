//! The single-camera pipeline: correspondences in, one pose with covariance and ambiguity out.
//!
//! classify → closed form → refine → choose. Each line of `locate` is one file: `classify.rs`, `candidates.rs`, `minima.rs`, `answer.rs`.

pub mod choose;
pub mod prior;
pub(crate) mod factor;
pub mod loss;
pub mod group;
pub mod problem;
pub(crate) mod accumulate;
pub(crate) mod reweight;
pub(crate) mod sandwich;
pub mod refine;
pub(crate) mod curvature;
pub(crate) mod posterior;
pub mod consistency;
pub mod known_rotation;
pub mod lines;
pub(crate) mod method;
pub(crate) mod multi_start;
mod prior_start;
mod upright;
mod wang_covariance;
pub(crate) mod common;
pub(crate) mod classify;
mod candidates;
pub(crate) mod minima;
mod shared_error;
pub(crate) mod parts;
pub(crate) mod uncertainty;
pub(crate) mod answer;
mod budget;
pub mod warnings;
#[cfg(feature = "std")]
pub mod suspects;
pub mod observability;
#[cfg(feature = "std")]
pub mod unknown_focal;

use crate::solve::configuration::Geometry;
use crate::solve::line_plus_one::Weakness;
use crate::{Camera, Correspondence, Error, Matrix6, Pose};
use answer::choose;
use candidates::closed_form;
use choose::{Ambiguity, Hypothesis, Minimum, Others};
use classify::classify;
use consistency::Consistency;
use group::RigidGroup;
use loss::Loss;
pub use method::Method;
use minima::refine;
use prior::Prior;

/// Settings of [`locate`]; the default is right for most jobs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config<'a> {
    /// The method; `Auto` decides from the points.
    pub method: Method,
    /// Covariance of the camera's intrinsic parameters, row by row, in the order of `Camera::parameters`; adds their share
    /// to the pose covariance.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// Standard deviation of the scale of a printed target along its x and y, relative; 0 when exact. All points share the error:
    /// docs/math/printed_scale.md.
    pub target_scale_sigma: [f64; 2],
    /// What is known about the pose besides the points; each prior adds residuals to the cost and a start to the search.
    pub priors: &'a [Prior],
    /// What a point's residual costs; `Squared` is maximum likelihood for Gaussian noise.
    pub loss: Loss,
    /// Runs of points whose known positions share one unknown motion, such as the corners of a tag of a map; under the squared loss.
    pub groups: &'a [RigidGroup],
    /// Whether the covariance holds errors that all points of the view share, where the residuals show them: docs/math/shared_error.md.
    pub shared_errors: bool,
}

impl Default for Config<'_> {
    fn default() -> Self {
        Config {
            method: Method::default(),
            intrinsics_covariance: None,
            target_scale_sigma: [0.0; 2],
            priors: &[],
            loss: Loss::default(),
            groups: &[],
            shared_errors: true,
        }
    }
}

/// A pose with its covariance, and whether another pose fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target. Where several fit, the most probable of them.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances, those of priors and of uncertain intrinsics and scales included; of what they cost under
    /// a robust loss.
    pub chi2: f64,
    /// Root mean square of the smooth displacement that all points share, along one axis of the image, px: a bent board, a lens not quite
    /// known. `covariance` holds it. 0 where none shows, and where fewer than twelve points could not show it.
    pub shared_error_px: f64,
    /// What uncertain points and intrinsics add to minus twice the log-likelihood: `Minimum::log_determinant`.
    pub log_determinant: f64,
    /// As in `Hypothesis`: above 0 where a pose that fits a little worse is the more probable one.
    pub delta_chi2: f64,
    /// 2 n − 6, and one more for each residual of a prior.
    pub degrees_of_freedom: usize,
    /// How many correspondences took part.
    pub n_points: usize,
    /// The method that answered (never `Auto`).
    pub method: Method,
    /// Whether another pose fits as well.
    pub ambiguity: Ambiguity,
    /// Whether the residual agrees with the stated sigmas.
    pub consistency: Consistency,
    /// Probability of this pose among all minima found, no pose expected beforehand: docs/math/posterior.md. With more points
    /// than unknowns it compares the minima; `consistency` states whether the best of them is right.
    pub probability: f64,
    /// The other minima: the second solutions within the gate come first, the most probable one before the others; then those of larger χ², in its order.
    pub others: Others,
    /// Why the view is weak, from the closed form or from the two poses that fit alike; none where it is not.
    pub weakness: Option<Weakness>,
    /// What was measured on the points before anything was solved, and what it was compared with; none where priors stood in for
    /// points that determine no pose.
    pub geometry: Option<Geometry>,
}

/// The pose of a camera from known points.
///
/// Returns the most probable pose without touching the heap. A pose beside which a second one fits about as well is `Ambiguous`, one whose
/// residual contradicts the sigmas is `Inconsistent`. Fails with a named error where the points do not determine a pose.
pub fn locate(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<PoseEstimate, Error> {
    let view = classify(seen, camera, config)?;
    let candidates = closed_form(&view)?;
    let minima = refine(&view, &candidates);
    choose(&view, minima)
}

impl PoseEstimate {
    /// Every minimum found, at most four: this pose, then the others.
    pub fn minima(&self) -> impl Iterator<Item = Hypothesis> + '_ {
        let Self { cam_from_target, covariance, chi2, rms_px, log_determinant, .. } = *self;
        let minimum = Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant };
        let Self { delta_chi2, probability, .. } = *self;
        let first = Hypothesis { minimum, delta_chi2, probability, is_alternative: true };
        core::iter::once(first).chain(self.others.iter().flatten().copied())
    }

    /// Returns how far above the lowest minimum, in χ², another must be to be excluded: 9, or 16 where points or intrinsics are uncertain or
    /// all points are near one line.
    pub fn gate_chi2(&self) -> f64 {
        let is_exact = self.minima().all(|h| h.minimum.log_determinant == 0.0);
        if is_exact { choose::gate_of_layout(self.geometry.as_ref()) } else { choose::UNCERTAIN_GATE_CHI2 }
    }

    /// How many minima lie within the gate, this pose included: 1 where it is unique.
    pub fn n_alternatives(&self) -> usize {
        self.minima().filter(|h| h.is_alternative).count()
    }
}
