//! Scenes of which many correspondences are wrong, with their truth.

use super::Rng;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Pixel, Pose};

/// 1280×960, f = 1000 px.
pub fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// What was seen, and how it came about.
pub struct Scene {
    pub cam_from_target: Pose,
    pub seen: Vec<Correspondence>,
    /// Whether each row is right.
    pub is_good: Vec<bool>,
}

impl Scene {
    /// The right correspondences.
    pub fn good(&self) -> Vec<Correspondence> {
        self.seen.iter().zip(&self.is_good).filter(|(_, good)| **good).map(|(c, _)| *c).collect()
    }

    /// Angle, degrees, and distance of the camera centres, metres, from the truth.
    pub fn errors(&self, cam_from_target: &Pose) -> (f64, f64) {
        let turn = cam_from_target.angle_to_rad(&self.cam_from_target).to_degrees();
        (turn, (cam_from_target.origin() - self.cam_from_target.origin()).norm())
    }
}

pub fn any_pixel(rng: &mut Rng) -> Pixel {
    Pixel::new(rng.uniform(-0.5, 1279.5), rng.uniform(-0.5, 959.5))
}

/// `n` points at depths of 4–20 m all over the image, noise of `sigma_px`; the first `n_wrong` of them have a pixel of their own
/// anywhere in the image. Rows are in no order of merit for an estimator that shuffles.
pub fn scene(rng: &mut Rng, n: usize, n_wrong: usize, sigma_px: f64) -> Scene {
    let camera = camera();
    let cam_from_target = Pose::new(
        rng.rotation(),
        Vector3::new(rng.uniform(-5.0, 5.0), rng.uniform(-5.0, 5.0), rng.uniform(-5.0, 5.0)),
    );
    let target_from_cam = cam_from_target.inverse();
    let is_good: Vec<bool> = (0..n).map(|row| n_wrong <= row).collect();
    let mut point = |good: &bool| {
        let (place, depth_m) = (any_pixel(rng), rng.uniform(4.0, 20.0));
        let ray = camera.bearing(&place).expect("in the field").into_inner();
        let x_in_target = target_from_cam * (ray * (depth_m / ray.z));
        let noise = Vector2::new(rng.normal(), rng.normal()) * sigma_px;
        let pixel = if *good { place + noise } else { any_pixel(rng) };
        Correspondence::new(&camera, x_in_target, pixel, sigma_px).expect("in the field")
    };
    let seen = is_good.iter().map(&mut point).collect();
    Scene { cam_from_target, seen, is_good }
}

/// As `scene`, of which `n_good` rows agree with the truth and `n_alternative` others with one other pose.
pub fn with_alternative(
    rng: &mut Rng,
    n: usize,
    n_good: usize,
    n_alternative: usize,
    sigma_px: f64,
) -> Scene {
    let mut scene = scene(rng, n, n - n_good, sigma_px);
    let camera = camera();
    let turned = rng.rotation();
    for c in &mut scene.seen[..n_alternative] {
        // The second solution's pixel is drawn first, and the point put onto its ray as another camera at the same place would see it.
        let (pixel, depth_m) = (any_pixel(rng), rng.uniform(4.0, 20.0));
        let ray = camera.bearing(&pixel).expect("in the field").into_inner();
        let x_in_cam = turned * ray * (depth_m / ray.z);
        let x_in_target = scene.cam_from_target.inverse() * x_in_cam;
        let noise = Vector2::new(rng.normal(), rng.normal()) * sigma_px;
        *c = Correspondence::new(&camera, x_in_target, pixel + noise, sigma_px).expect("in the field");
    }
    scene
}
