//! Lines marked in a photograph to how its camera stands.

use crate::camera::Camera;
use crate::jobs::{answered, line};
use crate::points::unknown_lens;
use pyo3::prelude::*;
use resight::locate::Method;
use resight::marked_lines::SceneLens;
use std::path::PathBuf;

/// Focal length, tilt, roll, heading and height from lines marked in photographs; the lines that the program prints with --json.
#[pyfunction]
#[pyo3(signature = (file, camera, sigma_px, image_size_px))]
pub fn solve_lines(
    py: Python<'_>,
    file: PathBuf,
    camera: Option<&Camera>,
    sigma_px: Option<f64>,
    image_size_px: Option<(u32, u32)>,
) -> PyResult<Vec<String>> {
    let lens = match camera {
        Some(camera) => SceneLens::Known(Box::new(camera.known.camera.clone()), camera.intrinsics()),
        None => SceneLens::Unknown(unknown_lens(py, Method::Auto, None, image_size_px)?),
    };
    let remark = camera.and_then(|camera| camera.remark.clone());
    answered(py, move || {
        let mut answers = resight::scene_views(&file, &lens, sigma_px)?;
        answers.iter_mut().for_each(|answer| answer.remarks.extend(remark.clone()));
        answers.iter().map(line).collect()
    })
}
