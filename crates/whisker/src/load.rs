//! The hub's measurements: load and pose, with their noise.

use crate::PlanarPose;
use nalgebra::{Matrix3, Vector2, Vector3};

/// What the whisker exerts on the hub, which is what the object exerts on the whisker: hub axes, moment about the clamp point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HubLoad {
    /// Force along the clamped whisker, newtons.
    pub fx_n: f64,
    /// Force to its left, newtons.
    pub fy_n: f64,
    /// Moment about the clamp, counter-clockwise, newton metres.
    pub mz_n_m: f64,
}

impl HubLoad {
    /// `[fx, fy, mz]`, N, N, N·m.
    pub fn to_vector(self) -> Vector3<f64> {
        Vector3::new(self.fx_n, self.fy_n, self.mz_n_m)
    }

    /// From `[fx, fy, mz]`, N, N, N·m.
    pub fn from_vector(load: &Vector3<f64>) -> Self {
        HubLoad { fx_n: load.x, fy_n: load.y, mz_n_m: load.z }
    }

    /// The force, hub axes, newtons.
    pub fn force_n(&self) -> Vector2<f64> {
        Vector2::new(self.fx_n, self.fy_n)
    }

    /// Seen in the mirror of the clamped whisker: left and right exchanged.
    pub fn mirrored(self) -> Self {
        HubLoad { fx_n: self.fx_n, fy_n: -self.fy_n, mz_n_m: -self.mz_n_m }
    }

    /// On which side of the whisker the object is: 1 on its right (M₀ > 0), −1 on its left; without a moment the force decides.
    pub fn side(&self) -> f64 {
        let sign_of = if self.mz_n_m == 0.0 { self.fy_n } else { self.mz_n_m };
        if sign_of < 0.0 { -1.0 } else { 1.0 }
    }

    /// Whether every entry is a number.
    pub fn is_finite(&self) -> bool {
        self.to_vector().iter().all(|v| v.is_finite())
    }
}

/// One reading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Which sweep it belongs to.
    pub sweep: u32,
    /// Its number within the sweep.
    pub sample: u32,
    /// When, seconds; none where the file has no time.
    pub t_s: Option<f64>,
    /// Where the hub was.
    pub world_from_hub: PlanarPose,
    /// The reading of the load cell.
    pub load: HubLoad,
}

/// How exact the instruments are: standard deviations of Gaussian noise and the steps readings are rounded to (0: none).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cell {
    /// Noise of either force, newtons.
    pub force_sigma_n: f64,
    /// Noise of the torque, newton metres.
    pub torque_sigma_n_m: f64,
    /// Noise of the hub's angle, radians.
    pub hub_angle_sigma_rad: f64,
    /// Noise of either hub coordinate, metres.
    pub hub_xy_sigma_m: f64,
    /// Step of either force, newtons.
    pub force_step_n: f64,
    /// Step of the torque, newton metres.
    pub torque_step_n_m: f64,
    /// Step of the hub's angle, radians.
    pub hub_angle_step_rad: f64,
}

impl Cell {
    /// Covariance of `[fx, fy, mz]`: noise plus step²/12, N², N²·m².
    pub fn load_covariance(&self) -> Matrix3<f64> {
        let force = variance(self.force_sigma_n, self.force_step_n);
        Matrix3::from_diagonal(&Vector3::new(
            force,
            force,
            variance(self.torque_sigma_n_m, self.torque_step_n_m),
        ))
    }

    /// Covariance of the hub's `[x, y, angle]`, m², rad².
    pub fn hub_covariance(&self) -> Matrix3<f64> {
        let place = variance(self.hub_xy_sigma_m, 0.0);
        let angle = variance(self.hub_angle_sigma_rad, self.hub_angle_step_rad);
        Matrix3::from_diagonal(&Vector3::new(place, place, angle))
    }
}

/// A reading rounded to a step errs uniformly over it besides its noise.
fn variance(sigma: f64, step: f64) -> f64 {
    sigma * sigma + step * step / 12.0
}
