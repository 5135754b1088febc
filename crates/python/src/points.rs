//! Known points to a pose.

use crate::answer::PoseAnswer;
use crate::arrays::{Numbers, each};
use crate::camera::Camera;
use crate::error;
use crate::run::{here, run};
use pyo3::prelude::*;
use resight::core::camera::ImageSize;
use resight::core::locate::prior::Prior;
use resight::core::locate::unknown_focal::LensPrior;
use resight::locate::{METHODS, Method, PointRows, PointsOptions};
use resight::nominal::lens_of_unknown_focal;
use resight::points::{TableLocator, read_table};
use std::path::PathBuf;

/// The solver of this name.
///
/// # Errors
/// `input` for any other word, with the names that there are.
pub fn method(py: Python<'_>, name: &str) -> PyResult<Method> {
    let found = METHODS.iter().find(|(known, _)| *known == name);
    found.map(|(_, method)| *method).ok_or_else(|| {
        let names = METHODS.map(|(known, _)| known).join(", ");
        error::input(py, format!("method: there is no `{name}`; there are {names}"))
    })
}

/// Directions of down in target and camera, and the standard deviation of the angle between them.
type Gravity = ([f64; 3], [f64; 3], f64);

fn priors(py: Python<'_>, gravity: Option<Gravity>) -> PyResult<Vec<Prior>> {
    let Some((down_in_target, down_in_cam, sigma_deg)) = gravity else { return Ok(Vec::new()) };
    let unit = |name: &str, direction: [f64; 3]| {
        let length = direction.iter().fold(0.0_f64, |sum, x| sum.hypot(*x));
        match length.is_normal() {
            true => Ok(direction.map(|x| x / length)),
            false => {
                Err(error::input(py, format!("gravity: {name} must be three numbers that are not all zero")))
            }
        }
    };
    if !(0.0 < sigma_deg && sigma_deg < 90.0) {
        return Err(error::input(py, format!("gravity: sigma_deg is {sigma_deg}; 0 to 90 is needed")));
    }
    Ok(vec![Prior::Gravity {
        down_in_target: unit("down_in_target", down_in_target)?.into(),
        down_in_cam: unit("down_in_cam", down_in_cam)?.into(),
        sigma_rad: sigma_deg.to_radians(),
    }])
}

/// From so many points on a view may take seconds, as the search for wrong ones may, during which Ctrl-C must be heard.
pub const MANY_POINTS: usize = 1000;

/// The pose of a camera from points (n, 3) in the target frame and their pixels (n, 2).
#[pyfunction]
#[pyo3(signature = (points_m, pixels, camera, *, sigma_px=None, sigma_m=None, method="auto", gravity=None, robust_threshold_px=None, names=None, view=""))]
#[allow(clippy::too_many_arguments)] // As the function has them in Python, by keyword.
pub fn solve(
    py: Python<'_>,
    points_m: &Bound<'_, PyAny>,
    pixels: &Bound<'_, PyAny>,
    camera: &Camera,
    sigma_px: Option<&Bound<'_, PyAny>>,
    sigma_m: Option<&Bound<'_, PyAny>>,
    method: &str,
    gravity: Option<Gravity>,
    robust_threshold_px: Option<f64>,
    names: Option<Vec<String>>,
    view: &str,
) -> PyResult<PoseAnswer> {
    let (points, seen) = (Numbers::new("points_m", points_m)?, Numbers::new("pixels", pixels)?);
    let (points, seen) = (points.rows::<3>("points_m")?, seen.rows::<2>("pixels")?);
    if points.len() != seen.len() {
        let message = format!(
            "{} points_m and {} pixels are given; one pixel for each point is needed",
            points.len(),
            seen.len()
        );
        return Err(error::input(py, message));
    }
    let n = points.len();
    let sigmas_px = sigma_px.map_or_else(|| Ok(vec![0.5; n]), |value| each("sigma_px", value, n))?;
    let sigmas_m = sigma_m.map_or_else(|| Ok(vec![0.0; n]), |value| each("sigma_m", value, n))?;
    if names.as_ref().is_some_and(|names| names.len() != n) {
        return Err(error::input(py, format!("names: one for each of {n} points is needed")));
    }
    let rows = PointRows {
        points_m: points,
        pixels: seen,
        sigma_px: &sigmas_px,
        sigma_m: &sigmas_m,
        names: names.as_deref(),
    };
    let seen = rows.seen(&camera.known.camera).map_err(|fault| {
        let kind = fault.kind.as_ref().map_or_else(|| "input".to_owned(), error::math_kind);
        error::error(py, &kind, fault.message)
    })?;
    let method = self::method(py, method)?;
    let options = PointsOptions {
        method,
        intrinsics: camera.intrinsics().filter(|_| method != Method::Wang2004),
        priors: priors(py, gravity)?,
        robust_threshold_px,
        ..PointsOptions::default()
    };
    let mut answer = match n < MANY_POINTS && robust_threshold_px.is_none() {
        true => here(py, || seen.locate(view, &camera.known.camera, &options))?,
        false => {
            let (view, lens) = (view.to_owned(), camera.known.camera.clone());
            run(py, None, move |_| seen.locate(&view, &lens, &options))?
        }
    };
    answer.remarks.extend(camera.remark.clone());
    Ok(answer.into())
}

/// The poses of a CSV file of points, one a view.
#[pyfunction]
#[pyo3(signature = (file, camera, *, sigma_px=None, method="auto", robust_threshold_px=None, image_size_px=None, progress=None))]
#[allow(clippy::too_many_arguments)] // As the function has them in Python, by keyword.
pub fn solve_table(
    py: Python<'_>,
    file: PathBuf,
    camera: Option<&Camera>,
    sigma_px: Option<f64>,
    method: &str,
    robust_threshold_px: Option<f64>,
    image_size_px: Option<(u32, u32)>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<PoseAnswer>> {
    let method = self::method(py, method)?;
    let intrinsics = camera.and_then(Camera::intrinsics).filter(|_| method != Method::Wang2004);
    let estimate_focal = match camera {
        Some(_) => None,
        None => Some(unknown_lens(py, method, robust_threshold_px, image_size_px)?),
    };
    let lens = camera.map_or_else(resight::core::Camera::normalized, |camera| camera.known.camera.clone());
    let options =
        PointsOptions { method, intrinsics, robust_threshold_px, estimate_focal, ..PointsOptions::default() };
    let locator = TableLocator::new(Some(lens), sigma_px, options);
    let table = read_table(&file, false, None).map_err(|reason| error::file(py, &reason))?;
    let locator = locator.for_table(&file, &table);
    let views = table.views;
    let mut remarks: Vec<String> = locator.remarks().collect();
    remarks.extend(camera.and_then(|camera| camera.remark.clone()));
    let answers = run(py, progress, move |reporter| {
        let mut answers = Vec::with_capacity(views.len());
        for view in &views {
            let mut answer = locator.locate(view);
            answer.remarks.extend(remarks.iter().cloned());
            answers.push(answer);
            if !reporter.done(answers.len(), views.len()) {
                break; // Nobody waits for the rest.
            }
        }
        answers
    })?;
    Ok(answers.into_iter().map(PoseAnswer::from).collect())
}

/// What is known of a lens whose focal length is estimated with the pose.
///
/// # Errors
/// `input` without the size of the image, and beside options that a known lens needs.
pub fn unknown_lens(
    py: Python<'_>,
    method: Method,
    robust_threshold_px: Option<f64>,
    image_size_px: Option<(u32, u32)>,
) -> PyResult<LensPrior> {
    if method != Method::Auto || robust_threshold_px.is_some() {
        let message = "camera: without one the focal length is estimated, which has a method of its own and takes no robust_threshold_px";
        return Err(error::input(py, message));
    }
    let Some((width_px, height_px)) = image_size_px else {
        let message = "image_size_px: without a camera the size of the image is needed, for the principal point is near its middle";
        return Err(error::input(py, message));
    };
    Ok(lens_of_unknown_focal(ImageSize { width_px, height_px }))
}
