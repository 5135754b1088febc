//! A camera on a robot, and a known rig in front of known points.

use crate::answer::PoseAnswer;
use crate::columns::Detected;
use crate::error;
use crate::image::corner_window;
use crate::jobs::{JobResult, Named, Solving, Taken, answered, line, observed, request, taken};
use crate::pose::{NOT_RIGID, rigid};
use pyo3::prelude::*;
use resight::answer::HandEyeAnswer;
use resight::core::explanation::Tolerance;
use resight::core::multiview::hand_eye::{GripperNoise, HandEyeConfig, Height, Mounting};
use resight::core::{Matrix6, Point, Pose};
use resight::formats::pose_list::{
    LengthUnit, PoseList, PoseListOptions, RotationWord, pose_list_from_text, pose_list_of_array,
};
use resight::rig::pairs::pose_from_numbers;
use resight::rig::{
    HandEyeRequest, HandEyeViews, ImageOptions, ObservedRig, RobotFile, RobotPose, ViewPoses,
    read_robot_file, read_view_poses,
};
use resight::rig_pose::{RigPoseRequest, read_known_rig, read_rig_points, rig_poses};
use std::path::PathBuf;

/// What is known of the robot, as `resight hand-eye` has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Robot {
    eye_to_hand: bool,
    sigma_rad: Option<f64>,
    sigma_m: Option<f64>,
    height_m: Option<f64>,
    height_sigma_m: f64,
    height_axis: [f64; 3],
    tolerance_rotation_rad: Option<f64>,
    tolerance_translation_m: Option<f64>,
    rotation: Option<String>,
    length: Option<String>,
    inverse: bool,
}

impl Robot {
    fn pose_list_options(&self, py: Python<'_>) -> PyResult<PoseListOptions> {
        let wrong = |reason| error::input(py, reason);
        Ok(PoseListOptions {
            rotation: self.rotation.as_deref().map(RotationWord::parse).transpose().map_err(wrong)?,
            length: self.length.as_deref().map(LengthUnit::parse).transpose().map_err(wrong)?,
            is_inverse: self.inverse,
            eye_to_hand: self.eye_to_hand,
        })
    }

    fn noise(&self, py: Python<'_>) -> PyResult<Option<GripperNoise>> {
        match (self.sigma_rad, self.sigma_m) {
            (Some(sigma_rad), Some(sigma_m)) if 0.0 <= sigma_rad && 0.0 <= sigma_m => {
                Ok(Some(GripperNoise { sigma_rad, sigma_m }))
            }
            (None, None) => Ok(None),
            _ => Err(error::input(
                py,
                "robot_sigma_rad and robot_sigma_m: both, of 0 or more, or none are needed",
            )),
        }
    }

    fn config(&self) -> HandEyeConfig {
        let mounting = if self.eye_to_hand { Mounting::TargetOnGripper } else { Mounting::CameraOnGripper };
        let direction_in_carrier = Point::from(self.height_axis);
        let height = |height_m| Height { direction_in_carrier, height_m, sigma_m: self.height_sigma_m };
        let tolerance = Tolerance {
            rotation_rad: self.tolerance_rotation_rad,
            translation_m: self.tolerance_translation_m,
        };
        HandEyeConfig { mounting, height: self.height_m.map(height), tolerance }
    }
}

fn hand_eye_lines(answer: HandEyeAnswer) -> JobResult<Vec<String>> {
    Ok(vec![match answer {
        HandEyeAnswer::Solved(solved) => line(&solved)?,
        HandEyeAnswer::Unsolved(reason) => line(&reason)?,
    }])
}

/// The gripper's poses: a file, the shape and numbers of an array, the text of JSON, or by name 16 numbers of a homogeneous matrix, or qw, qx, qy,
/// qz, x_m, y_m, z_m.
#[derive(FromPyObject)]
pub enum Motions {
    Array((Vec<usize>, Vec<f64>)),
    Text((String,)),
    File(PathBuf),
    Named(Vec<(String, Vec<f64>)>),
}

/// The same, checked.
enum KnownMotions {
    File(PathBuf, PoseListOptions),
    List(PoseList),
    Named(Vec<(String, Pose)>),
}

impl Motions {
    fn known(self, py: Python<'_>, options: PoseListOptions) -> PyResult<KnownMotions> {
        let wrong = |reason: resight::FileError| error::input(py, reason.to_string());
        let poses = match self {
            Motions::File(file) => return Ok(KnownMotions::File(file, options)),
            Motions::Array((shape, data)) => {
                let list = pose_list_of_array("motions", &shape, data, &options);
                return list.map(KnownMotions::List).map_err(wrong);
            }
            Motions::Text((text,)) => {
                let list = pose_list_from_text("motions", &text, &options);
                return list.map(KnownMotions::List).map_err(wrong);
            }
            Motions::Named(poses) => poses,
        };
        let pose = |(view, numbers): (String, Vec<f64>)| {
            let pose = pose_of(&numbers);
            pose.map(|pose| (view.clone(), pose))
                .map_err(|reason| error::input(py, format!("motions: view {view}: {reason}")))
        };
        Ok(KnownMotions::Named(poses.into_iter().map(pose).collect::<PyResult<_>>()?))
    }
}

impl KnownMotions {
    fn robot(self, noise: Option<GripperNoise>) -> JobResult<RobotFile> {
        match self {
            KnownMotions::File(file, options) => Ok(read_robot_file(&file, &options, noise)?),
            KnownMotions::List(list) => Ok(RobotFile::of("motions", list, noise)),
            KnownMotions::Named(poses) => {
                let robot = RobotPose::named(poses, noise)?;
                Ok(RobotFile { robot, seen: None, mounting: None, remarks: Vec::new() })
            }
        }
    }
}

/// Of 16 numbers of a homogeneous matrix, or a quaternion and a translation.
fn pose_of(numbers: &[f64]) -> Result<Pose, String> {
    if let Ok(matrix) = <&[f64; 16]>::try_from(numbers) {
        return rigid(matrix).ok_or_else(|| NOT_RIGID.to_owned());
    }
    match <&[f64; 7]>::try_from(numbers) {
        Ok(numbers) if numbers.iter().all(|x| x.is_finite()) => pose_from_numbers(numbers),
        _ => Err(format!(
            "{} numbers are given; a matrix (4, 4), or qw, qx, qy, qz, x_m, y_m, z_m is needed",
            numbers.len()
        )),
    }
}

/// Poses of the target by the name of their view: a file, answers, or matrices with their covariances.
#[derive(FromPyObject)]
pub enum SeenPoses<'py> {
    File(PathBuf),
    Answers(Vec<(String, Bound<'py, PoseAnswer>)>),
    Matrices(Vec<(String, [f64; 16], [f64; 36])>),
}

enum KnownPoses {
    File(PathBuf),
    Views(Vec<ViewPoses>),
}

impl SeenPoses<'_> {
    fn known(self, py: Python<'_>) -> PyResult<KnownPoses> {
        Ok(KnownPoses::Views(match self {
            SeenPoses::File(file) => return Ok(KnownPoses::File(file)),
            SeenPoses::Answers(answers) => {
                let poses = |(view, answer): (String, Bound<'_, PoseAnswer>)| answer.get().poses(view);
                answers.into_iter().map(poses).collect::<Result<_, _>>().map_err(|e| error::input(py, e))?
            }
            SeenPoses::Matrices(poses) => {
                let of = |(view, matrix, covariance): (String, [f64; 16], [f64; 36])| {
                    let pose = rigid(&matrix)
                        .ok_or_else(|| error::input(py, format!("poses: view {view}: {NOT_RIGID}")))?;
                    Ok(ViewPoses::of_pose(view, pose, Matrix6::from_row_slice(&covariance)))
                };
                poses.into_iter().map(of).collect::<PyResult<_>>()?
            }
        }))
    }
}

/// From poses that were found already.
#[pyfunction]
pub fn hand_eye_of_poses(
    py: Python<'_>,
    motions: Motions,
    poses: Option<SeenPoses<'_>>,
    robot: Robot,
) -> PyResult<Vec<String>> {
    let (noise, config) = (robot.noise(py)?, robot.config());
    let motions = motions.known(py, robot.pose_list_options(py)?)?;
    let poses = poses.map(|poses| poses.known(py)).transpose()?;
    answered(py, move || {
        let RobotFile { robot, seen, mounting, mut remarks } = motions.robot(noise)?;
        let config = HandEyeConfig { mounting: mounting.unwrap_or(config.mounting), ..config };
        let views = HandEyeViews::Poses(match (poses, seen) {
            (Some(KnownPoses::File(file)), _) => {
                let (views, others) = read_view_poses(&file)?;
                remarks.extend(others);
                views
            }
            (Some(KnownPoses::Views(views)), _) => views,
            (None, Some(seen)) => seen,
            (None, None) => {
                return Err(resight::Error::request(
                    "one of poses, images and detections is needed, or samples that hold the poses of the target",
                ));
            }
        });
        hand_eye_lines(resight::hand_eye(HandEyeRequest { robot, views, config, remarks })?)
    })
}

/// From images, or from detections.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn hand_eye(
    py: Python<'_>,
    motions: Motions,
    cameras: Vec<Named<'_>>,
    targets: Vec<Named<'_>>,
    images: Vec<Taken<'_>>,
    detections: Option<Detected<'_>>,
    sigma_px: Option<f64>,
    solving: Solving,
    robot: Robot,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let (noise, config) = (robot.noise(py)?, robot.config());
    let request = solving.of(request(cameras, targets)?);
    let images = taken(images)?;
    let motions = motions.known(py, robot.pose_list_options(py)?)?;
    let found = detections.map(|detections| detections.owned(py)).transpose()?;
    observed(py, progress, move || {
        let RobotFile { robot, mounting, remarks, .. } = motions.robot(noise)?;
        let config = HandEyeConfig { mounting: mounting.unwrap_or(config.mounting), ..config };
        let observed = match found {
            Some(found) => found.with(sigma_px, |rows| ObservedRig::from_detections(&rows, &request))?,
            None => {
                let options = ImageOptions { corner_window: corner_window(None), ..ImageOptions::default() };
                ObservedRig::from_images(&images, &options, &request)?
            }
        };
        let views = HandEyeViews::Points(Box::new(observed));
        hand_eye_lines(resight::hand_eye(HandEyeRequest { robot, views, config, remarks })?)
    })
}

/// One line a view.
#[pyfunction]
pub fn rig_pose(
    py: Python<'_>,
    points: PathBuf,
    rig: PathBuf,
    sigma_px: f64,
    robust_threshold_px: Option<f64>,
) -> PyResult<Vec<String>> {
    if !(0.0 < sigma_px && sigma_px.is_finite()) {
        return Err(error::input(py, format!("sigma_px: {sigma_px} is given, a positive number is needed")));
    }
    answered(py, move || {
        let rig = read_known_rig(&rig)?;
        let views = read_rig_points(&points, &rig)?;
        let request = RigPoseRequest { sigma_px, robust_threshold_px };
        rig_poses(&rig, &views, &request).iter().map(line).collect()
    })
}
