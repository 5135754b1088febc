//! Lenses adjusted together with a rig: how far they moved, how well they are known now, and what that changed.

use super::images::{CameraImage, ImageOptions};
use super::{NamedRig, RigRequest};
use crate::core::multiview::intrinsics::{Projection, ProjectionDifference, projection_difference};
use crate::core::multiview::rig::{AdjustedLens, RigConfig, RigSolution, solve_rig, solve_rig_and_lenses};
use crate::core::{Camera, Error, Pixel};
use crate::error::Error as JobError;
use crate::formats::NamedCamera;
use crate::intrinsics::{IntrinsicsRequest, IntrinsicsSource, intrinsics};

/// Rows and columns of the places in an image at which a lens is compared.
const GRID: (usize, usize) = (12, 9);

/// A lens that was adjusted with the rig.
#[derive(Debug, Clone, PartialEq)]
pub struct LensChange {
    /// The difference from the camera file over the image, apart from a rotation of the camera; none without an image size.
    pub moved: Option<ProjectionDifference>,
    /// Standard deviation of the projection over the image now, root mean square, px; none without an image size.
    pub sigma_px: Option<f64>,
    /// Squared distance from the stated intrinsics in units of what their covariance and the rig's allow, and its degrees of freedom; none where
    /// no covariance was stated.
    pub from_stated: Option<(f64, usize)>,
    /// How far the camera lies from where it would with the camera files as they are: m, and rad; none where these give no rig.
    pub moved_camera: Option<(f64, f64)>,
}

/// Returns the request with the lenses of cameras without a file, estimated from their own images; none where every camera has one, or where
/// lenses are not adjusted.
pub(super) fn estimated(
    images: &[CameraImage],
    options: &ImageOptions,
    request: &RigRequest,
) -> Result<Option<RigRequest>, JobError> {
    let is_known = |name: &str| request.cameras.iter().any(|camera| camera.name == name);
    let own: Vec<CameraImage> = images.iter().filter(|image| !is_known(image.camera())).cloned().collect();
    if !request.adjust_lenses || own.is_empty() {
        return Ok(None);
    }
    let mut names: Vec<String> = own.iter().map(|image| image.camera().to_string()).collect();
    names.sort();
    names.dedup();
    let source = IntrinsicsSource::Images { images: own, options: options.clone() };
    let targets = request.targets.clone();
    let answer =
        intrinsics(&IntrinsicsRequest { targets, cameras: names, ..IntrinsicsRequest::new(source) })?;
    let mut request = request.clone();
    request.remarks.extend(answer.remarks);
    for one in answer.cameras {
        let Some(camera) = one.camera else {
            return Err(JobError::request(format!(
                "camera {} has no file, and its own images give no lens: {}; give its file: --camera {}=FILE",
                one.name, one.message, one.name
            )));
        };
        request.remarks.push(format!(
            "camera {} has no file: its lens ({}) is estimated from its own images and then adjusted with the rig",
            one.name,
            camera.camera.model_name()
        ));
        // The same images are evidence once: what they say of the lens, they say in the rig.
        request.cameras.push(NamedCamera { intrinsics_covariance: None, ..camera });
    }
    Ok(Some(request))
}

/// Solves for a rig and all of its lenses, and puts the lenses with their covariances into the rig.
pub(super) fn solve(rig: &mut NamedRig, config: &RigConfig) -> Result<(RigSolution, Vec<LensChange>), Error> {
    let held = solve_rig(&rig.problem(), config).ok();
    let all: Vec<usize> = (0..rig.cameras.len()).collect();
    // An offset of a lens is adjusted; what then is left is no error of the lens.
    let free = RigConfig { lens_errors: false, ..*config };
    let found = solve_rig_and_lenses(&rig.problem(), &free, &all)?;
    let moved_camera = |camera: usize| {
        let (before, after) = (&held.as_ref()?.cameras[camera], &found.solution.cameras[camera]);
        let moved_m = (after.cam_from_rig.origin() - before.cam_from_rig.origin()).norm();
        Some((moved_m, after.cam_from_rig.angle_to_rad(&before.cam_from_rig)))
    };
    let corners = |camera: usize| {
        let seen = found.observations.iter().filter(move |s| s.camera == camera);
        seen.flat_map(|s| s.seen.iter().map(|c| c.pixel)).collect::<Vec<Pixel>>()
    };
    let changes = found.lenses.iter().map(|lens| LensChange {
        moved_camera: moved_camera(lens.camera),
        ..change(&rig.lenses[lens.camera], lens, corners(lens.camera))
    });
    let changes: Vec<LensChange> = changes.collect();
    for lens in &found.lenses {
        rig.lenses[lens.camera] = lens.intrinsics.clone();
        let NamedCamera { camera, intrinsics_covariance, .. } = &mut rig.cameras[lens.camera];
        *camera = lens.intrinsics.clone();
        *intrinsics_covariance = Some(lens.covariance.clone());
    }
    rig.observations = found.observations;
    Ok((found.solution, changes))
}

fn change(before: &Camera, lens: &AdjustedLens, corners: Vec<Pixel>) -> LensChange {
    let after = &lens.intrinsics;
    let moved = after.size.and_then(|size| projection_difference(before, after, size));
    let projection = Projection::new(after, &lens.covariance, corners);
    let sigma_px = after.size.and_then(|size| projection.over_image(size, GRID.0, GRID.1).rms_px());
    LensChange { moved, sigma_px, from_stated: lens.from_stated, moved_camera: None }
}
