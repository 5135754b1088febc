//! The rotation of a camera against the vehicle that carries it, from the camera's own motion while the vehicle drives.
//!
//! pairs of frames → `two_view` → [`FrameMotion`] → which stretches are straight → direction of travel (yaw, pitch) · curves and the ground → roll ·
//! speed and ground → height · other lenses → what the intrinsics add · and the direction of travel over time → the change detector. Derivation: docs/math/vehicle.md.
//!
//! The vehicle frame is that of ISO 8855: x forward, along the mean direction of travel; y left; z up, the axis of its curves.
//!
//! ```text
//!   d  direction of travel, camera frame   ·   ψ, θ, φ  yaw, pitch, roll of the camera: ψ positive to the left, θ down, φ to the right side
//!   d = (sin ψ cos θ, −sin θ, cos ψ cos θ)   ·   u₀ = (−sin ψ sin θ, −cos θ, −cos ψ sin θ)   ·   l₀ = u₀ × d   ·   up = cos φ u₀ + sin φ l₀
//! ```

mod ground;
mod motion;
mod stretches;
mod blocks;
mod travel;
mod height;
mod roll;
mod lens;
mod alarm;

pub use alarm::{VehicleAlarm, VehicleAlarmConfig, vehicle_alarm};
pub use ground::{GroundPlane, ground_plane};
pub use height::Height;
pub use lens::LensVariation;
pub use motion::{FrameMotion, TravelDirection};
pub use roll::{Roll, RollSource};
pub use travel::{Halves, Travel};

use crate::{Error, Pose};
use nalgebra::{Matrix3, Vector3};
use stretches::Stretches;

/// What is stated about the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleConfig {
    /// Standard deviation of the scale of the speeds, as a share of them.
    pub speed_relative_sigma: f64,
}

impl Default for VehicleConfig {
    fn default() -> Self {
        VehicleConfig { speed_relative_sigma: 0.02 }
    }
}

/// Why a number is not determined.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Undetermined {
    /// The camera hardly moves: most pairs of frames show no parallax.
    Standing {
        /// Seconds of motion.
        moving_s: f64,
        /// Seconds needed.
        needed_s: f64,
    },
    /// The vehicle moves, but hardly ever straight ahead.
    TooLittleStraight {
        /// Seconds of straight motion.
        straight_s: f64,
        /// Seconds needed.
        needed_s: f64,
    },
    /// Both directions of travel occur, and no signed speed tells which one is forward.
    ForwardSign {
        /// Share of the pairs that move in the less frequent direction.
        share: f64,
    },
    /// Neither curves nor the ground were seen.
    NoCurve {
        /// The largest change of heading in one curve, radians.
        heading_rad: f64,
        /// The least needed.
        needed_rad: f64,
    },
    /// No ground was seen below the camera.
    NoGround,
    /// No speed was given.
    NoSpeed,
    /// The direction of travel, on which it is based, is not determined.
    NoDirection,
    /// The standard deviation is larger than is of use.
    Uncertain {
        /// The standard deviation, radians.
        sigma_rad: f64,
        /// The largest accepted.
        most_rad: f64,
    },
    /// The intrinsics are too uncertain.
    LensUncertain {
        /// The standard deviation and the largest accepted, radians; `None` where the drive determines nothing through a lens within the uncertainty.
        sigma_rad: Option<(f64, f64)>,
    },
    /// The camera lies on its side or upside down as far as the curves tell, and left and right cannot be distinguished.
    NotUpright {
        /// The angle, radians.
        roll_rad: f64,
        /// The largest accepted.
        most_rad: f64,
    },
}

/// What contradicts the estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Contradiction {
    /// The first and the second half of the drive give other directions.
    Halves(Halves),
    /// The residuals of the points are several times larger than stated: another lens, or a rolling shutter.
    Residuals {
        /// Median ratio of standard deviations.
        ratio: f64,
        /// The largest accepted.
        most: f64,
    },
    /// The stated speeds are not those of these frames: the vehicle drives where the frames show no motion, or stands where they do.
    Speeds {
        /// Pairs of frames of which this is so.
        n: usize,
        /// Pairs of frames with a speed.
        of: usize,
    },
    /// Curves and ground give other rolls.
    RollSources {
        /// Roll by the curves less roll by the ground, radians.
        difference_rad: f64,
        /// Its standard deviation.
        sigma_rad: f64,
    },
}

/// A camera on a vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleEstimate {
    /// Yaw and pitch.
    pub travel: Result<Travel, Undetermined>,
    /// Roll.
    pub roll: Result<Roll, Undetermined>,
    /// Height above the ground.
    pub height: Result<Height, Undetermined>,
    /// What contradicts it; nothing of an answer that may be relied on.
    pub contradictions: Vec<Contradiction>,
    /// Seconds of motion, of straight motion, and of curves.
    pub moving_s: f64,
    /// Of straight motion.
    pub straight_s: f64,
    /// Of curves.
    pub curve_s: f64,
}

impl VehicleEstimate {
    /// Returns the rotation x_cam = cam_from_vehicle · x_vehicle; `None` unless yaw, pitch and roll are determined.
    pub fn cam_from_vehicle_rotation(&self) -> Option<Matrix3<f64>> {
        let (travel, roll) = (self.travel.as_ref().ok()?, self.roll.as_ref().ok()?);
        let axes = VehicleAxes::new(&travel.in_cam);
        let up = axes.up * roll.roll_rad.cos() + axes.left * roll.roll_rad.sin();
        Some(Matrix3::from_columns(&[axes.forward, up.cross(&axes.forward), up]))
    }
}

/// Axes of a vehicle whose camera has no roll, camera frame: eqs. (1) and (2).
#[derive(Debug, Clone, Copy)]
pub(crate) struct VehicleAxes {
    pub forward: Vector3<f64>,
    pub left: Vector3<f64>,
    pub up: Vector3<f64>,
    pub yaw_rad: f64,
    pub pitch_rad: f64,
}

impl VehicleAxes {
    pub fn new(forward: &Vector3<f64>) -> Self {
        let (yaw_rad, pitch_rad) =
            (forward.x.atan2(forward.z), -(forward.y / forward.norm()).clamp(-1.0, 1.0).asin());
        let ((sin_yaw, cos_yaw), (sin, cos)) = (yaw_rad.sin_cos(), pitch_rad.sin_cos());
        let forward = Vector3::new(sin_yaw * cos, -sin, cos_yaw * cos);
        let up = Vector3::new(-sin_yaw * sin, -cos, -cos_yaw * sin);
        VehicleAxes { forward, left: up.cross(&forward), up, yaw_rad, pitch_rad }
    }
}

/// Accurate for small angles, and a number for the identity with rounding.
fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    Pose::new(*r, Vector3::zeros()).log().fixed_rows::<3>(0).into()
}

/// Residuals larger than this many stated standard deviations, in the median pair, are no noise of corners.
const MOST_NOISE_RATIO: f64 = 4.0;

/// From this speed on a camera sees a motion, and below that one none, m/s.
const MOVING_M_S: f64 = 3.0;
const STANDING_M_S: f64 = 0.05;
/// Pairs that contradict their speed, at least, and their share of those with a speed.
const LEAST_CONTRADICTED: usize = 5;
const MOST_CONTRADICTED: f64 = 0.2;

/// Estimates the camera's rotation against the vehicle, and its height, from motions in order of time. `variations` are the same drive through other
/// lenses, of which the intrinsics' part of each covariance follows; without any the intrinsics are exact.
///
/// # Errors
/// `InvalidSetting`, `NotFinite` for numbers that cannot be. What the motions do not determine is named in the estimate.
pub fn vehicle(
    motions: &[FrameMotion],
    variations: &[LensVariation],
    config: &VehicleConfig,
) -> Result<VehicleEstimate, Error> {
    let mut estimate = estimated(motions, config)?;
    let lens_variance = lens::add(&mut estimate, variations, config)?;
    let conflict = estimate.roll.as_ref().ok().and_then(|found| roll::conflict(found, lens_variance));
    estimate.contradictions.extend(conflict);
    Ok(estimate)
}

/// With exact intrinsics, and both sources of the roll not compared.
fn estimated(motions: &[FrameMotion], config: &VehicleConfig) -> Result<VehicleEstimate, Error> {
    motion::check(motions, config)?;
    let stretches = Stretches::new(motions);
    let mut contradictions = Vec::new();
    let travel = travel::travel(&stretches);
    contradictions
        .extend(travel.as_ref().ok().and_then(|travel| travel.contradiction).map(Contradiction::Halves));
    contradictions.extend(residuals(motions));
    contradictions.extend(speeds(motions));
    let roll = match &travel {
        Ok(travel) => roll::roll(&stretches, travel),
        Err(_) => Err(Undetermined::NoDirection),
    };
    let height = height::height(&stretches, config);
    let [moving_s, straight_s, curve_s] = [stretches.moving_s, stretches.straight_s(), stretches.curve_s()];
    Ok(VehicleEstimate { travel, roll, height, contradictions, moving_s, straight_s, curve_s })
}

fn speeds(motions: &[FrameMotion]) -> Option<Contradiction> {
    let stated = motions.iter().filter_map(|m| Some((m.direction.is_some(), m.speed_m_s?.abs())));
    let (mut n, mut of) = (0, 0);
    for (moves, speed_m_s) in stated {
        of += 1;
        n += usize::from(if moves { speed_m_s < STANDING_M_S } else { MOVING_M_S < speed_m_s });
    }
    (LEAST_CONTRADICTED <= n && MOST_CONTRADICTED * of as f64 <= n as f64)
        .then_some(Contradiction::Speeds { n, of })
}

fn residuals(motions: &[FrameMotion]) -> Option<Contradiction> {
    let mut factors: Vec<f64> =
        motions.iter().filter(|m| m.direction.is_some()).map(|m| m.noise_factor).collect();
    factors.sort_by(f64::total_cmp);
    let ratio = factors.get(factors.len() / 2)?.sqrt();
    (MOST_NOISE_RATIO < ratio).then_some(Contradiction::Residuals { ratio, most: MOST_NOISE_RATIO })
}
