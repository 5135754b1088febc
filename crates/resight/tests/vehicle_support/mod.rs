//! Images of a rendered street, ground and facades, from a camera on a vehicle.

use nalgebra::{Matrix3, Rotation3, Vector3};
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::{Camera, CameraMatrix, Lens, Pixel};
use std::sync::Mutex;

const SIZE: [u32; 2] = [480, 320];
pub const FRAME_S: f64 = 0.3;
pub const SPEED_M_S: f64 = 3.0;
/// Yaw to the left, pitch down, roll to the right side, radians.
pub const MOUNTED: [f64; 3] = [0.035, 0.052, 0.017];
pub const HEIGHT_M: f64 = 1.4;

pub fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 320.0, fy_px: 320.0, cx_px: 239.5, cy_px: 159.5 };
    let size = Some(ImageSize { width_px: SIZE[0], height_px: SIZE[1] });
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
}

/// docs/math/vehicle.md eqs. (1) and (2).
fn cam_from_vehicle() -> Matrix3<f64> {
    let [yaw, pitch, roll] = MOUNTED;
    let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), pitch.sin_cos());
    let forward = Vector3::new(sy * cp, -sp, cy * cp);
    let level = Vector3::new(-sy * sp, -cp, -cy * sp);
    let up = level * roll.cos() + level.cross(&forward) * roll.sin();
    Matrix3::from_columns(&[forward, up.cross(&forward), up])
}

/// A grey of its own for each cell of a plane, 0 to 1.
fn cell(x: f64, y: f64, size_m: f64, plane: u64) -> f64 {
    let [i, j] = [x, y].map(|v| (v / size_m).floor() as i64 as u64);
    let mut z = i.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ j.wrapping_mul(0xC2B2_AE3D_27D4_EB4F) ^ (plane << 7);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 40) as f64 / f64::from(1u32 << 24)
}

/// The grey along a ray of the world, from a place above the road's middle: the ground, facades 7 m to both sides and 8 m high, the sky.
fn grey(at: &Vector3<f64>, ray: &Vector3<f64>) -> f64 {
    let ground = if ray.z < -1e-3 { -at.z / ray.z } else { f64::INFINITY };
    let side = if ray.y.abs() < 1e-3 { f64::INFINITY } else { (7.0 * ray.y.signum() - at.y) / ray.y };
    let depth = ground.min(side);
    let x = at + ray * depth;
    if !(depth < 80.0) || 8.0 < x.z {
        return 0.8;
    }
    let (u, v, plane) = if ground < side { (x.x, x.y, 1) } else { (x.x, x.z, if 0.0 < x.y { 2 } else { 3 }) };
    // Cells that would be smaller than two pixels are left grey.
    let contrast = |size_m: f64| (150.0 * size_m / depth - 1.0).clamp(0.0, 1.0);
    let part = |size_m: f64| contrast(size_m) * (cell(u, v, size_m, plane) - 0.5);
    0.5 + 0.35 * part(0.17) + 0.35 * part(0.61) + 0.3 * part(2.3)
}

/// The image from a place along the road, the body pitched.
fn image(x_m: f64, pitch_rad: f64) -> GrayImage {
    let camera = camera();
    let attitude = Rotation3::from_axis_angle(&Vector3::y_axis(), pitch_rad);
    let world_from_cam = attitude.matrix() * cam_from_vehicle().transpose();
    let at = Vector3::new(x_m, -0.3, HEIGHT_M);
    let pixel = |i: u32| {
        let (u, v) = (f64::from(i % SIZE[0]), f64::from(i / SIZE[0]));
        let sum: f64 = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)]
            .into_iter()
            .map(|(du, dv)| {
                let bearing = camera.bearing(&Pixel::new(u + du, v + dv)).expect("in the field");
                grey(&at, &(world_from_cam * bearing.into_inner()))
            })
            .sum();
        (255.0 * 0.25 * sum).round().clamp(1.0, 254.0) as u8
    };
    GrayImage { width_px: SIZE[0], height_px: SIZE[1], data: (0..SIZE[0] * SIZE[1]).map(pixel).collect() }
}

/// The frame of a time, the body pitching by 0.17° while it drives.
fn frame(t_s: f64) -> GrayImage {
    image(SPEED_M_S * t_s, 0.003 * (8.0 * t_s).sin())
}

/// The first frames of a drive, rendered once.
pub fn drive(n: usize) -> Vec<GrayImage> {
    static RENDERED: Mutex<Vec<GrayImage>> = Mutex::new(Vec::new());
    let mut rendered = RENDERED.lock().expect("no test failed while it rendered");
    for i in rendered.len()..n {
        rendered.push(frame(i as f64 * FRAME_S));
    }
    rendered[..n].to_vec()
}
