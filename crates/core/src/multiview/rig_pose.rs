//! The pose of a rig of cameras from known points, each observed by any of the cameras: at least three points, even in three cameras.
//!
//! check → three-ray and single-camera starts → refine each → choose → consistency. The result has the same parts as that of `locate`:
//! covariance, other minima, verdict.
//! Derivation: docs/math/rig_pose.md.

mod uncertain_lens;
mod cost;
mod starts;
mod check;
mod apart;
#[cfg(feature = "std")]
mod budget;
#[cfg(feature = "std")]
mod consensus;

use crate::covariance::is_covariance;
use crate::locate::choose::{AMBIGUITY_GATE_CHI2, Choice, Minima, Minimum, choose, insert};
use crate::locate::consistency::{is_inconsistent, is_unlikely, noise_scale};
use crate::locate::curvature::{Cost, along_the_ridge, is_bent, range_share};
use crate::locate::problem::Problem;
use crate::locate::refine::{OVERFLOW, whitened_residual};
use crate::locate::uncertainty::check_known;
use crate::locate::{Config, PoseEstimate, locate};
use crate::{Camera, Correspondence, Error, Matrix6, Pose};
pub(crate) use check::check_views;
#[cfg(feature = "std")]
pub use consensus::{RigConsensus, RigPoint, rig_consensus};
pub(crate) use cost::RigCost;

use apart::Apart;
use check::check_points;
use starts::{Extents, Starts, push_single_cameras, push_triples};

/// One camera of a rig and its observations.
#[derive(Debug, Clone, Copy)]
pub struct RigView<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Its pose: x_in_cam = cam_from_rig · x_in_rig.
    pub cam_from_rig: Pose,
    /// Covariance of the small left motion `[rotation_rad; translation_m]` of `cam_from_rig`, camera frame, taken as
    /// independent of the other cameras'; none when exact.
    /// Its share enters the weights, the covariance and the consistency verdict.
    pub cam_from_rig_covariance: Option<Matrix6>,
    /// Covariance of this camera's intrinsics, row by row, in the order of `Camera::parameters`, taken as independent of the other cameras';
    /// none when exact. Its share enters the weights, the covariance and the consistency verdict.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// Known points and their pixels in this camera; may be empty.
    pub seen: &'a [Correspondence],
}

impl RigView<'_> {
    /// Returns whether its pose and its intrinsics are exact.
    fn is_exact(&self) -> bool {
        self.cam_from_rig_covariance.is_none() && self.intrinsics_covariance.is_none()
    }
}

/// A minimum of the rig's reprojection error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigMinimum {
    /// The pose: x_in_rig = rig_from_target · x_in_target.
    pub rig_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, rig frame.
    pub covariance: Matrix6,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
}

/// The second solution, if another pose of the rig explains the pixels as well.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // Boxing the other pose would put a heap into the single-pose path.
pub enum RigAmbiguity {
    /// No other minimum is within the gate. `ratio` = residual sum of squares of the nearest other minimum over this one's; none when no other
    /// exists.
    Unique {
        /// The ratio of the nearest other minimum.
        ratio: Option<f64>,
    },
    /// Two poses fit: χ² of the other is less than the gate above this one's.
    Ambiguous {
        /// Residual sum of squares of the other over the first.
        ratio: f64,
        /// The other pose.
        other: RigMinimum,
    },
}

/// The agreement of the residuals of all cameras with the stated sigmas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigConsistency {
    /// The residuals are as large as the sigmas state, or there is no redundancy for a test.
    Consistent,
    /// The residuals are far larger: a camera that moved, wrong intrinsics, target or labels. The covariance is widened by
    /// `chi2_per_degree_of_freedom`.
    Inconsistent {
        /// χ² over degrees of freedom.
        chi2_per_degree_of_freedom: f64,
        /// Index of the view with the largest mean squared normalised residual.
        worst_camera: usize,
        /// Index, in that view, of the point with the largest normalised residual.
        worst_point: usize,
        /// Its residual, px.
        worst_px: f64,
    },
    /// The pose that the points of one camera give differs from that of all others by more than the covariances explain: the camera moved, or its
    /// file or the target is wrong. The covariance is widened for it.
    CameraApart {
        /// Index of the view whose pose differs most.
        camera: usize,
        /// Squared difference in units of its covariance, 6 expected.
        chi2: f64,
    },
}

/// The pose of a rig with its uncertainty and a possible second solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigPoseEstimate {
    /// The pose: x_in_rig = rig_from_target · x_in_target.
    pub rig_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, rig frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances, with the uncertainty of camera poses and intrinsics included.
    pub chi2: f64,
    /// 2 n − 6.
    pub degrees_of_freedom: usize,
    /// Number of correspondences that took part.
    pub n_points: usize,
    /// Number of cameras that observe any point.
    pub n_cameras: usize,
    /// Whether another pose fits as well.
    pub ambiguity: RigAmbiguity,
    /// Whether the residuals agree with the sigmas.
    pub consistency: RigConsistency,
}

/// Largest number of further rounds of triples where the first leave a doubt.
const MORE_ROUNDS: usize = 6;
/// A start whose χ² exceeds the best minimum's by more than this is not refined, as in `search`.
const HOPELESS_CHI2: f64 = 1e4;

/// Solves for the pose of a rig of cameras with known poses in it, without heap allocation.
///
/// # Errors
/// `EmptyRig`, `InvalidRig` and `InvalidRigPoint` name the camera and what is wrong in it; `TooFewPoints` (three over all cameras), `Collinear`;
/// otherwise the errors of `locate`.
pub fn locate_rig(views: &[RigView]) -> Result<RigPoseEstimate, Error> {
    check_views(views)?;
    let cost = &RigCost::new(views);
    let n_cameras = views.iter().filter(|view| !view.seen.is_empty()).count();
    if let (1, Some(view)) = (n_cameras, views.iter().find(|view| !view.seen.is_empty())) {
        let camera = views.iter().position(|v| core::ptr::eq(v, view)).unwrap_or(0);
        let config = Config { intrinsics_covariance: view.intrinsics_covariance, ..Config::default() };
        let found = locate(view.seen, view.camera, &config)?;
        return checked(seen_by_one(&found, view, camera));
    }
    let extents = check_points(cost)?;
    let minima = minima(cost, &extents)?;
    let degrees_of_freedom = 2 * cost.n_points() - 6;
    let noise_scale = minima.first().map_or(1.0, |m| noise_scale(m.chi2, degrees_of_freedom));
    let apart =
        minima.first().map_or_else(Apart::none, |m| Apart::new(cost, &m.cam_from_target, noise_scale));
    let noise_scale = noise_scale * apart.scale();
    let Choice { best, ratio, alternative } =
        choose(&minima, cost.n_points(), noise_scale, AMBIGUITY_GATE_CHI2)?;
    let ambiguity = match (alternative, ratio) {
        (Some(alternative), Some(ratio)) => {
            RigAmbiguity::Ambiguous { ratio, other: widened(alternative, noise_scale, cost)? }
        }
        (_, ratio) => RigAmbiguity::Unique { ratio },
    };
    let RigMinimum { rig_from_target, covariance, chi2, rms_px } = widened(best, noise_scale, cost)?;
    let consistency = match consistency(&rig_from_target, chi2, degrees_of_freedom, cost) {
        RigConsistency::Consistent => apart.consistency(),
        inconsistent => inconsistent,
    };
    if let (RigAmbiguity::Unique { .. }, RigConsistency::Consistent) = (ambiguity, consistency) {
        for view in views {
            let problem = Problem::new(view.seen, view.camera);
            check_known(&(view.cam_from_rig * rig_from_target), &covariance, &problem)?;
        }
    }
    let n_points = cost.n_points();
    checked(RigPoseEstimate {
        rig_from_target,
        covariance,
        rms_px,
        chi2,
        degrees_of_freedom,
        n_points,
        n_cameras,
        ambiguity,
        consistency,
    })
}

/// Returns the factor by which the residuals widen the covariance of a pose: that of the lowest minimum.
#[cfg(feature = "std")]
fn minima_scale(e: &RigPoseEstimate) -> f64 {
    let other = match e.ambiguity {
        RigAmbiguity::Ambiguous { other, .. } => other.chi2,
        RigAmbiguity::Unique { .. } => e.chi2,
    };
    noise_scale(e.chi2.min(other), e.degrees_of_freedom)
}

/// Refuses an estimate with a number that is not finite or a matrix that is no covariance.
fn checked(estimate: RigPoseEstimate) -> Result<RigPoseEstimate, Error> {
    let pose = &estimate.rig_from_target;
    let sum = pose.rotation.sum() + pose.translation.sum() + estimate.chi2 + estimate.rms_px;
    if sum.is_finite() && is_covariance(&estimate.covariance) { Ok(estimate) } else { Err(OVERFLOW) }
}

/// Returns every minimum reached, lowest first.
fn minima(cost: &RigCost, extents: &Extents) -> Result<Minima, Error> {
    let (mut minima, mut starts) = (Minima::new(), Starts::new());
    push_triples(&mut starts, cost, 0);
    push_single_cameras(&mut starts, cost);
    let mut failure = refine_each(&starts, cost, &mut minima);
    if let Some(best) = minima.first().copied() {
        starts.clear();
        extents.push_mirrored(&mut starts, cost, &best.cam_from_target, &cost.pivot());
        refine_each(&starts, cost, &mut minima);
    }
    let degrees_of_freedom = 2 * cost.n_points() - 6;
    for round in 1..=MORE_ROUNDS {
        if 0 < degrees_of_freedom && minima.first().is_none_or(|m| is_unlikely(m.chi2, degrees_of_freedom)) {
            starts.clear();
            push_triples(&mut starts, cost, round);
            failure = refine_each(&starts, cost, &mut minima).or(failure);
        }
    }
    match failure {
        Some(error) if minima.is_empty() => Err(error),
        _ => Ok(minima),
    }
}

/// Refines the starts, best first; returns why the best of them failed, if it did.
fn refine_each(starts: &Starts, cost: &RigCost, minima: &mut Minima) -> Option<Error> {
    let mut failure = None;
    for (chi2, start) in starts {
        // Uncertain intrinsics may explain residuals that the pixels' sigmas cannot: no start is then given up.
        let alternative = minima.first().map(|m| m.chi2).filter(|_| cost.has_exact_lenses());
        if alternative.is_some_and(|alternative| alternative + HOPELESS_CHI2 < *chi2) {
            break;
        }
        match cost.refine(start, alternative) {
            Ok(minimum) if minimum.is_finite() => insert(minima, minimum),
            Ok(_) => {}
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    failure
}

/// Returns the minimum with its covariance widened for the curvature of the likelihood and for the residuals.
fn widened(m: &Minimum, noise_scale: f64, cost: &RigCost) -> Result<RigMinimum, Error> {
    let cost = &cost.held_at(&m.cam_from_target);
    let straight = || m.covariance + range_share(m, &cost.pivot());
    let covariance = if is_bent(m, cost) { along_the_ridge(m, cost)[1] } else { straight() };
    let widened = Minimum { covariance: covariance * noise_scale, ..*m };
    if widened.is_finite() { Ok(rig_minimum(&widened)) } else { Err(OVERFLOW) }
}

fn rig_minimum(m: &Minimum) -> RigMinimum {
    RigMinimum {
        rig_from_target: m.cam_from_target,
        covariance: m.covariance,
        chi2: m.chi2,
        rms_px: m.rms_px,
    }
}

/// Returns the verdict, with the camera and the point that fit worst.
fn consistency(
    rig_from_target: &Pose,
    chi2: f64,
    degrees_of_freedom: usize,
    cost: &RigCost,
) -> RigConsistency {
    if !is_inconsistent(chi2, degrees_of_freedom) {
        return RigConsistency::Consistent;
    }
    let (mut worst_camera, mut worst_point, mut worst_px, mut largest_mean) = (0, 0, 0.0, -1.0);
    for (camera, view) in cost.views.iter().enumerate() {
        let cam_from_target = view.cam_from_rig * *rig_from_target;
        let (mut sum, mut worst) = (0.0, (0, 0.0, -1.0));
        for (point, c) in view.seen.iter().enumerate() {
            if let Some((_, e, whitened)) = whitened_residual(&cam_from_target, c, view.camera) {
                sum += whitened;
                if worst.2 < whitened {
                    worst = (point, e.norm(), whitened);
                }
            }
        }
        let mean = sum / view.seen.len().max(1) as f64;
        if largest_mean < mean {
            (worst_camera, worst_point, worst_px, largest_mean) = (camera, worst.0, worst.1, mean);
        }
    }
    let chi2_per_degree_of_freedom = chi2 / degrees_of_freedom as f64;
    RigConsistency::Inconsistent { chi2_per_degree_of_freedom, worst_camera, worst_point, worst_px }
}

/// Returns the estimate of `locate` transformed into the rig frame, docs/math/rig_pose.md eq. (7).
fn seen_by_one(e: &PoseEstimate, view: &RigView, camera: usize) -> RigPoseEstimate {
    use crate::locate::choose::Ambiguity;
    use crate::locate::consistency::Consistency;
    let rig_from_cam = view.cam_from_rig.inverse();
    let own = view.cam_from_rig_covariance.unwrap_or_else(Matrix6::zeros);
    let own_in_rig = view.cam_from_rig.inverse_covariance(&own);
    let carried = |covariance: &Matrix6| rig_from_cam.product_covariance(&own_in_rig, covariance);
    let ambiguity = match e.ambiguity {
        Ambiguity::Unique { ratio } => RigAmbiguity::Unique { ratio },
        Ambiguity::Ambiguous { ratio, other: m } => {
            let cam_from_target = rig_from_cam * m.cam_from_target;
            let other = rig_minimum(&Minimum { cam_from_target, covariance: carried(&m.covariance), ..m });
            RigAmbiguity::Ambiguous { ratio, other }
        }
    };
    let consistency = match e.consistency {
        Consistency::Consistent => RigConsistency::Consistent,
        Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_point, worst_px, .. } => {
            RigConsistency::Inconsistent {
                chi2_per_degree_of_freedom,
                worst_camera: camera,
                worst_point,
                worst_px,
            }
        }
    };
    RigPoseEstimate {
        rig_from_target: rig_from_cam * e.cam_from_target,
        covariance: carried(&e.covariance),
        rms_px: e.rms_px,
        chi2: e.chi2,
        degrees_of_freedom: e.degrees_of_freedom,
        n_points: e.n_points,
        n_cameras: 1,
        ambiguity,
        consistency,
    }
}
