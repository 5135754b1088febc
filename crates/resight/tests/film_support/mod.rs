//! Rendered films of one camera: a tag or a map of tags before printed words, with the noise of a good camera.

use nalgebra::Vector6;
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{MapTag, Tag, TagMap};
use resight::core::{Camera, CameraMatrix, Lens, Pose, Target};
use resight::render::{Finish, Scene, Style, clutter, render};
use std::sync::Arc;

pub const WIDTH_PX: u32 = 1280;
pub const HEIGHT_PX: u32 = 960;
const FOCAL_PX: f64 = 1000.0;
pub const TAG_M: f64 = 0.16;

/// 1280 × 960 pixels, 65° wide.
pub fn camera() -> Camera {
    let (cx_px, cy_px) = (0.5 * (WIDTH_PX - 1) as f64, 0.5 * (HEIGHT_PX - 1) as f64);
    let matrix = CameraMatrix { fx_px: FOCAL_PX, fy_px: FOCAL_PX, cx_px, cy_px };
    let lens = Lens::Pinhole(Pinhole::new(matrix).expect("a lens"));
    Camera { lens, size: Some(ImageSize { width_px: WIDTH_PX, height_px: HEIGHT_PX }) }
}

pub fn tag() -> Target {
    Target::Tag(Tag { family: "tag36h11".to_string(), id: 3, size_m: TAG_M })
}

/// Twelve tags on a wall, four in a row.
pub fn map() -> Target {
    let tag = |i: u32| {
        let (x_m, y_m) = (0.4 * (i % 4) as f64 - 0.6, 0.4 * (i / 4) as f64 - 0.4);
        let world_from_tag = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, x_m, y_m, 0.0));
        MapTag { id: i, size_m: TAG_M, world_from_tag, sigma_m: 0.0, sigma_rad: 0.0 }
    };
    Target::TagMap(TagMap {
        family: "tag36h11".to_string(),
        tags: (0..12).map(tag).collect(),
        joint_covariance: None,
    })
}

/// A tilted tag of about `edge_px`, its centre `u_px`, `v_px` from the middle of the image.
pub fn tag_pose(edge_px: f64, u_px: f64, v_px: f64) -> Pose {
    let z_m = FOCAL_PX * TAG_M / edge_px;
    Pose::exp(&Vector6::new(0.0, 0.0, 0.0, u_px * z_m / FOCAL_PX, v_px * z_m / FOCAL_PX, z_m))
        * Pose::exp(&Vector6::new(0.3, -0.5, 0.2, 0.0, 0.0, 0.0))
}

/// The target before printed words and spots, with the noise of a good camera.
pub fn picture(target: &Target, cam_from_target: Pose, seed: u64) -> GrayImage {
    let mut all = clutter::words(80, [WIDTH_PX, HEIGHT_PX], 14.0, 30.0, 7);
    all.extend(clutter::dots(100, [WIDTH_PX, HEIGHT_PX], [3.0, 40.0], 60.0, 9));
    let scene = Scene { clutter: all, ..Scene::of(target.clone(), cam_from_target, Style::default()) };
    let finish = Finish { seed, samples_per_axis: 3, ..Finish::default() };
    render(&scene, &camera(), &finish).expect("an image")
}

/// An image of each pose, with a noise of its own, drawn on two threads.
pub fn film(target: &Target, poses: &[Pose], seed: u64) -> Arc<Vec<GrayImage>> {
    let half = poses.len().div_ceil(2).max(1);
    let draw = |(part, poses): (usize, &[Pose])| -> Vec<GrayImage> {
        let seed = |i: usize| seed + (part * half + i) as u64;
        poses.iter().enumerate().map(|(i, pose)| picture(target, *pose, seed(i))).collect()
    };
    let parts: Vec<Vec<GrayImage>> = std::thread::scope(|scope| {
        let threads: Vec<_> =
            poses.chunks(half).enumerate().map(|part| scope.spawn(move || draw(part))).collect();
        threads.into_iter().map(|thread| thread.join().expect("pictures")).collect()
    });
    Arc::new(parts.into_iter().flatten().collect())
}

/// A camera that trembles by a hundredth of a degree.
pub fn trembling(cam_from_target: Pose, n: usize) -> Vec<Pose> {
    let tremble = |i: usize| {
        let phase = i as f64;
        Vector6::new(phase.sin(), (1.7 * phase).sin(), (2.3 * phase).sin(), 0.0, 0.0, 0.0) * 1.7e-4
    };
    (0..n).map(|i| Pose::exp(&tremble(i)) * cam_from_target).collect()
}
