//! One simulated camera: its pose, its fate, and its observation at a time.

use super::Simulation;
use nalgebra::{Vector2, Vector3};
use resight::core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::{Config, locate};
use resight::core::statistics::random::{SplitMix64, mixed};
use resight::core::{Camera, Correspondence, Pixel, Point, Pose, Vector6};

/// The fate of a camera on the day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fate {
    /// The camera does not move.
    Steady,
    /// A sudden motion at a time, after which the camera does not move.
    Step {
        /// Seconds from the first image.
        at_s: f64,
        /// Small motion of the camera, `[rotation_rad; translation_m]`, in its own frame.
        motion: Vector6,
    },
    /// A slow motion from a time to the end.
    Drifting {
        /// Seconds from the first image.
        at_s: f64,
        /// Small motion until the end of the day.
        motion: Vector6,
    },
    /// A point of its map is wrong.
    WrongMap,
    /// The camera provides rows until a time.
    Dead {
        /// Seconds from the first image; 0: no rows at all.
        at_s: f64,
    },
    /// The clock is ahead, behind, or is set back at noon.
    Clock {
        /// Seconds by which its times are ahead.
        offset_s: f64,
        /// Start of the offset, seconds from the first image.
        from_s: f64,
    },
}

impl Fate {
    /// Returns the word in the truth table.
    pub fn name(&self) -> &'static str {
        match self {
            Fate::Steady => "steady",
            Fate::Step { .. } => "step",
            Fate::Drifting { .. } => "drifting",
            Fate::WrongMap => "wrong_map",
            Fate::Dead { .. } => "dead",
            Fate::Clock { .. } => "clock",
        }
    }
}

/// A camera with its observations and its fate.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedCamera {
    /// Its name.
    pub name: String,
    /// Its crossing.
    pub site: String,
    /// Degrees of longitude and latitude.
    pub east_north: [f64; 2],
    /// Its lens.
    pub camera: Camera,
    /// Positions of the points.
    pub points: [Point; 4],
    /// Positions of the points according to the map.
    pub map_points: [Point; 4],
    /// Its initial pose.
    pub cam_from_target: Pose,
    /// Its fate.
    pub fate: Fate,
    /// Rotation at the warmest time, radians.
    thermal: Vector3<f64>,
    seed: u64,
}

/// Number of cameras at one crossing.
const AT_A_SITE: usize = 4;
/// Three points on a line and one off it, metres: marks on a kerb and a post beside it.
const LAYOUT: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.5, 0.0]];

impl SimulatedCamera {
    pub(super) fn new(day: &Simulation, number: usize, rng: &mut SplitMix64) -> Self {
        let camera = lens(rng);
        let stretch = rng.between(0.8, 1.6);
        let points = LAYOUT.map(|x| Point::from(x) * stretch);
        let cam_from_target = stand(&camera, &points, day.sigma_px, rng);
        let fate = fate(day, rng);
        let mut map_points = points;
        if fate == Fate::WrongMap {
            // An error across the line, which no pose explains; the pose absorbs most of an error along it, or of the fourth point.
            map_points[1].y += rng.between(0.1, 0.3);
        }
        let site = number / AT_A_SITE;
        let mut place = SplitMix64::scattered(day.seed ^ mixed(site as u64));
        SimulatedCamera {
            name: format!("cam-{number:05}"),
            site: format!("site-{site:04}"),
            east_north: [13.2 + 0.4 * place.uniform(), 52.4 + 0.2 * place.uniform()],
            camera,
            points,
            map_points,
            cam_from_target,
            fate,
            thermal: direction(rng) * (day.thermal_deg.to_radians() * (0.7 * rng.normal()).exp()),
            seed: rng.bits(),
        }
    }

    /// Returns the pose at a time, seconds from the first image; days are warmest at 15 h.
    pub fn cam_from_target_at(&self, t_s: f64) -> Pose {
        let warmth = (std::f64::consts::TAU * (t_s / 86_400.0 - 0.375)).sin();
        let thermal = self.thermal * warmth;
        let warm = Pose::exp(&Vector6::new(thermal.x, thermal.y, thermal.z, 0.0, 0.0, 0.0));
        let moved = match self.fate {
            Fate::Step { at_s, motion } if at_s <= t_s => Pose::exp(&-motion),
            Fate::Drifting { at_s, motion } if at_s <= t_s => {
                Pose::exp(&(-motion * ((t_s - at_s) / 86_400.0)))
            }
            _ => Pose::identity(),
        };
        warm * moved * self.cam_from_target
    }

    /// Returns the row of an image: its time and pixels; none where there is no row.
    pub fn row(&self, day: &Simulation, tick: usize) -> Option<(f64, [Pixel; 4])> {
        self.row_moved(day, tick, &Vector6::zeros())
    }

    /// Returns the same row for a camera moved by a small motion in its own frame, `[rotation_rad; translation_m]`.
    pub fn row_moved(&self, day: &Simulation, tick: usize, motion: &Vector6) -> Option<(f64, [Pixel; 4])> {
        let t_s = tick as f64 * day.every_s;
        let mut rng = SplitMix64::scattered(self.seed ^ mixed(tick as u64));
        let offset_s = match self.fate {
            Fate::Dead { at_s } if at_s <= t_s => return None,
            Fate::Clock { offset_s, from_s } if from_s <= t_s => offset_s,
            _ => 0.0,
        };
        if rng.uniform() < day.missed {
            return None;
        }
        let cam_from_target = Pose::exp(&-motion) * self.cam_from_target_at(t_s);
        let mut pixels = [Pixel::zeros(); 4];
        for (pixel, x) in pixels.iter_mut().zip(&self.points) {
            let [du, dv] = rng.normal_pair();
            *pixel = self.camera.project(&(cam_from_target * *x))? + Vector2::new(du, dv) * day.sigma_px;
        }
        Some((day.begin_s + t_s + offset_s, pixels))
    }
}

fn lens(rng: &mut SplitMix64) -> Camera {
    let f = rng.between(900.0, 1800.0);
    let matrix = CameraMatrix {
        fx_px: f,
        fy_px: f * rng.between(0.999, 1.001),
        cx_px: 959.5 + 20.0 * rng.normal(),
        cy_px: 539.5 + 20.0 * rng.normal(),
    };
    Camera { lens: Pinhole { matrix }.into(), size: Some(ImageSize { width_px: 1920, height_px: 1080 }) }
}

/// Returns a pose from which all points are well visible and only one pose fits, as an installer would choose it.
fn stand(camera: &Camera, points: &[Point; 4], sigma_px: f64, rng: &mut SplitMix64) -> Pose {
    let centre = points.iter().sum::<Point>() / 4.0;
    loop {
        let away = rng.between(4.0, 9.0);
        let turn = direction(rng) * rng.between(0.4, 1.0);
        let rotation = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation;
        let aim = Vector3::new(rng.between(-0.2, 0.2) * away, rng.between(-0.1, 0.1) * away, away);
        let cam_from_target = Pose::new(rotation, aim - rotation * centre);
        if is_well_seen(camera, points, &cam_from_target, sigma_px) {
            return cam_from_target;
        }
    }
}

fn is_well_seen(camera: &Camera, points: &[Point; 4], cam_from_target: &Pose, sigma_px: f64) -> bool {
    let one = |x: &Point| {
        let pixel = camera.project(&(*cam_from_target * *x))?;
        let is_inside = (60.0..1860.0).contains(&pixel.x) && (60.0..1020.0).contains(&pixel.y);
        is_inside.then(|| Correspondence::new(camera, *x, pixel, sigma_px).ok()).flatten()
    };
    let seen: Option<Vec<Correspondence>> = points.iter().map(one).collect();
    let found = seen.and_then(|seen| locate(&seen, camera, &Config::default()).ok());
    // The other minimum must be far off whatever the noise: Δχ² of 80 leaves no doubt in ten standard deviations.
    found.is_some_and(|found| {
        let is_unique = matches!(found.ambiguity, Ambiguity::Unique { .. });
        is_unique && found.probability > 1.0 - 1e-9 && found.covariance[(5, 5)] < 0.05 * 0.05
    })
}

fn fate(day: &Simulation, rng: &mut SplitMix64) -> Fate {
    let [step, drifting, wrong, dead, clock] = day.shares;
    let (draw, at_s) = (rng.uniform(), day.duration_s * rng.between(0.15, 0.85));
    let motion = motion(rng);
    let limits = [step, drifting, wrong, dead, clock].into_iter().scan(0.0, |sum, share| {
        *sum += share;
        Some(*sum)
    });
    match limits.take_while(|limit| *limit <= draw).count() {
        0 => Fate::Step { at_s, motion },
        1 => Fate::Drifting { at_s: day.duration_s * 0.1, motion: motion * 0.5 },
        2 => Fate::WrongMap,
        3 => Fate::Dead { at_s: if rng.below(3) == 0 { 0.0 } else { at_s * 0.9 } },
        4 => clock_fault(day, rng),
        _ => Fate::Steady,
    }
}

fn clock_fault(day: &Simulation, rng: &mut SplitMix64) -> Fate {
    match rng.below(3) {
        0 => Fate::Clock { offset_s: rng.between(0.1, 0.5) * day.duration_s, from_s: 0.0 },
        1 => Fate::Clock { offset_s: -1.7e9, from_s: 0.0 },
        _ => Fate::Clock { offset_s: -0.15 * day.duration_s, from_s: 0.5 * day.duration_s },
    }
}

/// Returns a motion of 0.01° to 1°, most of it a rotation about the camera's own centre, as of a loose bracket.
fn motion(rng: &mut SplitMix64) -> Vector6 {
    let angle = 10_f64.powf(rng.between(-2.0, 0.0)).to_radians();
    let (rotation, shift) = (direction(rng) * angle, direction(rng) * (angle * 0.05));
    Vector6::new(rotation.x, rotation.y, rotation.z, shift.x, shift.y, shift.z)
}

fn direction(rng: &mut SplitMix64) -> Vector3<f64> {
    loop {
        let v = Vector3::new(rng.normal(), rng.normal(), rng.normal());
        if let Some(unit) = v.try_normalize(1e-9) {
            return unit;
        }
    }
}
