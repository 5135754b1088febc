//! Enhanced unified camera model. Kalibr: `eucm` with `none`; Basalt: `eucm`.
//!
//! Paper: B. Khomutenko, G. Garcia, P. Martinet, IEEE Robotics and Automation Letters, 2016.
//!   d = √(β (x² + y²) + z²)   ρ = α d + (1 − α) z   u = fx x/ρ + cx   v = fy y/ρ + cy
//! Valid field: ρ > 0, for α > 1/2 also α z + (1 − α) d > 0 (beyond it the image folds).
//! Kalibr's order is α, β, fu, fv, pu, pv; ours puts the matrix first. Derivations: docs/math/camera.md section 6.

use super::field::{SPHERE_RADIUS_CAP, depth_sum, distance_is_usable, outside, within};
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_alpha, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The camera matrix, α and β.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eucm {
    matrix: CameraMatrix,
    alpha: f64,
    beta: f64,
    radius_max: f64,
}

impl Eucm {
    /// The name in files and messages.
    pub const NAME: &'static str = "eucm";

    /// # Errors
    /// `InvalidCamera` for a value that is not finite, f ≤ 0, α outside 0..=1 or β ≤ 0.
    pub fn new(matrix: CameraMatrix, alpha: f64, beta: f64) -> Result<Self, Error> {
        matrix.check()?;
        check_alpha(alpha)?;
        check_finite("beta", beta)?;
        if beta <= 0.0 {
            let needed = "beta of the eucm model is positive";
            return Err(Error::InvalidCamera { parameter: "beta", seen: beta, needed });
        }
        let bend = (2.0 * alpha - 1.0) * beta;
        let radius_max =
            if 0.0 < bend { (1.0 / bend.sqrt()).min(SPHERE_RADIUS_CAP) } else { SPHERE_RADIUS_CAP };
        Ok(Eucm { matrix, alpha, beta, radius_max })
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns α: 0 is a pinhole.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Returns β.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// Returns (x, y)/ρ, d and ρ; `None` outside the field.
    #[inline]
    fn on_plane(&self, x: &Point) -> Option<(Vector2<f64>, f64, f64)> {
        let beta_r2 = self.beta * (x.x * x.x + x.y * x.y);
        let d2 = beta_r2 + x.z * x.z;
        if !distance_is_usable(d2) {
            return None;
        }
        let d = d2.sqrt();
        let rho = depth_sum(self.alpha, 1.0 - self.alpha, d, x.z, beta_r2);
        let m = Vector2::new(x.x / rho, x.y / rho);
        let before_fold = self.alpha <= 0.5 || 0.0 < self.alpha * x.z + (1.0 - self.alpha) * d;
        let inside = 0.0 < rho && before_fold && m.norm_squared() <= self.radius_max * self.radius_max;
        inside.then_some((m, d, rho))
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (m, _, _) = self.on_plane(x_in_cam)?;
        Some(self.matrix.pixel(&m))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (m, d, rho) = self.on_plane(x_in_cam)?;
        // ∂m/∂x = (e − m ∇ρᵀ)/ρ, ∇ρ = (αβ x/d, αβ y/d, α z/d + 1 − α).
        let a = self.alpha / d;
        let slope = Vector3::new(
            a * self.beta * x_in_cam.x,
            a * self.beta * x_in_cam.y,
            a * x_in_cam.z + (1.0 - self.alpha),
        );
        Some((self.matrix.pixel(&m), self.matrix.quotient_jacobian(&m, rho, &slope)))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let m = within(self.matrix.unpixel(pixel), self.radius_max)
            .ok_or_else(|| outside(pixel, Self::NAME, "radius (u - cx)/fx up to", self.radius_max))?;
        let (a, beta_r2) = (self.alpha, self.beta * m.norm_squared());
        let root = (1.0 - (2.0 * a - 1.0) * beta_r2).max(0.0).sqrt();
        let z = (1.0 - a * a * beta_r2) / (a * root + 1.0 - a);
        Ok(Unit::new_normalize(Vector3::new(m.x, m.y, z)))
    }

    /// Order: fx, fy, cx, cy, α, β.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (m, d, rho) = self.on_plane(x)?;
        let mut columns = self.matrix.columns(&m);
        let by_alpha = d - x.z;
        let by_beta = self.alpha * (x.x * x.x + x.y * x.y) / (2.0 * d);
        columns.extend([by_alpha, by_beta].map(|slope| self.matrix.stretch(&(m * (-slope / rho)))));
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.extend([("alpha", self.alpha), ("beta", self.beta)]);
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), values[4], values[5])
    }
}
