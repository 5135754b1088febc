//! The camera's motion between two frames, as the estimate needs it.

use super::ground::GroundPlane;
use super::{VehicleConfig, rotation_vector};
use crate::Error;
use crate::multiview::two_view::TwoView;
use nalgebra::{Matrix3, Matrix3x5, Rotation3, Vector3};

/// The motion of the camera between two frames.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameMotion {
    /// The middle between both frames, seconds.
    pub t_s: f64,
    /// Time between them, seconds.
    pub duration_s: f64,
    /// Direction of the motion; `None` where the frames show no parallax.
    pub direction: Option<TravelDirection>,
    /// Rotation vector of the camera from the first frame to the second, about its own axes, radians; zero where it is not known.
    pub rotation_rad: Vector3<f64>,
    /// Speed, negative in reverse, m/s; `None` where it is not known.
    pub speed_m_s: Option<f64>,
    /// The ground below; `None` where it was not seen.
    pub ground: Option<GroundPlane>,
    /// s² of `two_view`: variances of the points over those stated.
    pub noise_factor: f64,
}

/// A direction with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TravelDirection {
    /// Unit vector in the camera frame half-way between both frames.
    pub in_cam: Vector3<f64>,
    /// Its covariance, rad²; zero along itself.
    pub covariance: Matrix3<f64>,
}

impl FrameMotion {
    /// Converts a relative pose of two frames: docs/math/vehicle.md eqs. (3) and (4).
    pub fn new(t_s: f64, duration_s: f64, view: &TwoView) -> Self {
        let r = &view.second_from_first.rotation;
        let second_by_first = rotation_vector(r);
        let middle_from_second = Rotation3::new(-0.5 * second_by_first).into_inner();
        let in_cam = -(middle_from_second * view.second_from_first.translation);
        // A small left rotation ω of R turns the middle by half of it the other way.
        let mut by_step = Matrix3x5::zeros();
        by_step.fixed_columns_mut::<3>(0).copy_from(&(0.5 * in_cam.cross_matrix() * middle_from_second));
        by_step.fixed_columns_mut::<2>(3).copy_from(&-(middle_from_second * view.across));
        let covariance = by_step * view.covariance * by_step.transpose();
        FrameMotion {
            t_s,
            duration_s,
            direction: Some(TravelDirection { in_cam, covariance }),
            rotation_rad: -second_by_first,
            speed_m_s: None,
            ground: None,
            noise_factor: view.noise_factor,
        }
    }

    /// A pair of frames without parallax.
    pub fn without_direction(t_s: f64, duration_s: f64) -> Self {
        FrameMotion {
            t_s,
            duration_s,
            direction: None,
            rotation_rad: Vector3::zeros(),
            speed_m_s: None,
            ground: None,
            noise_factor: 1.0,
        }
    }
}

/// Times must not fall, numbers must be finite.
pub(super) fn check(motions: &[FrameMotion], config: &VehicleConfig) -> Result<(), Error> {
    let seen = config.speed_relative_sigma;
    if !(0.0 <= seen && seen.is_finite()) {
        let needed = "it must be zero or positive";
        return Err(Error::InvalidSetting { setting: "speed_relative_sigma", seen, needed });
    }
    for (index, motion) in motions.iter().enumerate() {
        let direction = motion.direction.map_or(0.0, |d| d.in_cam.sum() + d.covariance.sum());
        let numbers =
            motion.t_s + motion.duration_s + motion.rotation_rad.sum() + direction + motion.noise_factor;
        if !(numbers + motion.speed_m_s.unwrap_or(0.0)).is_finite() {
            return Err(Error::NotFinite { what: "a number of a motion", index });
        }
        if !(0.0 < motion.duration_s) {
            let (setting, needed) = ("duration_s", "the second frame must be later than the first");
            return Err(Error::InvalidSetting { setting, seen: motion.duration_s, needed });
        }
    }
    match motions.windows(2).find(|pair| pair[1].t_s < pair[0].t_s) {
        Some(pair) => Err(Error::InvalidSetting {
            setting: "t_s",
            seen: pair[1].t_s,
            needed: "motions must be in order of time",
        }),
        None => Ok(()),
    }
}
