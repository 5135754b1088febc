//! fSpy's camera parameters as JSON, written only: one pinhole camera.
//!
//! fSpy's camera is OpenGL's (x right, y up, looking along −z). Its image plane has the origin in the middle of the
//! image, y up, and half the longer side as its unit: x runs from −1 to 1 in a wide image, y in a tall one. Edges are
//! edges of pixels, so that our pixel (0, 0) lies half a pixel inside. `cameraTransform` is world_from_cam.

use super::emit::{list, number};
use super::lens::{self, LensNumbers};
use super::placed::{placed, size_of, the_only};
use super::{CameraFile, CameraFormat, Format, OutFile, WriteError, Writer};
use crate::core::Pose;
use crate::core::camera::{CameraMatrix, ImageSize};
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::FSpy,
    words: &["fspy"],
    reads: None,
    write: Some(Writer::Rig(write)),
    traps: &[],
};

/// Largest error that square pixels may make at the image's edge, px.
const SQUARE_PX: f64 = 0.5;
/// A vanishing point at infinity is put this many units of the image plane away.
const FAR: f64 = 1e9;

fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let camera = the_only(&file.cameras, "fSpy")?;
    let size = size_of(camera, "fSpy")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    if numbers != LensNumbers::Pinhole {
        return Err(WriteError(format!(
            "{}: fSpy has no {} model, only pinhole cameras; undistort the image and write its new camera matrix",
            camera.name,
            numbers.model()
        )));
    }
    let edge_px = 0.5 * (1.0 - k.fy_px / k.fx_px).abs() * f64::from(size.height_px);
    if SQUARE_PX < edge_px {
        return Err(WriteError(format!(
            "{}: fSpy's pixels are square, but fx = {} and fy = {} move the image's edge by {edge_px:.1} px (at most \
                {SQUARE_PX}); resample the image to fx = fy",
            camera.name, k.fx_px, k.fy_px
        )));
    }
    let rig = placed(file, Format::FSpy)?;
    let world_from_cam = rig.cameras[0].root_from_gl_cam();
    Ok(OutFile::only("fspy.json", text(&k, size, &world_from_cam)))
}

fn text(k: &CameraMatrix, size: ImageSize, world_from_cam: &Pose) -> String {
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let half = 0.5 * w.max(h);
    let principal = [(k.cx_px + 0.5 - 0.5 * w) / half, (0.5 * h - k.cy_px - 0.5) / half];
    let focal = k.fx_px / half;
    let field = |side: f64| number(2.0 * (0.5 * side / k.fx_px).atan());
    let cam_from_world = world_from_cam.inverse();
    let points: Vec<String> = (0..3)
        .map(|i| vanishing_point(&cam_from_world.rotation.column(i).into(), focal, principal))
        .collect();
    [
        format!("{{\n  \"principalPoint\": {},\n", point(principal)),
        format!("  \"viewTransform\": {},\n", rows(&cam_from_world)),
        format!("  \"cameraTransform\": {},\n", rows(world_from_cam)),
        format!("  \"horizontalFieldOfView\": {},\n  \"verticalFieldOfView\": {},\n", field(w), field(h)),
        format!("  \"vanishingPoints\": [{}],\n", points.join(", ")),
        "  \"vanishingPointAxes\": [\"xPositive\", \"yPositive\", \"zPositive\"],\n".to_owned(),
        format!("  \"relativeFocalLength\": {},\n", number(focal)),
        format!("  \"imageWidth\": {},\n  \"imageHeight\": {}\n}}\n", size.width_px, size.height_px),
    ]
    .concat()
}

/// Where lines along a world axis meet in the image: −f x/z + p.
fn vanishing_point(axis_in_cam: &Vector3<f64>, focal: f64, principal: [f64; 2]) -> String {
    let z = if axis_in_cam.z.abs() < 1.0 / FAR { (1.0 / FAR).copysign(axis_in_cam.z) } else { axis_in_cam.z };
    point([principal[0] - focal * axis_in_cam.x / z, principal[1] - focal * axis_in_cam.y / z])
}

fn point([x, y]: [f64; 2]) -> String {
    format!("{{ \"x\": {}, \"y\": {} }}", number(x), number(y))
}

fn rows(b_from_a: &Pose) -> String {
    format!("{{ \"rows\": [{}] }}", b_from_a.matrix().map(|row| list(&row)).join(", "))
}
