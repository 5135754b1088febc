//! A simulated rig whose truth is known, written as the files that `rig` reads.

use nalgebra::Vector2;
use resight::core::camera::Pinhole;
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Vector6};
use std::fmt::Write;
use std::path::Path;

/// Noise of the simulated pixels.
pub const SIGMA_PX: f64 = 0.2;

/// Numbers without a pattern, the same on every machine (SplitMix64).
pub struct Chance(pub u64);

impl Chance {
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let (radius, turn) = ((1.0 - self.uniform()).ln(), self.uniform());
        (-2.0 * radius).sqrt() * (std::f64::consts::TAU * turn).cos()
    }

    /// A new order of `n` things.
    pub fn order(&mut self, n: usize) -> Vec<usize> {
        let mut keyed: Vec<(u64, usize)> = (0..n).map(|i| ((self.uniform() * 1e15) as u64, i)).collect();
        keyed.sort_unstable();
        keyed.into_iter().map(|(_, i)| i).collect()
    }
}

/// One row of detections.
#[derive(Clone)]
pub struct Observed {
    pub camera: &'static str,
    pub view: usize,
    pub id: usize,
    pub x: Point,
    pub pixel: Vector2<f64>,
}

/// cam_from_rig of each camera, reference first.
pub fn cameras() -> Vec<(&'static str, Pose)> {
    let at = |x: f64, turn: f64, z: f64| {
        Pose::exp(&Vector6::new(0.02, turn, -0.01, 0.0, 0.0, 0.0)) * shift(-x, 0.01, z)
    };
    vec![("left", Pose::identity()), ("middle", at(0.12, 0.05, 0.01)), ("right", at(0.30, 0.2, 0.02))]
}

fn shift(x: f64, y: f64, z: f64) -> Pose {
    Pose { translation: Point::new(x, y, z), ..Pose::identity() }
}

pub fn lens() -> Camera {
    let matrix = CameraMatrix { fx_px: 600.0, fy_px: 600.0, cx_px: 319.5, cy_px: 239.5 };
    Camera { lens: Lens::Pinhole(Pinhole::new(matrix).unwrap()), size: None }
}

/// A board of 6 × 5 corners, 40 mm apart, as a chessboard counts them.
pub fn board() -> Vec<Point> {
    (0..30).map(|i| Point::new(0.04 * (i % 6) as f64, 0.04 * (i / 6) as f64, 0.0)).collect()
}

/// The board in view `i`, tilted this way and that, 0.7 to 1 m away.
pub fn rig_from_board(i: usize, chance: &mut Chance) -> Pose {
    let mut between = |a: f64, b: f64| a + (b - a) * chance.uniform();
    let tilt = Vector6::new(between(-0.6, 0.6), between(-0.6, 0.6), between(-0.4, 0.4), 0.0, 0.0, 0.0);
    let place = shift(between(-0.05, 0.15), between(-0.15, 0.05), 0.7 + 0.3 * (i % 5) as f64 / 4.0);
    place * Pose::exp(&tilt) * shift(-0.1, -0.08, 0.0)
}

/// What every camera sees of points at `rig_from_target`, with noise; views and cameras filtered by `sees`.
pub fn observations(
    n_views: usize,
    points: &[Point],
    chance: &mut Chance,
    rig_from_target: impl Fn(usize, &mut Chance) -> Pose,
    sees: impl Fn(usize, &str) -> bool,
) -> Vec<Observed> {
    let mut seen = Vec::new();
    for view in 0..n_views {
        let place = rig_from_target(view, chance);
        for (camera, cam_from_rig) in cameras() {
            for (id, x) in points.iter().enumerate() {
                let noise = Vector2::new(chance.normal(), chance.normal()) * SIGMA_PX;
                let pixel = lens().project(&(cam_from_rig * place * *x)).unwrap() + noise;
                if sees(view, camera) {
                    seen.push(Observed { camera, view, id, x: *x, pixel });
                }
            }
        }
    }
    seen
}

/// The simulated recording: 12 views of the board.
pub fn recording(seed: u64) -> Vec<Observed> {
    observations(12, &board(), &mut Chance(seed), rig_from_board, |_, _| true)
}

/// As the contract's columns.
pub fn csv(seen: &[Observed]) -> String {
    let mut text = "camera,view,id,x_m,y_m,z_m,u_px,v_px\n".to_string();
    for s in seen {
        let (x, p) = (s.x, s.pixel);
        writeln!(text, "{},v{},{},{},{},{},{},{}", s.camera, s.view, s.id, x.x, x.y, x.z, p.x, p.y).unwrap();
    }
    text
}

/// `--camera NAME=FILE` for all three.
pub fn camera_arguments(folder: &Path) -> Vec<String> {
    let text = "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 600.0\nfy_px = 600.0\ncx_px = 319.5\ncy_px = 239.5\n";
    let write = |(name, _): (&str, Pose)| {
        let path = folder.join(format!("{name}.toml"));
        std::fs::write(&path, text).unwrap();
        vec!["--camera".to_string(), format!("{name}={}", path.display())]
    };
    cameras().into_iter().flat_map(write).collect()
}

/// A pose object of the program's JSON.
pub fn pose_of(object: &serde_json::Value) -> Pose {
    let number = |value: &serde_json::Value, i: usize| value[i].as_f64().unwrap();
    let (q, t) = (&object["rotation_wxyz"], &object["translation_m"]);
    let t = Point::new(number(t, 0), number(t, 1), number(t, 2));
    Pose::from_quaternion_wxyz([0, 1, 2, 3].map(|i| number(q, i)), t)
}

/// Squared Mahalanobis distance of a pose from the truth by its own covariance.
pub fn distance2(found: &Pose, truth: &Pose, covariance: &serde_json::Value) -> f64 {
    let covariance = nalgebra::Matrix6::from_fn(|i, j| covariance[i][j].as_f64().unwrap());
    let error = (*found * truth.inverse()).log();
    error.dot(&covariance.cholesky().expect("a covariance").solve(&error))
}
