//! Made-up rooms: cameras around, targets carried through the middle, seen by whoever they face.

use super::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector3};
use resight_core::camera::{BrownConrady, Pinhole};
use resight_core::multiview::rig::{Observation, RigConfig, RigProblem, RigSolution, solve_rig};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Pixel, Point, Pose, Vector6};

/// A rig with its truth.
#[derive(Clone)]
pub struct Room {
    pub cameras: Vec<Camera>,
    pub cam_from_rig: Vec<Pose>,
    pub points: Vec<Vec<Point>>,
    pub body_of_target: Vec<usize>,
    pub body_from_target: Vec<Pose>,
    pub n_views: usize,
    pub observations: Vec<Observation>,
    /// (view, body, rig_from_body).
    pub bodies: Vec<(usize, usize, Pose)>,
}

/// f in px, 1280×960.
pub fn pinhole(f_px: f64) -> Camera {
    let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: 639.5, cy_px: 479.5 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// The same with a barrel of −0.2, 0.05.
pub fn barrel(f_px: f64) -> Camera {
    let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: 639.5, cy_px: 479.5 };
    let lens = BrownConrady::new(matrix, &[-0.2, 0.05, 1e-4, -1e-4]).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

/// Columns × rows of points `pitch_m` apart, the middle at the origin.
pub fn board(columns: usize, rows: usize, pitch_m: f64) -> Vec<Point> {
    let at = |i: usize, n: usize| (i as f64 - 0.5 * (n as f64 - 1.0)) * pitch_m;
    (0..columns * rows).map(|i| Point::new(at(i % columns, columns), at(i / columns, rows), 0.0)).collect()
}

/// The paper's target: 0, 0.5, 1 m on a line and one off its beginning.
pub fn line_plus_one() -> Vec<Point> {
    [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.7, 0.0]].map(Point::from).to_vec()
}

/// `n` cameras on a circle of `radius_m` looking inwards, in the frame of the first.
pub fn ring(n: usize, radius_m: f64) -> Vec<Pose> {
    let cam_from_world = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / n as f64;
        let height = if i.is_multiple_of(2) { 0.4 } else { -0.3 };
        let centre = Vector3::new(radius_m * angle.cos(), height, radius_m * angle.sin());
        views::looking_at(centre, Point::new(0.1, 0.0, -0.1))
    };
    let world_from_rig = cam_from_world(0).inverse();
    (0..n).map(|i| cam_from_world(i) * world_from_rig).collect()
}

/// Two cameras 0.9 m apart, both turned towards a place 1.6 m away.
pub fn pair() -> Vec<Pose> {
    let cam_from_world = |angle: f64, y: f64| {
        views::looking_at(Point::new(1.6 * angle.sin(), y, -1.6 * angle.cos()), Point::new(0.02, 0.0, 0.03))
    };
    let (first, second) = (cam_from_world(-0.3, 0.1), cam_from_world(0.3, -0.05));
    vec![Pose::identity(), second * first.inverse()]
}

/// Sees a pixel of the image?
fn in_image(pixel: &Pixel) -> bool {
    (0.0..1279.0).contains(&pixel.x) && (0.0..959.0).contains(&pixel.y)
}

impl Room {
    pub fn new(cameras: Vec<Camera>, cam_from_rig: Vec<Pose>) -> Self {
        let (points, body_of_target, body_from_target) = (Vec::new(), Vec::new(), Vec::new());
        let (observations, bodies) = (Vec::new(), Vec::new());
        Room {
            cameras,
            cam_from_rig,
            points,
            body_of_target,
            body_from_target,
            n_views: 0,
            observations,
            bodies,
        }
    }

    /// A target on a body.
    pub fn with_target(mut self, points: Vec<Point>, body: usize, body_from_target: Pose) -> Self {
        self.points.push(points);
        self.body_of_target.push(body);
        self.body_from_target.push(body_from_target);
        self
    }

    /// Puts a body somewhere in a new view (or the last one): every camera that its targets face sees them, exactly.
    pub fn see(&mut self, view: usize, body: usize, rig_from_body: Pose, sigma_px: f64) {
        self.n_views = self.n_views.max(view + 1);
        self.bodies.push((view, body, rig_from_body));
        for camera in 0..self.cameras.len() {
            for target in (0..self.points.len()).filter(|t| self.body_of_target[*t] == body) {
                let cam_from_target =
                    self.cam_from_rig[camera] * rig_from_body * self.body_from_target[target];
                let seen = self.seen(camera, target, &cam_from_target, sigma_px);
                if seen.len() == self.points[target].len() {
                    self.observations.push(Observation { camera, view, target, seen });
                }
            }
        }
    }

    /// Points in the image; none of a target seen from behind or at less than 15° (the front is where z points away from the camera).
    fn seen(
        &self,
        camera: usize,
        target: usize,
        cam_from_target: &Pose,
        sigma_px: f64,
    ) -> Vec<Correspondence> {
        let towards = cam_from_target.translation.normalize();
        if cam_from_target.rotation.column(2).dot(&towards) < 0.26 {
            return Vec::new();
        }
        let lens = &self.cameras[camera];
        let point = |x: &Point| {
            let pixel = lens.project(&(cam_from_target * x)).filter(in_image)?;
            Correspondence::new(lens, *x, pixel, sigma_px).ok()
        };
        self.points[target].iter().filter_map(point).collect()
    }

    /// Observations with noise of their sigma.
    pub fn disturbed(&self, rng: &mut Rng) -> Vec<Observation> {
        let moved = |s: &Observation, c: &Correspondence, rng: &mut Rng| {
            let pixel = c.pixel + Vector2::new(rng.normal(), rng.normal()) * c.sigma_px;
            let seen = Correspondence::new(&self.cameras[s.camera], c.x_in_target, pixel, c.sigma_px);
            Correspondence {
                sigma_m: c.sigma_m,
                covariance_px2: c.covariance_px2,
                ..seen.expect("in the field")
            }
        };
        let noisy = |s: &Observation| Observation {
            seen: s.seen.iter().map(|c| moved(s, c, rng)).collect(),
            ..s.clone()
        };
        self.observations.iter().map(noisy).collect()
    }

    pub fn solve(&self, observations: &[Observation], config: &RigConfig) -> Result<RigSolution, Error> {
        let problem = RigProblem {
            cameras: &self.cameras,
            body_of_target: &self.body_of_target,
            n_views: self.n_views,
            observations,
        };
        let found = solve_rig(&problem, config)?;
        // Without `lens_errors` the intrinsics are to be taken as given.
        if config.lens_errors || found.lens_sigma_m.is_none() {
            super::held::assert_rig(&found, self.n_views, "a room");
        }
        Ok(found)
    }

    /// Left motion from the truth to the estimate of a camera, and its square in units of the covariance.
    pub fn error(&self, solution: &RigSolution, camera: usize) -> (Vector6, f64) {
        let found = &solution.cameras[camera];
        let motion = (found.cam_from_rig * self.cam_from_rig[camera].inverse()).log();
        (motion, nees(&motion, &found.covariance))
    }
}

pub fn nees(motion: &Vector6, covariance: &Matrix6<f64>) -> f64 {
    motion.dot(&(covariance.cholesky().expect("a covariance").solve(motion)))
}

/// A pose in a ball of `reach_m` around a place, its z within `tilt_rad` of a direction, turned anyhow about it.
pub fn somewhere(rng: &mut Rng, around: Point, reach_m: f64, facing: Vector3<f64>, tilt_rad: f64) -> Pose {
    let place = around + rng.unit_vector() * rng.uniform(0.0, reach_m);
    let sideways = facing.cross(&rng.unit_vector()).normalize();
    let angle = rng.uniform(0.0, tilt_rad);
    let z = facing.normalize() * angle.cos() + sideways * angle.sin();
    let x = z.cross(&rng.unit_vector()).normalize();
    let rotation = nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]);
    Pose::new(rotation, place)
}

/// A ring of cameras and a board carried through its middle, `n_views` times.
pub fn ring_with_board(
    rng: &mut Rng,
    cameras: Vec<Camera>,
    points: Vec<Point>,
    n_views: usize,
    sigma_px: f64,
) -> Room {
    let poses = ring(cameras.len(), 3.0);
    let rig_from_world = views::looking_at(Vector3::new(3.0, 0.4, 0.0), Point::new(0.1, 0.0, -0.1));
    let mut room = Room::new(cameras, poses).with_target(points, 0, Pose::identity());
    for view in 0..n_views {
        let facing = rng.unit_vector();
        let facing = Vector3::new(facing.x, 0.4 * facing.y, facing.z);
        let world_from_body = somewhere(rng, Point::zeros(), 0.6, facing, 0.3);
        room.see(view, 0, rig_from_world * world_from_body, sigma_px);
    }
    room
}

/// Two cameras and a target in front of them, about 1.6 m away, tilted up to 50°, `n_views` times.
pub fn pair_with(rng: &mut Rng, points: Vec<Point>, n_views: usize, sigma_px: f64) -> Room {
    let cameras = vec![pinhole(1000.0), pinhole(1000.0)];
    let mut room = Room::new(cameras, pair()).with_target(points, 0, Pose::identity());
    while room.n_views < n_views {
        let around = Point::new(0.0, 0.0, 1.6);
        let rig_from_body = somewhere(rng, around, 0.9, Vector3::new(0.3, 0.0, 0.95), 0.9);
        let mut trial = room.clone();
        trial.see(room.n_views, 0, rig_from_body, sigma_px);
        if trial.observations.len() == room.observations.len() + 2 {
            room = trial;
        }
    }
    room
}

/// Cameras 0.8 m apart in a row, all looking the same way, and a board of twelve points carried along them: each view is seen by about four.
pub fn row(rng: &mut Rng, n_cameras: usize, n_views: usize, sigma_px: f64) -> Room {
    let place = |i: usize| Pose::new(nalgebra::Matrix3::identity(), Vector3::new(-0.8 * i as f64, 0.0, 0.0));
    let cameras = (0..n_cameras).map(|_| pinhole(900.0)).collect();
    let mut room = Room::new(cameras, (0..n_cameras).map(place).collect()).with_target(
        board(4, 3, 0.15),
        0,
        Pose::identity(),
    );
    for view in 0..n_views {
        // From one end to the other and back, so that every neighbour shares views whatever their number.
        let x = 0.8 * (n_cameras as f64 - 1.0) * view as f64 / (n_views as f64 - 1.0).max(1.0);
        let around = Point::new(x, 0.0, 2.5);
        room.see(view, 0, somewhere(rng, around, 0.4, Vector3::z(), 0.8), sigma_px);
    }
    room
}

/// As many views of a board of 100 points as asked for, each seen whole by nearly all of eight cameras in an arc.
pub fn arc(rng: &mut Rng, n_views: usize, sigma_px: f64) -> Room {
    let cam_from_world = |i: usize| {
        let angle = -0.6 + 1.2 * i as f64 / 7.0;
        views::looking_at(Point::new(2.0 * angle.sin(), 0.2, -2.0 * angle.cos()), Point::new(0.02, 0.0, 0.03))
    };
    let rig_from_world = cam_from_world(0);
    let poses = (0..8).map(|i| cam_from_world(i) * rig_from_world.inverse()).collect();
    let mut room = Room::new((0..8).map(|_| barrel(1100.0)).collect(), poses).with_target(
        board(10, 10, 0.06),
        0,
        Pose::identity(),
    );
    for view in 0..n_views {
        let world_from_body = somewhere(rng, Point::zeros(), 0.35, Vector3::z(), 0.6);
        room.see(view, 0, rig_from_world * world_from_body, sigma_px);
    }
    room
}
