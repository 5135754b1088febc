//! A scene at infinity whose image is known from every direction: patches of grey that meet at corners, coarse and fine.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::{Camera, CameraMatrix, Lens};
use resight::render::Pcg;

/// A camera without distortion, principal point at the image centre.
pub fn camera(width_px: u32, height_px: u32, f_px: f64) -> Camera {
    let centre = |size: u32| 0.5 * (f64::from(size) - 1.0);
    let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: centre(width_px), cy_px: centre(height_px) };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: Some(ImageSize { width_px, height_px }) }
}

/// 64 bits of a lattice cell.
fn hash(x: i64, y: i64, seed: u64) -> u64 {
    let mut z = (x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ seed.wrapping_mul(0xD6E8_FEB8_6659_FD93);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

fn share(bits: u64) -> f64 {
    bits as f64 / 65536.0
}

/// Grey of the cell whose centre is nearest.
fn mosaic(x: f64, y: f64, seed: u64) -> f64 {
    let (column, row) = (x.floor() as i64, y.floor() as i64);
    let mut nearest = (f64::INFINITY, 0.0);
    for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
        let bits = hash(column + i, row + j, seed);
        let centre = [share(bits & 0xffff), share((bits >> 16) & 0xffff)];
        let at = [(column + i) as f64 + centre[0] - x, (row + j) as f64 + centre[1] - y];
        let distance = at[0] * at[0] + at[1] * at[1];
        if distance < nearest.0 {
            nearest = (distance, share((bits >> 32) & 0xffff));
        }
    }
    nearest.1
}

/// Grey 0 to 255 in a direction; another seed is another scene.
pub fn grey(direction: &Vector3<f64>, seed: u64) -> f64 {
    let (x, y) = (direction.x / direction.z, direction.y / direction.z);
    30.0 + 190.0 * (0.6 * mosaic(14.0 * x, 14.0 * y, seed) + 0.4 * mosaic(45.0 * x, 45.0 * y, seed + 1))
}

/// The image of a camera rotated by `now_from_reference`, before noise; each pixel the mean of 3 × 3 directions.
pub fn picture(camera: &Camera, now_from_reference: &Matrix3<f64>, seed: u64) -> Vec<f64> {
    let size = camera.size.expect("a size");
    let reference_from_now = now_from_reference.transpose();
    let at = |u: f64, v: f64| {
        let bearing = camera.bearing(&Vector2::new(u, v)).expect("in the field");
        grey(&(reference_from_now * bearing.into_inner()), seed)
    };
    let steps = [-1.0 / 3.0, 0.0, 1.0 / 3.0];
    let pixel = |(u, v): (u32, u32)| {
        let of_row =
            |dv: f64| -> f64 { steps.iter().map(|du| at(f64::from(u) + du, f64::from(v) + dv)).sum() };
        steps.iter().map(|dv| of_row(*dv)).sum::<f64>() / 9.0
    };
    (0..size.height_px).flat_map(|v| (0..size.width_px).map(move |u| (u, v))).map(pixel).collect()
}

/// What a sensor makes of it: light, noise, eight bits.
pub fn exposed(camera: &Camera, grey: &[f64], light: f64, noise: f64, chance: &mut Pcg) -> GrayImage {
    let size = camera.size.expect("a size");
    let value = |g: &f64| (light * g + noise * chance.normal()).round().clamp(0.0, 255.0) as u8;
    GrayImage { width_px: size.width_px, height_px: size.height_px, data: grey.iter().map(value).collect() }
}

/// now_from_reference of a camera that rotated by `old_from_new`, degrees about x, y, z.
pub fn turned(degrees: [f64; 3]) -> Matrix3<f64> {
    Rotation3::new(Vector3::from(degrees.map(f64::to_radians))).inverse().into_inner()
}

/// A photograph as a scene at infinity, seen by a turned camera of half its columns and rows: each pixel is the mean of 3 × 3 exact
/// directions, greys between the photograph's by the cubic convolution of Keys (1981). What is not in the photograph is black.
pub fn photographed(photograph: &GrayImage, camera: &Camera, now_from_reference: &Matrix3<f64>) -> Vec<f64> {
    let reference_from_now = now_from_reference.transpose();
    let size = camera.size.expect("a size");
    let at = |u: f64, v: f64| {
        let bearing = camera.bearing(&Vector2::new(u, v)).ok()?;
        let pixel = camera.project(&(reference_from_now * bearing.into_inner()))?;
        sampled(photograph, pixel.map(|x| 2.0 * x + 0.5))
    };
    let steps = [-1.0 / 3.0, 0.0, 1.0 / 3.0];
    let pixel = |(u, v): (u32, u32)| {
        let of_row = |dv: f64| -> f64 {
            steps.iter().map(|du| at(f64::from(u) + du, f64::from(v) + dv).unwrap_or(0.0)).sum()
        };
        steps.iter().map(|dv| of_row(*dv)).sum::<f64>() / 9.0
    };
    (0..size.height_px).flat_map(|v| (0..size.width_px).map(move |u| (u, v))).map(pixel).collect()
}

fn keys(f: f64) -> [f64; 4] {
    let (f2, f3) = (f * f, f * f * f);
    [-0.5 * f3 + f2 - 0.5 * f, 1.5 * f3 - 2.5 * f2 + 1.0, -1.5 * f3 + 2.0 * f2 + 0.5 * f, 0.5 * f3 - 0.5 * f2]
}

fn sampled(image: &GrayImage, at: Vector2<f64>) -> Option<f64> {
    let (left, top) = (at.x.floor(), at.y.floor());
    let inside = |x: f64, size: u32| 1.0 <= x && x < f64::from(size) - 2.0;
    if !inside(left, image.width_px) || !inside(top, image.height_px) {
        return None;
    }
    let (wu, wv) = (keys(at.x - left), keys(at.y - top));
    let row = |j: usize| -> f64 {
        let v = top as u32 + j as u32 - 1;
        (0..4).map(|i| wu[i] * f64::from(image.at(left as u32 + i as u32 - 1, v))).sum()
    };
    Some((0..4).map(|j| wv[j] * row(j)).sum())
}

/// The scene above a horizon at infinity and a floor 1.5 m below the camera that took the reference, seen from `place` (metres, axes of
/// the reference), not turned.
pub fn picture_with_floor(camera: &Camera, place: Vector3<f64>, seed: u64) -> Vec<f64> {
    let size = camera.size.expect("a size");
    let at = |u: f64, v: f64| {
        let d = camera.bearing(&Vector2::new(u, v)).expect("in the field").into_inner();
        let to_floor = (1.5 - place.y) / d.y;
        let is_floor = 0.0 < d.y && to_floor < 100.0;
        grey(&if is_floor { place + d * to_floor } else { d }, seed)
    };
    let steps = [-0.25, 0.25];
    let pixel = |(u, v): (u32, u32)| {
        let of_row =
            |dv: f64| -> f64 { steps.iter().map(|du| at(f64::from(u) + du, f64::from(v) + dv)).sum() };
        steps.iter().map(|dv| of_row(*dv)).sum::<f64>() / 4.0
    };
    (0..size.height_px).flat_map(|v| (0..size.width_px).map(move |u| (u, v))).map(pixel).collect()
}

/// A passer-by: something with a pattern of its own over `columns` × `rows` of the image, its left top corner at (u, v).
pub fn pass_by(image: &mut GrayImage, (u, v): (u32, u32), (columns, rows): (u32, u32), seed: u64) {
    for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
        if u + i < image.width_px && v + j < image.height_px {
            let direction = Vector3::new(f64::from(i) / 400.0, f64::from(j) / 400.0, 1.0);
            image.data[((v + j) * image.width_px + u + i) as usize] = grey(&direction, seed) as u8;
        }
    }
}

/// Three-by-three means: a lens out of focus.
pub fn blurred(grey: &[f64], camera: &Camera) -> Vec<f64> {
    let size = camera.size.expect("a size");
    let (width, height) = (size.width_px as i64, size.height_px as i64);
    let at = |u: i64, v: i64| grey[(v.clamp(0, height - 1) * width + u.clamp(0, width - 1)) as usize];
    let mean = |u: i64, v: i64| {
        (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j))).map(|(i, j)| at(u + i, v + j)).sum::<f64>() / 9.0
    };
    (0..height).flat_map(|v| (0..width).map(move |u| (u, v))).map(|(u, v)| mean(u, v)).collect()
}
