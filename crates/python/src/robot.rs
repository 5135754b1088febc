//! A camera on a robot, and a known rig in front of known points.

use crate::error;
use crate::image::corner_window;
use crate::jobs::{JobResult, Named, Solving, Taken, answered, line, observed, request, taken};
use pyo3::prelude::*;
use resight::answer::HandEyeAnswer;
use resight::core::Point;
use resight::core::multiview::hand_eye::{GripperNoise, HandEyeConfig, Height, Mounting};
use resight::rig::{
    Detections, HandEyeRequest, HandEyeViews, ImageOptions, ObservedRig, read_robot_poses, read_view_poses,
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
}

impl Robot {
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
        HandEyeConfig { mounting, height: self.height_m.map(height) }
    }
}

fn hand_eye_lines(answer: HandEyeAnswer) -> JobResult<Vec<String>> {
    Ok(vec![match answer {
        HandEyeAnswer::Solved(solved) => line(&solved)?,
        HandEyeAnswer::Unsolved(reason) => line(&reason)?,
    }])
}

/// From poses that were found already.
#[pyfunction]
pub fn hand_eye_of_poses(
    py: Python<'_>,
    motions: PathBuf,
    poses: PathBuf,
    robot: Robot,
) -> PyResult<Vec<String>> {
    let (noise, config) = (robot.noise(py)?, robot.config());
    answered(py, move || {
        let robot = read_robot_poses(&motions, noise)?;
        let views = HandEyeViews::Poses(read_view_poses(&poses)?);
        hand_eye_lines(resight::hand_eye(HandEyeRequest { robot, views, config })?)
    })
}

/// From images, or from files of detections.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn hand_eye(
    py: Python<'_>,
    motions: PathBuf,
    cameras: Vec<Named<'_>>,
    targets: Vec<Named<'_>>,
    images: Vec<Taken<'_>>,
    files: Vec<PathBuf>,
    sigma_px: Option<f64>,
    solving: Solving,
    robot: Robot,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let (noise, config) = (robot.noise(py)?, robot.config());
    let request = solving.of(request(cameras, targets)?);
    let images = taken(images)?;
    observed(py, progress, move || {
        let robot = read_robot_poses(&motions, noise)?;
        let observed = match files.is_empty() {
            false => {
                let detections = Detections { sigma_px, ..Detections::files(&files) };
                ObservedRig::from_detections(&detections, &request)?
            }
            true => {
                let options = ImageOptions { times: None, corner_window: corner_window(None) };
                ObservedRig::from_images(&images, &options, &request)?
            }
        };
        let views = HandEyeViews::Points(Box::new(observed));
        hand_eye_lines(resight::hand_eye(HandEyeRequest { robot, views, config })?)
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
