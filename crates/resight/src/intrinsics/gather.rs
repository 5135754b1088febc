//! Collects the observations of each camera, view by view, from images or from rows, without intrinsics.

use super::{IntrinsicsRequest, IntrinsicsSource, NAMELESS};
use crate::core::camera::{ImageSize, Pinhole};
use crate::core::{Camera, CameraMatrix, Correspondence, Target};
use crate::error::Error;
use crate::formats::{NamedCamera, plausible};
use crate::input::not_among;
use crate::rig::names::natural;
use crate::rig::{
    Collected, DetectionSource, LeftOut, OTHER_SIZE, RigRequest, camera_names, collect_detections,
    collect_images,
};

/// One target in one image.
#[derive(Debug, Clone)]
pub(crate) struct NamedView {
    /// Its name, combined with that of the target where there are several.
    pub name: String,
    /// Its target, where that is known.
    pub target: Option<Target>,
    /// Names of the points.
    pub names: Vec<String>,
    pub points: Vec<Correspondence>,
}

/// The observations of one camera.
#[derive(Debug, Clone)]
pub(crate) struct CameraViews {
    pub name: String,
    /// Size of the images; `None` where nothing was found.
    pub size: Option<ImageSize>,
    pub views: Vec<NamedView>,
    pub left_out: Vec<LeftOut>,
    pub several_targets: bool,
}

impl CameraViews {
    /// Returns the relative standard deviations of the printed target's lengths along x and y, from its rulers; zero where these were not
    /// measured.
    pub fn scale_sigma(&self) -> [f64; 2] {
        let scale = |view: &NamedView| Some(view.target.as_ref()?.printed_scale()?.relative_sigma());
        self.views.iter().find_map(scale).unwrap_or_default()
    }

    /// Returns remarks on sizes of the targets, or on stated positions of points, that are implausible in metres.
    pub fn size_remarks(&self) -> Vec<String> {
        let stated = self.views.iter().filter(|view| view.target.is_none()).flat_map(|view| &view.points);
        let mut remarks: Vec<String> =
            plausible::of_uncertain_points(stated.map(|c| (c.x_in_target, c.sigma_m))).into_iter().collect();
        for target in self.views.iter().filter_map(|view| view.target.as_ref()) {
            remarks.extend(plausible::of_target(target));
        }
        remarks.dedup();
        remarks
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Gathered {
    pub cameras: Vec<CameraViews>,
    pub remarks: Vec<String>,
}

pub(super) fn gather(request: &IntrinsicsRequest) -> Result<Gathered, Error> {
    let names = names(request)?;
    let mut collected = nothing_observed(&names, &request.targets)?;
    let stated = match &request.source {
        IntrinsicsSource::Images { images, options } => {
            collect_images(images, options, &mut collected)?;
            None
        }
        IntrinsicsSource::Detections { detections, size } => {
            collect_detections(detections, &mut collected)?;
            Some(*size)
        }
    };
    collected.check_duplicates()?;
    check_sizes(&collected)?;
    let remarks = std::mem::take(&mut collected.remarks);
    let wanted = |name: &String| request.cameras.is_empty() || request.cameras.contains(name);
    let cameras =
        (0..names.len()).filter(|i| wanted(&names[*i])).map(|i| of_camera(i, &collected, stated)).collect();
    Ok(Gathered { cameras, remarks })
}

/// Returns cameras of unknown lenses that observed nothing yet.
pub(crate) fn nothing_observed(names: &[String], targets: &[(String, Target)]) -> Result<Collected, Error> {
    let mut collected = Collected::new(&RigRequest {
        cameras: names.iter().map(|name| of_unknown_lens(name)).collect(),
        targets: targets.to_vec(),
        ..RigRequest::default()
    })?;
    collected.knows_lenses = false;
    Ok(collected)
}

/// Returns the names of all cameras: those of the request, or those of the detections.
fn names(request: &IntrinsicsRequest) -> Result<Vec<String>, Error> {
    let IntrinsicsSource::Detections { detections, .. } = &request.source else {
        return Ok(match request.cameras.is_empty() {
            true => vec![NAMELESS.to_string()],
            false => request.cameras.clone(),
        });
    };
    let mut names: Vec<String> = Vec::new();
    match detections.source {
        DetectionSource::Files(files) => {
            for file in files {
                names.extend(camera_names(file)?);
            }
        }
        DetectionSource::Rows(rows) => names.extend(rows.iter().map(|row| row.camera.to_string())),
    }
    names.sort_by(|a, b| natural(a, b));
    names.dedup();
    if names.is_empty() {
        let named = request.cameras.first().cloned();
        return Ok(vec![named.unwrap_or_else(|| NAMELESS.to_string())]);
    }
    match request.cameras.iter().find(|name| !names.contains(name)) {
        Some(unknown) => {
            Err(Error::request(format!("--camera-name {unknown}: {}", not_among(unknown, "camera", &names))))
        }
        None => Ok(names),
    }
}

/// Returns a camera whose intrinsics are unknown. A correspondence has a bearing beside its pixel: this pinhole gives every pixel one, which
/// neither detectors (`knows_lenses`) nor the adjustment read.
fn of_unknown_lens(name: &str) -> NamedCamera {
    let matrix = CameraMatrix { fx_px: 1e3, fy_px: 1e3, cx_px: 0.0, cy_px: 0.0 };
    let camera = Camera { lens: Pinhole { matrix }.into(), size: None };
    NamedCamera { name: name.to_string(), camera, placement: None, intrinsics_covariance: None }
}

/// Checks that the images of a camera have one size.
fn check_sizes(collected: &Collected) -> Result<(), Error> {
    let odd: Vec<&LeftOut> = collected.left_out.iter().filter(|one| one.reason == OTHER_SIZE).collect();
    let Some(first) = odd.first() else { return Ok(()) };
    let size = collected.cameras.iter().find(|c| c.name == first.camera).and_then(|c| c.camera.size);
    let size = size.map_or_else(String::new, |s| format!(" of {} × {} px", s.width_px, s.height_px));
    let n = collected.frames.iter().filter(|f| collected.cameras[f.camera].name == first.camera).count();
    Err(Error::request(format!(
        "camera {}: {} of {} images, {} first, have another size than the others{size}; calibrate images of each size apart, for they were cropped, scaled or taken by different cameras",
        first.camera,
        odd.len(),
        odd.len() + n,
        first.view
    )))
}

/// Returns the observations of one camera; `stated` is the size of its images where detections do not state it.
pub(crate) fn of_camera(camera: usize, collected: &Collected, stated: Option<ImageSize>) -> CameraViews {
    let NamedCamera { name, camera: lens, .. } = &collected.cameras[camera];
    let mut frames: Vec<_> = collected.frames.iter().filter(|frame| frame.camera == camera).collect();
    frames.sort_by(|a, b| natural(&a.name, &b.name));
    let mut used: Vec<usize> =
        frames.iter().flat_map(|frame| frame.targets.iter().map(|(t, _)| *t)).collect();
    used.sort_unstable();
    used.dedup();
    let several_targets = 1 < used.len();
    let mut views = Vec::new();
    for frame in frames {
        for (target, points) in &frame.targets {
            let named = &collected.targets[*target];
            let view =
                if several_targets { format!("{} {}", frame.name, named.name) } else { frame.name.clone() };
            views.push(NamedView {
                name: view,
                target: named.target.clone(),
                names: points.iter().map(|(name, _)| name.clone()).collect(),
                points: points.iter().map(|(_, c)| *c).collect(),
            });
        }
    }
    let left_out = collected.left_out.iter().filter(|one| one.camera == *name).cloned().collect();
    CameraViews { name: name.clone(), size: stated.or(lens.size), views, left_out, several_targets }
}
