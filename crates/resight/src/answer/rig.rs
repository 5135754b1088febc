//! The answer of the jobs that solve a rig, and the JSON object that it becomes.

mod rejected;
mod views;

use super::budget::{BudgetPartObject, parts};
use super::placed::{JointObject, UncertainObject};
use super::{SchemaNumber, Status, TransformObject, Unsolved, rows};
use crate::core::Pose;
use crate::core::multiview::rig::{CameraInRig, Cause, RigSolution, TargetOnBody, TargetScale};
use crate::formats::{JointCovariance, WriteError, own_rig_file, status_keys};
use crate::report::explanation::WeighedExplanation;
use crate::report::rig::{
    camera_status, rig_camera_sentence, rig_explanations, rig_status, rig_verdict, rig_verdict_sentence,
    scale_sentences,
};
use crate::report::verdict::Verdict;
use crate::report::words::{distance_sigma_m, sigmas, translation_sigma_m};
use crate::rig::relative::{InWorld, UncertainPose, between};
use crate::rig::{InputFile, LeftOut, LensChange, RigRun};
use rejected::RejectedObject;
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use views::ViewObject;

/// A rig, or why there is none. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum RigAnswer {
    /// The rig; its status says whether it can be believed.
    Solved(Box<SolvedRig>),
    /// Why there is none.
    Unsolved(Unsolved),
}

/// A rig with everything needed to report it.
#[derive(Debug, Clone)]
pub struct SolvedRig {
    /// The request, the solution, the files and the command line.
    pub run: RigRun,
    /// For each observation of a target: the view in which it was taken.
    pub taken_in: Vec<String>,
    /// For each observation of a target: the names of its points.
    pub points: Vec<Vec<String>>,
    /// The pose of the rig in the frame of the target at rest.
    pub in_world: Option<InWorld>,
    /// Name of that target.
    pub world_target: Option<String>,
    /// What never took part, with the reasons.
    pub left_out: Vec<LeftOut>,
    /// Number of frames without a counterpart from another camera.
    pub n_alone: usize,
    /// What is unusual about files and observations.
    pub remarks: Vec<String>,
    /// Whether the JSON object holds the covariance of all cameras together.
    pub joint_covariance: bool,
}

impl RigAnswer {
    /// Returns whether the answer may be relied on.
    pub fn status(&self) -> Status {
        match self {
            RigAnswer::Solved(solved) => solved.status(),
            RigAnswer::Unsolved(unsolved) => unsolved.status,
        }
    }

    /// Returns the rig, where there is one.
    pub fn solved(&self) -> Option<&SolvedRig> {
        match self {
            RigAnswer::Solved(solved) => Some(solved),
            RigAnswer::Unsolved(_) => None,
        }
    }
}

impl SolvedRig {
    /// Returns whether the rig may be relied on.
    pub fn status(&self) -> Status {
        rig_status(&self.run)
    }

    /// Writes the file of cameras with poses and covariances that other commands read (TOML), with the status in its first line.
    ///
    /// # Errors
    /// A lens that the format cannot hold.
    pub fn file(&self) -> Result<String, WriteError> {
        let file = own_rig_file(&self.run.placed_cameras(), self.joint())?;
        let why = rig_verdict_sentence(&self.run).or_else(|| self.run.rig.size_remarks().into_iter().next());
        Ok(with_status(&file, self.status(), why.as_deref()))
    }

    /// Returns the covariance of all cameras together, where it is known.
    pub fn joint(&self) -> Option<JointCovariance> {
        let matrix = self.run.solution.joint_covariance.as_ref()?;
        let cameras: Vec<String> = self.run.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
        Some(JointCovariance::of(&cameras, matrix))
    }
}

/// Adds the status as the first line of a camera file; commands that read the file repeat it.
pub(super) fn with_status(file: &str, status: Status, why: Option<&str>) -> String {
    // A single camera without a pose is not a rig and needs no status.
    match file.contains("[[") {
        true => format!("{}{file}", status_keys(status.name(), why)),
        false => file.to_owned(),
    }
}

impl Serialize for SolvedRig {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        object(self).serialize(serializer)
    }
}

/// One rig.
#[derive(Serialize, JsonSchema)]
pub(super) struct RigObject {
    schema: SchemaNumber,
    status: Status,
    /// What contradicts, and the likely cause; null where nothing does.
    contradiction: Option<String>,
    /// What explains the observations, the most probable first.
    explanations: Vec<WeighedExplanation>,
    reference: String,
    rms_px: f64,
    chi2: f64,
    degrees_of_freedom: usize,
    noise_scale: f64,
    /// Variances beyond that, for errors that whole observations or neighbouring views share.
    view_scale: f64,
    /// The largest standard deviation of a place with intrinsics as uncertain as views agree that they are off.
    lens_sigma_m: Option<f64>,
    /// When the cameras exposed, where frames have time stamps and a target moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    times: Option<TimesObject>,
    n_views: usize,
    n_seen: usize,
    n_used: usize,
    n_rejected: usize,
    n_frames_alone: usize,
    cameras: BTreeMap<String, CameraObject>,
    pairs: Vec<PairObject>,
    rejected: Vec<RejectedObject>,
    weakest_link: Option<WeakestLinkObject>,
    scale: ScaleObject,
    targets: BTreeMap<String, TargetObject>,
    views: Vec<ViewObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<WorldObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointObject>,
    inputs: Vec<InputObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    command: Option<String>,
    message: String,
}

#[derive(Serialize, JsonSchema)]
struct CameraObject {
    status: Status,
    /// Null where nothing is wrong with it.
    cause: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    cam_from_rig: TransformObject,
    rig_from_cam: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    /// Of the translation of `cam_from_rig` itself, which a rotation changes too.
    sigma_translation_m: [f64; 3],
    /// The parts of `covariance` by the sources of the errors; empty for the reference.
    budget: Vec<BudgetPartObject>,
    /// Views in which it took part, of those in which it saw something.
    n_views: usize,
    n_views_seen: usize,
    n_observations_rejected: usize,
    n_seen: usize,
    n_used: usize,
    n_rejected: usize,
    rms_px: f64,
    /// Where the lenses were adjusted with the rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<LensObject>,
    /// By how much it exposes later than its stamps say, beside the camera with an offset of 0; absent where no motion shows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_offset: Option<TimeObject>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world_from_cam: Option<UncertainObject>,
}

/// A lens that was adjusted with the rig.
#[derive(Serialize, JsonSchema)]
struct LensObject {
    model: &'static str,
    /// By the names of the model.
    parameters: BTreeMap<&'static str, ParameterObject>,
    /// Difference from the camera file over the image, apart from a rotation of the camera.
    moved_rms_px: Option<f64>,
    moved_largest_px: Option<f64>,
    /// Standard deviation of the projection over the image, root mean square.
    sigma_px: Option<f64>,
    /// Squared distance from the stated intrinsics in units of what their covariance and the rig's allow; null where none was stated.
    chi2_from_stated: Option<f64>,
    degrees_of_freedom: Option<usize>,
    /// Distance and angle of the camera from its pose with the camera files as they are.
    moved_camera_m: Option<f64>,
    moved_camera_rad: Option<f64>,
}

/// A time, s, with its standard deviation.
#[derive(Serialize, JsonSchema)]
struct TimeObject {
    value_s: f64,
    sigma_s: f64,
}

impl TimeObject {
    fn of((value_s, sigma_s): (f64, f64)) -> Self {
        TimeObject { value_s, sigma_s }
    }
}

/// What time stamps and a moving target say.
#[derive(Serialize, JsonSchema)]
struct TimesObject {
    /// `each` stamp is taken at its word, or only the `mean` of a camera's, because they scatter more than the exposures.
    stamps: &'static str,
    /// By how much χ² is lower than with all frames of a view taken at once, in units of the noise.
    gain_chi2: f64,
    /// From one row of a rolling shutter to the next, where asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    line_time: Option<TimeObject>,
}

#[derive(Serialize, JsonSchema)]
struct ParameterObject {
    value: f64,
    sigma: f64,
}

#[derive(Serialize, JsonSchema)]
struct PairObject {
    a: String,
    b: String,
    n_shared_views: usize,
    n_shared_views_used: usize,
    b_from_a: TransformObject,
    covariance: Option<[[f64; 6]; 6]>,
    sigma_rad: Option<[f64; 3]>,
    sigma_m: Option<[f64; 3]>,
    /// Of the translation of `b_from_a` itself, which a rotation changes too.
    sigma_translation_m: Option<[f64; 3]>,
    distance_m: f64,
    /// Of the distance.
    sigma_distance_m: Option<f64>,
}

#[derive(Serialize, JsonSchema)]
struct WeakestLinkObject {
    camera: String,
    with: String,
    n_shared_views: usize,
    sigma_rad: f64,
    sigma_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct ScaleObject {
    message: String,
    targets: BTreeMap<String, TargetScaleObject>,
}

/// True size over stated size; null where nothing in the rig has a length to compare with.
#[derive(Serialize, JsonSchema)]
struct TargetScaleObject {
    ratio: Option<f64>,
    sigma: Option<f64>,
    extent_m: f64,
}

#[derive(Serialize, JsonSchema)]
struct TargetObject {
    body: usize,
    /// Of the first target of its body.
    body_frame: String,
    body_from_target: UncertainObject,
}

#[derive(Serialize, JsonSchema)]
struct WorldObject {
    target: String,
    world_from_rig: UncertainObject,
}

#[derive(Serialize, JsonSchema)]
struct InputObject {
    path: String,
    sha256: String,
}

fn object(solved: &SolvedRig) -> RigObject {
    let s = &solved.run.solution;
    let Verdict { status, message } = rig_verdict(&solved.run);
    RigObject {
        schema: SchemaNumber,
        status,
        contradiction: rig_verdict_sentence(&solved.run),
        explanations: rig_explanations(&solved.run),
        reference: camera_name(solved, s.reference),
        rms_px: s.rms_px,
        chi2: s.chi2,
        degrees_of_freedom: s.degrees_of_freedom,
        noise_scale: s.noise_scale,
        view_scale: s.view_scale,
        lens_sigma_m: s.lens_sigma_m,
        times: solved.run.times.as_ref().map(|times| TimesObject {
            stamps: if times.stamps_count { "each" } else { "mean" },
            gain_chi2: times.gain_chi2,
            line_time: times.line_time_s.map(TimeObject::of),
        }),
        n_views: solved.run.rig.views.len(),
        n_seen: s.n_seen,
        n_used: s.n_used,
        n_rejected: s.n_seen - s.n_used,
        n_frames_alone: solved.n_alone,
        cameras: cameras(solved),
        pairs: pairs(solved),
        rejected: rejected::rejected(solved),
        weakest_link: weakest_link(solved),
        scale: scale(solved),
        targets: targets(solved),
        views: views::views(solved),
        world: world(solved),
        joint_covariance: joint(solved),
        inputs: solved.run.inputs.iter().map(input).collect(),
        command: solved.run.command.clone(),
        message,
    }
}

/// Returns one word for the likely cause.
fn cause_word(cause: Cause) -> &'static str {
    match cause {
        Cause::Intrinsics => "intrinsics",
        Cause::ExchangedIntrinsics { .. } => "exchanged_intrinsics",
        Cause::Contradiction => "contradiction",
        Cause::Target => "target",
        Cause::Size => "size",
        Cause::Reference => "reference",
        _ => "noise",
    }
}

fn camera_name(solved: &SolvedRig, camera: usize) -> String {
    solved.run.rig.cameras[camera].name.clone()
}

fn target_name(solved: &SolvedRig, target: usize) -> String {
    solved.run.rig.targets[target].name.clone()
}

fn cameras(solved: &SolvedRig) -> BTreeMap<String, CameraObject> {
    let object = |(i, c): (usize, &CameraInRig)| {
        let (sigma_rad, sigma_m) = sigmas(&c.covariance);
        let (losses, n_views_seen) =
            (&solved.run.solution.verdict.cameras[i], solved.run.solution.shared.counts[i][i]);
        let object = CameraObject {
            status: camera_status(&solved.run, i),
            cause: losses.cause.map(cause_word),
            message: rig_camera_sentence(&solved.run, i),
            cam_from_rig: c.cam_from_rig.into(),
            rig_from_cam: c.cam_from_rig.inverse().into(),
            covariance: rows(&c.covariance),
            sigma_rad,
            sigma_m,
            sigma_translation_m: translation_sigma_m(&c.cam_from_rig, &c.covariance),
            budget: solved.run.solution.budgets.get(i).map(parts).unwrap_or_default(),
            n_views: c.n_views,
            n_views_seen,
            n_observations_rejected: losses.n_lost,
            n_seen: c.n_seen,
            n_used: c.n_used,
            n_rejected: c.n_seen - c.n_used,
            rms_px: c.rms_px,
            lens: solved.run.lenses.get(i).map(|change| lens(solved, i, change)),
            time_offset: solved.run.times.as_ref().and_then(|times| times.offset_s[i]).map(TimeObject::of),
            world_from_cam: solved.in_world.as_ref().map(|w| UncertainObject::of(&w.world_from_cam[i])),
        };
        (camera_name(solved, i), object)
    };
    solved.run.solution.cameras.iter().enumerate().map(object).collect()
}

fn lens(solved: &SolvedRig, camera: usize, change: &LensChange) -> LensObject {
    let named = &solved.run.rig.cameras[camera];
    let sigma = |i: usize| {
        let variance = named.intrinsics_covariance.as_ref().map_or(0.0, |covariance| covariance[(i, i)]);
        variance.max(0.0).sqrt()
    };
    let parameters = named.camera.parameters().into_iter().enumerate();
    LensObject {
        model: named.camera.model_name(),
        parameters: parameters
            .map(|(i, (name, value))| (name, ParameterObject { value, sigma: sigma(i) }))
            .collect(),
        moved_rms_px: change.moved.map(|moved| moved.rms_px),
        moved_largest_px: change.moved.map(|moved| moved.largest_px),
        sigma_px: change.sigma_px,
        chi2_from_stated: change.from_stated.map(|(chi2, _)| chi2),
        degrees_of_freedom: change.from_stated.map(|(_, n)| n),
        moved_camera_m: change.moved_camera.map(|(m, _)| m),
        moved_camera_rad: change.moved_camera.map(|(_, rad)| rad),
    }
}

/// Returns every pair of cameras: those that share views, and those that are connected through others.
fn pairs(solved: &SolvedRig) -> Vec<PairObject> {
    let s = &solved.run.solution;
    let n = s.cameras.len();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    pairs.map(|(a, b)| pair(solved, a, b)).collect()
}

fn pair(solved: &SolvedRig, a: usize, b: usize) -> PairObject {
    let s = &solved.run.solution;
    let known = between(s, a, b);
    let b_from_a: Pose = s.cameras[b].cam_from_rig * s.cameras[a].cam_from_rig.inverse();
    let sigma = known.as_ref().map(|pose| sigmas(&pose.covariance));
    PairObject {
        a: camera_name(solved, a),
        b: camera_name(solved, b),
        n_shared_views: s.shared.counts[a][b],
        n_shared_views_used: s.verdict.used_views[a][b],
        b_from_a: b_from_a.into(),
        sigma_translation_m: known.as_ref().map(|pose| translation_sigma_m(&b_from_a, &pose.covariance)),
        sigma_distance_m: known.as_ref().map(|pose| distance_sigma_m(&b_from_a, &pose.covariance).1),
        covariance: known.map(|pose| rows(&pose.covariance)),
        sigma_rad: sigma.map(|s| s.0),
        sigma_m: sigma.map(|s| s.1),
        distance_m: b_from_a.translation.norm(),
    }
}

fn weakest_link(solved: &SolvedRig) -> Option<WeakestLinkObject> {
    solved.run.solution.weakest_link.as_ref().map(|link| WeakestLinkObject {
        camera: camera_name(solved, link.camera),
        with: camera_name(solved, link.with),
        n_shared_views: link.n_shared_views,
        sigma_rad: link.sigma_rad,
        sigma_m: link.sigma_m,
    })
}

fn scale(solved: &SolvedRig) -> ScaleObject {
    let object = |scale: &TargetScale| TargetScaleObject {
        ratio: Some(scale.ratio).filter(|_| scale.sigma.is_finite()),
        sigma: Some(scale.sigma).filter(|sigma| sigma.is_finite()),
        extent_m: scale.extent_m,
    };
    let scales = solved.run.solution.scales.iter().enumerate();
    let targets = scales.map(|(i, scale)| (target_name(solved, i), object(scale))).collect();
    ScaleObject { message: scale_sentences(&solved.run).join(" "), targets }
}

fn targets(solved: &SolvedRig) -> BTreeMap<String, TargetObject> {
    let rig = &solved.run.rig;
    let object = |(i, on_body): (usize, &TargetOnBody)| {
        let body = rig.body_of_target[i];
        let pose = UncertainPose { b_from_a: on_body.body_from_target, covariance: on_body.covariance };
        let body_frame = first_target(solved, body);
        (
            target_name(solved, i),
            TargetObject { body, body_frame, body_from_target: UncertainObject::of(&pose) },
        )
    };
    solved.run.solution.targets.iter().enumerate().map(object).collect()
}

/// Returns the target whose frame is the frame of the body.
fn first_target(solved: &SolvedRig, body: usize) -> String {
    let rig = &solved.run.rig;
    rig.targets.iter().find(|target| target.body == body).map_or_else(String::new, |t| t.name.clone())
}

fn world(solved: &SolvedRig) -> Option<WorldObject> {
    let world = solved.in_world.as_ref()?;
    let target = solved.world_target.clone()?;
    Some(WorldObject { target, world_from_rig: UncertainObject::of(&world.world_from_rig) })
}

fn input(input: &InputFile) -> InputObject {
    InputObject { path: input.path.clone(), sha256: input.sha256.clone() }
}

/// Returns the joint covariance, six rows for each camera, where it was asked for.
fn joint(solved: &SolvedRig) -> Option<JointObject> {
    let RigSolution { joint_covariance: Some(matrix), .. } = &solved.run.solution else { return None };
    let cameras = || solved.run.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    solved.joint_covariance.then(|| JointObject::of(cameras(), matrix))
}
