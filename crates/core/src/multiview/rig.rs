//! The relative poses of the cameras of a rig, from targets that they observe together; no surveyed point is needed.
//!
//! canonical order → poses of each observation → a start that the most observations agree with → joint adjustment, wrong points left out →
//! covariances, weakest link, scales, verdict. Derivation: docs/math/rig.md.

mod views;
mod layout;
mod sighted;
mod votes;
mod start;
mod distance;
mod classify;
mod adjust;
mod scale;
mod common_scale;
mod lens;
mod lens_score;
mod lens_doubt;
mod blocks;
mod neighbours;
mod uncertain_lens;
mod timing;
mod explain;
mod verdict;
mod budget;
mod answer;
mod late;
mod exchanged;
mod faults;
mod free_lenses;

use crate::budget::Budget;
use crate::explanation::{Tolerance, Weighed};
use crate::locate::loss::Loss;
use crate::{Camera, Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::DMatrix;

pub use explain::RigExplanation;
pub use free_lenses::{AdjustedLens, RigWithLenses, solve_rig_and_lenses};
pub use lens::LensOffset;
pub use timing::{FrameStamps, TimeOffsets, time_offsets};
pub use verdict::{Cause, Losses, RigVerdict, RigWarning};
pub(in crate::multiview) use views::Groups;
pub use views::shared_views;

/// The observation of one target by one camera in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The camera, an index into `RigProblem::cameras`.
    pub camera: usize,
    /// The view: observations of one view were taken at the same time.
    pub view: usize,
    /// The target, an index into `RigProblem::body_of_target`.
    pub target: usize,
    /// Known points of that target with their pixels.
    pub seen: Vec<Correspondence>,
}

/// Cameras, views and observations.
#[derive(Debug, Clone, Copy)]
pub struct RigProblem<'a> {
    /// Intrinsics, held fixed.
    pub cameras: &'a [Camera],
    /// The rigid body to which each target is fixed, one entry for each target: targets of one body keep their relative poses, which need not be
    /// known; different bodies move independently.
    pub body_of_target: &'a [usize],
    /// Number of views.
    pub n_views: usize,
    /// The observations, in any order; the answer does not depend on the order.
    pub observations: &'a [Observation],
}

/// Settings of `solve_rig`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigConfig<'a> {
    /// The camera whose frame is the rig's. One frame must be held, because a common motion of rig and bodies changes no pixel.
    pub reference: usize,
    /// The cost of a residual. `Truncated`, the default at `GATE_SIGMAS`, finds wrong points and leaves them out; the others use every visible
    /// point.
    pub loss: Loss,
    /// Whether the covariances of all cameras, and of all targets, together are computed.
    pub joint_covariance: bool,
    /// Measured distances between cameras, which add to the cost and check a target's size.
    pub known_distances: &'a [KnownDistance],
    /// Whether errors that a whole observation shares are estimated from contradictions between views and put into every covariance.
    /// Without it the errors of points count as independent.
    pub shared_errors: bool,
    /// Whether intrinsics errors on which views agree, but which do not make the rig inconsistent, widen every covariance by their estimated
    /// size. Without (the default) the intrinsics are taken as given: parts of one recording have such errors in common, and agree within their
    /// covariances without them. `RigSolution::lens_sigma_m` states their effect in either case.
    pub lens_errors: bool,
    /// Covariance of each camera's intrinsics in the order of `Camera::parameters` (none: exact), one entry for each camera, or an empty list.
    /// They widen every covariance, and an offset that they explain is no fault of a lens.
    pub intrinsics: &'a [Option<DMatrix<f64>>],
    /// Relative standard deviation of the size of all targets together, as of a printed scale; 0 where sizes are exact. It widens every
    /// covariance, because no view shows it and more views do not reduce it.
    pub scale_sigma: f64,
    /// Tags that are displaced on their target, in all views alike; groups are independent. They widen every covariance, because more views do
    /// not reduce it.
    pub displaced_tags: &'a [UncertainTags],
    /// Estimated times of exposure, by which the points of the observations were moved: their uncertainty widens every covariance.
    pub time_offsets: Option<&'a TimeOffsets>,
    /// By how much a camera's pose may move under another explanation of the observations before the rig is inconsistent.
    pub tolerance: Tolerance,
}

/// Tags whose poses on their target are uncertain together.
#[derive(Debug, Clone, PartialEq)]
pub struct UncertainTags {
    /// Index of the target.
    pub target: usize,
    /// The corners of each tag as stated, target frame; points there belong to it.
    pub corners_in_target: Vec<[Point; 4]>,
    /// Covariance of the small left motions `[rotation_rad; translation_m]` of all of them, target frame, six rows for each.
    pub covariance: DMatrix<f64>,
}

/// The gate for good points, exceeded by one in ten thousand: the root of the 99.99 % quantile of χ² with two degrees of freedom.
pub const GATE_SIGMAS: f64 = 4.291_932_052_578_694;

impl Default for RigConfig<'_> {
    fn default() -> Self {
        let loss = Loss::Truncated { sigmas: GATE_SIGMAS };
        RigConfig {
            reference: 0,
            loss,
            joint_covariance: false,
            known_distances: &[],
            shared_errors: true,
            lens_errors: false,
            intrinsics: &[],
            scale_sigma: 0.0,
            displaced_tags: &[],
            time_offsets: None,
            tolerance: Tolerance::default(),
        }
    }
}

/// A measured distance between the centres of two cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownDistance {
    /// One camera.
    pub a: usize,
    /// The other.
    pub b: usize,
    /// The distance, m.
    pub distance_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

/// The number of views that each pair of cameras shares, and the groups of connected cameras.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SharedViews {
    /// `counts[a][b]`: views in which both cameras see the same body; the diagonal holds the views of each.
    pub counts: Vec<Vec<usize>>,
    /// Groups of cameras joined by chains of shared views, the largest first; one group where a rig can be solved.
    pub groups: Vec<Vec<usize>>,
}

/// A camera's pose in the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInRig {
    /// x_in_cam = cam_from_rig · x_in_rig; identity for the reference.
    pub cam_from_rig: Pose,
    /// 6×6 covariance of the small left motion `[rotation_rad; translation_m]`, camera frame; zero for the reference.
    pub covariance: Matrix6,
    /// Number of views in which it took part.
    pub n_views: usize,
    /// Number of points that it observed.
    pub n_seen: usize,
    /// Number of points that took part.
    pub n_used: usize,
    /// Root mean square reprojection error over the points used, px.
    pub rms_px: f64,
}

/// A target's pose on its body.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetOnBody {
    /// x_in_body = body_from_target · x_in_target; identity for the first target of each body.
    pub body_from_target: Pose,
    /// 6×6 covariance, body frame; zero for the first.
    pub covariance: Matrix6,
}

/// A body's pose in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyInView {
    /// The view.
    pub view: usize,
    /// The body.
    pub body: usize,
    /// x_in_rig = rig_from_body · x_in_body.
    pub rig_from_body: Pose,
    /// 6×6 covariance, rig frame, the cameras' uncertainty included.
    pub covariance: Matrix6,
    /// Number of points that took part.
    pub n_used: usize,
    /// Root mean square reprojection error over them, px.
    pub rms_px: f64,
}

/// How an observation was used.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationResult {
    /// For each of its points the residual (observed − predicted, px) and whether the point took part. None where the point cannot be projected.
    pub residuals_px: Vec<Option<(nalgebra::Vector2<f64>, bool)>>,
    /// The reason why the whole observation took no part; none where it did.
    pub rejected: Option<RejectedObservation>,
}

/// The reason why a whole observation took no part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum RejectedObservation {
    /// Its points do not determine a pose, and nothing else in the view does.
    Undetermined(Error),
    /// It contradicts the other observations: wrong labels, a moved target, a wrong view.
    Contradicts {
        /// Root mean square of its residuals, px.
        rms_px: f64,
    },
}

/// The solved rig: poses with covariances, and the fit of the observations.
#[derive(Debug, Clone, PartialEq)]
pub struct RigSolution {
    /// The camera whose frame is the rig's.
    pub reference: usize,
    /// One entry for each camera, in the order given.
    pub cameras: Vec<CameraInRig>,
    /// The parts of each camera's covariance by their sources, which add up to it.
    pub budgets: Vec<Budget>,
    /// One entry for each target, in the order given.
    pub targets: Vec<TargetOnBody>,
    /// Ordered by view, then body.
    pub bodies: Vec<BodyInView>,
    /// One entry for each observation, in the order given.
    pub observations: Vec<ObservationResult>,
    /// Shared views before any observation was rejected.
    pub shared: SharedViews,
    /// The weakest link: two groups of cameras joined by the least information. None for one camera.
    pub weakest_link: Option<WeakestLink>,
    /// The test of each target's stated size.
    pub scales: Vec<TargetScale>,
    /// Root mean square reprojection error over the points used, px.
    pub rms_px: f64,
    /// Sum of squared residuals of the points used over their variances.
    pub chi2: f64,
    /// Number of residuals used less number of unknowns.
    pub degrees_of_freedom: usize,
    /// Number of observed points, over all observations.
    pub n_seen: usize,
    /// Number of points that took part.
    pub n_used: usize,
    /// Covariance of all cameras together, 6 rows for each camera in the order given (zero for the reference), where requested.
    pub joint_covariance: Option<DMatrix<f64>>,
    /// Covariance of all targets together, 6 rows for each target in the order given (zero for the first of each body), where requested.
    pub joint_targets: Option<DMatrix<f64>>,
    /// Factor by which every covariance was widened because the residuals are larger than the stated sigmas; 1 where they agree.
    pub noise_scale: f64,
    /// Factor by which the variances were widened beyond `noise_scale`, in the mean over cameras and targets, because views contradict each
    /// other by more than their points do: errors that a whole observation shares, or neighbouring views. In a single view, because neighbouring
    /// points of a sequence are displaced together. 1 where no such error shows.
    pub view_scale: f64,
    /// The largest standard deviation of a camera's position along an axis, m, for intrinsics as uncertain as the errors on which views agree;
    /// none where nothing contradicts the intrinsics. The covariances contain it with `RigConfig::lens_errors`.
    pub lens_sigma_m: Option<f64>,
    /// Steps of the joint adjustment.
    pub steps: usize,
    /// The explanations of the observations that were tried, the most probable first, each with the motion of every camera.
    pub explanations: Vec<Weighed<RigExplanation>>,
    /// The verdict; no pose may be used where it is inconsistent.
    pub verdict: RigVerdict,
}

/// The weakest link of the camera graph.
#[derive(Debug, Clone, PartialEq)]
pub struct WeakestLink {
    /// Its end in the smaller of the two groups that it joins.
    pub camera: usize,
    /// Its other end.
    pub with: usize,
    /// Number of shared views in which both cameras have points that took part.
    pub n_shared_views: usize,
    /// Largest standard deviation of the rotation between them, rad.
    pub sigma_rad: f64,
    /// Largest standard deviation of their relative position, m.
    pub sigma_m: f64,
}

/// A target's stated size compared with all other lengths.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetScale {
    /// True size over stated size; 1 where nothing else in the rig has a length to compare with.
    pub ratio: f64,
    /// Its standard deviation; infinite where there is nothing to compare with.
    pub sigma: f64,
    /// Extent of the target as stated, m, for messages in mm.
    pub extent_m: f64,
}

impl TargetScale {
    /// Returns whether the size differs from the stated one by more than chance: three standard deviations, once in 370 cases.
    pub fn is_clearly_off(&self) -> bool {
        CLEARLY_SIGMAS * self.sigma < (self.ratio - 1.0).abs()
    }
}

/// Standard deviations.
const CLEARLY_SIGMAS: f64 = 3.0;

/// Solves for the pose of every camera in the rig, with covariances and a verdict.
///
/// # Errors
/// `NoSuchIndex`, `InvalidObservation`, `InvalidSetting`, `InvalidLoss` for bad input; `EmptyRig`; `CameraNotObserved`, `CamerasUnconnected`,
/// `TargetUnconnected` name what is missing; `NotConverged`.
pub fn solve_rig(problem: &RigProblem, config: &RigConfig) -> Result<RigSolution, Error> {
    let stated = solve_as_stated(problem, config)?;
    let stated = late::examined(problem, config, stated, solve_as_stated);
    let stated = exchanged::examined(problem, config, stated, solve_as_stated);
    Ok(faults::examined(problem, config, stated, solve_as_stated))
}

/// Returns the usual faults of a rig that [`solve_rig`] refuses: those with one of which it is solved and consistent, the most probable first.
/// docs/math/suspects.md section 5.
pub fn faults_of_unsolved(problem: &RigProblem, config: &RigConfig) -> Vec<RigExplanation> {
    faults::of_unsolved(problem, config, solve_as_stated)
}

fn solve_as_stated(problem: &RigProblem, config: &RigConfig) -> Result<RigSolution, Error> {
    uncertain_lens::check(config.intrinsics, problem.cameras)?;
    let layout = layout::Layout::new(problem, config)?;
    let located_views = sighted::poses_of_observations(&layout);
    let start = start::start(&layout, &located_views)?;
    let adjusted = adjust::adjust(&layout, &located_views, start, config)?;
    answer::answer(&layout, &located_views, adjusted, config, None)
}
