//! The rig as the command line's contract prints it.

use super::solving::{Solved, Unsolved, rejection};
use nalgebra::DMatrix;
use resight::answer::pose::{TransformObject, rows};
use resight::core::Pose;
use resight::core::rig::{CameraInRig, Cause, RigSolution, SightingResult, TargetScale};
use resight::formats::JointCovariance;
use resight::report::rig::{camera_status, rig_camera_sentence, rig_status, rig_verdict_sentence};
use resight::report::words::sigmas;
use resight::rig::InputFile;
use resight::rig::relative::{UncertainPose, between};
use serde::Serialize;
use std::collections::BTreeMap;

/// One rig.
#[derive(Serialize)]
pub struct RigObject {
    status: &'static str,
    /// What contradicts, and the likely cause; null where nothing does.
    contradiction: Option<String>,
    reference: String,
    rms_px: f64,
    chi2: f64,
    dof: usize,
    noise_scale: f64,
    /// Variances beyond that, for errors that whole sightings share.
    view_scale: f64,
    /// The largest standard deviation of a place with intrinsics as uncertain as views agree that they are off.
    lens_sigma_m: Option<f64>,
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
    command: String,
    message: String,
}

#[derive(Serialize)]
struct CameraObject {
    status: &'static str,
    /// Null where nothing is wrong with it.
    cause: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    cam_from_rig: TransformObject,
    rig_from_cam: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    /// Views in which it took part, of those in which it saw something.
    n_views: usize,
    n_views_seen: usize,
    n_sightings_rejected: usize,
    n_seen: usize,
    n_used: usize,
    n_rejected: usize,
    rms_px: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    world_from_cam: Option<UncertainObject>,
}

/// A pose with its covariance.
#[derive(Serialize)]
struct UncertainObject {
    #[serde(flatten)]
    pose: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
}

#[derive(Serialize)]
struct PairObject {
    a: String,
    b: String,
    n_shared_views: usize,
    n_shared_views_used: usize,
    b_from_a: TransformObject,
    covariance: Option<[[f64; 6]; 6]>,
    sigma_rad: Option<[f64; 3]>,
    sigma_m: Option<[f64; 3]>,
    distance_m: f64,
}

#[derive(Serialize)]
struct RejectedObject {
    /// `frame`, `sighting` or `point`.
    kind: &'static str,
    camera: String,
    view: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    residual_px: Option<f64>,
    reason: String,
}

#[derive(Serialize)]
struct WeakestLinkObject {
    camera: String,
    with: String,
    n_shared_views: usize,
    sigma_rad: f64,
    sigma_m: f64,
}

#[derive(Serialize)]
struct ScaleObject {
    message: String,
    targets: BTreeMap<String, TargetScaleObject>,
}

/// True size over stated size; null where nothing in the rig has a length to compare with.
#[derive(Serialize)]
struct TargetScaleObject {
    ratio: Option<f64>,
    sigma: Option<f64>,
    extent_m: f64,
}

#[derive(Serialize)]
struct TargetObject {
    body: usize,
    /// Of the first target of its body.
    body_frame: String,
    body_from_target: UncertainObject,
}

#[derive(Serialize)]
struct ViewObject {
    view: String,
    n_seen: usize,
    n_used: usize,
    rms_px: Option<f64>,
    cameras: BTreeMap<String, SeenObject>,
    bodies: Vec<BodyObject>,
}

#[derive(Serialize, Default)]
struct SeenObject {
    n_seen: usize,
    n_used: usize,
    rms_px: Option<f64>,
}

#[derive(Serialize)]
struct BodyObject {
    body: usize,
    /// Of the first target of the body.
    target: String,
    rig_from_target: TransformObject,
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    n_used: usize,
    rms_px: f64,
}

#[derive(Serialize)]
struct WorldObject {
    target: String,
    world_from_rig: UncertainObject,
}

#[derive(Serialize)]
pub struct JointObject {
    /// Six rows each.
    cameras: Vec<String>,
    matrix: Vec<Vec<f64>>,
}

#[derive(Serialize)]
struct InputObject {
    path: String,
    sha256: String,
}

/// No rig, and why.
#[derive(Serialize)]
pub struct RefusalObject {
    status: &'static str,
    message: String,
    groups: Vec<Vec<String>>,
}

/// As `RefusalObject`.
pub fn refusal(reason: &Unsolved) -> RefusalObject {
    RefusalObject { status: reason.status, message: reason.message.clone(), groups: reason.groups.clone() }
}

/// As `RigObject`; the covariance of all cameras together only on request, it grows with their square.
pub fn object(solved: &Solved, with_joint: bool) -> RigObject {
    let s = &solved.run.solution;
    RigObject {
        status: rig_status(s).name(),
        contradiction: rig_verdict_sentence(&solved.run),
        reference: camera_name(solved, s.reference),
        rms_px: s.rms_px,
        chi2: s.chi2,
        dof: s.degrees_of_freedom,
        noise_scale: s.noise_scale,
        view_scale: s.view_scale,
        lens_sigma_m: s.lens_sigma_m,
        n_views: solved.run.rig.views.len(),
        n_seen: s.n_seen,
        n_used: s.n_used,
        n_rejected: s.n_seen - s.n_used,
        n_frames_alone: solved.n_alone,
        cameras: cameras(solved),
        pairs: pairs(solved),
        rejected: rejected(solved),
        weakest_link: weakest_link(solved),
        scale: scale(solved),
        targets: targets(solved),
        views: views(solved),
        world: world(solved),
        joint_covariance: if with_joint { joint(solved) } else { None },
        inputs: solved.run.inputs.iter().map(input).collect(),
        command: solved.run.command.clone(),
        message: super::words::headline(solved),
    }
}

/// The likely cause, in one word.
fn cause_word(cause: Cause) -> &'static str {
    match cause {
        Cause::Intrinsics => "intrinsics",
        Cause::Contradiction => "contradiction",
        Cause::Target => "target",
        Cause::Size => "size",
        Cause::Reference => "reference",
        _ => "noise",
    }
}

fn camera_name(solved: &Solved, camera: usize) -> String {
    solved.run.rig.cameras[camera].name.clone()
}

fn target_name(solved: &Solved, target: usize) -> String {
    solved.run.rig.targets[target].name.clone()
}

fn uncertain(pose: &UncertainPose) -> UncertainObject {
    let (sigma_rad, sigma_m) = sigmas(&pose.covariance);
    UncertainObject { pose: pose.b_from_a.into(), covariance: rows(&pose.covariance), sigma_rad, sigma_m }
}

fn cameras(solved: &Solved) -> BTreeMap<String, CameraObject> {
    let object = |(i, c): (usize, &CameraInRig)| {
        let (sigma_rad, sigma_m) = sigmas(&c.covariance);
        let (losses, n_views_seen) =
            (&solved.run.solution.verdict.cameras[i], solved.run.solution.shared.counts[i][i]);
        let object = CameraObject {
            status: camera_status(&solved.run.solution, i).name(),
            cause: losses.cause.map(cause_word),
            message: rig_camera_sentence(&solved.run, i),
            cam_from_rig: c.cam_from_rig.into(),
            rig_from_cam: c.cam_from_rig.inverse().into(),
            covariance: rows(&c.covariance),
            sigma_rad,
            sigma_m,
            n_views: c.n_views,
            n_views_seen,
            n_sightings_rejected: losses.n_lost,
            n_seen: c.n_seen,
            n_used: c.n_used,
            n_rejected: c.n_seen - c.n_used,
            rms_px: c.rms_px,
            world_from_cam: solved.in_world.as_ref().map(|w| uncertain(&w.world_from_cam[i])),
        };
        (camera_name(solved, i), object)
    };
    solved.run.solution.cameras.iter().enumerate().map(object).collect()
}

/// Every two cameras, those that share views and those that others join.
fn pairs(solved: &Solved) -> Vec<PairObject> {
    let s = &solved.run.solution;
    let n = s.cameras.len();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    pairs.map(|(a, b)| pair(solved, a, b)).collect()
}

fn pair(solved: &Solved, a: usize, b: usize) -> PairObject {
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
        covariance: known.map(|pose| rows(&pose.covariance)),
        sigma_rad: sigma.map(|s| s.0),
        sigma_m: sigma.map(|s| s.1),
        distance_m: b_from_a.translation.norm(),
    }
}

/// Frames and points that never took part, then what the solver left out.
fn rejected(solved: &Solved) -> Vec<RejectedObject> {
    let before = solved.left_out.iter().map(|left_out| {
        let id = left_out.what.strip_prefix("point ").map(str::to_string);
        RejectedObject {
            kind: if id.is_some() { "point" } else { "frame" },
            camera: left_out.camera.clone(),
            view: left_out.view.clone(),
            target: None,
            id,
            residual_px: None,
            reason: left_out.reason.clone(),
        }
    });
    let found = solved.run.solution.sightings.iter().enumerate();
    before.chain(found.flat_map(|(i, result)| rejected_of(solved, i, result))).collect()
}

fn rejected_of(solved: &Solved, i: usize, result: &SightingResult) -> Vec<RejectedObject> {
    let sighting = &solved.run.rig.sightings[i];
    let object = |kind: &'static str, id: Option<String>, residual_px: Option<f64>, reason: String| {
        let (camera, view) = (camera_name(solved, sighting.camera), solved.taken_in[i].clone());
        let target = Some(target_name(solved, sighting.target));
        RejectedObject { kind, camera, view, target, id, residual_px, reason }
    };
    if let Some(reason) = &result.rejected {
        return vec![object("sighting", None, None, rejection(reason))];
    }
    let points = result.residuals_px.iter().zip(&solved.points[i]);
    let out = points.filter_map(|(residual, name)| match residual {
        Some((_, true)) => None,
        Some((e, false)) => {
            let reason = "farther off than its sigma allows".to_string();
            Some(object("point", Some(name.clone()), Some(e.norm()), reason))
        }
        None => Some(object("point", Some(name.clone()), None, "projects nowhere from there".to_string())),
    });
    out.collect()
}

fn weakest_link(solved: &Solved) -> Option<WeakestLinkObject> {
    solved.run.solution.weakest_link.as_ref().map(|link| WeakestLinkObject {
        camera: camera_name(solved, link.camera),
        with: camera_name(solved, link.with),
        n_shared_views: link.n_shared_views,
        sigma_rad: link.sigma_rad,
        sigma_m: link.sigma_m,
    })
}

fn scale(solved: &Solved) -> ScaleObject {
    let object = |scale: &TargetScale| TargetScaleObject {
        ratio: Some(scale.ratio).filter(|_| scale.sigma.is_finite()),
        sigma: Some(scale.sigma).filter(|sigma| sigma.is_finite()),
        extent_m: scale.extent_m,
    };
    let scales = solved.run.solution.scales.iter().enumerate();
    let targets = scales.map(|(i, scale)| (target_name(solved, i), object(scale))).collect();
    ScaleObject { message: super::words::scale(solved), targets }
}

fn targets(solved: &Solved) -> BTreeMap<String, TargetObject> {
    let rig = &solved.run.rig;
    let object = |(i, on_body): (usize, &resight::core::rig::TargetOnBody)| {
        let body = rig.body_of_target[i];
        let pose = UncertainPose { b_from_a: on_body.body_from_target, covariance: on_body.covariance };
        let body_frame = first_target(solved, body);
        (target_name(solved, i), TargetObject { body, body_frame, body_from_target: uncertain(&pose) })
    };
    solved.run.solution.targets.iter().enumerate().map(object).collect()
}

/// The target whose frame is the body's.
fn first_target(solved: &Solved, body: usize) -> String {
    let rig = &solved.run.rig;
    rig.targets.iter().find(|target| target.body == body).map_or_else(String::new, |t| t.name.clone())
}

fn views(solved: &Solved) -> Vec<ViewObject> {
    let mut views: Vec<ViewObject> = solved.run.rig.views.iter().map(|name| empty_view(name)).collect();
    let s = &solved.run.solution;
    let mut sums = vec![Sums::default(); views.len()];
    for (sighting, result) in solved.run.rig.sightings.iter().zip(&s.sightings) {
        let sum = Sums::of(result);
        sums[sighting.view].add(sum);
        let of_camera = views[sighting.view].cameras.entry(camera_name(solved, sighting.camera)).or_default();
        // Two targets of one camera in one view: squares add up.
        let earlier = of_camera.rms_px.map_or(0.0, |rms| rms * rms * of_camera.n_used as f64);
        let total = Sums {
            n_seen: of_camera.n_seen + sum.n_seen,
            n_used: of_camera.n_used + sum.n_used,
            squares: earlier + sum.squares,
        };
        *of_camera = SeenObject { n_seen: total.n_seen, n_used: total.n_used, rms_px: total.rms_px() };
    }
    for (view, sum) in views.iter_mut().zip(&sums) {
        (view.n_seen, view.n_used, view.rms_px) = (sum.n_seen, sum.n_used, sum.rms_px());
    }
    for body in &s.bodies {
        views[body.view].bodies.push(body_object(solved, body));
    }
    views
}

fn empty_view(name: &str) -> ViewObject {
    let (cameras, bodies) = (BTreeMap::new(), Vec::new());
    ViewObject { view: name.to_string(), n_seen: 0, n_used: 0, rms_px: None, cameras, bodies }
}

/// What residuals add up to.
#[derive(Clone, Copy, Default)]
struct Sums {
    n_seen: usize,
    n_used: usize,
    squares: f64,
}

impl Sums {
    fn of(result: &SightingResult) -> Self {
        let used = result.residuals_px.iter().flatten().filter(|(_, took_part)| *took_part);
        let (n_used, squares) = used.fold((0, 0.0), |(n, sum), (e, _)| (n + 1, sum + e.norm_squared()));
        Sums { n_seen: result.residuals_px.len(), n_used, squares }
    }

    fn add(&mut self, other: Sums) {
        self.n_seen += other.n_seen;
        self.n_used += other.n_used;
        self.squares += other.squares;
    }

    fn rms_px(&self) -> Option<f64> {
        (0 < self.n_used).then(|| (self.squares / self.n_used as f64).sqrt())
    }
}

fn body_object(solved: &Solved, body: &resight::core::rig::BodyInView) -> BodyObject {
    let (sigma_rad, sigma_m) = sigmas(&body.covariance);
    BodyObject {
        body: body.body,
        target: first_target(solved, body.body),
        rig_from_target: body.rig_from_body.into(),
        sigma_rad,
        sigma_m,
        n_used: body.n_used,
        rms_px: body.rms_px,
    }
}

fn world(solved: &Solved) -> Option<WorldObject> {
    let world = solved.in_world.as_ref()?;
    let target = solved.world_target.clone()?;
    Some(WorldObject { target, world_from_rig: uncertain(&world.world_from_rig) })
}

fn joint(solved: &Solved) -> Option<JointObject> {
    let RigSolution { joint_covariance: Some(matrix), .. } = &solved.run.solution else { return None };
    let cameras = solved.run.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    Some(JointObject::of(cameras, matrix))
}

/// For the rig's file.
pub fn joint_of(solved: &Solved) -> Option<JointCovariance> {
    let matrix = solved.run.solution.joint_covariance.as_ref()?;
    let cameras: Vec<String> = solved.run.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
    Some(JointCovariance::of(&cameras, matrix))
}

impl JointObject {
    /// Of these cameras, 6 rows each.
    pub fn of(cameras: Vec<String>, matrix: &DMatrix<f64>) -> Self {
        JointObject { cameras, matrix: matrix.row_iter().map(|row| row.iter().copied().collect()).collect() }
    }
}

fn input(input: &InputFile) -> InputObject {
    InputObject { path: input.path.clone(), sha256: input.sha256.clone() }
}
