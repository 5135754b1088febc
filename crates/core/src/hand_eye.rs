//! Where a camera (or a rig) sits on the robot arm or vehicle that carries it, and where the target stands.
//!
//! check → closed forms from three views each → the views that agree → maximum likelihood over both unknown poses.
//! Derivation: docs/math/hand_eye.md.
//!
//! ```text
//!   T = X H Z   ·   T cam_from_target, measured   ·   H carrier_from_holder, known   ·   X cam_from_carrier, Z holder_from_target, wanted
//!   carrier: what the camera is fixed to   ·   holder: what the target is fixed to   ·   one is the hand, the other the base
//! ```

mod views;
mod motions;
mod closed_form;
mod cost;
mod consensus;

use crate::consistency::{FAR_ABOVE, is_unlikely, noise_scale};
use crate::rig_pose::RigView;
use crate::{Error, Matrix6, Pose, Vector6};
use consensus::Consensus;
use cost::{Fit, Level, fit};
use nalgebra::{DMatrix, Vector3};
use views::{Known, located};

pub use motions::MIN_TURN_RAD;

/// Which of the two is on the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mount {
    /// The camera moves with the hand, the target stands still ("eye in hand"): carrier = hand, holder = base.
    #[default]
    CameraOnHand,
    /// The target moves with the hand, the camera stands still ("eye to hand"): carrier = base, holder = hand.
    TargetOnHand,
}

/// A pose of the target that fits what a view shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// x_in_cam = cam_from_target · x_in_target (x_in_rig for a rig).
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// χ² above that of the view's best pose.
    pub delta_chi2: f64,
}

/// One station of the hand.
#[derive(Debug, Clone)]
pub struct HandView<'a> {
    /// Where the hand was: x_in_base = base_from_hand · x_in_hand.
    pub base_from_hand: Pose,
    /// 6×6 covariance of its small left motion, base frame; none when exact.
    pub hand_covariance: Option<Matrix6>,
    /// The poses of the target that fit this view, the best first; may be empty where `seen` is given.
    pub candidates: Vec<Candidate>,
    /// The points behind them, for each camera of the rig (one camera: a rig of one, at the identity). Where given, the answer minimises
    /// their reprojection error; where empty, the candidates stand for them.
    pub seen: &'a [RigView<'a>],
}

/// The camera's place along one direction of its carrier, where it is known: what turns about parallel axes leave open.
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
    /// What is on the hand.
    pub mount: Mount,
    /// A known coordinate of the camera's place.
    pub height: Option<Height>,
}

/// What became of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct HandViewResult {
    /// Log(measured · solved⁻¹) of the view's pose, `[rotation_rad; translation_m]`, camera frame; none without a pose.
    pub residual: Option<Vector6>,
    /// Which of its candidates agrees best with the other views.
    pub candidate: Option<usize>,
    /// Sum of squared residuals over their variances, of the pose (6 numbers), motion noise included.
    pub chi2: Option<f64>,
    /// Why it took no part.
    pub rejected: Option<RejectedView>,
}

/// Why a view took no part.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum RejectedView {
    /// The target's pose could not be found.
    Unlocated(Error),
    /// It contradicts the others: a flipped pose, a hand pose of another view, a target that moved.
    Contradicts,
}

/// Both unknown poses, how sure, and how well the views agree.
#[derive(Debug, Clone, PartialEq)]
pub struct HandEye {
    /// What was on the hand.
    pub mount: Mount,
    /// `cam_from_hand` for a camera on the hand, `cam_from_base` for a target on the hand.
    pub cam_from_carrier: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub carrier_covariance: Matrix6,
    /// `base_from_target` for a camera on the hand, `hand_from_target` for a target on the hand.
    pub holder_from_target: Pose,
    /// 6×6 covariance of its small left motion, base or hand frame.
    pub holder_covariance: Matrix6,
    /// Covariance of both motions together, 12×12, `cam_from_carrier` first.
    pub joint_covariance: DMatrix<f64>,
    /// One entry a view, in the order given.
    pub views: Vec<HandViewResult>,
    /// Views that took part.
    pub n_used: usize,
    /// Sum of squared residuals over their variances: of pixels where views came with points, else of poses.
    pub chi2: f64,
    /// Numbers used beyond the 12 unknowns.
    pub degrees_of_freedom: usize,
    /// Factor by which every covariance was widened because the residuals are larger than stated; 1 where they agree.
    pub noise_scale: f64,
    /// Whether the residuals are far larger than stated: wrong size of the target, wrong intrinsics, or motions less exact than stated.
    pub is_inconsistent: bool,
    /// Root mean square turns between used views about the three principal axes of their turning, rad, the largest first: the second decides
    /// what is known.
    pub turns_rad: [f64; 3],
}

/// The carrier and the holder from at least three stations.
///
/// # Errors
/// `InvalidPose`, `InvalidSetting` and the errors of `locate_rig` about numbers name what is wrong; `TooFewMotions` with fewer than three
/// views; `DegenerateMotion` when the hand did not turn, or only about parallel axes with no `height` given; `NotConverged`.
pub fn solve_hand_eye(views: &[HandView], config: &HandEyeConfig) -> Result<HandEye, Error> {
    let (known, mut results) = located(views, config)?;
    if known.len() < 3 {
        return Err(Error::TooFewMotions { seen: known.len(), needed: 3 });
    }
    motions::check(&known, config)?;
    let agreed = consensus::consensus(&known, config)?;
    let used = agreed.used();
    if used.len() < 3 {
        return Err(Error::TooFewMotions { seen: used.len(), needed: 3 });
    }
    // A wrong hand pose can look like a turn about another axis: asked again without those rejected.
    let kept: Vec<Known> = used.iter().map(|(view, _)| known[*view].clone()).collect();
    let turns_rad = motions::check(&kept, config)?;
    let best = fit(&agreed.poses, &known, &used, config, Level::Points)?;
    describe(&known, &agreed, &best, &mut results);
    Ok(answer(&known, config, best, results, turns_rad))
}

/// Fills in what became of the views that have a pose.
fn describe(known: &[Known], agreed: &Consensus, best: &Fit, results: &mut [HandViewResult]) {
    for (view, known) in known.iter().enumerate() {
        let (candidate, chi2) = cost::nearest(known, &best.poses);
        let measured = &known.candidates[candidate].cam_from_target;
        let (residual, _) = crate::relative::residual(measured, &best.poses.cam_from_target(known));
        let rejected = agreed.candidate[view].is_none().then_some(RejectedView::Contradicts);
        results[known.index] = HandViewResult {
            residual: Some(residual),
            candidate: Some(candidate),
            chi2: Some(chi2),
            rejected,
        };
    }
}

fn answer(
    known: &[Known],
    config: &HandEyeConfig,
    best: Fit,
    views: Vec<HandViewResult>,
    turns_rad: [f64; 3],
) -> HandEye {
    let noise_scale = noise_scale(best.chi2, best.degrees_of_freedom);
    let centre = views::centre(known);
    let (poses, covariance) = centre.undone(&best.poses, &(best.covariance * noise_scale));
    let block = |at: usize| -> Matrix6 {
        crate::pose::symmetric(&covariance.fixed_view::<6, 6>(at, at).into_owned())
    };
    let far = FAR_ABOVE * best.degrees_of_freedom as f64 <= best.chi2;
    HandEye {
        mount: config.mount,
        cam_from_carrier: poses.cam_from_carrier,
        carrier_covariance: block(0),
        holder_from_target: poses.holder_from_target,
        holder_covariance: block(6),
        n_used: views.iter().filter(|view| view.rejected.is_none()).count(),
        views,
        chi2: best.chi2,
        degrees_of_freedom: best.degrees_of_freedom,
        noise_scale,
        is_inconsistent: far && is_unlikely(best.chi2, best.degrees_of_freedom),
        turns_rad,
        joint_covariance: covariance,
    }
}
