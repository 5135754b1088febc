//! The pose of a camera (or a rig) on the robot arm or vehicle that carries it, and that of the target.
//!
//! check → closed forms from three views each → the views that agree → the gripper's noise → maximum likelihood over both unknown poses →
//! verdict
//! Derivation: docs/math/hand_eye.md.
//!
//! ```text
//!   T = X H Z   ·   T cam_from_target, measured   ·   H carrier_from_holder, known   ·   X cam_from_carrier, Z holder_from_target, wanted
//!   carrier: what the camera is fixed to   ·   holder: what the target is fixed to   ·   one is the hand, the other the base
//! ```

mod written;
mod views;
mod motions;
mod closed_form;
mod noise;
mod blocks;
mod cost;
mod consensus;
mod shared;
mod settle;
mod causes;
mod alternatives;
mod verdict;
mod budget;

use crate::budget::{Budget, ErrorSource};
use crate::explanation::{Tolerance, Weighed};
use crate::locate::consistency::measured_scale;
use crate::multiview::rig_pose::RigView;
use crate::{Camera, Correspondence, Error, Matrix6, Pose, Vector6};
use budget::budgets;
use core::cmp::Ordering;
use cost::{Fit, Level, fit};
use nalgebra::{DMatrix, Vector3};
use settle::{Effect, Settled, settled};
use shared::SharedError;
use verdict::{ByLens, CONFIRMED_GAIN, CONFIRMED_NOISE, Residuals, Verdict, judged, other_lens, pixels};

pub use causes::{HandEyeCause, HandEyeExplanation, HandEyeWarning};
pub use shared::LensError;
pub use written::{AngleUnit, RotationConvention, RotationOrder, WrittenPose};

/// The largest plausible noise of an orientation, rad (2 degrees).
pub(crate) const MAX_GRIPPER_SIGMA_RAD: f64 = 0.035;
/// The largest plausible noise of a position, relative to the larger of the gripper's travel and the distance of the target.
pub(crate) const MAX_GRIPPER_SIGMA_BY_REACH: f64 = 0.02;

/// Whether the camera or the target is on the gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mounting {
    /// The camera moves with the gripper, the target is at rest ("eye in hand"): carrier = hand, holder = base.
    #[default]
    CameraOnGripper,
    /// The target moves with the gripper, the camera is at rest ("eye to hand"): carrier = base, holder = hand.
    TargetOnGripper,
}

/// A pose of the target that fits the observations of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// x_in_cam = cam_from_target · x_in_target (x_in_rig for a rig).
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Difference between its χ² and that of the view's best pose.
    pub delta_chi2: f64,
}

/// One pose of the gripper.
#[derive(Debug, Clone)]
pub struct HandEyeView<'a> {
    /// The gripper's pose: x_in_base = base_from_gripper · x_in_hand.
    pub base_from_gripper: Pose,
    /// 6×6 covariance of its small left motion, base frame; zero when exact. `None`: its noise is estimated from the views, with one standard
    /// deviation for the orientation and one for the position of all such views.
    pub gripper_covariance: Option<Matrix6>,
    /// The gripper's pose as its file writes it, where that has three numbers of a rotation: views that contradict each other are tried with
    /// other conventions.
    pub written: Option<WrittenPose>,
    /// The poses of the target that fit this view, the best first; may be empty where `seen` is given.
    pub candidates: Vec<Candidate>,
    /// The points behind them, for each camera of the rig (one camera: a rig of one, at the identity). Where they are given, the answer
    /// minimises their reprojection error; where empty, the candidates are used instead.
    pub seen: &'a [RigView<'a>],
}

/// The camera's position along one direction of its carrier, where it is known: rotations about parallel axes do not determine it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Height {
    /// Direction in the carrier frame, of any length: for a vehicle usually its vertical axis.
    pub direction_in_carrier: Vector3<f64>,
    /// Coordinate of the camera's centre along it, from the carrier's origin, m.
    pub height_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
}

/// Settings of `solve_hand_eye`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandEyeConfig {
    /// Whether camera or target is on the gripper.
    pub mounting: Mounting,
    /// A known coordinate of the camera's position.
    pub height: Option<Height>,
    /// By how much camera and target may move under another explanation of the views before the answer is inconsistent.
    pub tolerance: Tolerance,
}

/// The result of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEyeViewResult {
    /// Log(measured · solved⁻¹) of the view's pose, `[rotation_rad; translation_m]`, camera frame; `None` without a pose.
    pub residual: Option<Vector6>,
    /// Index of the candidate that agrees best with the other views.
    pub candidate: Option<usize>,
    /// Sum of squared residuals of the pose (6 numbers) over their variances, noise of the motion included.
    pub chi2: Option<f64>,
    /// Why it took no part.
    pub rejected: Option<RejectedView>,
}

/// Why a view took no part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum RejectedView {
    /// The target's pose could not be computed.
    Unlocated(Error),
    /// It contradicts the others: a flipped pose, a gripper pose of another view, or a target that moved.
    Contradicts,
}

/// The noise of the gripper's poses as estimated from the views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripperNoise {
    /// Standard deviation of the orientation, rad per axis.
    pub sigma_rad: f64,
    /// Standard deviation of the position of the gripper's origin, m per axis.
    pub sigma_m: f64,
}

/// The target's size as measured by the gripper's motions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetSize {
    /// Measured size divided by stated size.
    pub ratio: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Both unknown poses with their uncertainty, and the agreement of the views.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEye {
    /// Whether camera or target was on the gripper.
    pub mounting: Mounting,
    /// `cam_from_hand` for a camera on the gripper, `cam_from_base` for a target on the gripper.
    pub cam_from_carrier: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub carrier_covariance: Matrix6,
    /// The parts of `carrier_covariance` by their sources, which add up to it.
    pub carrier_budget: Budget,
    /// `base_from_target` for a camera on the gripper, `gripper_from_target` for a target on the gripper.
    pub holder_from_target: Pose,
    /// 6×6 covariance of its small left motion, base or hand frame.
    pub holder_covariance: Matrix6,
    /// The parts of `holder_covariance`.
    pub holder_budget: Budget,
    /// Covariance of both motions together, 12×12, `cam_from_carrier` first.
    pub joint_covariance: DMatrix<f64>,
    /// One entry for each view, in the order given.
    pub views: Vec<HandEyeViewResult>,
    /// Number of views that took part.
    pub n_used: usize,
    /// Sum of squared residuals over their variances: of pixels if the views have points, with the variance that they show where it contradicts the stated
    /// one, else of poses.
    pub chi2: f64,
    /// Number of observations beyond the 12 unknowns.
    pub degrees_of_freedom: usize,
    /// Sum of squared residuals of the poses over their variances, the gripper's noise (stated or estimated) included.
    pub pose_chi2: f64,
    /// Number of observed pose components beyond the 12 unknowns.
    pub pose_degrees_of_freedom: usize,
    /// Factor by which every covariance was widened because the poses disagree more than their stated noise; 1 where they agree.
    pub noise_scale: f64,
    /// Factors by which the covariances of `cam_from_carrier` and `holder_from_target` were widened because neighbouring views, in time or in the gripper's
    /// pose, share errors; 1 where they do not show it.
    pub block_scale: [f64; 2],
    /// The estimated noise of the gripper; `None` where every view states its own.
    pub gripper_noise: Option<GripperNoise>,
    /// The target's size from the gripper's motions; `None` where they do not determine it.
    pub target_size: Option<TargetSize>,
    /// The same where an error of it is more probable than none, and the answer consistent: the covariance holds it.
    pub small_size: Option<TargetSize>,
    /// What of the lens is more probably wrong than right by the gripper's motions, and by which part of the focal length, where the answer is consistent:
    /// the covariance holds it.
    pub other_lens: Option<(LensError, f64)>,
    /// By how far the camera's position on its carrier moves if the intrinsics are those that the pixels fit better; `None` where they fit. The
    /// covariances hold it.
    pub lens_shift_m: Option<f64>,
    /// The explanations of the views that are probable enough, the most probable first, with the motions of camera and target: that of the camera in the
    /// carrier about its centre, that of the target in the holder about its origin.
    pub explanations: Vec<Weighed<HandEyeExplanation>>,
    /// Whether the answer is inconsistent.
    pub is_inconsistent: bool,
    /// The causes, the most likely first; empty where the answer is consistent.
    pub causes: Vec<HandEyeCause>,
    /// Root mean square rotations between used views about the three principal axes, rad, the largest first: the second determines how much is
    /// known.
    pub rotations_rad: [f64; 3],
}

/// Solves for the poses of camera and target from at least three robot poses.
///
/// # Errors
/// `InvalidPose`, `InvalidSetting` and the errors of `locate_rig` about numbers name what is wrong; `TooFewMotions` with fewer than three views;
/// `DegenerateMotion` when the gripper did not rotate, or only about parallel axes without a `height`; `ViewsDisagree` names a change that would
/// make views agree that otherwise do not.
pub fn solve_hand_eye(views: &[HandEyeView], config: &HandEyeConfig) -> Result<HandEye, Error> {
    let settled = settled(views, config).map_err(|reason| explained(reason, views, config))?;
    let (own, rays) = pixels(&settled);
    let (best, level) = finest(&settled, own, config);
    let residuals =
        Residuals { poses: (settled.fit.chi2, settled.fit.degrees_of_freedom), pixels: own, rays };
    let lens = other_lens(&settled, own).map(|lens| {
        let by_lens = by_lens(&settled, &best, views, &lens.camera, config);
        (lens, by_lens)
    });
    let shift = lens.as_ref().and_then(|(_, by_lens)| Some(by_lens.as_ref()?.shift));
    let share = shift.map(|shift| {
        let share = DMatrix::from_fn(12, 12, |i, j| shift[i] * shift[j]);
        views::centre(&settled.known).undone(&best.poses, &share).1
    });
    let unshared = settled.widened(settled.with_noise(&best.covariance));
    let verdict = judged(views, &settled, (&residuals, &unshared), lens, config);
    let mut found = answer(&settled, (&best, level), &verdict, config);
    if let Some(share) = share {
        found.add_lens(&share);
    }
    Ok(found)
}

/// Returns the minimum on pixels; where they cannot be used, as for points outside a lens's field, that on poses.
fn finest(settled: &Settled, pixels: (f64, usize), config: &HandEyeConfig) -> (Fit, Level) {
    let level = Level::Points { pixel_scale: measured_scale(pixels.0, pixels.1) };
    match fit(&settled.fit.poses, &settled.known, &settled.used(), config, level) {
        Ok(fit) => (fit, level),
        Err(_) => (settled.fit.clone(), Level::Poses),
    }
}

/// Returns by how much both poses move where every view was seen by another lens of its only camera: docs/math/budget.md eq. (19).
fn by_lens(
    settled: &Settled,
    best: &Fit,
    views: &[HandEyeView],
    lens: &Camera,
    config: &HandEyeConfig,
) -> Option<ByLens> {
    // A point outside of the field of the other lens takes no part.
    let rebased = |view: &HandEyeView| -> Vec<Correspondence> {
        let seen = view.seen.iter().flat_map(|one| one.seen);
        seen.filter_map(|c| Some(Correspondence { bearing: lens.bearing(&c.pixel).ok()?, ..*c })).collect()
    };
    let seen: Vec<Vec<Correspondence>> = views.iter().map(rebased).collect();
    let rig = |(view, seen)| -> Vec<RigView> {
        let view: &HandEyeView = view;
        let seen: &Vec<Correspondence> = seen;
        view.seen.iter().map(|one| RigView { camera: lens, seen, ..*one }).collect()
    };
    let rigs: Vec<Vec<RigView>> = views.iter().zip(&seen).map(rig).collect();
    let others: Vec<HandEyeView> = views
        .iter()
        .zip(&rigs)
        .map(|(view, seen)| HandEyeView { candidates: Vec::new(), seen, ..view.clone() })
        .collect();
    let other = settle::settled(&others, config).ok()?;
    let (other_best, _) = finest(&other, pixels(&other).0, config);
    let shift = other_best.poses.motion_from(&best.poses);
    let gain = || Some(other.log_likelihood(config)? - settled.log_likelihood(config)?);
    // Of other views ℓ is not comparable, but the noise is.
    let noise = |settled: &Settled| settled.sigmas().map_or(f64::INFINITY, |[turn, shift]| turn * shift);
    let is_confirmed = match other.used().len().cmp(&settled.used().len()) {
        Ordering::Less => noise(&other) < CONFIRMED_NOISE * noise(settled),
        Ordering::Equal => gain().is_some_and(|gain| CONFIRMED_GAIN < gain),
        Ordering::Greater => true,
    };
    shift.iter().all(|x| x.is_finite()).then_some(ByLens { shift, is_confirmed })
}

impl HandEye {
    /// Adds the product of the motion of both poses by another lens with itself, 12×12, to their covariances.
    fn add_lens(&mut self, share: &DMatrix<f64>) {
        let block = |at: usize| -> Matrix6 { share.fixed_view::<6, 6>(at, at).into_owned() };
        self.lens_shift_m = Some(share.diagonal().rows(3, 3).sum().sqrt());
        self.carrier_covariance += block(0);
        self.carrier_budget.add(ErrorSource::Lens, &block(0));
        self.holder_covariance += block(6);
        self.holder_budget.add(ErrorSource::Lens, &block(6));
        self.joint_covariance += share;
    }
}

/// Explains views that no X and Z fit, with the likely cause.
fn explained(reason: Error, views: &[HandEyeView], config: &HandEyeConfig) -> Error {
    match reason {
        Error::NotConverged { .. } => {}
        // Radians that are read as degrees look like motions without rotation.
        Error::DegenerateMotion { .. } => {
            let other = alternatives::other_convention(views, config);
            return other.map_or(reason, |convention| Error::ViewsDisagree { likely: convention.likely() });
        }
        _ => return reason,
    }
    let likely = match alternatives::of_unsettled(views, config) {
        Some(HandEyeCause::Size { .. }) => {
            "the target's size or the unit of the gripper's positions is wrong"
        }
        Some(HandEyeCause::InvertedGripper) => {
            "they agree once every pose of the gripper is inverted: gripper_from_base was given for base_from_gripper, target_from_cam for cam_from_target, or the mounting is the other one (`--eye-to-hand` is of a fixed camera that observes a target on the gripper)"
        }
        Some(HandEyeCause::QuaternionOrder) => {
            "they agree once the quaternion's numbers are read in another order"
        }
        Some(HandEyeCause::TransposedRotation) => {
            "they agree once every rotation of the gripper is transposed and its position kept"
        }
        Some(HandEyeCause::Convention(convention)) => convention.likely(),
        Some(HandEyeCause::ShiftedRows(_)) => {
            "they agree once each view takes the gripper pose of its neighbour"
        }
        _ => "check that gripper poses and images belong together",
    };
    Error::ViewsDisagree { likely }
}

/// Returns the result of each view.
fn described(settled: &Settled, best: &Fit) -> Vec<HandEyeViewResult> {
    let mut results = settled.results.clone();
    for (view, known) in settled.known.iter().enumerate() {
        let (candidate, chi2) = cost::nearest(known, &best.poses);
        let measured = &known.candidates[candidate].cam_from_target;
        let (residual, _) =
            crate::multiview::relative::residual(measured, &best.poses.cam_from_target(known));
        let rejected = settled.agreed.candidate[view].is_none().then_some(RejectedView::Contradicts);
        results[known.index] = HandEyeViewResult {
            residual: Some(residual),
            candidate: Some(candidate),
            chi2: Some(chi2),
            rejected,
        };
    }
    results
}

/// Returns the covariance of X and Z: the inverse information, plus the contributions of the uncertain noise and of errors that all views may share,
/// widened where the poses disagree more than stated, and for what neighbouring views share.
fn covariance(settled: &Settled, best: &Fit, verdict: &Verdict) -> DMatrix<f64> {
    let added = verdict.shared().map(|(probability, effect)| Verdict::added(probability, effect));
    settled.widened(added.fold(settled.with_noise(&best.covariance), |sum, one| sum + one))
}

/// Names what an explanation supposes.
fn explanation(one: &Weighed<Option<Effect>>) -> Weighed<HandEyeExplanation> {
    let what = match one.what.as_ref().map(|effect| effect.error) {
        None => HandEyeExplanation::AsStated,
        Some(SharedError::Size) => HandEyeExplanation::Size,
        Some(SharedError::Lens(error)) => HandEyeExplanation::Lens(error),
    };
    Weighed { what, log_odds: one.log_odds, probability: one.probability, motions: one.motions.clone() }
}

fn answer(
    settled: &Settled,
    (best, level): (&Fit, Level),
    verdict: &Verdict,
    config: &HandEyeConfig,
) -> HandEye {
    let (pose_chi2, pose_degrees_of_freedom) = (settled.fit.chi2, settled.fit.degrees_of_freedom);
    let covariance = covariance(settled, best, verdict);
    let centre = views::centre(&settled.known);
    let (poses, covariance) = centre.undone(&best.poses, &covariance);
    let block = |at: usize| -> Matrix6 {
        crate::pose::symmetric(&covariance.fixed_view::<6, 6>(at, at).into_owned())
    };
    let views = described(settled, best);
    let [carrier_budget, holder_budget] = budgets(settled, best, verdict, config, level);
    let (is_small, likely) = (verdict.causes.is_empty(), verdict.likely().map(|effect| effect.error));
    HandEye {
        mounting: config.mounting,
        cam_from_carrier: poses.cam_from_carrier,
        carrier_covariance: block(0),
        carrier_budget,
        holder_from_target: poses.holder_from_target,
        holder_covariance: block(6),
        holder_budget,
        n_used: views.iter().filter(|view| view.rejected.is_none()).count(),
        views,
        chi2: best.chi2,
        degrees_of_freedom: best.degrees_of_freedom,
        pose_chi2,
        pose_degrees_of_freedom,
        noise_scale: settled.noise_scale,
        block_scale: settled.block_scale,
        gripper_noise: settled.sigmas().map(|[sigma_rad, sigma_m]| GripperNoise { sigma_rad, sigma_m }),
        target_size: verdict.size,
        small_size: verdict.size.filter(|_| is_small && likely == Some(SharedError::Size)),
        other_lens: verdict.likely().filter(|_| is_small).and_then(|effect| match effect.error {
            SharedError::Lens(error) => Some((error, effect.part)),
            SharedError::Size => None,
        }),
        explanations: verdict.explanations.iter().map(explanation).collect(),
        is_inconsistent: !verdict.causes.is_empty(),
        causes: verdict.causes.clone(),
        lens_shift_m: None,
        rotations_rad: settled.rotations_rad,
        joint_covariance: covariance,
    }
}
