//! Scenes with dot targets for the tests.

use resight::GrayImage;
use resight::render::{Finish, Pcg, Placed, Scene, Style, render, true_pixels};
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::correspondence::Detection;
use resight_core::target::LinePlusOne;
use resight_core::{Camera, Lens, Pixel, Point, Pose, Target, Vector6};

/// The layout of Table II of the paper, over an end as the design rule asks: 0, 100, 150 mm and 150 mm across.
pub const UNEQUAL: LinePlusOne = LinePlusOne { line_m: [0.0, 0.10, 0.15], off_m: [0.0, 0.15] };
/// Equal spacing: only the fourth dot tells the ends apart.
pub const EQUAL: LinePlusOne = LinePlusOne { line_m: [0.0, 0.10, 0.20], off_m: [0.02, 0.12] };

pub fn camera(width_px: u32, height_px: u32, f: f64) -> Camera {
    let matrix = CameraMatrix {
        fx_px: f,
        fy_px: f,
        cx_px: 0.5 * width_px as f64,
        cy_px: 0.5 * height_px as f64 - 3.0,
    };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: Some(ImageSize { width_px, height_px }) }
}

/// A pose `cam_from_target` at a distance, tilted away from frontal by `tilt_rad` about a random axis of the image
/// plane and turned in the plane at random; the target's middle stands near the image's.
pub fn pose(target: &LinePlusOne, distance_m: f64, tilt_rad: f64, spread: f64, pcg: &mut Pcg) -> Pose {
    let angle = pcg.between(0.0, std::f64::consts::TAU);
    let tilt = Pose::exp(&Vector6::new(tilt_rad * angle.cos(), tilt_rad * angle.sin(), 0.0, 0.0, 0.0, 0.0));
    let turn = Pose::exp(&Vector6::new(0.0, 0.0, pcg.between(-3.1, 3.1), 0.0, 0.0, 0.0));
    let rotation = tilt.rotation * turn.rotation;
    let x = [target.line_m[0], target.line_m[1], target.line_m[2], target.off_m[0]];
    let middle = Point::new(x.iter().sum::<f64>() / 4.0, target.off_m[1] / 4.0, 0.0);
    let aim = Point::new(pcg.between(-spread, spread), pcg.between(-spread, spread), 1.0) * distance_m;
    Pose::new(rotation, aim - rotation * middle)
}

pub fn placed(target: &LinePlusOne, cam_from_target: Pose, style: Style) -> Placed {
    Placed { target: Target::LinePlusOne(*target), cam_from_target, style }
}

pub fn picture(scene: &Scene, camera: &Camera, finish: &Finish) -> GrayImage {
    render(scene, camera, finish).expect("the scene can be drawn")
}

/// Error of each detection against the truth, px; none if a feature is missing or another is there.
pub fn errors(found: &[Detection], placed: &Placed, camera: &Camera) -> Option<Vec<Pixel>> {
    let truth = true_pixels(placed, camera);
    if found.len() != 4 || truth.len() != 4 {
        return None;
    }
    truth.iter().map(|(f, p)| found.iter().find(|d| d.feature == *f).map(|d| d.pixel - p)).collect()
}

/// Largest distance of a detection from its true place, px.
pub fn worst_px(errors: &[Pixel]) -> f64 {
    errors.iter().map(|e| e.norm()).fold(0.0, f64::max)
}
