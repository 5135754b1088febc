//! The answer of the job that finds where a camera is mounted on a robot, and the JSON object that it becomes.

use super::placed::UncertainObject;
use super::{SchemaNumber, Status, Unsolved};
use crate::core::multiview::hand_eye::{
    HandEye, HandEyeCause, HandEyeExplanation, HandEyeViewResult, HandEyeWarning, Mounting,
    RejectedView as Rejection,
};
use crate::report::explanation::{Named, WeighedExplanation};
use crate::report::verdict::{Verdict, figures};
use crate::report::words::length;
use crate::rig::relative::UncertainPose;
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// Where the camera is mounted, or why that is not known. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum HandEyeAnswer {
    /// The poses; the status states whether they can be trusted.
    Solved(Box<SolvedHandEye>),
    /// Why there are none.
    Unsolved(Unsolved),
}

/// A hand–eye calibration with everything needed to report it.
#[derive(Debug, Clone)]
pub struct SolvedHandEye {
    /// The solution.
    pub solution: HandEye,
    /// Name of the observer in the poses: `cam`, or `rig` for several cameras.
    pub eye: &'static str,
    /// The names of the solution's views.
    pub views: Vec<String>,
    /// Views that never took part, with the reasons.
    pub left_out: Vec<(String, String)>,
    /// Why the rig of several cameras is inconsistent; `None` where it is consistent, or where there is one camera.
    pub rig_contradiction: Option<String>,
    /// Sizes of the target and positions of the robot that are implausible in metres: with one, an answer that would be `ok` is `implausible`.
    pub sizes: Vec<String>,
    /// What is unusual about files and observations.
    pub remarks: Vec<String>,
}

/// How well one view agrees with all.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ViewAgreement {
    /// Its name.
    pub view: String,
    /// Rotation between the view's pose and the solved one, rad; none without a pose.
    pub residual_rad: Option<f64>,
    /// Translation between them, metres.
    pub residual_m: Option<f64>,
    /// Sum of squared residuals of the pose over their variances.
    pub chi2: Option<f64>,
    /// Whether it took part.
    pub is_used: bool,
}

/// A view that took no part.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RejectedView {
    /// Its name.
    pub view: String,
    /// Why.
    pub reason: String,
}

impl HandEyeAnswer {
    /// Returns whether the answer may be relied on.
    pub fn status(&self) -> Status {
        match self {
            HandEyeAnswer::Solved(solved) => solved.status(),
            HandEyeAnswer::Unsolved(unsolved) => unsolved.status,
        }
    }

    /// Returns the poses, where there are any.
    pub fn solved(&self) -> Option<&SolvedHandEye> {
        match self {
            HandEyeAnswer::Solved(solved) => Some(solved),
            HandEyeAnswer::Unsolved(_) => None,
        }
    }
}

impl SolvedHandEye {
    /// Returns whether the poses may be relied on; they are no better than the rig that they rest on.
    pub fn status(&self) -> Status {
        self.verdict().status
    }

    fn verdict(&self) -> Verdict {
        let status = match self.solution.is_inconsistent || self.rig_contradiction.is_some() {
            true => Status::Inconsistent,
            false => Status::Ok,
        };
        Verdict { status, message: self.agreement() }.with_sizes(&self.sizes)
    }

    /// Returns the names of the two poses: `cam_from_gripper` and `base_from_target`, or, for a camera at rest, `cam_from_base` and
    /// `gripper_from_target`; with `rig` instead of `cam` where several cameras observe.
    pub fn pose_names(&self) -> (String, &'static str) {
        match self.solution.mounting {
            Mounting::CameraOnGripper => (format!("{}_from_gripper", self.eye), "base_from_target"),
            Mounting::TargetOnGripper => (format!("{}_from_base", self.eye), "gripper_from_target"),
        }
    }

    /// Returns how well each view agrees with the solution of all views.
    pub fn agreements(&self) -> Vec<ViewAgreement> {
        let view = |(name, result): (&String, &HandEyeViewResult)| ViewAgreement {
            view: name.clone(),
            residual_rad: result.residual.map(|r| r.fixed_rows::<3>(0).norm()),
            residual_m: result.residual.map(|r| r.fixed_rows::<3>(3).norm()),
            chi2: result.chi2,
            is_used: result.rejected.is_none(),
        };
        self.views.iter().zip(&self.solution.views).map(view).collect()
    }

    /// Returns the views without a counterpart, then those that the solver left out.
    pub fn rejected(&self) -> Vec<RejectedView> {
        let before = self
            .left_out
            .iter()
            .map(|(view, reason)| RejectedView { view: view.clone(), reason: reason.clone() });
        let solver = self.views.iter().zip(&self.solution.views).filter_map(|(view, result)| {
            let reason = rejection(result.rejected.as_ref()?);
            Some(RejectedView { view: view.clone(), reason })
        });
        before.chain(solver).collect()
    }

    /// Explains why the answer cannot be trusted, the likely cause first.
    pub fn causes(&self) -> Vec<String> {
        let of_rig = self.rig_contradiction.iter();
        let of_rig = of_rig.map(|sentence| format!("the rig of cameras is inconsistent: {sentence}"));
        of_rig.chain(self.solution.causes.iter().map(HandEyeCause::to_string)).collect()
    }

    /// Returns the explanations of the views with the motions of both poses, the most probable first.
    pub fn explanations(&self) -> Vec<WeighedExplanation> {
        let (carrier, holder) = self.pose_names();
        let poses = [carrier, holder.to_string()];
        let named = |what: HandEyeExplanation| match what {
            HandEyeExplanation::Size => {
                Named { key: "target_size", of: None, words: "another size of the target".into() }
            }
            HandEyeExplanation::Lens(error) => {
                Named { key: "lens", of: None, words: format!("another value of {error}") }
            }
            _ => Named::as_stated(),
        };
        let all = self.solution.explanations.iter();
        all.map(|one| WeighedExplanation::of(one, named(one.what), &poses)).collect()
    }

    /// Returns one line: how many views agree, or the likely cause why the answer cannot be trusted.
    pub fn message(&self) -> String {
        self.verdict().message
    }

    fn agreement(&self) -> String {
        let found = &self.solution;
        let used = format!("{} of {} views agree", found.n_used, found.views.len());
        if let Some(cause) = self.causes().first() {
            return format!("not to be believed ({used}): {cause}");
        }
        let widened: String = found.warnings().iter().filter_map(widened).collect();
        used + &widened
    }

    fn json(&self) -> HandEyeObject {
        let found = &self.solution;
        let (carrier, holder) = self.pose_names();
        let pose = |b_from_a, covariance, budget| {
            UncertainObject::of(&UncertainPose { b_from_a, covariance }).with_budget(budget)
        };
        let poses = BTreeMap::from([
            (carrier, pose(found.cam_from_carrier, found.carrier_covariance, &found.carrier_budget)),
            (
                holder.to_string(),
                pose(found.holder_from_target, found.holder_covariance, &found.holder_budget),
            ),
        ]);
        let Verdict { status, message } = self.verdict();
        HandEyeObject {
            schema: SchemaNumber,
            status,
            mounting: if found.mounting == Mounting::CameraOnGripper { "eye_in_hand" } else { "eye_to_hand" },
            poses,
            n_views: found.views.len(),
            n_used: found.n_used,
            chi2: found.chi2,
            degrees_of_freedom: found.degrees_of_freedom,
            pose_chi2: found.pose_chi2,
            pose_degrees_of_freedom: found.pose_degrees_of_freedom,
            noise_scale: found.noise_scale,
            block_scale: found.block_scale,
            robot_noise: found
                .gripper_noise
                .map(|noise| RobotNoiseObject { sigma_rad: noise.sigma_rad, sigma_m: noise.sigma_m }),
            target_size: found
                .target_size
                .map(|size| TargetSizeObject { ratio: size.ratio, sigma: size.sigma }),
            rotations_rad: found.rotations_rad,
            views: self.agreements(),
            rejected: self.rejected(),
            causes: self.causes(),
            explanations: self.explanations(),
            remarks: self.remarks.clone(),
            message,
        }
    }
}

/// Describes a doubt for which every ± was widened; the others have sentences of their own.
fn widened(doubt: &HandEyeWarning) -> Option<String> {
    match doubt {
        HandEyeWarning::Residuals(times) => Some(format!(
            "; residuals are {} times what the sigmas say, and every ± is widened by as much",
            figures(*times)
        )),
        HandEyeWarning::SharedInBlock(times) => Some(format!(
            "; neighbouring views share errors, and the ± is up to {} times as large for them",
            figures(*times)
        )),
        HandEyeWarning::Size(size) => Some(format!(
            "; the target seems {:.2} % ± {:.2} % {} than stated, and every ± holds that",
            100.0 * (size.ratio - 1.0).abs(),
            100.0 * size.sigma,
            if 1.0 < size.ratio { "larger" } else { "smaller" }
        )),
        HandEyeWarning::OtherLens(error, part) => Some(format!(
            "; {error} seems {:.2} % {} than stated, and every ± holds that",
            100.0 * part.abs(),
            if 0.0 < *part { "larger" } else { "smaller" }
        )),
        HandEyeWarning::Lens(shift_m) => Some(format!(
            "; the pixels do not quite fit the intrinsics, and every ± holds the {} by which that moves the camera",
            length(*shift_m)
        )),
        HandEyeWarning::Cause(_) | HandEyeWarning::LeftOut(_) => None,
    }
}

fn rejection(reason: &Rejection) -> String {
    match reason {
        Rejection::Unlocated(reason) => reason.to_string(),
        Rejection::Contradicts => {
            "contradicts the other views: a flipped pose, a robot pose of another view, or a target that moved".into()
        }
        _ => "took no part".into(),
    }
}

impl Serialize for SolvedHandEye {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.json().serialize(serializer)
    }
}

#[derive(Serialize, JsonSchema)]
pub(super) struct HandEyeObject {
    schema: SchemaNumber,
    status: Status,
    mounting: &'static str,
    /// `cam_from_gripper` (or `rig_from_gripper`, `cam_from_base`, `rig_from_base`) and `base_from_target` (or `gripper_from_target`).
    #[serde(flatten)]
    poses: BTreeMap<String, UncertainObject>,
    n_views: usize,
    n_used: usize,
    chi2: f64,
    degrees_of_freedom: usize,
    pose_chi2: f64,
    pose_degrees_of_freedom: usize,
    noise_scale: f64,
    /// The factors of the covariances of both poses for errors that neighbouring views share.
    block_scale: [f64; 2],
    /// The robot's noise where it was estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    robot_noise: Option<RobotNoiseObject>,
    /// The target's size by the robot's motions, over the stated one.
    #[serde(skip_serializing_if = "Option::is_none")]
    target_size: Option<TargetSizeObject>,
    /// Root mean square rotation between views about three axes, the largest first.
    rotations_rad: [f64; 3],
    views: Vec<ViewAgreement>,
    rejected: Vec<RejectedView>,
    /// Why the answer is not to be believed, the likely cause first.
    causes: Vec<String>,
    /// What explains the views, the most probable first.
    explanations: Vec<WeighedExplanation>,
    /// What is unusual about files and observations.
    remarks: Vec<String>,
    message: String,
}

/// Standard deviations per axis.
#[derive(Serialize, JsonSchema)]
struct RobotNoiseObject {
    sigma_rad: f64,
    sigma_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct TargetSizeObject {
    ratio: f64,
    sigma: f64,
}
