//! Solves for the mounting of a camera (or rig) from a robot's poses and the camera's observations: the job of `resight hand-eye`.

use super::job::{ObservedRig, uncertain_tags};
use super::robot_poses::{RobotPose, RobotView, ViewPoses, joined};
use super::{NamedRig, uncertain_lens};
use crate::answer::{HandEyeAnswer, RigAnswer, SolvedHandEye, Status, Unsolved};
use crate::core::budget::ErrorSource;
use crate::core::multiview::hand_eye::{HandEye, HandEyeConfig, HandEyeView, solve_hand_eye};
use crate::core::multiview::rig::UncertainTags;
use crate::core::multiview::rig_pose::RigView;
use crate::core::{Camera, Correspondence, Error as MathError, Point, Pose, Vector6};
use crate::error::Error;
use crate::formats::plausible;
use crate::report::rig::rig_verdict_sentence;
use crate::report::words::counted;
use nalgebra::{DMatrix, DVector};

/// The observations of a camera or rig during the robot's motions.
#[derive(Debug, Clone)]
pub enum HandEyeViews {
    /// Known poses of the target in the frame of one camera.
    Poses(Vec<ViewPoses>),
    /// Points of one target; a rig of several cameras is solved first.
    Points(Box<ObservedRig>),
}

/// A robot's poses and the observations in them.
#[derive(Debug, Clone)]
pub struct HandEyeRequest {
    /// The poses of the gripper; views are matched by name.
    pub robot: Vec<RobotPose>,
    /// The observations of the camera or rig.
    pub views: HandEyeViews,
    /// Whether camera or target is on the gripper, and coordinates of the camera that are known otherwise.
    pub config: HandEyeConfig,
    /// Remarks on the file of the robot's poses, which the answer repeats.
    pub remarks: Vec<String>,
}

/// Solves for the pose of a camera or rig on a robot or vehicle, and for that of the target.
///
/// An answer without poses has a status: `Degenerate` where the robot's motions do not determine them, `Inconsistent` where the views contradict
/// each other, the rig's own status where there is no rig, else `Error`.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/hand_eye"))?;
/// use resight::rig::{Detections, HandEyeRequest, HandEyeViews, ObservedRig, RigRequest, RobotFile, read_robot_file};
/// let mut request = RigRequest::default();
/// request.read_camera(Some("cam"), "camera.toml")?;
/// let observed = ObservedRig::from_detections(&Detections::files(&["detections.csv".into()]), &request)?;
/// let RobotFile { robot, remarks, .. } = read_robot_file("motions.csv", &Default::default(), None)?;
/// let views = HandEyeViews::Points(Box::new(observed));
/// let answer = resight::hand_eye(HandEyeRequest { robot, views, config: Default::default(), remarks })?;
/// assert_eq!(answer.status(), resight::Status::Ok);
/// if let Some(solved) = answer.solved() {
///     println!("the camera is at {} m in the gripper", solved.solution.cam_from_carrier.origin().transpose());
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// Observations of more or fewer than one target; robot poses without names whose number is not that of the views.
pub fn hand_eye(request: HandEyeRequest) -> Result<HandEyeAnswer, Error> {
    let HandEyeRequest { robot, views, config, remarks } = request;
    let sizes = size_remarks(&robot);
    match views {
        HandEyeViews::Poses(poses) => {
            let (robot_views, left_out) = joined(robot, poses)?;
            let views: Vec<HandEyeView> = robot_views.iter().map(|view| view.view(&[])).collect();
            let names = names(&robot_views);
            let named = Named { eye: "cam", views: names, left_out, rig_contradiction: None, sizes, remarks };
            Ok(answer(solve_hand_eye(&views, &config), named))
        }
        HandEyeViews::Points(observed) => from_points(robot, *observed, &config, (sizes, remarks)),
    }
}

/// Solves from points of one target; if the rig contradicts itself, the answer is not a success.
fn from_points(
    robot: Vec<RobotPose>,
    observed: ObservedRig,
    config: &HandEyeConfig,
    (mut sizes, mut remarks): (Vec<String>, Vec<String>),
) -> Result<HandEyeAnswer, Error> {
    if let Some(nothing) = observed.nothing_found() {
        return Ok(HandEyeAnswer::Unsolved(nothing));
    }
    let rig = observed.gathered.rig.clone();
    sizes.extend(rig.size_remarks());
    remarks.extend(observed.remarks.iter().cloned());
    let (cam_from_rig, rig_contradiction) = match cameras(observed.clone()) {
        Ok(placed) => placed,
        Err(unsolved) => return Ok(HandEyeAnswer::Unsolved(unsolved)),
    };
    if rig.targets.len() != 1 {
        let n = rig.targets.len();
        return Err(Error::request(format!(
            "hand-eye needs one target, {n} are given; solve one target at a time"
        )));
    }
    let without_pose = |view: &String| ViewPoses { view: view.clone(), candidates: Vec::new() };
    let (robot_views, left_out) = joined(robot, rig.views.iter().map(without_pose).collect())?;
    let mut solution = mounted(&rig, &cam_from_rig, &robot_views, config);
    if let Ok(found) = &mut solution
        && let Some(share) = lens_share(found, &observed, &robot_views, config)
    {
        add(found, ErrorSource::Lens, &share);
    }
    if let Ok(found) = &mut solution {
        let share = tag_share(found, &rig, &cam_from_rig, &robot_views, config);
        if let Some(share) = share {
            add(found, ErrorSource::Target, &share);
        }
    }
    let eye = if rig.cameras.len() == 1 { "cam" } else { "rig" };
    let named = Named { eye, views: names(&robot_views), left_out, rig_contradiction, sizes, remarks };
    Ok(answer(solution, named))
}

/// Adds what a source contributes to both poses.
fn add(found: &mut HandEye, source: ErrorSource, share: &DMatrix<f64>) {
    let [of_carrier, of_holder] = [0, 6].map(|at| share.fixed_view::<6, 6>(at, at).into_owned());
    found.carrier_covariance += of_carrier;
    found.holder_covariance += of_holder;
    found.carrier_budget.add(source, &of_carrier);
    found.holder_budget.add(source, &of_holder);
    found.joint_covariance += share;
}

/// Returns the motions of both poses from one answer to another, `cam_from_carrier` first.
fn moved(other: &HandEye, found: &HandEye) -> DVector<f64> {
    let by_camera = (other.cam_from_carrier * found.cam_from_carrier.inverse()).log();
    let by_target = (other.holder_from_target * found.holder_from_target.inverse()).log();
    DVector::from_iterator(12, by_camera.iter().chain(&by_target).copied())
}

/// Returns the contribution of tags whose poses on their map are uncertain: the same error in all views, so that the answer is solved again with
/// each tag displaced along and rotated about every axis by one standard deviation. `None` where every tag is exact.
fn tag_share(
    found: &HandEye,
    rig: &NamedRig,
    cam_from_rig: &[Pose],
    robot_views: &[RobotView],
    config: &HandEyeConfig,
) -> Option<DMatrix<f64>> {
    let mut sum: Option<DMatrix<f64>> = None;
    for group in uncertain_tags(&rig.targets) {
        let covariance = about_centres(&group);
        let mut by_motion = DMatrix::zeros(12, covariance.nrows());
        for (i, mut column) in by_motion.column_iter_mut().enumerate() {
            let (corners, sigma) = (&group.corners_in_target[i / 6], covariance[(i, i)].max(0.0).sqrt());
            let own = |c: &Correspondence| corners.contains(&c.x_in_target);
            if sigma == 0.0 || !rig.observations.iter().flat_map(|s| &s.seen).any(own) {
                continue;
            }
            let (centre, motion) = (centre(corners), Pose::exp(&Vector6::ith(i % 6, sigma)));
            let mut other = rig.clone();
            for c in other.observations.iter_mut().flat_map(|s| &mut s.seen).filter(|c| own(c)) {
                c.x_in_target = centre + motion * (c.x_in_target - centre);
            }
            let other = mounted(&other, cam_from_rig, robot_views, config).ok()?;
            column.copy_from(&(moved(&other, found) / sigma));
        }
        let added = &by_motion * covariance * by_motion.transpose();
        sum = Some(sum.map_or_else(|| added.clone(), |sum| sum + &added));
    }
    sum
}

fn centre(corners: &[Point; 4]) -> Point {
    corners.iter().sum::<Point>() / 4.0
}

/// Returns the covariance of the motions of tags about their centres.
fn about_centres(group: &UncertainTags) -> DMatrix<f64> {
    let n = group.covariance.nrows();
    let mut by = DMatrix::identity(n, n);
    for (i, corners) in group.corners_in_target.iter().enumerate() {
        by.fixed_view_mut::<3, 3>(6 * i + 3, 6 * i).copy_from(&-centre(corners).cross_matrix());
    }
    &by * &group.covariance * by.transpose()
}

/// Returns a remark where the robot's positions are implausible in metres.
fn size_remarks(robot: &[RobotPose]) -> Vec<String> {
    let sigma_m = |pose: &RobotPose| pose.covariance.map_or(0.0, |c| c[(3, 3)].max(0.0).sqrt());
    let positions = robot.iter().map(|pose| (pose.base_from_gripper.translation, sigma_m(pose)));
    plausible::of_uncertain_points(positions).map(|remark| format!("motions: {remark}")).into_iter().collect()
}

/// Solves the hand–eye calibration of a rig whose cameras have known poses in it.
fn mounted(
    rig: &NamedRig,
    cam_from_rig: &[Pose],
    robot_views: &[RobotView],
    config: &HandEyeConfig,
) -> Result<HandEye, MathError> {
    let of_view = |robot_view: &RobotView| -> Vec<RigView> {
        let number = rig.views.iter().position(|view| *view == robot_view.view);
        let observations = rig.observations.iter().filter(|s| Some(s.view) == number);
        let view = observations.map(|s| RigView {
            camera: &rig.lenses[s.camera],
            cam_from_rig: cam_from_rig[s.camera],
            cam_from_rig_covariance: None,
            // The error is common to all views: `lens_share` adds it once, at the end.
            intrinsics_covariance: None,
            seen: &s.seen,
        });
        view.collect()
    };
    let rigs: Vec<Vec<RigView>> = robot_views.iter().map(of_view).collect();
    let views: Vec<HandEyeView> = robot_views.iter().zip(&rigs).map(|(view, seen)| view.view(seen)).collect();
    solve_hand_eye(&views, config)
}

/// Returns the contribution of each camera's uncertain intrinsics, docs/math/hand_eye.md eq. (28): the rig and its mounting are solved again
/// with other lenses.
fn lens_share(
    found: &HandEye,
    observed: &ObservedRig,
    robot_views: &[RobotView],
    config: &HandEyeConfig,
) -> Option<DMatrix<f64>> {
    let mut sum: Option<DMatrix<f64>> = None;
    for (i, camera) in observed.gathered.rig.cameras.iter().enumerate() {
        let through = |lens: &Camera| {
            let again = through(observed, i, lens)?;
            let rig = again.gathered.rig.clone();
            let (cam_from_rig, _) = cameras(again).ok()?;
            let other = mounted(&rig, &cam_from_rig, robot_views, config).ok()?;
            Some(moved(&other, found))
        };
        let Some(share) = uncertain_lens::share(camera, through) else { continue };
        sum = Some(sum.map_or_else(|| share.clone(), |sum| sum + &share));
    }
    sum
}

/// Returns the same points as seen through another lens of one camera; `None` where one of them is outside its field.
fn through(observed: &ObservedRig, camera: usize, lens: &Camera) -> Option<ObservedRig> {
    let mut again = observed.clone();
    let rig = &mut again.gathered.rig;
    rig.lenses[camera] = lens.clone();
    rig.cameras[camera].camera = lens.clone();
    for observation in rig.observations.iter_mut().filter(|s| s.camera == camera) {
        for c in &mut observation.seen {
            *c = Correspondence { bearing: lens.bearing(&c.pixel).ok()?, ..*c };
        }
    }
    // The effect of a lens on the poses needs no covariance of them.
    rig.cameras.iter_mut().for_each(|camera| camera.intrinsics_covariance = None);
    Some(again)
}

/// Returns the cameras' poses in their rig, and what contradicts in it; a single camera is its own rig.
fn cameras(observed: ObservedRig) -> Result<(Vec<Pose>, Option<String>), Unsolved> {
    if let [_] = &observed.gathered.rig.cameras[..] {
        return Ok((vec![Pose::identity()], None));
    }
    match observed.solve() {
        RigAnswer::Solved(solved) => {
            let cameras = &solved.run.solution.cameras;
            let cam_from_rig = cameras.iter().map(|camera| camera.cam_from_rig).collect();
            Ok((cam_from_rig, rig_verdict_sentence(&solved.run)))
        }
        RigAnswer::Unsolved(unsolved) => Err(unsolved),
    }
}

fn names(robot_views: &[RobotView]) -> Vec<String> {
    robot_views.iter().map(|view| view.view.clone()).collect()
}

/// The names of the solver's indices.
struct Named {
    eye: &'static str,
    views: Vec<String>,
    left_out: Vec<(String, String)>,
    rig_contradiction: Option<String>,
    sizes: Vec<String>,
    remarks: Vec<String>,
}

fn answer(solution: Result<HandEye, MathError>, named: Named) -> HandEyeAnswer {
    let Named { eye, views: names, left_out, rig_contradiction, sizes, remarks } = named;
    match solution {
        Ok(solution) => HandEyeAnswer::Solved(Box::new(SolvedHandEye {
            solution,
            eye,
            views: names,
            left_out,
            rig_contradiction,
            sizes,
            remarks,
        })),
        Err(reason) => {
            let status = match reason {
                MathError::DegenerateMotion { .. } | MathError::TooFewMotions { .. } => Status::Degenerate,
                MathError::ViewsDisagree { .. } => Status::Inconsistent,
                _ => Status::Error,
            };
            let aside = match &left_out[..] {
                [] => String::new(),
                [(view, why), ..] => {
                    format!("; {} took no part, e.g. {view}: {why}", counted(left_out.len(), "view"))
                }
            };
            HandEyeAnswer::Unsolved(Unsolved::new(status, format!("{reason}{aside}")))
        }
    }
}
