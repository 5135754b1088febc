//! Reads poses of the robot and of the target, and matches them by the name of the view, or by place.

use super::pairs::{isotropic, pose_from_numbers};
use crate::answer::PoseAnswer;
use crate::core::locate::PoseEstimate;
use crate::core::locate::choose::Hypothesis;
use crate::core::multiview::hand_eye::{Candidate, GripperNoise, HandEyeView, Mounting, WrittenPose};
use crate::core::multiview::rig_pose::RigView;
use crate::core::{Matrix6, Pose};
use crate::error::{Error, FileError};
use crate::formats::pose_list::{ListedPose, PoseList, PoseListOptions, read_pose_list};
use crate::report::words::counted;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::path::Path;

/// The pose of a robot's gripper, or of a vehicle's body, in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotPose {
    /// Name of the view; `None` where poses and the camera's views go together by place.
    pub view: Option<String>,
    /// x_in_base = base_from_gripper · x_in_gripper.
    pub base_from_gripper: Pose,
    /// The pose as its file writes it, where its rotation has three numbers.
    pub written: Option<WrittenPose>,
    /// 6×6 covariance of its small left motion, base frame; zero when exact; `None` to estimate the robot's noise from the views.
    pub covariance: Option<Matrix6>,
}

impl RobotPose {
    /// Creates poses of the gripper by the name of their view, all with the covariance of `noise`; without it the robot's noise is estimated
    /// from the views.
    ///
    /// # Errors
    /// A view that occurs twice.
    pub fn named(poses: Vec<(String, Pose)>, noise: Option<GripperNoise>) -> Result<Vec<Self>, Error> {
        let covariance = noise.map(|noise| isotropic(noise.sigma_rad, noise.sigma_m));
        let mut views = BTreeSet::new();
        let of = |(view, base_from_gripper): (String, Pose)| match views.insert(view.clone()) {
            true => Ok(RobotPose { view: Some(view), base_from_gripper, written: None, covariance }),
            false => Err(Error::request(format!("motions: view {view} is there twice; give each view once"))),
        };
        poses.into_iter().map(of).collect()
    }
}

impl ViewPoses {
    /// Creates the candidates of a view from one pose of the target, with the 6×6 covariance of its small left motion, camera frame.
    pub fn of_pose(view: String, cam_from_target: Pose, covariance: Matrix6) -> Self {
        ViewPoses { view, candidates: vec![Candidate { cam_from_target, covariance, delta_chi2: 0.0 }] }
    }

    /// Reads a line of `locate` or `solve`.
    ///
    /// # Errors
    /// Text that is not such an object, a quaternion that is not unit.
    pub fn of_line(line: &str) -> Result<Self, String> {
        let pose: PoseLine = serde_json::from_str(line).map_err(|reason| reason.to_string())?;
        let candidates = candidates(&pose)?;
        Ok(ViewPoses { view: pose.view, candidates })
    }

    /// Takes every pose of an answer that fits its view; none where it has none.
    pub fn of_answer(view: String, answer: &PoseAnswer) -> Self {
        let fitting = answer.estimate.iter().flat_map(PoseEstimate::minima);
        let fitting = fitting.filter(|h| h.is_alternative || h.delta_chi2 == 0.0);
        let candidate = |h: Hypothesis| Candidate {
            cam_from_target: h.minimum.cam_from_target,
            covariance: h.minimum.covariance,
            delta_chi2: h.delta_chi2.max(0.0),
        };
        ViewPoses { view, candidates: fitting.map(candidate).collect() }
    }
}

/// The poses of the target that fit one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewPoses {
    /// Name of the view.
    pub view: String,
    /// Poses of the target in the camera frame; empty where the view shows no target.
    pub candidates: Vec<Candidate>,
}

/// The robot's pose and the camera's observations in one view.
pub(super) struct RobotView {
    /// The view's name in the camera's input.
    pub view: String,
    robot: RobotPose,
    candidates: Vec<Candidate>,
}

impl RobotView {
    /// Returns the input of the solver.
    pub fn view<'a>(&self, seen: &'a [RigView<'a>]) -> HandEyeView<'a> {
        HandEyeView {
            base_from_gripper: self.robot.base_from_gripper,
            gripper_covariance: self.robot.covariance,
            written: self.robot.written,
            candidates: self.candidates.clone(),
            seen,
        }
    }
}

/// What a file of robot poses holds.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotFile {
    /// The poses of the gripper.
    pub robot: Vec<RobotPose>,
    /// The poses of the target in the same views, in files that hold both (samples of easy_handeye and MoveIt).
    pub seen: Option<Vec<ViewPoses>>,
    /// Whether camera or target is on the gripper, where the file states it.
    pub mounting: Option<Mounting>,
    /// What is unusual, in sentences that name the file.
    pub remarks: Vec<String>,
}

impl RobotFile {
    /// Takes the poses of a list, called `name` in remarks; `noise` is that of poses that state none, and without it the robot's noise is estimated
    /// from the views.
    pub fn of(name: impl Display, list: PoseList, noise: Option<GripperNoise>) -> Self {
        let names: Vec<Option<String>> = list.poses.iter().map(|pose| pose.view.clone()).collect();
        let robot_pose = |pose: ListedPose| {
            let own = pose.sigmas.map(|[sigma_rad, sigma_m]| GripperNoise { sigma_rad, sigma_m });
            RobotPose {
                view: pose.view,
                base_from_gripper: pose.b_from_a,
                written: pose.written,
                covariance: own.or(noise).map(|noise| isotropic(noise.sigma_rad, noise.sigma_m)),
            }
        };
        RobotFile {
            robot: list.poses.into_iter().map(robot_pose).collect(),
            seen: list.cam_from_target.map(|poses| seen(names.into_iter().zip(poses))),
            mounting: list.mounting,
            remarks: remarks_on(name, list.remarks),
        }
    }
}

fn remarks_on(name: impl Display, remarks: Vec<String>) -> Vec<String> {
    remarks.into_iter().map(|remark| format!("{name}: {remark}")).collect()
}

/// Reads the poses of a robot in any of the formats of [`read_pose_list`].
///
/// # Errors
/// As of [`read_pose_list`].
pub fn read_robot_file(
    path: impl AsRef<Path>,
    options: &PoseListOptions,
    noise: Option<GripperNoise>,
) -> Result<RobotFile, FileError> {
    let path = path.as_ref();
    Ok(RobotFile::of(path.display(), read_pose_list(path, options)?, noise))
}

/// Poses of a target that state no noise count as nearly exact: their scatter, too, is attributed to the robot, whose noise is estimated from the
/// views. Six digits leave less; rad and m.
const UNSTATED_SIGMA: f64 = 1e-5;

/// Takes poses of the target that state no noise; those without a name are called by their number from 1.
fn seen(poses: impl Iterator<Item = (Option<String>, Pose)>) -> Vec<ViewPoses> {
    let of = |(i, (view, pose)): (usize, (Option<String>, Pose))| {
        let view = view.unwrap_or_else(|| (i + 1).to_string());
        ViewPoses::of_pose(view, pose, isotropic(UNSTATED_SIGMA, UNSTATED_SIGMA))
    };
    poses.enumerate().map(of).collect()
}

/// The keys of the pose object that are used here.
#[derive(Deserialize)]
struct PoseLine {
    view: String,
    cam_from_target: Option<TransformLine>,
    covariance: Option<[[f64; 6]; 6]>,
    minima: Option<Vec<MinimumLine>>,
}

#[derive(Deserialize)]
struct TransformLine {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

#[derive(Deserialize)]
struct MinimumLine {
    cam_from_target: TransformLine,
    covariance: [[f64; 6]; 6],
    delta_chi2: f64,
    within_gate: bool,
}

/// Reads the JSON Lines of `locate` and `solve`, of which views without a pose have no candidates, or a list of poses `cam_from_target` in any of
/// the formats of [`read_pose_list`]. The second value is what is unusual, in sentences that name the file.
///
/// # Errors
/// With its line: text that is not such an object, a view that occurs twice, a quaternion that is not unit; the errors of [`read_pose_list`].
pub fn read_view_poses(path: impl AsRef<Path>) -> Result<(Vec<ViewPoses>, Vec<String>), FileError> {
    let path = path.as_ref();
    crate::input::must_not_block(path)?;
    let is_file = std::fs::metadata(path).map_or(true, |found| found.is_file());
    let is_named_so = path.extension().is_some_and(|ending| ending == "jsonl");
    if is_file && !is_named_so {
        let bytes = crate::input::read(path, crate::input::Kind::Results)?;
        if !begins_results(&bytes) {
            let list = read_pose_list(path, &PoseListOptions::default())?;
            let poses = seen(list.poses.into_iter().map(|pose| (pose.view, pose.b_from_a)));
            return Ok((poses, remarks_on(path.display(), list.remarks)));
        }
    }
    let text = crate::input::read_text(path, crate::input::Kind::Results)?;
    let (mut poses, mut views) = (Vec::new(), BTreeSet::new());
    for (n, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = |reason: String| FileError::at_line(path, n + 1, reason);
        let pose = ViewPoses::of_line(line).map_err(wrong)?;
        if !views.insert(pose.view.clone()) {
            return Err(wrong(format!("view {} is there twice", pose.view)));
        }
        poses.push(pose);
    }
    Ok((poses, Vec::new()))
}

/// Returns whether the first line is an object of `locate` or `solve`.
fn begins_results(bytes: &[u8]) -> bool {
    let first = bytes.split(|byte| *byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    let object = first.and_then(|line| serde_json::from_slice::<serde_json::Value>(line).ok());
    object.is_some_and(|object| object.get("view").is_some() && object.get("status").is_some())
}

/// Returns every minimum within the gate; the answer alone where none are listed.
fn candidates(line: &PoseLine) -> Result<Vec<Candidate>, String> {
    let candidate = |pose: &TransformLine, covariance: &[[f64; 6]; 6], delta_chi2: f64| {
        let ([w, x, y, z], [tx, ty, tz]) = (pose.rotation_wxyz, pose.translation_m);
        let cam_from_target = pose_from_numbers(&[w, x, y, z, tx, ty, tz])?;
        let covariance = Matrix6::from_fn(|i, j| covariance[i][j]);
        Ok(Candidate { cam_from_target, covariance, delta_chi2 })
    };
    let listed = line.minima.iter().flatten().filter(|m| m.within_gate || m.delta_chi2 == 0.0);
    let listed: Vec<Candidate> = listed
        .map(|m| candidate(&m.cam_from_target, &m.covariance, m.delta_chi2.max(0.0)))
        .collect::<Result<_, String>>()?;
    match (listed.is_empty(), &line.cam_from_target, &line.covariance) {
        (true, Some(pose), Some(covariance)) => Ok(vec![candidate(pose, covariance, 0.0)?]),
        _ => Ok(listed),
    }
}

/// The views of robot and camera, and those without a counterpart.
pub(super) type Joined = (Vec<RobotView>, Vec<(String, String)>);

/// Matches views by name: as written, else by the file's name, else without its extension; without names by place. Views without a counterpart are
/// listed.
///
/// # Errors
/// Poses without names, where the camera has more or fewer views; poses of which only some have names.
pub(super) fn joined(robot: Vec<RobotPose>, observed: Vec<ViewPoses>) -> Result<Joined, Error> {
    let n_named = robot.iter().filter(|pose| pose.view.is_some()).count();
    match (n_named, robot.len()) {
        (0, n) if n == observed.len() => {
            let view = |(robot, seen): (RobotPose, ViewPoses)| RobotView {
                view: seen.view,
                robot,
                candidates: seen.candidates,
            };
            Ok((robot.into_iter().zip(observed).map(view).collect(), Vec::new()))
        }
        (0, n) if 0 < n => Err(Error::request(format!(
            "motions: {} without names of views and a camera with {} of a target are given; equal numbers go together by place, else name the view of each pose (column `view`)",
            counted(n, "pose"),
            counted(observed.len(), "view")
        ))),
        (named, n) if named < n => Err(Error::request(format!(
            "motions: {named} of {n} poses name their view; name the view of each, or of none"
        ))),
        _ => Ok(joined_by_name(robot, observed)),
    }
}

fn joined_by_name(mut robot: Vec<RobotPose>, observed: Vec<ViewPoses>) -> Joined {
    let name = |pose: &RobotPose| pose.view.clone().unwrap_or_default();
    let (mut robot_views, mut left_out) = (Vec::new(), Vec::new());
    for ViewPoses { view, candidates } in observed {
        let by = |key: fn(&str) -> &str| {
            let mut same =
                (0..robot.len()).filter(|i| key(robot[*i].view.as_deref().unwrap_or("")) == key(&view));
            same.next().filter(|_| same.next().is_none())
        };
        match by(|name| name).or_else(|| by(file_name)).or_else(|| by(stem)) {
            Some(at) => robot_views.push(RobotView { view, robot: robot.swap_remove(at), candidates }),
            None => left_out.push((view, "no row of the motions has this view".to_string())),
        }
    }
    left_out.extend(robot.iter().map(|pose| (name(pose), "the camera has no such view".to_string())));
    left_out.sort();
    (robot_views, left_out)
}

fn file_name(view: &str) -> &str {
    view.rsplit(['/', '\\']).next().unwrap_or(view)
}

fn stem(view: &str) -> &str {
    file_name(view).rsplit_once('.').map_or(file_name(view), |(stem, _)| stem)
}
