//! Double sphere camera. Kalibr: `ds` with `none`; Basalt: `ds`.
//!
//! Paper: V. Usenko, N. Demmel, D. Cremers, The Double Sphere Camera Model, 3DV 2018.
//!   d = |x|   ζ = z + ξ d   D = √(x² + y² + ζ²)   ρ = α D + (1 − α) ζ   u = fx x/ρ + cx   v = fy y/ρ + cy
//! Valid field: ρ > 0, for α > 1/2 also α ζ + (1 − α) D > 0 (the second sphere's fold), for ξ > 1 also d + ξ z > 0 (the first's).
//! Kalibr's order is ξ, α, fu, fv, pu, pv; ours puts the matrix first. Derivations: docs/math/camera.md section 6.

use super::field::{SPHERE_RADIUS_CAP, depth_sum, distance_is_usable, outside, within};
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_alpha, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The camera matrix, ξ and α.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleSphere {
    matrix: CameraMatrix,
    xi: f64,
    alpha: f64,
    radius_max: f64,
}

/// Intermediate results of a projection.
struct Sphered {
    m: Vector2<f64>,
    d: f64,
    zeta: f64,
    big_d: f64,
    rho: f64,
}

impl DoubleSphere {
    /// The name in files and messages.
    pub const NAME: &'static str = "double_sphere";

    /// # Errors
    /// `InvalidCamera` for a value that is not finite, f ≤ 0, ξ ≤ −1 or α outside 0..=1.
    pub fn new(matrix: CameraMatrix, xi: f64, alpha: f64) -> Result<Self, Error> {
        matrix.check()?;
        check_finite("xi", xi)?;
        if xi <= -1.0 {
            let needed = "xi of the double_sphere model is above -1";
            return Err(Error::InvalidCamera { parameter: "xi", seen: xi, needed });
        }
        check_alpha(alpha)?;
        Ok(DoubleSphere { matrix, xi, alpha, radius_max: radius_max(xi, alpha) })
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns ξ, the distance of the spheres.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// Returns α: 0 is the unified model.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    #[inline]
    fn on_plane(&self, x: &Point) -> Option<Sphered> {
        let r2 = x.x * x.x + x.y * x.y;
        let d2 = r2 + x.z * x.z;
        if !distance_is_usable(d2) {
            return None;
        }
        let d = d2.sqrt();
        let zeta = depth_sum(self.xi, 1.0, d, x.z, r2);
        let big_d = (r2 + zeta * zeta).sqrt();
        let rho = depth_sum(self.alpha, 1.0 - self.alpha, big_d, zeta, r2);
        let m = Vector2::new(x.x / rho, x.y / rho);
        let before_first = 0.0 < d + self.xi * x.z;
        let before_second = self.alpha <= 0.5 || 0.0 < self.alpha * zeta + (1.0 - self.alpha) * big_d;
        let in_disc = m.norm_squared() <= self.radius_max * self.radius_max;
        (0.0 < rho && before_first && before_second && in_disc).then_some(Sphered { m, d, zeta, big_d, rho })
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        Some(self.matrix.pixel(&self.on_plane(x_in_cam)?.m))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let Sphered { m, d, zeta, big_d, rho } = self.on_plane(x_in_cam)?;
        // ∇ζ = (ξ x/d, ξ y/d, 1 + ξ z/d), ∇ρ = α (x, y, 0)/D + (α ζ/D + 1 − α) ∇ζ.
        let a = self.alpha / big_d;
        let by_zeta = a * zeta + (1.0 - self.alpha);
        let across = a + by_zeta * self.xi / d;
        let slope = Vector3::new(
            across * x_in_cam.x,
            across * x_in_cam.y,
            by_zeta * (1.0 + self.xi * x_in_cam.z / d),
        );
        Some((self.matrix.pixel(&m), self.matrix.quotient_jacobian(&m, rho, &slope)))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let m = within(self.matrix.unpixel(pixel), self.radius_max)
            .ok_or_else(|| outside(pixel, Self::NAME, "radius (u - cx)/fx up to", self.radius_max))?;
        let (a, xi, r2) = (self.alpha, self.xi, m.norm_squared());
        let root = (1.0 - (2.0 * a - 1.0) * r2).max(0.0).sqrt();
        let mz = (1.0 - a * a * r2) / (a * root + 1.0 - a);
        let lift = (mz * xi + (mz * mz + (1.0 - xi * xi) * r2).max(0.0).sqrt()) / (mz * mz + r2);
        Ok(Unit::new_normalize(Vector3::new(lift * m.x, lift * m.y, lift * mz - xi)))
    }

    /// Order: fx, fy, cx, cy, ξ, α.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let Sphered { m, d, zeta, big_d, rho } = self.on_plane(x)?;
        let mut columns = self.matrix.columns(&m);
        let by_xi = (self.alpha * zeta / big_d + 1.0 - self.alpha) * d;
        let by_alpha = big_d - zeta;
        columns.extend([by_xi, by_alpha].map(|slope| self.matrix.stretch(&(m * (-slope / rho)))));
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.extend([("xi", self.xi), ("alpha", self.alpha)]);
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), values[4], values[5])
    }
}

/// Returns the radius on the image plane at which one of the two spheres folds, or the cap.
fn radius_max(xi: f64, alpha: f64) -> f64 {
    let bend = 2.0 * alpha - 1.0;
    let second = if 0.0 < bend { 1.0 / bend.sqrt() } else { SPHERE_RADIUS_CAP };
    let first = if 1.0 < xi {
        // The first sphere's outline, cos θ = −1/ξ: x² + y² = ξ² − 1, ζ = ξ² − 1, D = ξ √(ξ² − 1) in units of d/ξ.
        let s = (xi * xi - 1.0).sqrt();
        1.0 / (alpha * xi + (1.0 - alpha) * s)
    } else {
        SPHERE_RADIUS_CAP
    };
    second.min(first).min(SPHERE_RADIUS_CAP)
}
