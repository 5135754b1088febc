//! What the next observation is worth. One line an object, as the program prints them.

use crate::camera::Camera;
use crate::error;
use crate::jobs::{answered, line};
use crate::target::Target;
use pyo3::prelude::*;
use resight::advise::{
    NextBoardRequest, NextPointRequest, TargetRequest, advise_boards as boards, advise_points as points,
    advise_target as target, read_points, read_poses,
};
use resight::core::advise::board::Criterion;
use resight::core::advise::volume::Volume;
use std::path::PathBuf;

/// A range of lengths or angles, from and to.
fn range(py: Python<'_>, name: &str, [from, to]: [f64; 2], least: f64, most: f64) -> PyResult<[f64; 2]> {
    if least <= from && from <= to && to <= most {
        return Ok([from, to]);
    }
    let message = format!("{name}: ({from}, {to}) is given, a range within {least} and {most} is needed");
    Err(error::input(py, message))
}

fn positive(py: Python<'_>, name: &str, value: f64) -> PyResult<f64> {
    match 0.0 < value && value.is_finite() {
        true => Ok(value),
        false => Err(error::input(py, format!("{name}: {value} is given, a positive number is needed"))),
    }
}

/// Where the next point should go.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn advise_points(
    py: Python<'_>,
    camera: &Camera,
    file: PathBuf,
    sigma_px: f64,
    pose: Option<PathBuf>,
    candidates: Option<PathBuf>,
    ground_z_m: f64,
    region_m: Option<[f64; 4]>,
    length_m: Option<[f64; 4]>,
) -> PyResult<Vec<String>> {
    let sigma_px = positive(py, "sigma_px", sigma_px)?;
    let known = camera.known.clone();
    answered(py, move || {
        let measured = read_points(&file)?;
        let candidates = candidates.as_deref().map(read_points).transpose()?;
        let pose = pose.as_deref().map(|path| read_poses(path, &["cam_from_target"])).transpose()?;
        let rows = known.intrinsics_rows();
        let advice = points(&NextPointRequest {
            camera: &known.camera,
            intrinsics_covariance: rows.as_deref(),
            points: &measured,
            sigma_px,
            pose: pose.and_then(|poses| poses.first().copied()),
            candidates: candidates.as_deref(),
            ground_z_m,
            region_m,
            length_m,
            aim: None,
            pictures: false,
        })?;
        [line(&advice.now)].into_iter().chain(advice.suggestions.iter().map(line)).collect()
    })
}

/// How well a target is seen over a volume, and which change of it helps.
#[pyfunction]
pub fn advise_target(
    py: Python<'_>,
    camera: &Camera,
    given: &Target,
    distance_m: [f64; 2],
    tilt_deg: [f64; 2],
    direction_deg: [f64; 2],
    sigma_px: f64,
) -> PyResult<Vec<String>> {
    let sigma_px = positive(py, "sigma_px", sigma_px)?;
    let volume = Volume {
        distance_m: range(py, "distance_m", distance_m, f64::MIN_POSITIVE, f64::MAX)?,
        tilt_rad: range(py, "tilt_deg", tilt_deg, 0.0, 85.0)?.map(f64::to_radians),
        direction_rad: range(py, "direction_deg", direction_deg, -360.0, 360.0)?.map(f64::to_radians),
    };
    let (known, given) = (camera.known.clone(), given.target.clone());
    answered(py, move || {
        let rows = known.intrinsics_rows();
        let advice = target(&TargetRequest {
            camera: &known.camera,
            intrinsics_covariance: rows.as_deref(),
            target: &given,
            sigma_px,
            volume,
            pictures: false,
        })?;
        advice.outlooks.iter().map(line).chain(advice.changes.iter().map(line)).collect()
    })
}

/// Where the next boards should be shown to a rig.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn advise_boards(
    py: Python<'_>,
    rig: PathBuf,
    given: &Target,
    distance_m: [f64; 2],
    views: Option<PathBuf>,
    reference: Option<String>,
    n_boards: usize,
    sigma_px: f64,
) -> PyResult<Vec<String>> {
    let sigma_px = positive(py, "sigma_px", sigma_px)?;
    let distance_m = range(py, "distance_m", distance_m, f64::MIN_POSITIVE, f64::MAX)?;
    if !(1..=100).contains(&n_boards) {
        return Err(error::input(py, format!("n_boards: {n_boards} is given, 1 to 100 are needed")));
    }
    let given = given.target.clone();
    answered(py, move || {
        let cameras = resight::formats::read_cameras(&rig)?.cameras;
        let keys = ["rig_from_target", "rig_from_body", "rig_from_board"];
        let views = views.as_deref().map(|path| read_poses(path, &keys)).transpose()?.unwrap_or_default();
        let advice = boards(&NextBoardRequest {
            cameras: &cameras,
            target: &given,
            sigma_px,
            views: &views,
            distance_m,
            reference: reference.as_deref(),
            criterion: Criterion::Worst,
            n_boards,
            pictures: false,
        })?;
        [line(&advice.now)].into_iter().chain(advice.suggestions.iter().map(line)).collect()
    })
}
