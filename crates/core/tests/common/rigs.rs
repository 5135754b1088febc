//! Made-up rigs: cameras with f = 800 px at known places, each point seen by one of them.

use super::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use resight_core::multiview::rig_pose::{RigPoseEstimate, RigView, locate_rig};
use resight_core::{Camera, Correspondence, Error, Point, Pose};

/// Of every pixel coordinate.
pub const SIGMA_PX: f64 = 0.5;

/// One camera of a made-up rig: where it sits and what it sees.
#[derive(Clone)]
pub struct Made {
    pub cam_from_rig: Pose,
    pub seen: Vec<Correspondence>,
}

/// A rig, what its cameras see without noise, and the pose.
pub struct Scene {
    pub cameras: Vec<Made>,
    pub rig_from_target: Pose,
}

/// The same views with an uncertainty of each camera's position.
pub fn views_of<'a>(
    cameras: &'a [Made],
    camera: &'a Camera,
    covariance: Option<Matrix6<f64>>,
) -> Vec<RigView<'a>> {
    let view = |m: &'a Made| RigView {
        camera,
        cam_from_rig: m.cam_from_rig,
        cam_from_rig_covariance: covariance,
        intrinsics_covariance: None,
        seen: &m.seen,
    };
    cameras.iter().map(view).collect()
}

pub fn solve(cameras: &[Made]) -> Result<RigPoseEstimate, Error> {
    locate_rig(&views_of(cameras, &views::camera(), None))
}

/// Cameras within 0.3 m that look forward, up to 20° apart: a stereo head. A 1 m target at 2–6 m.
pub fn head(rng: &mut Rng, n_cameras: usize, n_points: usize) -> Scene {
    let z = rng.uniform(2.0, 6.0);
    let shift = Vector3::new(rng.uniform(-0.2, 0.2) * z, rng.uniform(-0.1, 0.1) * z, z);
    let rig_from_target = Pose::new(rng.rotation(), shift);
    let place = |rng: &mut Rng| {
        let turn = rng.unit_vector() * rng.uniform(0.0, 0.17);
        let centre = Vector3::new(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1));
        let turn = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation;
        Pose::new(turn, -(turn * centre))
    };
    let cameras = (0..n_cameras).map(|_| Made { cam_from_rig: place(rng), seen: Vec::new() }).collect();
    let mut scene = Scene { cameras, rig_from_target };
    for i in 0..n_points {
        let x = Point::new(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
        scene.see(i % n_cameras, x);
    }
    scene
}

/// Cameras on a vehicle of 2 m that look in different directions; each sees its own points of the world around, 2–8 m away.
pub fn vehicle(rng: &mut Rng, n_cameras: usize, n_points: usize) -> Scene {
    let rig_from_target = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(0.0, 5.0));
    let place = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / n_cameras as f64;
        let outwards = Vector3::new(angle.sin(), 0.0, angle.cos());
        views::looking_at(outwards, outwards * 3.0)
    };
    let cameras: Vec<_> = (0..n_cameras).map(|i| Made { cam_from_rig: place(i), seen: Vec::new() }).collect();
    let mut scene = Scene { cameras, rig_from_target };
    for i in 0..n_points {
        let camera = i % n_cameras;
        let z = rng.uniform(2.0, 8.0);
        let x_in_cam = Point::new(rng.uniform(-0.35, 0.35) * z, rng.uniform(-0.25, 0.25) * z, z);
        let target_from_cam = (scene.cameras[camera].cam_from_rig * rig_from_target).inverse();
        scene.see(camera, target_from_cam * x_in_cam);
    }
    scene
}

impl Scene {
    pub fn see(&mut self, camera: usize, x_in_target: Point) {
        let made = &mut self.cameras[camera];
        let pixel = views::pixel_of(&(made.cam_from_rig * self.rig_from_target * x_in_target));
        let c = Correspondence::new(&views::camera(), x_in_target, pixel, SIGMA_PX).expect("in the field");
        made.seen.push(c);
    }

    pub fn disturbed(&self, rng: &mut Rng) -> Vec<Made> {
        let noisy = |m: &Made| Made { seen: views::disturbed(rng, &m.seen), ..*m };
        self.cameras.iter().map(noisy).collect()
    }

    /// Left motion from the truth to the estimate.
    pub fn error(&self, rig_from_target: &Pose) -> Vector6<f64> {
        (*rig_from_target * self.rig_from_target.inverse()).log()
    }

    /// Fisher information at the truth, by central differences of the exact pixels: shares no derivative with the product.
    pub fn information(&self) -> Matrix6<f64> {
        // Central differences err by h² and ε/h.
        const STEP: f64 = 6e-6;
        let mut information = Matrix6::zeros();
        for made in &self.cameras {
            for c in &made.seen {
                let pixel = |by: Vector6<f64>| {
                    views::pixel_of(
                        &(made.cam_from_rig * Pose::exp(&by) * self.rig_from_target * c.x_in_target),
                    )
                };
                let column = |i: usize| {
                    let h = Vector6::ith(i, STEP);
                    (pixel(h) - pixel(-h)) / (2.0 * STEP * SIGMA_PX)
                };
                let columns: [Vector2<f64>; 6] = core::array::from_fn(column);
                information += Matrix6::from_fn(|i, j| columns[i].dot(&columns[j]));
            }
        }
        information
    }
}

/// A random rig: how many cameras, how many points.
pub type Family = fn(&mut Rng, usize, usize) -> Scene;
/// Both.
pub const FAMILIES: [(&str, Family); 2] = [("head", head), ("vehicle", vehicle)];

/// Sum of squared residuals over their variances, by plain division: shares nothing with the product.
pub fn chi2(cameras: &[Made], rig_from_target: &Pose) -> f64 {
    let squared = |m: &Made, c: &Correspondence| {
        (views::pixel_of(&(m.cam_from_rig * *rig_from_target * c.x_in_target)) - c.pixel).norm_squared()
    };
    let sum = |m: &Made| m.seen.iter().map(|c| squared(m, c) / (c.sigma_px * c.sigma_px)).sum::<f64>();
    cameras.iter().map(sum).sum()
}
