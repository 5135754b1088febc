//! Intrinsics from images or detections of a target: the jobs of `resight intrinsics`.

mod gather;
mod describe;
mod check;

pub use crate::core::multiview::intrinsics::{Models, Noise, TargetShape, model_names};
pub use check::check_intrinsics;
pub(crate) use describe::{next_view_words, not_found, placed, too_few_points_of};
pub(crate) use gather::{CameraViews, nothing_observed, of_camera};

use crate::answer::intrinsics::{CameraIntrinsics, IntrinsicsAnswer};
use crate::core::Target;
use crate::core::camera::ImageSize;
use crate::core::multiview::intrinsics::{
    IntrinsicsConfig, IntrinsicsOutcome, LEAST_POINTS, SolvedIntrinsics, solve_intrinsics,
};
use crate::error::Error;
use crate::formats::{self, NamedCamera, TagOptions};
use crate::rig::{CameraImage, Detections, ImageOptions};
use gather::gather;
use std::path::Path;

/// The observations of the cameras.
#[derive(Debug, Clone)]
pub enum IntrinsicsSource<'a> {
    /// Images or videos in which the request's targets are searched for.
    Images {
        /// The images, each with the name of its camera.
        images: Vec<CameraImage>,
        /// Options of the detection.
        options: ImageOptions,
    },
    /// Points that another detector found.
    Detections {
        /// Files, in which the column `camera` may be missing, or rows in memory.
        detections: Detections<'a>,
        /// Size of the images.
        size: ImageSize,
    },
}

/// A request for intrinsics.
#[derive(Debug, Clone)]
pub struct IntrinsicsRequest<'a> {
    /// The observations.
    pub source: IntrinsicsSource<'a>,
    /// The targets by name.
    pub targets: Vec<(String, Target)>,
    /// Names of the cameras; those of images must be among them, and rows of other cameras are ignored. Empty with detections: all cameras named
    /// there.
    pub cameras: Vec<String>,
    /// Lens models that are tried.
    pub models: Models,
    /// The source of the noise of the corners.
    pub noise: Noise,
    /// Whether the stretch and the bend of a flat target are estimated too.
    pub target_shape: TargetShape,
    /// Cameras to be checked, for [`check_intrinsics`].
    pub checked: Vec<NamedCamera>,
}

/// The name of a camera whose observations state none.
pub const NAMELESS: &str = "camera";

impl<'a> IntrinsicsRequest<'a> {
    /// Creates a request for a source, with the defaults for everything else.
    pub fn new(source: IntrinsicsSource<'a>) -> Self {
        IntrinsicsRequest {
            source,
            targets: Vec::new(),
            cameras: Vec::new(),
            models: Models::default(),
            noise: Noise::default(),
            target_shape: TargetShape::default(),
            checked: Vec::new(),
        }
    }

    /// Reads the target of a file, under the file's name without its ending; returns what is unusual about it.
    ///
    /// # Errors
    /// What is wrong with the file, and where; a name that another target already has.
    pub fn read_target(&mut self, path: impl AsRef<Path>) -> Result<Vec<String>, Error> {
        let path = path.as_ref();
        let file = formats::read_target_with(path, &TagOptions::default())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if self.targets.iter().any(|(other, _)| *other == name) {
            return Err(Error::request(format!("two targets are called `{name}`; rename one of the files")));
        }
        self.targets.push((name, file.target));
        Ok(file.warnings.iter().map(|warning| format!("warning: {}: {warning}", path.display())).collect())
    }
}

/// Estimates the intrinsics of one or several cameras, with their covariance, from views of known points.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource};
/// use resight::rig::Detections;
/// # let folder = std::env::temp_dir().join("resight-intrinsics-doc");
/// # std::fs::create_dir_all(&folder)?;
/// # let file = folder.join("corners.csv");
/// # std::fs::write(&file, "view,id,x_m,y_m,z_m,u_px,v_px\n1,0,0,0,0,10,10\n")?;
/// let size = resight::core::camera::ImageSize { width_px: 640, height_px: 480 };
/// let files = [file];
/// let detections = Detections { sigma_px: Some(0.2), ..Detections::files(&files) };
/// let source = IntrinsicsSource::Detections { detections, size };
/// let answer = resight::intrinsics(&IntrinsicsRequest::new(source))?;
/// assert_eq!(answer.status, resight::Status::Degenerate); // One point of one view is not enough.
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// A file that cannot be read, a target that cannot be detected, an incomplete request, images of several sizes. If the views do not determine
/// the camera, the answer has the status `Degenerate` and states what is missing.
pub fn intrinsics(request: &IntrinsicsRequest) -> Result<IntrinsicsAnswer, Error> {
    let gathered = gather(request)?;
    let cameras = gathered.cameras.iter().map(|camera| solved(camera, request)).collect::<Result<_, _>>()?;
    Ok(IntrinsicsAnswer::new(cameras, gathered.remarks))
}

fn solved(camera: &CameraViews, request: &IntrinsicsRequest) -> Result<CameraIntrinsics, Error> {
    let is_of_images = matches!(request.source, IntrinsicsSource::Images { .. });
    let Some(size) = camera.size.filter(|_| !(is_of_images && camera.views.is_empty())) else {
        let n_images = camera.left_out.iter().filter(|one| one.what == "frame").count();
        return Ok(describe::not_found(camera, n_images));
    };
    let IntrinsicsRequest { models, noise, target_shape, .. } = *request;
    let config = IntrinsicsConfig { models, noise, target_shape, ..IntrinsicsConfig::default() };
    Ok(solved_views(camera, size, &config)?.0)
}

/// Estimates a camera from its views, of which there is at least one; returns what the mathematics returned too, if it found a camera.
pub(crate) fn solved_views(
    camera: &CameraViews,
    size: ImageSize,
    config: &IntrinsicsConfig,
) -> Result<(CameraIntrinsics, Option<Box<SolvedIntrinsics>>), Error> {
    let most = camera.views.iter().map(|view| view.points.len()).max().unwrap_or(LEAST_POINTS);
    if most < LEAST_POINTS {
        return Ok((describe::too_few_points(camera, most), None));
    }
    let (several_targets, scale_sigma) = (camera.several_targets, camera.scale_sigma());
    let config = IntrinsicsConfig { several_targets, scale_sigma, ..*config };
    let views: Vec<_> = camera.views.iter().map(|view| &view.points).collect();
    let outcome = solve_intrinsics(&views, size, &config)?;
    let answer = describe::described(camera, size, &outcome);
    let solved = match outcome {
        IntrinsicsOutcome::Solved(solved) => Some(solved),
        IntrinsicsOutcome::Refused(_) => None,
    };
    Ok((answer, solved))
}
