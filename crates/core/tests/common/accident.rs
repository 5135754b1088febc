//! The scene of an accident with known truth: a road, control points on it, points on and above it, photographs from eye height.

use super::Rng;
use nalgebra::{Matrix3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::multiview::network::{Constraint, NetworkCamera, NetworkProblem, Plane};
use resight_core::multiview::triangulate::isotropic;
use resight_core::{Camera, CameraMatrix, Lens, Point, Pose};

/// 1920×1280, f = 1500 px.
pub fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1500.0, fy_px: 1500.0, cx_px: 959.5, cy_px: 639.5 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// Standard deviations of fx, fy, cx, cy as a covariance.
pub fn intrinsics(sigmas_px: [f64; 4]) -> Vec<f64> {
    let mut c = vec![0.0; 16];
    sigmas_px.iter().enumerate().for_each(|(i, s)| c[i * 4 + i] = s * s);
    c
}

/// Eye at `centre`, looking at `at`, upright: y of the image is down.
pub fn looking_at(centre: Point, at: Point) -> Pose {
    let z = (at - centre).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}

/// Control points 0–3 on the road, 4–6 on the road too, 7–8 on a vehicle, 9 the top of a post on 4.
pub fn points() -> Vec<Point> {
    [
        [0.0, 0.0, 0.0],
        [6.0, 0.3, 0.0],
        [6.4, 4.8, 0.0],
        [-0.4, 4.5, 0.0],
        [2.0, 6.0, 0.0],
        [8.5, 3.0, 0.0],
        [3.0, 2.0, 0.0],
        [4.0, 7.0, 1.1],
        [1.5, 5.5, 0.6],
        [2.0, 6.0, 1.4],
    ]
    .map(Point::from)
    .to_vec()
}

/// Two eyes 8 m apart.
pub fn photos() -> Vec<Pose> {
    let middle = Point::new(3.2, 3.2, 0.3);
    [[-2.5, -6.0, 1.7], [8.5, -5.0, 1.6]].map(|c| looking_at(Point::from(c), middle)).to_vec()
}

/// What is seen and known, and with what sigmas.
pub struct Scene {
    pub camera: Camera,
    pub intrinsics: Option<Vec<f64>>,
    pub points: Vec<Point>,
    pub photos: Vec<Pose>,
    pub planes: Vec<Plane>,
    /// As the truth has them, labelled with their sigmas.
    pub constraints: Vec<Constraint>,
    pub camera_of_photo: Vec<usize>,
}

impl Scene {
    pub fn new(photos: Vec<Pose>) -> Self {
        let camera_of_photo = vec![0; photos.len()];
        let (points, planes) = (points(), vec![Plane::Unknown]);
        Scene {
            camera: camera(),
            intrinsics: None,
            points,
            photos,
            planes,
            constraints: Vec::new(),
            camera_of_photo,
        }
    }

    pub fn image_point(&mut self, photo: usize, point: usize, sigma_px: f64) {
        let pixel = self.camera.project(&(self.photos[photo] * self.points[point])).expect("in front");
        self.constraints.push(Constraint::ImagePoint {
            photo,
            point,
            pixel,
            covariance_px2: isotropic(sigma_px),
        });
    }

    pub fn image_point_all(&mut self, points: &[usize], sigma_px: f64) {
        for photo in 0..self.photos.len() {
            points.iter().for_each(|p| self.image_point(photo, *p, sigma_px));
        }
    }

    pub fn distance(&mut self, a: usize, b: usize, sigma_m: f64) {
        let distance_m = (self.points[a] - self.points[b]).norm();
        self.constraints.push(Constraint::Distance { a, b, distance_m, sigma_m });
    }

    pub fn place(&mut self, point: usize, sigma_m: f64) {
        let (x_in_world, sigma_m) = (self.points[point], Vector3::repeat(sigma_m));
        self.constraints.push(Constraint::Place { point, x_in_world, sigma_m });
    }

    pub fn on_plane(&mut self, points: &[usize], sigma_m: f64) {
        self.constraints.extend(points.iter().map(|point| Constraint::OnPlane {
            plane: 0,
            point: *point,
            sigma_m,
        }));
    }

    /// The same constraints with noise from their sigmas, the true lens being another than the stated one, the road as uneven as stated.
    pub fn drawn(&self, rng: &mut Rng) -> Drawn {
        let mut lens = self.camera.clone();
        if let Some(c) = &self.intrinsics {
            let n = lens.parameters().len();
            let drawn = |(i, p): (usize, &(&str, f64))| p.1 + c[i * n + i].sqrt() * rng.normal();
            let values: Vec<f64> = self.camera.parameters().iter().enumerate().map(drawn).collect();
            lens = lens.with_parameters(&values).expect("a camera");
        }
        let mut points = self.points.clone();
        for constraint in &self.constraints {
            if let Constraint::OnPlane { point, sigma_m, .. } = constraint {
                points[*point].z += rng.normal() * sigma_m;
            }
        }
        for constraint in &self.constraints {
            if let Constraint::Upright { foot, top, sigma_rad, .. } = constraint {
                let lean = Vector3::new(rng.normal(), rng.normal(), 0.0) * *sigma_rad;
                let height = points[*top].z - self.points[*foot].z;
                points[*top] = points[*foot] + (Vector3::z() + lean).normalize() * height;
            }
        }
        let mut noisy = |constraint: &Constraint| {
            let mut constraint = *constraint;
            match &mut constraint {
                Constraint::ImagePoint { photo, point, pixel, covariance_px2 } => {
                    let seen = lens.project(&(self.photos[*photo] * points[*point])).expect("in front");
                    *pixel = seen + Vector2::new(rng.normal(), rng.normal()) * covariance_px2.sigma_px();
                }
                Constraint::Distance { a, b, distance_m, sigma_m } => {
                    *distance_m = (points[*a] - points[*b]).norm() + rng.normal() * *sigma_m;
                }
                Constraint::Place { point, x_in_world, sigma_m } => {
                    *x_in_world = points[*point] + sigma_m.map(|s| s * rng.normal());
                }
                _ => {}
            }
            constraint
        };
        let constraints = self.constraints.iter().map(&mut noisy).collect();
        Drawn { points, constraints }
    }

    pub fn network<'a>(
        &'a self,
        cameras: &'a [NetworkCamera<'a>],
        constraints: &'a [Constraint],
    ) -> NetworkProblem<'a> {
        NetworkProblem {
            cameras,
            camera_of_photo: &self.camera_of_photo,
            n_points: self.points.len(),
            planes: &self.planes,
            constraints,
        }
    }

    pub fn cameras(&self) -> [NetworkCamera<'_>; 1] {
        [NetworkCamera { camera: &self.camera, intrinsics_covariance: self.intrinsics.as_deref() }]
    }
}

/// One draw: the points as they truly were, and the constraints as they were stated.
pub struct Drawn {
    pub points: Vec<Point>,
    pub constraints: Vec<Constraint>,
}
