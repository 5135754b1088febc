//! Compares overlays with the pose that they show.

use super::*;
use crate::core::camera::{ImageSize, Pinhole};
use crate::core::correspondence::correspond;
use crate::core::locate::{Config, locate};
use crate::core::target::Tag;
use crate::core::{CameraMatrix, Lens, Vector6};

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 700.0, cx_px: 319.5, cy_px: 239.5 };
    Camera {
        lens: Lens::Pinhole(Pinhole { matrix }),
        size: Some(ImageSize { width_px: 640, height_px: 480 }),
    }
}

fn drawn() -> (Canvas, PoseEstimate) {
    let target = Target::Tag(Tag { family: "tag36h11".into(), id: 0, size_m: 0.2 });
    let cam_from_target = Pose::exp(&Vector6::new(0.4, 0.5, 0.0, 0.0, 0.0, 0.6));
    let seen = |feature| {
        let pixel = camera().project(&(cam_from_target * target.point(feature)?.position))?;
        Some(Detection { feature, pixel, sigma_px: 0.1, lens_sigma_px: 0.0, covariance_px2: None })
    };
    let detections: Vec<Detection> = target.features().into_iter().filter_map(seen).collect();
    let points: Vec<_> = correspond(&detections, &target, &camera()).0.iter().map(|(_, c)| *c).collect();
    let estimate = locate(&points, &camera(), &Config::default()).unwrap();
    let image = GrayImage::filled(640, 480, 128);
    let scene = Scene {
        image: &image,
        detections: &detections,
        camera: Some(&camera()),
        target: &target,
        estimate: Some(&estimate),
        title: "test",
        verdict: "ok",
        tone: Tone::Good,
    };
    (draw(&scene), estimate)
}

/// Half-way along each axis (100 mm for a tag of 200 mm) the image has that axis' colour.
#[test]
fn axes_are_where_the_pose_sends_them() {
    let (canvas, estimate) = drawn();
    for (i, (name, color)) in AXES.iter().enumerate() {
        let mut x_in_target = Point::zeros();
        x_in_target[i] = 0.05;
        let p = camera().project(&(estimate.cam_from_target * x_in_target)).unwrap();
        assert_eq!(canvas.at(p.x.round() as u32, p.y.round() as u32), *color, "{name}");
    }
}

#[test]
fn the_photograph_keeps_its_place_and_the_caption_stands_below() {
    let (canvas, _) = drawn();
    assert_eq!((canvas.width, canvas.at(2, 2)), (640, [128; 3]));
    assert!(480 < canvas.height && canvas.at(639, canvas.height - 1) == BACKGROUND);
}

#[test]
fn magnification_is_a_round_number_that_never_shrinks() {
    for (typical, wanted, factor) in
        [(0.1, 9.0, 50.0), (9.0, 9.0, 1.0), (50.0, 9.0, 1.0), (0.044, 9.0, 200.0)]
    {
        assert_eq!(magnification(typical, wanted), Some(factor), "{typical}");
    }
    assert_eq!(magnification(0.0, 9.0), None);
}

#[test]
fn dashes_cover_half_of_a_path_however_it_is_cut() {
    let path: Path = (0..=64).map(|i| Vector2::new(i as f64 * 1.5, 0.0)).collect();
    let length: f64 = dashed(&path, 8.0).iter().map(|d| (d[1] - d[0]).norm()).sum();
    assert!((length - 48.0).abs() < 1e-3, "{length}");
}
