//! Cameras around one target, for viewers: fields of view, ellipsoids of their positions, and the target, in the target's frame.

use super::geometry::{self, Area, CHI2_3_95};
use crate::core::{Camera, Matrix6, Pixel, Point, Pose, Target};
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::Serialize;

/// A camera and its pose.
#[derive(Debug, Clone)]
pub struct CameraAround<'a> {
    /// Its name.
    pub name: String,
    /// Its lens.
    pub camera: &'a Camera,
    /// x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// Covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Whether this is the reference pose instead of the current one.
    pub is_reference: bool,
}

/// What a viewer draws, metres, frame of the target.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct AroundScene {
    /// Name of the target.
    pub target: String,
    centre_m: [f64; 3],
    radius_m: f64,
    /// Length of the target's axes and depth of the fields of view, chosen for the eye.
    axis_m: f64,
    /// By which viewers multiply the ellipsoids: 1, 2 or 5 times a power of ten.
    ellipsoid_magnification: f64,
    cameras: Vec<DrawnCamera>,
    /// Hull of a flat target, a closed line; none of others.
    outline_m: Vec<[f64; 3]>,
    points_m: Vec<[f64; 3]>,
}

/// One camera.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DrawnCamera {
    name: String,
    /// It is where the camera was by its reference, not where it is.
    is_reference: bool,
    position_m: [f64; 3],
    /// Standard deviations of that, along the axes of the target.
    sigma_m: [f64; 3],
    /// The border of its image, through the lens, a closed line; none where the camera has no image size.
    border_m: Vec<[f64; 3]>,
    /// Half axes of the ellipsoid that contains 95 % of its position, not magnified, the longest first.
    half_axes_m: Vec<[f64; 3]>,
}

/// Returns the cameras around a target.
pub fn cameras_around(name: &str, target: &Target, cameras: &[CameraAround<'_>]) -> AroundScene {
    let points: Vec<Point> =
        target.features().into_iter().filter_map(|feature| Some(target.point(feature)?.position)).collect();
    let mut places: Vec<Point> = cameras.iter().map(|camera| camera.cam_from_target.origin()).collect();
    places.push(geometry::mean(&points));
    let centre = geometry::mean(&places);
    let reach = |all: &[Point]| all.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max);
    let radius_m = reach(&places).max(reach(&points)).max(1e-3);
    let longest = cameras.iter().map(|camera| half_axes(camera).column(0).norm()).fold(0.0, f64::max);
    let depth_m = radius_m / 8.0;
    AroundScene {
        target: name.to_owned(),
        centre_m: centre.into(),
        radius_m,
        axis_m: depth_m,
        ellipsoid_magnification: geometry::magnification(longest, radius_m / 6.0),
        cameras: cameras.iter().map(|camera| drawn(camera, depth_m)).collect(),
        outline_m: geometry::outline(&points).into_iter().map(|i| points[i].into()).collect(),
        points_m: points.iter().map(|x| (*x).into()).collect(),
    }
}

fn half_axes(camera: &CameraAround<'_>) -> Matrix3<f64> {
    let position = geometry::position_covariance(&camera.cam_from_target, &camera.covariance);
    geometry::half_axes(&position, CHI2_3_95.sqrt())
}

fn drawn(camera: &CameraAround<'_>, depth_m: f64) -> DrawnCamera {
    let position = geometry::position_covariance(&camera.cam_from_target, &camera.covariance);
    DrawnCamera {
        name: camera.name.clone(),
        is_reference: camera.is_reference,
        position_m: camera.cam_from_target.origin().into(),
        sigma_m: position.diagonal().map(|x| x.max(0.0).sqrt()).into(),
        border_m: border(camera, depth_m),
        half_axes_m: half_axes(camera).column_iter().map(|axis| [axis[0], axis[1], axis[2]]).collect(),
    }
}

fn border(camera: &CameraAround<'_>, depth_m: f64) -> Vec<[f64; 3]> {
    let Some(size) = camera.camera.size else { return Vec::new() };
    let greatest = Pixel::new(f64::from(size.width_px) - 0.5, f64::from(size.height_px) - 0.5);
    let area = Area { least: Pixel::new(-0.5, -0.5), greatest };
    let target_from_cam = camera.cam_from_target.inverse();
    let border = geometry::border_in_cam(camera.camera, &area);
    border.iter().map(|x| (target_from_cam * (x * depth_m)).into()).collect()
}
