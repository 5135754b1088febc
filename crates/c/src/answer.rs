//! `resight_answer`: everything that a job answers.

use crate::call::{done, guarded};
use crate::message::Message;
use crate::pointer::{Out, borrowed, free, slice_out};
use crate::status::{Refusal, Status};
use resight::answer::detection::DetectedPoint;
use resight::answer::{DetectionAnswer, RigPoseAnswer};
use resight::core::correspondence::Detection as CoreDetection;
use resight::core::locate::choose::Ambiguity;
use resight::core::multiview::rig_pose::RigAmbiguity;
use resight::core::{self, Matrix6};
use std::ffi::{CString, c_char};
use std::ptr::null;
use std::sync::OnceLock;

/// Everything that a job answers. It does not change: threads may share it.
pub struct Answer {
    printed: Printed,
    /// Written when it is first asked for.
    json: OnceLock<Option<CString>>,
    poses: Vec<Pose>,
    detections: Vec<Detection>,
    residuals_px: Vec<[f64; 2]>,
}

/// What the program prints.
enum Printed {
    Pose(Box<resight::PoseAnswer>),
    Detection(DetectionAnswer),
    RigPose(Box<RigPoseAnswer>),
}

/// A rigid transform between two frames with its uncertainty: x_in_b = b_from_a x_in_a. Of resight_solve and resight_locate it is
/// cam_from_target, of resight_rig_pose rig_from_target.
///
/// Camera frame: x right, y down, z forward; the frame of a rig is its file's, that of the target is that of its points.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Pose {
    /// Rotation as a unit quaternion w, x, y, z with w not negative.
    pub rotation_wxyz: [f64; 4],
    /// Translation, m: the origin of frame a seen in frame b.
    pub translation_m: [f64; 3],
    /// The homogeneous matrix (4, 4), row by row.
    pub matrix: [f64; 16],
    /// Covariance (6, 6), row by row, of a small motion `[rotation_rad; translation_m]` applied on the left, in frame b: rotations about
    /// its x, y, z, rad, then translations along them, m. Units rad², rad m, m².
    pub covariance: [f64; 36],
    /// Root mean square distance of the observed points from the projected ones, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Probability that this pose, and no other one, is the right one; NaN of a rig.
    pub probability: f64,
}

/// A point found in an image.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Detection {
    /// Id of the tag, or number of the corner or dot.
    pub id: u32,
    /// Corner of the tag: 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left; 0 of other points.
    pub corner: u32,
    /// Column; pixel (0, 0) is the centre of the top-left pixel.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard deviation of u and of v by the image.
    pub sigma_px: f64,
    /// What the lens may do besides, as a standard deviation of u and of v.
    pub lens_sigma_px: f64,
}

/// Returns the JSON object that the program prints for the job with --json, which holds everything of the answer; null for null. The text
/// lives as long as the answer. Its keys: docs/files.md, and the schema that `resight schema` prints.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_json(answer: *const Answer) -> *const c_char {
    // SAFETY: what callers promise of handles.
    guarded(null(), || unsafe { borrowed("answer", answer) }.map_or(null(), Answer::json))
}

/// Returns the number of poses: 0 where there is none, 2 where another one fits about as well; 0 for null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_n_poses(answer: *const Answer) -> usize {
    // SAFETY: what callers promise of handles.
    guarded(0, || unsafe { borrowed("answer", answer) }.map_or(0, |answer| answer.poses.len()))
}

/// Copies a pose: 0 is the answer, 1 the second pose.
///
/// Gives RESIGHT_STATUS_INVALID_ARGUMENT where there is no such pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_pose(
    answer: *const Answer,
    index: usize,
    pose: *mut Pose,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (answer, pose) = unsafe { (borrowed("answer", answer)?, Out::new("pose", pose)?) };
        let n_poses = answer.poses.len();
        let found = answer.poses.get(index).ok_or_else(|| {
            Refusal::argument(format!("index is {index}; the number of poses is {n_poses}"))
        })?;
        pose.write(*found);
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Returns the number of points that resight_detect or resight_locate found in the image; 0 for null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_n_detections(answer: *const Answer) -> usize {
    // SAFETY: what callers promise of handles.
    guarded(0, || unsafe { borrowed("answer", answer) }.map_or(0, |answer| answer.detections.len()))
}

/// Copies the points that were found into an array of `n`, which is their number: resight_answer_n_detections.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_detections(
    answer: *const Answer,
    n: usize,
    detections: *mut Detection,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let answer = unsafe { borrowed("answer", answer) }?;
        // SAFETY: the same.
        unsafe { slice_out("detections", detections, n, &answer.detections) }
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Copies the residuals of resight_solve, observed less projected pixel, into an array (n, 2), px, n as the points were given. They are NaN for
/// points that were not observed. Other answers, and those without a pose, have none (n = 0).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_residuals(
    answer: *const Answer,
    n: usize,
    residuals_px: *mut f64,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let answer = unsafe { borrowed("answer", answer) }?;
        // SAFETY: the same; two numbers in a row are laid out as one array of two.
        unsafe { slice_out("residuals_px", residuals_px.cast(), n, &answer.residuals_px) }
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Frees an answer; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_answer_free(answer: *mut Answer) {
    // SAFETY: what callers promise of handles.
    guarded((), || unsafe { free(answer) });
}

impl Pose {
    fn new(b_from_a: &core::Pose, covariance: &Matrix6, [rms_px, chi2, probability]: [f64; 3]) -> Self {
        let mut matrix = [0.0; 16];
        matrix.copy_from_slice(b_from_a.matrix().as_flattened());
        Pose {
            rotation_wxyz: b_from_a.quaternion_wxyz(),
            translation_m: b_from_a.translation.into(),
            matrix,
            covariance: std::array::from_fn(|i| covariance[(i / 6, i % 6)]),
            rms_px,
            chi2,
            probability,
        }
    }
}

impl From<&CoreDetection> for Detection {
    fn from(d: &CoreDetection) -> Self {
        Detection {
            id: d.feature.id,
            corner: d.feature.corner.into(),
            u_px: d.pixel.x,
            v_px: d.pixel.y,
            sigma_px: d.sigma_px,
            lens_sigma_px: d.lens_sigma_px,
        }
    }
}

impl From<&DetectedPoint> for Detection {
    fn from(d: &DetectedPoint) -> Self {
        Detection {
            id: d.id,
            corner: d.corner.into(),
            u_px: d.u_px,
            v_px: d.v_px,
            sigma_px: d.sigma_px,
            lens_sigma_px: d.lens_sigma_px,
        }
    }
}

impl Printed {
    fn json(&self) -> Option<CString> {
        let json = match self {
            Printed::Pose(answer) => serde_json::to_string(answer),
            Printed::Detection(answer) => serde_json::to_string(answer),
            Printed::RigPose(answer) => serde_json::to_string(answer),
        };
        CString::new(json.ok()?).ok()
    }
}

impl Answer {
    fn new(printed: Printed, poses: Vec<Pose>) -> Self {
        Answer { printed, json: OnceLock::new(), poses, detections: Vec::new(), residuals_px: Vec::new() }
    }

    fn json(&self) -> *const c_char {
        let json = self.json.get_or_init(|| self.printed.json());
        json.as_ref().map_or(null(), |json| json.as_ptr())
    }

    /// The pose of a camera, with what was found in the image, or the residuals of the points.
    pub(crate) fn of_pose(
        answer: resight::PoseAnswer,
        detections: &[CoreDetection],
        residuals_px: Vec<[f64; 2]>,
    ) -> Self {
        let mut poses = Vec::new();
        if let Some(e) = &answer.estimate {
            let own = [e.rms_px, e.chi2, e.probability];
            poses.push(Pose::new(&e.cam_from_target, &e.covariance, own));
            if let Ambiguity::Ambiguous { other, .. } = &e.ambiguity {
                let probability = e.others[0].map_or(0.0, |hypothesis| hypothesis.probability);
                let own = [other.rms_px, other.chi2, probability];
                poses.push(Pose::new(&other.cam_from_target, &other.covariance, own));
            }
        }
        let detections = detections.iter().map(Detection::from).collect();
        Answer { detections, residuals_px, ..Answer::new(Printed::Pose(Box::new(answer)), poses) }
    }

    /// The points that were found.
    pub(crate) fn of_detection(answer: DetectionAnswer) -> Self {
        let detections = answer.detections.iter().map(Detection::from).collect();
        Answer { detections, ..Answer::new(Printed::Detection(answer), Vec::new()) }
    }

    /// The pose of a rig.
    pub(crate) fn of_rig_pose(answer: RigPoseAnswer) -> Self {
        let mut poses = Vec::new();
        if let Some(e) = &answer.estimate {
            poses.push(Pose::new(&e.rig_from_target, &e.covariance, [e.rms_px, e.chi2, f64::NAN]));
            if let RigAmbiguity::Ambiguous { other, .. } = &e.ambiguity {
                let own = [other.rms_px, other.chi2, f64::NAN];
                poses.push(Pose::new(&other.rig_from_target, &other.covariance, own));
            }
        }
        Answer::new(Printed::RigPose(Box::new(answer)), poses)
    }
}
