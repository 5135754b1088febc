//! Images to poses and detections. An image is a path, the bytes of a PNG or JPEG, or an array (height, width) or (height, width, channels) of
//! uint8.

use crate::answer::PoseAnswer;
use crate::camera::Camera;
use crate::error;
use crate::pixels::{Pixels, is_array};
use crate::points::method;
use crate::run::run;
use crate::target::Target;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use resight::GrayImage;
use resight::answer::DetectionAnswer;
use resight::detect::absent::Explainer;
use resight::detect::every_tag::EveryTagFinder;
use resight::detect::job::{self, detect_every_tag, detect_target};
use resight::detect::{CornerWindow, Detector};
use resight::locate::{ImageLocator, IntrinsicsCovariance, LocateOptions, Located, Method, explain};
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// An image, and what it is called in answers.
pub enum Input {
    File(PathBuf),
    Memory(String, GrayImage),
}

impl Input {
    /// # Errors
    /// `input` for what is no image.
    pub fn new(value: &Bound<'_, PyAny>, view: &str) -> PyResult<Self> {
        let py = value.py();
        if is_array(value)? {
            let image = GrayImage::of_channels(&Pixels::new(value)?.channels())
                .map_err(|reason| error::input(py, format!("image: {reason}")))?;
            return Ok(Input::Memory(view.to_owned(), image));
        }
        if let Ok(bytes) = value.cast::<PyBytes>() {
            let image = GrayImage::decode(bytes.as_bytes())
                .map_err(|reason| error::input(py, format!("image: {reason}")))?;
            return Ok(Input::Memory(view.to_owned(), image));
        }
        value.extract::<PathBuf>().map(Input::File).map_err(|_| {
            let kind = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
            let message = format!(
                "image: a path, the bytes of a PNG or JPEG, or an array of uint8 is needed, {kind} is given"
            );
            error::input(py, message)
        })
    }

    /// The name in answers, and the image with a remark on its orientation, or why there is none.
    pub fn read(&self) -> (String, Result<Remarked<'_>, String>) {
        match self {
            Input::File(path) => {
                let image = GrayImage::read_with_remark(path).map_err(|e| e.to_string());
                (path.display().to_string(), image.map(|(image, remark)| (Cow::Owned(image), remark)))
            }
            Input::Memory(view, image) => (view.clone(), Ok((Cow::Borrowed(image), None))),
        }
    }
}

/// An image, and the remark on its orientation where there is one.
type Remarked<'a> = (Cow<'a, GrayImage>, Option<String>);

/// Half width of the window in which corners are refined; none: what is printed around them is laid on the image.
pub fn corner_window(half_px: Option<u32>) -> CornerWindow {
    half_px.map_or(CornerWindow::default(), CornerWindow::Half)
}

/// What one image is asked, owned by the thread that answers.
struct Request {
    camera: resight::core::Camera,
    target: resight::core::Target,
    options: LocateOptions,
    remarks: Vec<String>,
    explainer: Arc<Mutex<Explainer>>,
}

impl Request {
    fn new(
        py: Python<'_>,
        camera: Option<&Camera>,
        target: &Target,
        method_name: &str,
        corner_half_px: Option<u32>,
    ) -> PyResult<Self> {
        let method = method(py, method_name)?;
        if camera.is_none() && method != Method::Auto {
            return Err(error::input(
                py,
                "method: without a camera the focal length is estimated, which has a method of its own",
            ));
        }
        let intrinsics: Option<IntrinsicsCovariance> = camera.and_then(Camera::intrinsics);
        let mut remarks = target.warnings.clone();
        remarks.extend(camera.and_then(|camera| camera.remark.clone()));
        Ok(Request {
            camera: camera
                .map_or_else(resight::core::Camera::normalized, |camera| camera.known.camera.clone()),
            target: target.target.clone(),
            options: LocateOptions {
                method,
                intrinsics: intrinsics.filter(|_| method != Method::Wang2004),
                corner_window: corner_window(corner_half_px),
                estimate_focal: camera.is_none(),
            },
            remarks,
            explainer: Arc::clone(&target.explainer),
        })
    }

    /// Says of the first image without the target what it shows instead.
    fn explain(&self, answer: &mut resight::PoseAnswer, image: Option<&Input>) {
        if let Ok(mut explainer) = self.explainer.lock() {
            explain(answer, &self.target, &mut explainer, || Some(image?.read().1.ok()?.0.into_owned()));
        }
    }

    fn answer(&self, locator: &mut ImageLocator, image: &Input) -> resight::PoseAnswer {
        let (view, image) = image.read();
        let mut located = match image {
            Ok((image, remark)) => {
                let mut located = locator.locate(&image, view);
                located.answer.remarks.extend(remark);
                located
            }
            Err(reason) => Located::error(view, reason),
        };
        located.answer.remarks.splice(..0, self.remarks.iter().cloned());
        located.answer
    }
}

/// The pose of a camera from an image of a target; without a camera its focal length is estimated too.
#[pyfunction]
#[pyo3(signature = (image, camera, target, *, method="auto", corner_half_px=None, view="image"))]
pub fn locate_image(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    camera: Option<&Camera>,
    target: &Target,
    method: &str,
    corner_half_px: Option<u32>,
    view: &str,
) -> PyResult<PoseAnswer> {
    let request = Request::new(py, camera, target, method, corner_half_px)?;
    let image = Input::new(image, view)?;
    let answer = run(py, None, move |_| -> Result<resight::PoseAnswer, resight::Error> {
        let mut locator = ImageLocator::new(&request.camera, &request.target, &request.options)?;
        let mut answer = request.answer(&mut locator, &image);
        request.explain(&mut answer, Some(&image));
        Ok(answer)
    })?;
    Ok(answer.map_err(|reason| error::job(py, &reason))?.into())
}

/// The same for many images, on all cores; answers in the order of the images.
#[pyfunction]
#[pyo3(signature = (images, camera, target, *, method="auto", corner_half_px=None, progress=None))]
pub fn locate_images(
    py: Python<'_>,
    images: Vec<Bound<'_, PyAny>>,
    camera: Option<&Camera>,
    target: &Target,
    method: &str,
    corner_half_px: Option<u32>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<PoseAnswer>> {
    let request = Request::new(py, camera, target, method, corner_half_px)?;
    let inputs = images.iter().enumerate().map(|(i, image)| Input::new(image, &format!("image {i}")));
    let inputs: Vec<Input> = inputs.collect::<PyResult<_>>()?;
    let total = inputs.len();
    let answers = run(py, progress, move |reporter| -> Result<Vec<resight::PoseAnswer>, resight::Error> {
        let mut answers = Vec::with_capacity(inputs.len());
        resight::parallel::detect_in_order(
            &inputs,
            || ImageLocator::new(&request.camera, &request.target, &request.options),
            |locator: &mut ImageLocator, input: &Input| request.answer(locator, input),
            |mut answer| -> Result<(), resight::Error> {
                request.explain(&mut answer, inputs.get(answers.len()));
                answers.push(answer);
                match reporter.done(answers.len(), total) {
                    true => Ok(()),
                    false => Err(resight::Error::request("the caller stopped")),
                }
            },
        )?;
        Ok(answers)
    })?;
    let answers = answers.map_err(|reason| error::job(py, &reason))?;
    Ok(answers.into_iter().map(PoseAnswer::from).collect())
}

/// The points of a target, or every tag of a family, in an image; the line that the program prints with --json.
#[pyfunction]
#[pyo3(signature = (image, target=None, *, family=None, corner_half_px=None, view="image"))]
pub fn detect(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    target: Option<&Target>,
    family: Option<String>,
    corner_half_px: Option<u32>,
    view: &str,
) -> PyResult<String> {
    let image = Input::new(image, view)?;
    let target = target.map(|target| target.target.clone());
    let found = run(py, None, move |_| -> Result<DetectionAnswer, resight::Error> {
        let (view, image) = image.read();
        let (image, remark) = match image {
            Ok(read) => read,
            Err(reason) => return Ok(DetectionAnswer::error(&view, reason)),
        };
        let mut answer = match (target, family) {
            (Some(target), None) => {
                let mut detector = Detector::with_corner_window(&target, corner_window(corner_half_px))?;
                let mut answer = detect_target(&mut detector, &target, &view, &image);
                // Asked about one image at a time, detection is what says what is there.
                job::explain(&mut answer, &target, &mut Explainer::default(), || Some(image.into_owned()));
                answer
            }
            (None, Some(family)) => {
                let mut finder = EveryTagFinder::new(&family)?;
                detect_every_tag(&mut finder, &family, &view, &image)
            }
            _ => return Err(resight::Error::request("give a target, or the family of the tags")),
        };
        answer.remarks.extend(remark);
        Ok(answer)
    })?;
    let found = found.map_err(|reason| error::job(py, &reason))?;
    serde_json::to_string(&found).map_err(|reason| error::error(py, "write", reason.to_string()))
}
