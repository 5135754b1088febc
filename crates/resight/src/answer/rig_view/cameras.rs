//! Cameras of a rig as they are drawn and listed.

use super::read::{Lenses, Placed};
use super::{Stage, Status};
use crate::core::{Pixel, Point, Pose};
use crate::report::words::{position_sigma_m, sigmas};
use crate::scene::geometry::{self, Area, CHI2_3_95};
use schemars::JsonSchema;
use serde::Serialize;

/// One camera.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RigCamera {
    name: String,
    status: Option<Status>,
    /// What is wrong with it.
    message: Option<String>,
    position_m: [f64; 3],
    /// Standard deviations of that, along the axes of the rig.
    sigma_m: Option<[f64; 3]>,
    /// Of its rotation, about the axes of the camera.
    sigma_rad: Option<[f64; 3]>,
    /// Row by row: axes of the camera are its columns.
    rotation: [[f64; 3]; 3],
    /// Half axes of the ellipsoid that contains 95 % of its position, not magnified, the longest first; none where nothing is known.
    half_axes_m: Vec<[f64; 3]>,
    /// The border of its image, through the lens, at the depth `axis_m`, a closed line; none where the lens is not known.
    border_m: Vec<[f64; 3]>,
    n_views: Option<usize>,
    n_seen: Option<usize>,
    n_used: Option<usize>,
    rms_px: Option<f64>,
}

impl Placed {
    pub fn origin_in_rig(&self) -> Point {
        self.cam_from_rig.origin()
    }

    fn half_axes(&self) -> Vec<[f64; 3]> {
        let Some(covariance) = &self.covariance else { return Vec::new() };
        let position = geometry::position_covariance(&self.cam_from_rig, covariance);
        let axes = geometry::half_axes(&position, CHI2_3_95.sqrt());
        axes.column_iter().map(|axis| [axis[0], axis[1], axis[2]]).collect()
    }

    pub fn object(&self, lenses: &Lenses, stage: &Stage) -> RigCamera {
        let sigma_m = self.covariance.as_ref().map(|c| position_sigma_m(&self.cam_from_rig, c).into());
        RigCamera {
            name: self.name.clone(),
            status: self.counts.status,
            message: self.counts.message.clone(),
            position_m: self.origin_in_rig().into(),
            sigma_m,
            sigma_rad: self.covariance.as_ref().map(|c| sigmas(c).0),
            rotation: rows(&self.cam_from_rig.inverse()),
            half_axes_m: self.half_axes(),
            border_m: self.border(lenses, stage),
            n_views: self.counts.n_views,
            n_seen: self.counts.n_seen,
            n_used: self.counts.n_used,
            rms_px: self.counts.rms_px,
        }
    }

    fn border(&self, lenses: &Lenses, stage: &Stage) -> Vec<[f64; 3]> {
        let Some(camera) = lenses.of(&self.name) else { return Vec::new() };
        let Some(size) = camera.size else { return Vec::new() };
        let greatest = Pixel::new(size.width_px as f64 - 0.5, size.height_px as f64 - 0.5);
        let area = Area { least: Pixel::new(-0.5, -0.5), greatest };
        let rig_from_cam = self.cam_from_rig.inverse();
        let border = geometry::border_in_cam(camera, &area);
        border.iter().map(|x| (rig_from_cam * (x * stage.depth_m)).into()).collect()
    }
}

pub(super) fn rows(b_from_a: &Pose) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| b_from_a.rotation[(i, j)]))
}

/// Returns one magnification for all cameras, with which the longest half axis is a sixth of the radius.
pub(super) fn magnification(cameras: &[Placed], radius_m: f64) -> f64 {
    let longest = |camera: &Placed| camera.half_axes().first().map_or(0.0, |[x, y, z]| x.hypot(*y).hypot(*z));
    geometry::magnification(cameras.iter().map(longest).fold(0.0, f64::max), radius_m / 6.0)
}
