//! A rig in which a hand carries a board.

use super::Rng;
use super::conditions::Condition;
use nalgebra::{Vector2, Vector6};
use resight_core::camera::Pinhole;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::temporal::monitor::rig::{FrameSet, TargetObservation};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

/// Of the board.
const CORNERS: usize = 12;
/// A session begins at this hour: night falls after six minutes.
const NIGHT_SOON_H: f64 = 17.9;
const SIGMA_PX: f64 = 0.3;
pub const PERIOD_S: f64 = 0.2;

pub fn lens() -> Camera {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 700.0, cx_px: 639.5, cy_px: 399.5 };
    Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None }
}

pub fn shift(x: f64, y: f64, z: f64) -> Pose {
    Pose { translation: Point::new(x, y, z), ..Pose::identity() }
}

/// Cameras around a room that look at its middle.
pub fn places(n: usize) -> Vec<Pose> {
    let place = |i: usize| {
        let around = 0.5 * (i as f64 - 0.5 * (n - 1) as f64);
        let turn = Pose::exp(&Vector6::new(0.1 - 0.05 * i as f64, around, 0.05 * i as f64, 0.0, 0.0, 0.0));
        shift(0.0, 0.0, 1.6 + 0.1 * i as f64) * turn
    };
    (0..n).map(place).collect()
}

/// A rig in which a hand carries a board of 12 corners; what is no noise of a pixel is there too.
pub struct Scene {
    pub places: Vec<Pose>,
    pub chance: Rng,
    /// What the lens model leaves, px at the image's corner: constant and linear, for each camera.
    pub lens_error: Vec<[Vector2<f64>; 3]>,
    /// When each camera fires after the first, seconds.
    pub late_s: Vec<f64>,
    frame_set: usize,
    pub period_s: f64,
    pub condition: Condition,
    /// AR(1) errors of each corner of each camera, of variance one.
    correlated: Vec<[Vector2<f64>; CORNERS]>,
}

pub struct Observed {
    pub camera: usize,
    pub points: Vec<Correspondence>,
    pub estimate: PoseEstimate,
}

impl Scene {
    pub fn new(n: usize, seed: u64) -> Self {
        let mut chance = Rng::new(seed);
        let mut error = |scale: f64| Vector2::new(scale * chance.normal(), scale * chance.normal());
        let lens_error = (0..n).map(|_| [error(0.1), error(0.2), error(0.2)]).collect();
        let late_s = (0..n).map(|_| chance.uniform(0.0, 0.008)).collect();
        Scene {
            places: places(n),
            chance,
            lens_error,
            late_s,
            frame_set: 0,
            period_s: PERIOD_S,
            condition: Condition::White,
            correlated: vec![[Vector2::zeros(); CORNERS]; n],
        }
    }

    /// Smooth, at up to 0.3 m/s.
    fn rig_from_board(&self, t_s: f64) -> Pose {
        let turn = Vector6::new(
            0.45 * (0.9 * t_s).sin(),
            0.45 * (0.7 * t_s + 1.0).sin(),
            0.3 * (0.5 * t_s).cos(),
            0.0,
            0.0,
            0.0,
        );
        shift(0.25 * (0.8 * t_s).sin(), 0.2 * (0.6 * t_s).cos(), 0.2 * (0.4 * t_s).sin())
            * Pose::exp(&turn)
            * shift(-0.12, -0.08, 0.0)
    }

    /// The next frame set, `old_from_new` of each camera given; a camera in four does not look.
    pub fn next(&mut self, moved: impl Fn(usize) -> Vector6<f64>) -> (f64, Vec<Observed>) {
        let t_s = self.period_s * self.frame_set as f64;
        self.frame_set += 1;
        let mut all = Vec::new();
        for camera in 0..self.places.len() {
            let is_away = 2 < self.places.len() && self.chance.uniform(0.0, 1.0) < 0.25;
            let rig_from_board = self.rig_from_board(t_s + self.late_s[camera]);
            let cam_from_board = Pose::exp(&moved(camera)).inverse() * self.places[camera] * rig_from_board;
            let points = self.points(camera, &cam_from_board);
            if let Some(estimate) =
                (!is_away).then(|| locate(&points, &lens(), &Config::default()).ok()).flatten()
            {
                all.push(Observed { camera, points, estimate });
            }
        }
        (t_s, all)
    }

    /// Error of a corner in units of the stated sigma.
    fn noise(&mut self, camera: usize, corner: usize) -> Vector2<f64> {
        let white = Vector2::new(self.chance.normal(), self.chance.normal());
        match self.condition {
            Condition::Understated(factor) => white * factor,
            Condition::NightDoubled => {
                let hour = (self.period_s * self.frame_set as f64 / 3600.0 + NIGHT_SOON_H) % 24.0;
                white * if (6.0..18.0).contains(&hour) { 1.0 } else { 2.0 }
            }
            Condition::Correlated { share, time_s } => {
                let kept = (-self.period_s / time_s).exp();
                let fresh = Vector2::new(self.chance.normal(), self.chance.normal());
                let persistent = &mut self.correlated[camera][corner];
                *persistent = *persistent * kept + fresh * (1.0 - kept * kept).sqrt();
                white * (1.0 - share).sqrt() + *persistent * share.sqrt()
            }
            _ => white,
        }
    }

    fn points(&mut self, camera: usize, cam_from_board: &Pose) -> Vec<Correspondence> {
        let lens = lens();
        let mut points = Vec::new();
        for i in 0..CORNERS {
            let x_in_board = Point::new(0.08 * (i % 4) as f64, 0.08 * (i / 4) as f64, 0.0);
            let Some(pixel) = lens.project(&(cam_from_board * &x_in_board)) else { continue };
            let [constant, by_u, by_v] = self.lens_error[camera];
            let at = (pixel - Vector2::new(639.5, 399.5)) / 750.0;
            let noise = self.noise(camera, i) * SIGMA_PX;
            let seen = pixel + constant + by_u * at.x + by_v * at.y + noise;
            points.extend(Correspondence::new(&lens, x_in_board, seen, SIGMA_PX).ok());
        }
        points
    }
}

pub fn frame_set<'a>(lens: &'a Camera, (t_s, seen): &'a (f64, Vec<Observed>)) -> FrameSet<'a> {
    let target_observation = |seen: &'a Observed| TargetObservation {
        camera: seen.camera,
        target: 0,
        lens,
        seen: &seen.points,
        estimate: &seen.estimate,
    };
    FrameSet { t_s: *t_s, target_observations: seen.iter().map(target_observation).collect() }
}
