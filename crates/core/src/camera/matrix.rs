//! The camera matrix, focal lengths and principal point, which all models except the photogrammetric one have.

use super::{IntrinsicsJacobian, Parameters};
use crate::{Error, Pixel, Point};
use nalgebra::{Matrix2x3, Vector2, Vector3};

/// Focal lengths and principal point, pixels; pixel (0, 0) is the centre of the top-left pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraMatrix {
    /// Focal length along u.
    pub fx_px: f64,
    /// Focal length along v.
    pub fy_px: f64,
    /// Column of the principal point.
    pub cx_px: f64,
    /// Row of the principal point.
    pub cy_px: f64,
}

impl CameraMatrix {
    /// Checks for finite values and f > 0. (Normalised cameras have f = 1 and principal point 0, so there is no other bound without an image
    /// size.)
    pub(super) fn check(&self) -> Result<(), Error> {
        for (name, value) in self.parameters() {
            check_finite(name, value)?;
        }
        for (parameter, seen) in [("fx_px", self.fx_px), ("fy_px", self.fy_px)] {
            if seen <= 0.0 {
                return Err(Error::InvalidCamera { parameter, seen, needed: "a focal length is positive" });
            }
        }
        Ok(())
    }

    /// Converts plane coordinates to pixels.
    #[inline]
    pub(super) fn pixel(&self, q: &Vector2<f64>) -> Pixel {
        Vector2::new(self.fx_px * q.x + self.cx_px, self.fy_px * q.y + self.cy_px)
    }

    /// Converts pixels to plane coordinates.
    #[inline]
    pub(super) fn unpixel(&self, pixel: &Pixel) -> Vector2<f64> {
        Vector2::new((pixel.x - self.cx_px) / self.fx_px, (pixel.y - self.cy_px) / self.fy_px)
    }

    /// Converts a difference on the plane to pixels.
    #[inline]
    pub(super) fn stretch(&self, q: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx_px * q.x, self.fy_px * q.y)
    }

    /// Converts a derivative of plane coordinates to one of pixels.
    #[inline]
    pub(super) fn stretch_rows(&self, j: Matrix2x3<f64>) -> Matrix2x3<f64> {
        let (fx, fy) = (self.fx_px, self.fy_px);
        Matrix2x3::new(fx * j.m11, fx * j.m12, fx * j.m13, fy * j.m21, fy * j.m22, fy * j.m23)
    }

    /// Returns the derivative of the pixel of m = (x, y)/ρ with respect to the point, given ρ and ∇ρ: ∂m/∂x = (e − m ∇ρᵀ)/ρ.
    #[inline]
    pub(super) fn quotient_jacobian(
        &self,
        m: &Vector2<f64>,
        rho: f64,
        slope: &Vector3<f64>,
    ) -> Matrix2x3<f64> {
        let (sx, sy) = (self.fx_px / rho, self.fy_px / rho);
        Matrix2x3::new(
            sx * (1.0 - m.x * slope.x),
            -sx * m.x * slope.y,
            -sx * m.x * slope.z,
            -sy * m.y * slope.x,
            sy * (1.0 - m.y * slope.y),
            -sy * m.y * slope.z,
        )
    }

    /// Returns the derivative of the pixel of δ n with respect to the point, where n is the unit vector of (x, y): `across` I + `excess` n nᵀ
    /// for (x, y), and −`along` (x, y) for z.
    #[inline]
    pub(super) fn radial_jacobian(
        &self,
        n: &Vector2<f64>,
        across: f64,
        excess: f64,
        along: f64,
        x_in_cam: &Point,
    ) -> Matrix2x3<f64> {
        let (fx, fy) = (self.fx_px, self.fy_px);
        let mixed = excess * n.x * n.y;
        Matrix2x3::new(
            fx * (across + excess * n.x * n.x),
            fx * mixed,
            -fx * along * x_in_cam.x,
            fy * mixed,
            fy * (across + excess * n.y * n.y),
            -fy * along * x_in_cam.y,
        )
    }

    /// Returns the larger focal length, which converts pixel tolerances to ones on the plane.
    pub(super) fn longest(&self) -> f64 {
        self.fx_px.max(self.fy_px)
    }

    /// Returns the derivatives of the pixel with respect to fx, fy, cx, cy, given the distorted plane coordinates.
    pub(super) fn columns(&self, q: &Vector2<f64>) -> IntrinsicsJacobian {
        [Vector2::new(q.x, 0.0), Vector2::new(0.0, q.y), Vector2::x(), Vector2::y()].into_iter().collect()
    }

    /// Names and values, the first four of every model.
    pub(super) fn parameters(&self) -> Parameters {
        [("fx_px", self.fx_px), ("fy_px", self.fy_px), ("cx_px", self.cx_px), ("cy_px", self.cy_px)]
            .into_iter()
            .collect()
    }

    /// Creates a matrix from the first four values of a model.
    pub(super) fn from_values(values: &[f64]) -> Self {
        CameraMatrix { fx_px: values[0], fy_px: values[1], cx_px: values[2], cy_px: values[3] }
    }
}

/// Returns `InvalidCamera` for NaN and infinity.
pub(super) fn check_finite(parameter: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() {
        return Ok(());
    }
    Err(Error::InvalidCamera { parameter, seen, needed: "it must be a finite number" })
}

/// Refuses coefficients whose model folds at the axis: they are in the wrong order, or belong to pixels.
pub(super) fn check_field(seen: f64) -> Result<(), Error> {
    if 1e-4 < seen {
        return Ok(());
    }
    let needed = "the radius (or angle) up to which the model is one-to-one must exceed 1e-4; check order and unit of the coefficients";
    Err(Error::InvalidCamera { parameter: "distortion", seen, needed })
}

/// Checks α of the sphere models.
pub(super) fn check_alpha(seen: f64) -> Result<(), Error> {
    if (0.0..=1.0).contains(&seen) {
        return Ok(());
    }
    Err(Error::InvalidCamera { parameter: "alpha", seen, needed: "alpha lies between 0 and 1" })
}
