//! Many scenes of accidents, drawn at random: control points on the road, points on and above it, one to four photographs that show everything.

use super::Rng;
use super::accident::{camera, looking_at};
use nalgebra::{Vector2, Vector3};
use resight_core::multiview::network::{Constraint, NetworkCamera, NetworkProblem, Plane, Query};
use resight_core::multiview::triangulate::isotropic;
use resight_core::{Camera, Pixel, Point, Pose};

pub const SIGMA_PX: f64 = 1.0;
pub const TAPE_SIGMA_M: f64 = 0.01;
const ROAD_SIGMA_M: f64 = 0.005;
const SIZE_PX: Vector2<f64> = Vector2::new(1919.0, 1279.0);

/// A scene, its constraints drawn from their sigmas.
pub struct Drawn {
    pub camera: Camera,
    /// Control points, three road points, three of a vehicle, the top of a post on the first road point.
    pub points: Vec<Point>,
    pub n_control_points: usize,
    pub photos: Vec<Pose>,
    pub camera_of_photo: Vec<usize>,
    pub planes: Vec<Plane>,
    pub constraints: Vec<Constraint>,
}

/// What is known of the control points.
pub enum Known {
    /// This many of their mutual distances.
    Tapes(usize),
    Coordinates,
}

/// Control points around the middle of the road.
pub fn ring(rng: &mut Rng, n: usize) -> Vec<Point> {
    let first = rng.uniform(0.0, std::f64::consts::TAU);
    let control_point = |i: usize| {
        let angle = first + std::f64::consts::TAU * i as f64 / n as f64 + rng.uniform(-0.35, 0.35);
        Point::new(angle.cos(), angle.sin(), 0.0) * rng.uniform(2.2, 5.5)
    };
    (0..n).map(control_point).collect()
}

/// Control points along a line, each off it by up to `width_m`.
pub fn row(rng: &mut Rng, n: usize, width_m: f64) -> Vec<Point> {
    let angle = rng.uniform(0.0, std::f64::consts::TAU);
    let (along, across) =
        (Vector3::new(angle.cos(), angle.sin(), 0.0), Vector3::new(-angle.sin(), angle.cos(), 0.0));
    let control_point = |i: usize| {
        let s = -4.5 + 9.0 * i as f64 / (n - 1) as f64 + rng.uniform(-0.5, 0.5);
        along * s + across * rng.uniform(-width_m, width_m)
    };
    (0..n).map(control_point).collect()
}

fn shows(camera: &Camera, pose: &Pose, x: &Point) -> bool {
    let seen = camera.project(&(*pose * *x));
    seen.is_some_and(|u| 0.0 < u.x && u.x < SIZE_PX.x && 0.0 < u.y && u.y < SIZE_PX.y)
}

/// Eyes 1.5 to `highest_m` above the road, the lines of sight 30° to 140° apart, that see all points; none where they cannot be found.
fn eyes(rng: &mut Rng, n: usize, highest_m: f64, points: &[Point]) -> Option<Vec<Pose>> {
    let (camera, mut found, mut first) = (camera(), Vec::new(), None);
    for _ in 0..3000 {
        let side = if rng.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let angle = match first {
            None => rng.uniform(0.0, std::f64::consts::TAU),
            Some(first) => first + side * rng.uniform(0.5, 2.4),
        };
        let centre = Point::new(angle.cos(), angle.sin(), 0.0) * rng.uniform(8.0, 16.0)
            + Vector3::z() * rng.uniform(1.5, highest_m);
        let pose = looking_at(centre, Point::new(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), 0.3));
        if points.iter().all(|x| shows(&camera, &pose, x)) {
            first = first.or(Some(angle));
            found.push(pose);
        }
        if found.len() == n {
            return Some(found);
        }
    }
    None
}

impl Drawn {
    pub fn new(
        rng: &mut Rng,
        n_photos: usize,
        known: &Known,
        highest_m: f64,
        control_points: impl Fn(&mut Rng) -> Vec<Point>,
    ) -> Self {
        loop {
            let mut points = control_points(rng);
            let n_control_points = points.len();
            for _ in 0..3 {
                points.push(Point::new(rng.uniform(-3.5, 3.5), rng.uniform(-3.5, 3.5), 0.0));
            }
            for _ in 0..3 {
                points.push(Point::new(
                    rng.uniform(-2.5, 2.5),
                    rng.uniform(-2.5, 2.5),
                    rng.uniform(0.3, 1.5),
                ));
            }
            points.push(points[n_control_points] + Vector3::z() * rng.uniform(1.0, 2.0));
            if let Some(photos) = eyes(rng, n_photos, highest_m, &points) {
                let mut scene = Drawn {
                    camera: camera(),
                    points,
                    n_control_points,
                    camera_of_photo: vec![0; photos.len()],
                    photos,
                    planes: vec![Plane::Unknown],
                    constraints: Vec::new(),
                };
                scene.see(rng);
                scene.measure_control_points(rng, known);
                return scene;
            }
        }
    }

    fn see(&mut self, rng: &mut Rng) {
        for photo in 0..self.photos.len() {
            for point in 0..self.points.len() {
                // One photograph says nothing of what stands on no plane.
                let is_vehicle = (self.n_control_points + 3..self.n_control_points + 6).contains(&point);
                if !(self.photos.len() == 1 && is_vehicle) {
                    self.image_point(rng, photo, point);
                }
            }
        }
        let on_road = 0..self.n_control_points + 3;
        self.constraints.extend(on_road.map(|point| Constraint::OnPlane {
            plane: 0,
            point,
            sigma_m: ROAD_SIGMA_M,
        }));
        let (foot, top) = (self.n_control_points, self.points.len() - 1);
        self.constraints.push(Constraint::Upright { plane: 0, foot, top, sigma_rad: 0.02 });
    }

    /// A road whose only known lengths are dashes of about 3 m, some on each lane line of `lines_m` (its distance from the middle), and
    /// three more points on it; photographs along the road.
    pub fn dashes(rng: &mut Rng, n_photos: usize, lines_m: &[f64], on_each: usize) -> Self {
        let mut points = Vec::new();
        for line in lines_m {
            let first = rng.uniform(0.0, 3.0);
            for k in 0..on_each {
                let y = first + 8.0 * k as f64 + rng.uniform(-0.5, 0.5);
                let x = line + rng.uniform(-0.05, 0.05);
                points.extend([Point::new(x, y, 0.0), Point::new(x, y + 3.0 + rng.uniform(-0.2, 0.2), 0.0)]);
            }
        }
        let n_control_points = points.len();
        points.extend((0..3).map(|_| Point::new(rng.uniform(-4.0, 4.0), rng.uniform(2.0, 18.0), 0.0)));
        let eye = |rng: &mut Rng| {
            let centre = Point::new(rng.uniform(-2.0, 2.0), rng.uniform(-14.0, -10.0), rng.uniform(2.0, 6.0));
            looking_at(centre, Point::new(rng.uniform(-0.5, 0.5), rng.uniform(4.0, 7.0), 0.0))
        };
        let photos: Vec<Pose> = (0..n_photos).map(|_| eye(rng)).collect();
        let mut scene = Drawn {
            camera: camera(),
            points,
            n_control_points,
            camera_of_photo: vec![0; n_photos],
            photos,
            planes: vec![Plane::Unknown],
            constraints: Vec::new(),
        };
        for point in 0..scene.points.len() {
            (0..n_photos).for_each(|photo| scene.image_point(rng, photo, point));
            scene.constraints.push(Constraint::OnPlane { plane: 0, point, sigma_m: ROAD_SIGMA_M });
        }
        (0..n_control_points / 2).for_each(|k| scene.tape(rng, 2 * k, 2 * k + 1));
        scene
    }

    fn image_point(&mut self, rng: &mut Rng, photo: usize, point: usize) {
        let seen = self.camera.project(&(self.photos[photo] * self.points[point])).expect("in front");
        let pixel = seen + Pixel::new(rng.normal(), rng.normal()) * SIGMA_PX;
        self.constraints.push(Constraint::ImagePoint {
            photo,
            point,
            pixel,
            covariance_px2: isotropic(SIGMA_PX),
        });
    }

    pub fn tape(&mut self, rng: &mut Rng, a: usize, b: usize) {
        let distance_m = (self.points[a] - self.points[b]).norm() + TAPE_SIGMA_M * rng.normal();
        self.constraints.push(Constraint::Distance { a, b, distance_m, sigma_m: TAPE_SIGMA_M });
    }

    fn measure_control_points(&mut self, rng: &mut Rng, known: &Known) {
        match known {
            Known::Tapes(n) => {
                let mut pairs: Vec<(usize, usize)> =
                    (0..self.n_control_points).flat_map(|b| (0..b).map(move |a| (a, b))).collect();
                while *n < pairs.len() {
                    pairs.remove(rng.index(pairs.len()));
                }
                pairs.into_iter().for_each(|(a, b)| self.tape(rng, a, b));
            }
            Known::Coordinates => {
                for point in 0..self.n_control_points {
                    let noise = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * TAPE_SIGMA_M;
                    let sigma_m = Vector3::repeat(TAPE_SIGMA_M);
                    self.constraints.push(Constraint::Place {
                        point,
                        x_in_world: self.points[point] + noise,
                        sigma_m,
                    });
                }
            }
        }
    }

    pub fn cameras(&self) -> [NetworkCamera<'_>; 1] {
        [NetworkCamera { camera: &self.camera, intrinsics_covariance: None }]
    }

    pub fn network<'a>(&'a self, cameras: &'a [NetworkCamera<'a>]) -> NetworkProblem<'a> {
        NetworkProblem {
            cameras,
            camera_of_photo: &self.camera_of_photo,
            n_points: self.points.len(),
            planes: &self.planes,
            constraints: &self.constraints,
        }
    }

    /// The distances among the constraints.
    pub fn tapes(&self) -> Vec<usize> {
        (0..self.constraints.len())
            .filter(|i| matches!(self.constraints[*i], Constraint::Distance { .. }))
            .collect()
    }

    /// Lengths and heights, with the truth.
    pub fn queries(&self) -> Vec<(Query, f64)> {
        let (n, last) = (self.n_control_points, self.points.len() - 1);
        let mut pairs = vec![(n, n + 1), (n + 2, 0)];
        let mut heights = vec![last];
        if 1 < self.photos.len() {
            pairs.push((n + 3, n + 4));
            heights.extend([n + 3, n + 5]);
        }
        if self.planes.is_empty() {
            heights.clear();
        }
        let lengths = pairs
            .into_iter()
            .map(|(a, b)| (Query::Distance { a, b }, (self.points[a] - self.points[b]).norm()));
        let heights =
            heights.into_iter().map(|point| (Query::Height { plane: 0, point }, self.points[point].z));
        lengths.chain(heights).collect()
    }
}
