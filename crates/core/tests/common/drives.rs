//! Made-up drives: a body that pitches, heaves and leans on its suspension, a camera mounted on it, the streets around.

use super::Rng;
use nalgebra::{Matrix3, Matrix3x2, Matrix5, Rotation3, Vector3};
use resight_core::multiview::two_view::TwoView;
use resight_core::temporal::vehicle::FrameMotion;
use resight_core::{Point, Pose};

/// A stretch: seconds, metres a second, radians a second to the left.
pub type Stretch = (f64, f64, f64);

/// How a camera is mounted: yaw to the left, pitch down, roll to the right side, radians; metres ahead, to the left and up of the rear axle.
#[derive(Debug, Clone, Copy)]
pub struct Mounting {
    pub yaw_rad: f64,
    pub pitch_rad: f64,
    pub roll_rad: f64,
    pub lever_m: [f64; 3],
}

impl Mounting {
    pub fn new(yaw_deg: f64, pitch_deg: f64, roll_deg: f64) -> Self {
        let [yaw_rad, pitch_rad, roll_rad] = [yaw_deg, pitch_deg, roll_deg].map(f64::to_radians);
        Mounting { yaw_rad, pitch_rad, roll_rad, lever_m: [1.5, 0.2, 1.0] }
    }

    /// docs/math/vehicle.md eqs. (1) and (2).
    pub fn cam_from_vehicle(&self) -> Matrix3<f64> {
        let ((sy, cy), (sp, cp)) = (self.yaw_rad.sin_cos(), self.pitch_rad.sin_cos());
        let forward = Vector3::new(sy * cp, -sp, cy * cp);
        let level = Vector3::new(-sy * sp, -cp, -cy * sp);
        let up = level * self.roll_rad.cos() + level.cross(&forward) * self.roll_rad.sin();
        Matrix3::from_columns(&[forward, up.cross(&forward), up])
    }
}

/// How the body moves on its suspension.
#[derive(Debug, Clone, Copy)]
pub struct Body {
    /// Root mean square of the oscillation of pitch and roll, radians.
    pub oscillation_rad: f64,
    /// … of slow changes of pitch, as by acceleration, which are correlated over `slow_s`.
    pub slow_rad: f64,
    pub slow_s: f64,
    /// Lean outwards for each m/s² across, radians; each curve besides has a bank of its own.
    pub lean_rad: f64,
    pub bank_rad: f64,
}

impl Body {
    pub const USUAL: Body =
        Body { oscillation_rad: 0.004, slow_rad: 0.0015, slow_s: 4.0, lean_rad: 0.006, bank_rad: 0.0175 };
}

/// Poses of the camera in time.
pub struct Drive {
    pub t_s: Vec<f64>,
    pub world_from_cam: Vec<Pose>,
    pub speed_m_s: Vec<f64>,
}

/// Steps of the simulation, seconds.
const STEP_S: f64 = 0.01;
/// Natural frequency of the suspension, Hz, and its damping.
const BODY_HZ: f64 = 1.3;
const DAMPING: f64 = 0.25;

/// A damped oscillator driven by white noise, scaled to unit root mean square.
struct Oscillator {
    x: f64,
    v: f64,
}

impl Oscillator {
    fn step(&mut self, rng: &mut Rng) -> f64 {
        let w = std::f64::consts::TAU * BODY_HZ;
        // Stationary variance of x is q/(4 ζ ω³).
        let q = 4.0 * DAMPING * w.powi(3);
        self.v +=
            (-2.0 * DAMPING * w * self.v - w * w * self.x) * STEP_S + (q * STEP_S).sqrt() * rng.normal();
        self.x += self.v * STEP_S;
        self.x
    }
}

/// Drives along stretches; frames every `frame_s`. `mounting` gives the mounting at a time.
pub fn drive(
    rng: &mut Rng,
    stretches: &[Stretch],
    frame_s: f64,
    body: &Body,
    mounting: impl Fn(f64) -> Mounting,
) -> Drive {
    let mut drive = Drive { t_s: Vec::new(), world_from_cam: Vec::new(), speed_m_s: Vec::new() };
    let mut swing = [0; 3].map(|_| Oscillator { x: rng.normal(), v: 0.0 });
    let (mut t_s, mut heading, mut at, mut slow, mut wander) =
        (0.0, 0.0f64, Vector3::zeros(), rng.normal(), 0.0);
    let (mut rate, mut lean, mut next_s) = (0.0, 0.0, 0.0);
    for (duration_s, speed, wanted) in stretches {
        let bank = if *wanted == 0.0 { 0.0 } else { body.bank_rad * rng.normal() };
        for _ in 0..(duration_s / STEP_S).round() as usize {
            let [pitch, roll, heave] = [0, 1, 2].map(|i| swing[i].step(rng));
            let share = STEP_S / body.slow_s;
            slow += -share * slow + (2.0 * share).sqrt() * rng.normal();
            // Steering takes half a second; on a straight the driver wanders within the lane.
            wander += -wander * STEP_S / 2.0 + 0.004 * STEP_S.sqrt() * rng.normal();
            rate += (wanted - rate) * STEP_S / 0.5;
            let across = (rate + wander) * speed;
            lean += (body.lean_rad * across + bank - lean) * STEP_S / 0.5;
            heading += (rate + wander) * STEP_S * if *speed == 0.0 { 0.0 } else { 1.0 };
            at += Vector3::new(heading.cos(), heading.sin(), 0.0) * (speed * STEP_S);
            t_s += STEP_S;
            if t_s < next_s {
                continue;
            }
            next_s = t_s + frame_s - 0.5 * STEP_S;
            let is_moving = f64::from(u8::from(*speed != 0.0));
            let pitch = (body.oscillation_rad * pitch + body.slow_rad * slow) * is_moving;
            let roll = (body.oscillation_rad * roll * is_moving) + lean * is_moving;
            let attitude = Rotation3::from_axis_angle(&Vector3::z_axis(), heading)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
            let mounted = mounting(t_s);
            let lift = Vector3::z() * (0.3 + 0.01 * heave * is_moving);
            let centre = at + lift + attitude * Vector3::from(mounted.lever_m);
            let rotation = attitude.matrix() * mounted.cam_from_vehicle().transpose();
            drive.t_s.push(t_s);
            drive.world_from_cam.push(Pose::new(rotation, centre));
            drive.speed_m_s.push(*speed);
        }
    }
    drive
}

/// Motions between frames as `two_view` would measure them, with this noise of directions and rotations.
pub fn motions(
    rng: &mut Rng,
    drive: &Drive,
    sigma_direction_rad: f64,
    sigma_rotation_rad: f64,
) -> Vec<FrameMotion> {
    let motion = |i: usize| {
        let (t_s, duration_s) = (0.5 * (drive.t_s[i] + drive.t_s[i + 1]), drive.t_s[i + 1] - drive.t_s[i]);
        let second_from_first = drive.world_from_cam[i + 1].inverse() * drive.world_from_cam[i];
        if second_from_first.translation.norm() < 0.02 {
            return FrameMotion::without_direction(t_s, duration_s);
        }
        let t = second_from_first.translation.normalize();
        let first = t.cross(&Vector3::ith(t.iamin(), 1.0)).normalize();
        let across = Matrix3x2::from_columns(&[first, t.cross(&first)]);
        let t = (t
            + first * (sigma_direction_rad * rng.normal())
            + t.cross(&first) * (sigma_direction_rad * rng.normal()))
        .normalize();
        let turn = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * sigma_rotation_rad;
        let rotation = Rotation3::new(turn).matrix() * second_from_first.rotation;
        let (d, r) = (sigma_direction_rad.powi(2), sigma_rotation_rad.powi(2));
        let view = TwoView {
            second_from_first: Pose::new(rotation, t),
            covariance: Matrix5::from_diagonal(&nalgebra::Vector5::new(r, r, r, d, d)),
            across,
            used: Vec::new(),
            noise_factor: 1.0,
            second_solution: None,
        };
        FrameMotion::new(t_s, duration_s, &view)
    };
    (0..drive.t_s.len().saturating_sub(1)).map(motion).collect()
}

/// Points of a street: the ground, and facades at both sides, along the way of a drive.
pub fn street(rng: &mut Rng, drive: &Drive, n: usize) -> Vec<Point> {
    (0..n)
        .map(|_| {
            let place = drive.world_from_cam[rng.index(drive.world_from_cam.len())];
            let side = if rng.uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
            let ahead = rng.uniform(0.0, 40.0);
            let (across, height) = match rng.index(3) {
                0 => (rng.uniform(-7.0, 7.0), 0.0),
                _ => (side * rng.uniform(8.0, 10.0), rng.uniform(0.5, 9.0)),
            };
            // Along the camera's own axis, level.
            let forward = place.rotation * Vector3::z();
            let forward = Vector3::new(forward.x, forward.y, 0.0).normalize();
            let left = Vector3::z().cross(&forward);
            let at = place.translation + forward * ahead + left * across;
            Vector3::new(at.x, at.y, height)
        })
        .collect()
}
