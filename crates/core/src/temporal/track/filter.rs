//! One track: the error-state Kalman filter of a pose and, for a moving camera, its twist.

use super::{Candidate, Motion};
use crate::temporal::snapshot::numbers;
use crate::{Error, Matrix6, Pose, Vector6};

/// The process noise of a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Of the pose of a static camera, of the velocity of a moving one: variance per second.
    per_s: Vector6,
    is_moving: bool,
}

/// Standard deviation of the first velocity of a moving camera, in those of its change in a second.
const FIRST_VELOCITY: f64 = 10.0;

impl Noise {
    pub fn new(motion: &Motion) -> Result<Self, Error> {
        let (rotation, translation, is_moving) = match *motion {
            Motion::Static { rotation_rad_per_sqrt_s, translation_m_per_sqrt_s } => {
                (rotation_rad_per_sqrt_s, translation_m_per_sqrt_s, false)
            }
            Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s, translation_m_per_s_sqrt_s } => {
                (rotation_rad_per_s_sqrt_s, translation_m_per_s_sqrt_s, true)
            }
        };
        for (setting, seen) in
            [("rotation noise of the motion", rotation), ("translation noise of the motion", translation)]
        {
            if !(seen.is_finite() && 0.0 <= seen) {
                return Err(Error::InvalidSetting { setting, seen, needed: "it must not be negative" });
            }
        }
        let (r, t) = (rotation * rotation, translation * translation);
        Ok(Noise { per_s: Vector6::new(r, r, r, t, t, t), is_moving })
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Filter {
    pub cam_from_target: Pose,
    /// v.
    pub velocity: Vector6,
    /// P_ξξ.
    pose: Matrix6,
    /// P_ξv.
    cross: Matrix6,
    /// P_vv.
    twist: Matrix6,
}

impl Filter {
    pub fn begin(noise: &Noise, candidate: &Candidate) -> Self {
        let first = if noise.is_moving { FIRST_VELOCITY * FIRST_VELOCITY } else { 0.0 };
        Filter {
            cam_from_target: candidate.cam_from_target,
            velocity: Vector6::zeros(),
            pose: candidate.covariance,
            cross: Matrix6::zeros(),
            twist: Matrix6::from_diagonal(&(noise.per_s * first)),
        }
    }

    pub fn pose_covariance(&self) -> Matrix6 {
        self.pose
    }

    /// docs/math/track.md eqs. (2)–(3).
    pub fn predict(&mut self, noise: &Noise, elapsed_s: f64) {
        if !noise.is_moving {
            self.pose += Matrix6::from_diagonal(&(noise.per_s * elapsed_s));
            return;
        }
        let step = Pose::exp(&(self.velocity * elapsed_s));
        let carry = step.adjoint();
        let carried_cross = carry * self.cross + self.twist * elapsed_s;
        let with_cross = carry * self.cross * elapsed_s;
        self.pose = carry * self.pose * carry.transpose()
            + with_cross
            + with_cross.transpose()
            + self.twist * (elapsed_s * elapsed_s)
            + Matrix6::from_diagonal(&(noise.per_s * (elapsed_s.powi(3) / 3.0)));
        self.cross = carried_cross + Matrix6::from_diagonal(&(noise.per_s * (elapsed_s.powi(2) / 2.0)));
        self.twist += Matrix6::from_diagonal(&(noise.per_s * elapsed_s));
        self.cam_from_target = self.cam_from_target.moved(&(self.velocity * elapsed_s));
    }

    /// With a candidate taken in, its χ² and its density; none where a covariance is not positive definite.
    pub fn updated(&self, candidate: &Candidate) -> Option<(Self, f64, f64)> {
        let innovation = (candidate.cam_from_target * self.cam_from_target.inverse()).log();
        let factor = scaled(&(self.pose + candidate.covariance))?;
        let weighted = factor.inverse * innovation;
        let chi2 = innovation.dot(&weighted);
        let density = (-0.5 * chi2).exp() / ((2.0 * std::f64::consts::PI).powi(3) * factor.root_determinant);
        let (gain, twist_gain) = (self.pose * factor.inverse, self.cross.transpose() * factor.inverse);
        let after = Filter {
            cam_from_target: self.cam_from_target.moved(&(gain * innovation)),
            velocity: self.velocity + twist_gain * innovation,
            pose: symmetric(&(self.pose - gain * self.pose)),
            cross: self.cross - gain * self.cross,
            twist: symmetric(&(self.twist - twist_gain * self.cross)),
        };
        Some((after, chi2, density))
    }

    /// χ² of the difference of two tracks by their larger covariance.
    pub fn chi2_to(&self, other: &Filter) -> f64 {
        let difference = (other.cam_from_target * self.cam_from_target.inverse()).log();
        let larger = if self.pose.trace() < other.pose.trace() { &other.pose } else { &self.pose };
        scaled(larger).map_or(f64::INFINITY, |factor| difference.dot(&(factor.inverse * difference)))
    }
}

/// Inverse and root of the determinant of a covariance of radians and metres.
struct Factor {
    inverse: Matrix6,
    root_determinant: f64,
}

/// Scaled to unit variances first: rotations and translations differ by orders.
fn scaled(covariance: &Matrix6) -> Option<Factor> {
    let scale = covariance.diagonal().map(f64::sqrt);
    if !scale.iter().all(|s| s.is_finite() && 0.0 < *s) {
        return None;
    }
    let correlation = Matrix6::from_fn(|i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let factor = correlation.cholesky()?;
    let root_determinant = factor.l_dirty().diagonal().product() * scale.product();
    let inverse = factor.inverse();
    let inverse = Matrix6::from_fn(|i, j| inverse[(i, j)] / (scale[i] * scale[j]));
    Some(Factor { inverse, root_determinant })
}

fn symmetric(m: &Matrix6) -> Matrix6 {
    (m + m.transpose()) * 0.5
}

numbers!(Noise { per_s, is_moving });
numbers!(Filter { cam_from_target, velocity, pose, cross, twist });
