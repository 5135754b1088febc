//! One contact as evidence about the object: a position, the outward normal there, and the covariance of both.
//!
//!   β  direction of the outward normal, world, radians: θ + 90° where the object is to the right of the whisker (M₀ > 0),
//!      θ − 90° where it is to the left                                             docs/math/whisker_identify.md eq. (1)

use crate::Rod;
use crate::estimate::{ContactEstimate, Mode, Status};
use nalgebra::{Matrix2, Matrix3, Vector2};
use std::f64::consts::FRAC_PI_2;

/// A contact as a row of a contacts file gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Which sweep it belongs to.
    pub sweep: u32,
    /// The point of contact, world, metres.
    pub x_in_world: Vector2<f64>,
    /// Direction of the whisker there, world, radians.
    pub theta_rad: f64,
    /// Sign of the moment at the hub: 1 where the object is to the right of the whisker, −1 where it is to the left.
    pub side: f64,
    /// Between clamp and tip, where whisker and object share a tangent, or at the tip, where they need not.
    pub mode: Mode,
    /// Covariance of `[x, y, θ]`, m², m·rad, rad².
    pub covariance: Matrix3<f64>,
    /// The sample's verdict; only `Ok` is evidence.
    pub status: Status,
}

/// Standard deviation of θ where a file has none, radians: that of a contact at 0.6 of a steel whisker (1 mm, 0.25 m) bent by
/// 10° under a load cell of 1/320 N and 1/64 N·mm, rounded up.
pub const DEFAULT_THETA_SIGMA_RAD: f64 = 0.01;

impl Touch {
    /// From one sample's estimate and the moment at the hub, N·m; none where the sample has no contact. The object's surface is
    /// half the rod's diameter off the centre line.
    pub fn from_estimate(sweep: u32, mz_n_m: f64, estimate: &ContactEstimate, rod: &Rod) -> Option<Self> {
        let contact = estimate.contact.as_ref()?;
        let side = if mz_n_m < 0.0 { -1.0 } else { 1.0 };
        let [base, tip] = rod.diameters_m;
        let radius_m = 0.5 * (base + (tip - base) * (contact.s_m / rod.length_m).clamp(0.0, 1.0));
        Some(Touch {
            sweep,
            x_in_world: contact.x_in_world - radius_m * contact.normal_in_world(side),
            theta_rad: contact.theta_rad,
            side,
            mode: estimate.mode,
            covariance: contact.covariance,
            status: estimate.status,
        })
    }

    /// The covariance of `[x, y, θ]` where only that of `[x, y]`, m², is known: θ independent and as uncertain as
    /// [`DEFAULT_THETA_SIGMA_RAD`].
    pub fn covariance_without_theta(xy: &Matrix2<f64>) -> Matrix3<f64> {
        let mut covariance = Matrix3::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(xy);
        covariance[(2, 2)] = DEFAULT_THETA_SIGMA_RAD * DEFAULT_THETA_SIGMA_RAD;
        covariance
    }

    /// β, radians, eq. (1).
    pub fn normal_angle_rad(&self) -> f64 {
        self.theta_rad + FRAC_PI_2.copysign(self.side)
    }
}
