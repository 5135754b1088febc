//! Reads poses of the robot from a CSV file and poses of the target from `locate`'s JSON Lines, and matches them by the name of the view.

use super::pairs::{isotropic, pose_from_numbers};
use crate::answer::PoseAnswer;
use crate::core::locate::PoseEstimate;
use crate::core::locate::choose::Hypothesis;
use crate::core::multiview::hand_eye::{Candidate, GripperNoise, HandEyeView};
use crate::core::multiview::rig_pose::RigView;
use crate::core::{Matrix6, Pose};
use crate::error::{Error, FileError};
use crate::input::table::Table;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::Path;

/// The pose of a robot's gripper, or of a vehicle's body, in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotPose {
    /// Name of the view.
    pub view: String,
    /// x_in_base = base_from_gripper · x_in_gripper.
    pub base_from_gripper: Pose,
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
            true => Ok(RobotPose { view, base_from_gripper, covariance }),
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
            candidates: self.candidates.clone(),
            seen,
        }
    }
}

/// Reads `view,qw,qx,qy,qz,x_m,y_m,z_m` and optionally `sigma_deg,sigma_mm`; `noise` is used where these are missing.
///
/// # Errors
/// With its line: a quaternion whose order is not stated or that is not unit, a view that occurs twice, invalid numbers.
pub fn read_robot_poses(path: &Path, noise: Option<GripperNoise>) -> Result<Vec<RobotPose>, FileError> {
    let table = Table::open(path, "view,qw,qx,qy,qz,x_m,y_m,z_m")?;
    let order = "the order of the quaternion must be named: qw is its scalar";
    let view = table.need("view", None)?;
    let mut columns = [0; 7];
    for (column, name) in columns.iter_mut().zip(["qw", "qx", "qy", "qz", "x_m", "y_m", "z_m"]) {
        *column = table.need(name, name.starts_with('q').then_some(order))?;
    }
    let (rotation, translation) = (table.find("sigma_deg"), table.find("sigma_mm"));
    if rotation.is_some() != translation.is_some() {
        return Err(table.complaint("sigma_deg and sigma_mm belong together; one is missing"));
    }
    let (mut poses, mut views) = (Vec::new(), BTreeSet::new());
    table.each(|row| {
        let Some(name) = row.text(view) else {
            return Err(row.complaint(view, "is empty; a view's name is needed"));
        };
        if !views.insert(name.to_string()) {
            return Err(row.complaint(view, &format!("has `{name}` twice; give each view once")));
        }
        let mut v = [0.0; 7];
        for (x, column) in v.iter_mut().zip(columns) {
            *x = row.number(column)?;
        }
        let base_from_gripper = pose_from_numbers(&v).map_err(|reason| row.complaint_of(&reason))?;
        let own = row.optional_number(rotation)?.zip(row.optional_number(translation)?);
        let own = own.map(|(deg, mm)| GripperNoise { sigma_rad: deg.to_radians(), sigma_m: 1e-3 * mm });
        let covariance = own.or(noise).map(|noise| isotropic(noise.sigma_rad, noise.sigma_m));
        poses.push(RobotPose { view: name.to_string(), base_from_gripper, covariance });
        Ok(())
    })?;
    Ok(poses)
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

/// Reads the JSON Lines of `locate` and `solve`; views without a pose have no candidates.
///
/// # Errors
/// With its line: text that is not such an object, a view that occurs twice, a quaternion that is not unit.
pub fn read_view_poses(path: &Path) -> Result<Vec<ViewPoses>, FileError> {
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
    Ok(poses)
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

/// Matches views by name: as written, else by the file's name, else without its extension. Views without a counterpart are listed.
pub(super) fn joined(
    mut robot: Vec<RobotPose>,
    observed: Vec<ViewPoses>,
) -> (Vec<RobotView>, Vec<(String, String)>) {
    let (mut robot_views, mut left_out) = (Vec::new(), Vec::new());
    for ViewPoses { view, candidates } in observed {
        let by = |key: fn(&str) -> &str| {
            let mut same = (0..robot.len()).filter(|i| key(&robot[*i].view) == key(&view));
            same.next().filter(|_| same.next().is_none())
        };
        match by(|name| name).or_else(|| by(file_name)).or_else(|| by(stem)) {
            Some(at) => robot_views.push(RobotView { view, robot: robot.swap_remove(at), candidates }),
            None => left_out.push((view, "no row of the motions has this view".to_string())),
        }
    }
    left_out.extend(robot.into_iter().map(|pose| (pose.view, "the camera has no such view".to_string())));
    left_out.sort();
    (robot_views, left_out)
}

fn file_name(view: &str) -> &str {
    view.rsplit(['/', '\\']).next().unwrap_or(view)
}

fn stem(view: &str) -> &str {
    file_name(view).rsplit_once('.').map_or(file_name(view), |(stem, _)| stem)
}
