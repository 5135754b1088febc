//! Pinhole camera without distortion: u = fx x/z + cx, v = fy y/z + cy.
//!
//! Valid field: in front of the camera. Derivation: docs/math/camera.md section 1.

use super::field::{distance_is_usable, outside};
use super::{CameraMatrix, IntrinsicsJacobian, Parameters};
use crate::{Bearing, Error, Pixel, Point};
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Squared radius x²/z² up to which pixels are finite for any f; false for NaN too.
pub(crate) const R2_MAX: f64 = 1e30;

/// The camera matrix alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Focal lengths and principal point.
    pub matrix: CameraMatrix,
}

impl Pinhole {
    /// The name in files and messages.
    pub const NAME: &'static str = "pinhole";

    /// # Errors
    /// `InvalidCamera` for a value that is not finite or f ≤ 0.
    pub fn new(matrix: CameraMatrix) -> Result<Self, Error> {
        matrix.check()?;
        Ok(Pinhole { matrix })
    }

    /// Returns (x/z, y/z) and 1/z in front of the camera; points behind it would project too, mirrored.
    #[inline]
    fn normalized(x: &Point) -> Option<(Vector2<f64>, f64)> {
        let iz = 1.0 / x.z;
        let q = Vector2::new(x.x * iz, x.y * iz);
        let in_front = 0.0 < x.z && distance_is_usable(x.z * x.z) && q.norm_squared() < R2_MAX;
        in_front.then_some((q, iz))
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (q, _) = Self::normalized(x_in_cam)?;
        Some(self.matrix.pixel(&q))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (q, iz) = Self::normalized(x_in_cam)?;
        let (ax, ay) = (self.matrix.fx_px * iz, self.matrix.fy_px * iz);
        Some((self.matrix.pixel(&q), Matrix2x3::new(ax, 0.0, -ax * q.x, 0.0, ay, -ay * q.y)))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let q = self.matrix.unpixel(pixel);
        if !(q.norm_squared() < R2_MAX) {
            return Err(outside(pixel, Self::NAME, "radius x/z up to", R2_MAX.sqrt()));
        }
        Ok(Unit::new_normalize(Vector3::new(q.x, q.y, 1.0)))
    }

    /// Order: fx, fy, cx, cy.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (q, _) = Self::normalized(x)?;
        Some(self.matrix.columns(&q))
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        self.matrix.parameters()
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values))
    }
}
