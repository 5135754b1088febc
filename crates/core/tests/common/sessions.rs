//! Sessions of a robot that is not exact: a camera that sees a board of 56 corners from all over, in pixels.

use super::{Rng, hands::World, views};
use nalgebra::{Vector2, Vector3, Vector6};
use resight_core::multiview::hand_eye::{HandEye, HandEyeConfig, HandEyeView, Mounting, solve_hand_eye};
use resight_core::multiview::rig_pose::RigView;
use resight_core::{Camera, Correspondence, Error, Point, Pose};

/// How the robot's poses are wrong.
#[derive(Debug, Clone, Copy)]
pub enum Robot {
    /// Orientation and position of the gripper, independently: rad, m.
    AtHand(f64, f64),
    /// A left motion in the base: its turns are about the base's origin.
    AtBase(f64, f64),
}

impl Robot {
    /// What the robot reports.
    pub fn reported(self, rng: &mut Rng, truth: &Pose) -> Pose {
        let (Robot::AtHand(rad, m) | Robot::AtBase(rad, m)) = self;
        let w = Vector3::from_fn(|_, _| rad * rng.normal());
        let v = Vector3::from_fn(|_, _| m * rng.normal());
        let by = Pose::exp(&Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z));
        match self {
            Robot::AtHand(..) => Pose::new(by.rotation * truth.rotation, truth.translation + v),
            Robot::AtBase(..) => by * *truth,
        }
    }
}

/// What is seen and reported, and the truth.
pub struct Session {
    pub world: World,
    pub camera: Camera,
    pub reported: Vec<Pose>,
    pub seen: Vec<Vec<Correspondence>>,
}

/// 7 × 8 corners, 30 mm apart, centred.
pub fn board() -> Vec<Point> {
    (0..56)
        .map(|i| Point::new(0.03 * (f64::from(i % 8) - 3.5), 0.03 * (f64::from(i / 8) - 3.0), 0.0))
        .collect()
}

impl Session {
    /// `bent_m`: how far the board's edges stand off its plane.
    pub fn new(
        rng: &mut Rng,
        mounting: Mounting,
        n: usize,
        robot: Robot,
        camera: &Camera,
        sigma_px: f64,
        bent_m: f64,
    ) -> Session {
        let middle = World::cell(rng, mounting, n);
        let world = aside(rng, &middle);
        let points = board();
        let bent = |p: &Point| Point::new(p.x, p.y, bent_m * (p.x / 0.105).powi(2));
        let look = |rng: &mut Rng, view: usize| -> Vec<Correspondence> {
            let pose = world.cam_from_target(view);
            let one = |p: &Point| {
                let pixel =
                    camera.project(&(pose * bent(p)))? + Vector2::new(rng.normal(), rng.normal()) * sigma_px;
                Correspondence::new(camera, *p, pixel, sigma_px).ok()
            };
            points.iter().filter_map(one).collect()
        };
        let seen = (0..n).map(|view| look(rng, view)).collect();
        let reported = world.base_from_gripper.iter().map(|truth| robot.reported(rng, truth)).collect();
        Session { world, camera: camera.clone(), reported, seen }
    }

    /// The robot's poses with further errors, which so many successive views share.
    pub fn with_shared_errors(mut self, rng: &mut Rng, robot: Robot, n_views: usize) -> Session {
        for block in self.reported.chunks_mut(n_views) {
            let error = robot.reported(rng, &Pose::identity());
            for hand in block {
                *hand = Pose::new(error.rotation * hand.rotation, error.translation + hand.translation);
            }
        }
        self
    }

    /// As seen with another camera in mind, and a target of another size.
    pub fn believed(&self, camera: &Camera, size: f64) -> Vec<Vec<Correspondence>> {
        let one = |c: &Correspondence| {
            Correspondence::new(camera, c.x_in_target * size, c.pixel, c.sigma_px).expect("in the field")
        };
        self.seen.iter().map(|view| view.iter().map(one).collect()).collect()
    }

    pub fn solved(&self) -> HandEye {
        solved(&self.reported, &self.seen, &self.camera, self.world.mounting).unwrap()
    }
}

/// The same robot poses with the camera turned, so that the board is not always in the middle of the image.
fn aside(rng: &mut Rng, world: &World) -> World {
    let mut turned = |view: usize| {
        let turn = Vector6::new(rng.uniform(-0.12, 0.12), rng.uniform(-0.2, 0.2), 0.0, 0.0, 0.0, 0.0);
        Pose::exp(&turn) * world.cam_from_target(view)
    };
    let seen: Vec<Pose> = (0..world.base_from_gripper.len()).map(&mut turned).collect();
    World::standing(world.mounting, world.cam_from_carrier, world.holder_from_target, &seen)
}

/// Hand–eye on pixels, the robot's noise open.
pub fn solved(
    reported: &[Pose],
    seen: &[Vec<Correspondence>],
    camera: &Camera,
    mounting: Mounting,
) -> Result<HandEye, Error> {
    solved_as((reported, seen), camera, &HandEyeConfig { mounting, ..HandEyeConfig::default() })
}

/// Hand–eye on pixels, with the configuration given.
pub fn solved_as(
    (reported, seen): (&[Pose], &[Vec<Correspondence>]),
    camera: &Camera,
    config: &HandEyeConfig,
) -> Result<HandEye, Error> {
    let identity = Pose::identity();
    let mut rigs: Vec<[RigView; 1]> = Vec::new();
    for seen in seen {
        rigs.push([RigView {
            camera,
            cam_from_rig: identity,
            cam_from_rig_covariance: None,
            intrinsics_covariance: None,
            seen,
        }]);
    }
    let mut views: Vec<HandEyeView> = Vec::new();
    for (base_from_gripper, seen) in reported.iter().zip(&rigs) {
        let (base_from_gripper, gripper_covariance) = (*base_from_gripper, None);
        views.push(HandEyeView {
            base_from_gripper,
            gripper_covariance,
            written: None,
            candidates: Vec::new(),
            seen,
        });
    }
    let found = solve_hand_eye(&views, config)?;
    super::held::assert_hand_eye(&found, "a session");
    Ok(found)
}

/// f = 800 px, no distortion.
pub fn camera() -> Camera {
    views::camera()
}
