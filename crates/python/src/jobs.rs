//! Jobs over several images or files. Each returns the JSON line that the program prints with --json; `python/resight` makes answers of it.

use crate::camera::Camera;
use crate::columns::{Detected, Found};
use crate::error;
use crate::image::{Input, corner_window};
use crate::run::run;
use crate::target::Target;
use pyo3::prelude::*;
use resight::answer::{
    CompareAnswer, IntrinsicsAnswer, IntrinsicsCheckAnswer, MapAnswer, PoseGraphAnswer, RigAnswer,
};
use resight::compare::CompareOptions;
use resight::core::Target as AnyTarget;
use resight::core::camera::ImageSize;
use resight::core::explanation::Tolerance;
use resight::core::multiview::pose_graph::PairSigma;
use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource, Models, model_names};
use resight::map::{MapImage, MapRequest, read_tag_rows};
use resight::rig::pairs::read_pairs;
use resight::rig::{
    CameraDistance, CameraImage, FrameTimes, ImageOptions, PoseGraphMethod, PoseGraphRequest, RigRequest,
};
use std::collections::BTreeMap;
use std::path::PathBuf;

pub type JobResult<T> = Result<T, resight::Error>;

/// Runs a job and writes its answer.
pub fn answered(
    py: Python<'_>,
    job: impl FnOnce() -> JobResult<Vec<String>> + Send + 'static,
) -> PyResult<Vec<String>> {
    run(py, None, move |_| job())?.map_err(|reason| error::job(py, &reason))
}

/// The same for a job over images, which reports how far it is.
pub fn observed(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce() -> JobResult<Vec<String>> + Send + 'static,
) -> PyResult<Vec<String>> {
    let answer = run(py, progress, move |reporter| {
        let reporter = reporter.clone();
        resight::parallel::observed(move |n_done, n_all| reporter.done(n_done, n_all), job)
    });
    answer?.map_err(|reason| error::job(py, &reason))
}

pub fn line(answer: &impl serde::Serialize) -> JobResult<String> {
    serde_json::to_string(answer).map_err(|reason| resight::Error::request(reason.to_string()))
}

/// A camera or target: its name where it has one, and the object or its file.
pub type Named<'py> = (Option<String>, Bound<'py, PyAny>);

/// What every rig is asked.
pub fn request(cameras: Vec<Named<'_>>, targets: Vec<Named<'_>>) -> PyResult<RigRequest> {
    let mut request = RigRequest::default();
    for (name, camera) in cameras {
        let py = camera.py();
        if let Ok(camera) = camera.cast::<Camera>() {
            let known = camera.get().known.clone();
            let name = name.unwrap_or_else(|| known.name.clone());
            request.cameras.push(resight::formats::NamedCamera { name, ..known });
            continue;
        }
        let file: PathBuf =
            camera.extract().map_err(|_| error::input(py, "cameras: a Camera or a path is needed"))?;
        let read = request.read_camera(name.as_deref(), file);
        read.map_err(|reason| error::job(py, &reason))?;
    }
    for (name, target) in targets {
        let py = target.py();
        if let Ok(target) = target.cast::<Target>() {
            let name = name.unwrap_or_else(|| target.get().target.kind().to_owned());
            request.add_target(name, target.get().target.clone());
            continue;
        }
        let file: PathBuf =
            target.extract().map_err(|_| error::input(py, "targets: a Target or a path is needed"))?;
        request.read_target(name.as_deref(), &file).map_err(|reason| error::job(py, &reason))?;
    }
    Ok(request)
}

/// Two cameras, their distance and its standard deviation, metres.
type Distance = (String, String, f64, f64);

/// How a rig is solved, as `resight rig` has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Solving {
    reference: Option<String>,
    world: Option<String>,
    fixed_together: Vec<Vec<String>>,
    known_distances_m: Vec<Distance>,
    sync_tolerance_s: Option<f64>,
    tolerance_rotation_rad: Option<f64>,
    tolerance_translation_m: Option<f64>,
    joint_covariance: bool,
    adjust_lenses: bool,
    rolling_shutter: bool,
}

impl Solving {
    pub fn of(self, request: RigRequest) -> RigRequest {
        let distance = |(a, b, distance_m, sigma_m)| CameraDistance { a, b, distance_m, sigma_m };
        RigRequest {
            reference: self.reference,
            world: self.world,
            fixed_together: self.fixed_together,
            known_distances: self.known_distances_m.into_iter().map(distance).collect(),
            sync_tolerance_s: self.sync_tolerance_s,
            tolerance: Tolerance {
                rotation_rad: self.tolerance_rotation_rad,
                translation_m: self.tolerance_translation_m,
            },
            joint_covariance: self.joint_covariance,
            adjust_lenses: self.adjust_lenses,
            rolling_shutter: self.rolling_shutter,
            ..request
        }
    }
}

/// The answer, and the file that `resight rig -o` writes where there is a rig; empty where cameras do not say how large their images are.
pub fn rig_lines(answer: &RigAnswer) -> JobResult<Vec<String>> {
    match answer {
        RigAnswer::Solved(solved) => Ok(vec![line(solved)?, solved.file().unwrap_or_default()]),
        RigAnswer::Unsolved(reason) => Ok(vec![line(reason)?]),
    }
}

/// An image of a camera: its name, the view's name in memory, the pattern of its file, and the image or its path.
pub type Taken<'py> = (String, Option<String>, Option<String>, Bound<'py, PyAny>);

pub fn taken(images: Vec<Taken<'_>>) -> PyResult<Vec<CameraImage>> {
    let one = |(camera, view, pattern, image): Taken<'_>| {
        let view = view.unwrap_or_default();
        Ok(match (Input::new(&image, &view)?, pattern) {
            (Input::File(path), Some(pattern)) => CameraImage::matched(camera, path, pattern),
            (Input::File(path), None) => CameraImage::file(camera, path),
            (Input::Memory(view, image), _) => CameraImage::in_memory(camera, view, image),
        })
    };
    images.into_iter().map(one).collect()
}

/// Solves for a rig from images; the line of `resight rig --json`, and its file.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn rig_from_images(
    py: Python<'_>,
    cameras: Vec<Named<'_>>,
    targets: Vec<Named<'_>>,
    images: Vec<Taken<'_>>,
    solving: Solving,
    timestamps: Option<PathBuf>,
    corner_half_px: Option<u32>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let request = solving.of(request(cameras, targets)?);
    let images = taken(images)?;
    observed(py, progress, move || {
        let names: Vec<String> = request.cameras.iter().map(|camera| camera.name.clone()).collect();
        let times = timestamps.map(|file| FrameTimes::read(&file, &names)).transpose()?;
        let options = ImageOptions { times, corner_window: corner_window(corner_half_px), kept: None };
        rig_lines(&resight::rig_from_images(&images, &options, &request)?)
    })
}

/// Solves for a rig from detections; the line of `resight rig --json`, and its file.
#[pyfunction]
pub fn rig_from_detections(
    py: Python<'_>,
    cameras: Vec<Named<'_>>,
    targets: Vec<Named<'_>>,
    detections: Detected<'_>,
    sigma_px: Option<f64>,
    solving: Solving,
) -> PyResult<Vec<String>> {
    let request = solving.of(request(cameras, targets)?);
    let found = detections.owned(py)?;
    answered(py, move || {
        found.with(sigma_px, |rows| rig_lines(&resight::rig_from_detections(&rows, &request)?))
    })
}

/// Writes a text whole or not at all.
#[pyfunction]
pub fn write_atomically(py: Python<'_>, path: PathBuf, text: &str) -> PyResult<()> {
    resight::formats::write_atomically(&path, text.as_bytes()).map_err(|reason| error::file(py, &reason))
}

/// Solves for a rig from poses of pairs; the line of `resight pose-graph --json`, and its file.
#[pyfunction]
pub fn pose_graph(
    py: Python<'_>,
    file: PathBuf,
    cameras: Vec<Named<'_>>,
    reference: Option<String>,
    is_chain: bool,
    sigmas: Option<(f64, f64)>,
    joint_covariance: bool,
) -> PyResult<Vec<String>> {
    let lenses = request(cameras, Vec::new())?.cameras;
    let method = if is_chain { PoseGraphMethod::Chain } else { PoseGraphMethod::Joint };
    let median_sigma = sigmas.map(|(sigma_rad, sigma_m)| PairSigma { sigma_rad, sigma_m });
    answered(py, move || {
        let request = PoseGraphRequest {
            reference,
            method,
            median_sigma,
            joint_covariance,
            ..PoseGraphRequest::new(read_pairs(&file)?)
        };
        match resight::pose_graph(&request)? {
            PoseGraphAnswer::Solved(solved) => Ok(vec![line(&solved)?, solved.file(&lenses)?]),
            PoseGraphAnswer::Unsolved(reason) => Ok(vec![line(&reason)?]),
        }
    })
}

/// What a map is asked, as `resight map` has it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Mapping {
    family: Option<String>,
    size_m: Option<f64>,
    sizes_m: BTreeMap<u32, f64>,
    reference: Option<u32>,
    sigma_px: f64,
    joint_covariance: bool,
}

/// The answer, and the map as a file where there is one to rely on.
#[pyfunction]
pub fn map_tags(
    py: Python<'_>,
    camera: &Bound<'_, Camera>,
    images: Vec<Taken<'_>>,
    detections: Option<PathBuf>,
    known: Option<&Bound<'_, Target>>,
    mapping: Mapping,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let known = match known.map(|target| target.get().target.clone()) {
        None => None,
        Some(AnyTarget::TagMap(map)) => Some(map),
        Some(_) => return Err(error::input(py, "known: a map of tags is needed")),
    };
    let image = |(_, view, _, image): Taken<'_>| {
        Ok(match Input::new(&image, &view.unwrap_or_default())? {
            Input::File(path) => MapImage::File(path),
            Input::Memory(view, image) => MapImage::Memory(view, image),
        })
    };
    let images = images.into_iter().map(image).collect::<PyResult<Vec<MapImage>>>()?;
    let family = mapping.family.or_else(|| known.as_ref().map(|map| map.family.clone()));
    let request = MapRequest {
        size_m: mapping.size_m,
        sizes_m: mapping.sizes_m,
        reference: mapping.reference,
        sigma_px: mapping.sigma_px,
        joint_covariance: mapping.joint_covariance,
        known,
        ..MapRequest::new(camera.get().known.clone(), family.unwrap_or_else(|| "tag36h11".to_owned()))
    };
    observed(py, progress, move || {
        let answer = match detections {
            Some(file) => resight::map_from_rows(&read_tag_rows(&file)?, &request)?,
            None => resight::map_from_images(&images, &request)?,
        };
        match answer {
            MapAnswer::Solved(solved) => Ok(std::iter::once(line(&solved)?).chain(solved.file()).collect()),
            MapAnswer::Unsolved(reason) => Ok(vec![line(&reason)?]),
        }
    })
}

fn models(py: Python<'_>, name: &str) -> PyResult<Models> {
    if name == "auto" {
        return Ok(Models::ByEvidence);
    }
    let names = model_names();
    let found = names.iter().find(|known| **known == name);
    found.map(|known| Models::Named(known)).ok_or_else(|| {
        error::input(py, format!("model: there is no `{name}`; there are auto, {}", names.join(", ")))
    })
}

/// What `intrinsics` and its check look at: images with targets, or detections with the size of their images.
struct Observations {
    targets: Vec<(String, resight::core::Target)>,
    seen: Seen,
}

enum Seen {
    Images(Vec<CameraImage>, Vec<String>),
    Points(Found, Option<f64>, ImageSize),
}

impl Observations {
    fn new(
        targets: Vec<Named<'_>>,
        images: Vec<Taken<'_>>,
        detections: Option<Detected<'_>>,
        image_size_px: Option<(u32, u32)>,
        sigma_px: Option<f64>,
        py: Python<'_>,
    ) -> PyResult<Self> {
        let seen = match (detections, image_size_px) {
            (None, _) => {
                let mut cameras: Vec<String> = Vec::new();
                for (camera, ..) in &images {
                    if !cameras.contains(camera) {
                        cameras.push(camera.clone());
                    }
                }
                Seen::Images(taken(images)?, cameras)
            }
            (Some(found), Some((width_px, height_px))) => {
                Seen::Points(found.owned(py)?, sigma_px, ImageSize { width_px, height_px })
            }
            (Some(_), None) => {
                return Err(error::input(py, "image_size_px: detections need the size of their images"));
            }
        };
        Ok(Observations { targets: request(Vec::new(), targets)?.targets, seen })
    }

    /// Runs a job with a request for these.
    fn with<T>(self, job: impl FnOnce(IntrinsicsRequest) -> T) -> T {
        let Observations { targets, seen } = self;
        match seen {
            Seen::Images(images, cameras) => {
                let source = IntrinsicsSource::Images { images, options: ImageOptions::default() };
                job(IntrinsicsRequest { cameras, targets, ..IntrinsicsRequest::new(source) })
            }
            Seen::Points(found, sigma_px, size) => found.with(sigma_px, |detections| {
                let source = IntrinsicsSource::Detections { detections, size };
                job(IntrinsicsRequest { targets, ..IntrinsicsRequest::new(source) })
            }),
        }
    }
}

/// The answer, and the camera file where there is a camera to rely on.
fn intrinsics_lines(answer: &IntrinsicsAnswer) -> JobResult<Vec<String>> {
    let reliable = answer.reliable();
    let mut lines = vec![line(answer)?];
    if !reliable.is_empty() {
        lines.push(resight::formats::own_file(&reliable)?);
    }
    Ok(lines)
}

/// Estimates the intrinsics of each camera; the lines of `resight intrinsics --json`, and their files.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn intrinsics(
    py: Python<'_>,
    targets: Vec<Named<'_>>,
    images: Vec<Taken<'_>>,
    detections: Option<Detected<'_>>,
    image_size_px: Option<(u32, u32)>,
    sigma_px: Option<f64>,
    model: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let observations = Observations::new(targets, images, detections, image_size_px, sigma_px, py)?;
    let models = models(py, model)?;
    observed(py, progress, move || {
        observations
            .with(|request| intrinsics_lines(&resight::intrinsics(&IntrinsicsRequest { models, ..request })?))
    })
}

/// Tests camera files on images; the lines of `resight intrinsics --check --json`.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // As the package has them, by keyword.
pub fn check_intrinsics(
    py: Python<'_>,
    cameras: Vec<Named<'_>>,
    targets: Vec<Named<'_>>,
    images: Vec<Taken<'_>>,
    detections: Option<Detected<'_>>,
    image_size_px: Option<(u32, u32)>,
    sigma_px: Option<f64>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let checked = request(cameras, Vec::new())?.cameras;
    let of_camera = || checked.first()?.camera.size.map(|size| (size.width_px, size.height_px));
    let size = image_size_px.or_else(of_camera);
    let observations = Observations::new(targets, images, detections, size, sigma_px, py)?;
    observed(py, progress, move || {
        observations.with(|request| {
            let answer: IntrinsicsCheckAnswer =
                resight::check_intrinsics(&IntrinsicsRequest { checked, ..request })?;
            Ok(vec![line(&answer)?])
        })
    })
}

/// Compares two calibrations; the lines of `resight compare --json`.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    before: PathBuf,
    after: PathBuf,
    alpha: f64,
    sigmas: Option<(f64, f64)>,
) -> PyResult<Vec<String>> {
    if !(0.0 < alpha && alpha < 1.0) {
        return Err(error::input(py, format!("alpha: {alpha} is given, a chance between 0 and 1 is needed")));
    }
    let options = CompareOptions { alpha, ..CompareOptions::default() };
    let options = match sigmas {
        Some((sigma_m, sigma_rad)) => options.with_sigmas(sigma_m, sigma_rad),
        None => options,
    };
    answered(py, move || {
        let (before, after) = (resight::compare::read(&before)?.0, resight::compare::read(&after)?.0);
        match resight::compare(&before, &after, &options)? {
            CompareAnswer::Rigs(rigs) => Ok(vec![line(&rigs)?]),
            CompareAnswer::Views(views) => views.iter().map(line).collect(),
        }
    })
}

/// One line a query, then one for the whole network.
#[pyfunction]
pub fn measure(py: Python<'_>, scene: PathBuf) -> PyResult<Vec<String>> {
    answered(py, move || {
        let scene = resight::measure::read_scene(&scene)?;
        let answer = resight::measure(&scene)?;
        answer.answers.iter().map(line).chain([line(&answer.network)]).collect()
    })
}

/// Describes a file; the lines of `resight explain --json`.
#[pyfunction]
pub fn explain(py: Python<'_>, file: PathBuf) -> PyResult<Vec<String>> {
    answered(py, move || Ok(vec![line(&resight::explain(&file)?)?]))
}

/// The JSON schema of every answer.
#[pyfunction]
pub fn schema(py: Python<'_>) -> PyResult<String> {
    serde_json::to_string(&resight::answer::json_schema(&[]))
        .map_err(|reason| error::error(py, "write", reason.to_string()))
}
