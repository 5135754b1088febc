//! Field-of-view model: one coefficient, the lens angle w. Kalibr: pinhole with `fov` distortion.
//!
//! Paper: F. Devernay, O. Faugeras, Straight lines have to be straight, Machine Vision and Applications, 2001.
//!   c = 2 tan(w/2)   r = √(x² + y²)   ψ = atan2(c r, z)   u = fx (ψ/w) x/r + cx   v = fy (ψ/w) y/r + cy     (w = 0: pinhole)
//! Valid field: z > 0, where ψ < 90°. Derivations: docs/math/camera.md section 7.

use super::field::{INSIDE, RADIUS_CAP, distance_is_usable, outside, within};
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use core::f64::consts::{FRAC_PI_2, PI};
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Below this w the derivative with respect to w is taken from its series: error w³ r⁵ against ε r/w of the closed form.
const SERIES_BELOW: f64 = 1e-6;

/// The camera matrix and w.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fov {
    matrix: CameraMatrix,
    w: f64,
    c: f64,
    radius_max: f64,
}

impl Fov {
    /// The name in files and messages.
    pub const NAME: &'static str = "fov";

    /// Creates a camera; `w` is the angle of the ideal field of view, rad, 0 ≤ w < π.
    ///
    /// # Errors
    /// `InvalidCamera` for a value that is not finite, f ≤ 0 or w out of range.
    pub fn new(matrix: CameraMatrix, w: f64) -> Result<Self, Error> {
        matrix.check()?;
        check_finite("w", w)?;
        if !(0.0..PI).contains(&w) {
            let needed = "the angle of the fov model is in radians, at least 0 and below pi";
            return Err(Error::InvalidCamera { parameter: "w", seen: w, needed });
        }
        // Below 1e-8 the model equals a pinhole to the last digit in any usable field; w = 0 avoids 0/0.
        let w = if w < 1e-8 { 0.0 } else { w };
        let c = 2.0 * (0.5 * w).tan();
        let radius_max = if w == 0.0 { RADIUS_CAP } else { (FRAC_PI_2 / w * INSIDE).min(RADIUS_CAP) };
        Ok(Fov { matrix, w, c, radius_max })
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns the angle w, rad.
    pub fn w_rad(&self) -> f64 {
        self.w
    }

    /// Returns the distorted radius ψ/w and the undistorted r; `None` outside the field.
    #[inline]
    fn radii(&self, x: &Point) -> Option<(f64, f64)> {
        let r2 = x.x * x.x + x.y * x.y;
        if !(0.0 < x.z && distance_is_usable(r2 + x.z * x.z)) {
            return None;
        }
        let r = r2.sqrt();
        let distorted = if self.w == 0.0 { r / x.z } else { (self.c * r).atan2(x.z) / self.w };
        (distorted <= self.radius_max).then_some((distorted, r))
    }

    /// Returns (x, y)/r, or zero on the axis.
    #[inline]
    fn direction(x: &Point, r: f64) -> Vector2<f64> {
        if r == 0.0 { Vector2::zeros() } else { Vector2::new(x.x / r, x.y / r) }
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (distorted, r) = self.radii(x_in_cam)?;
        Some(self.matrix.pixel(&(Self::direction(x_in_cam, r) * distorted)))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (distorted, r) = self.radii(x_in_cam)?;
        let n = Self::direction(x_in_cam, r);
        let z = x_in_cam.z;
        // ∂(ψ/w)/∂r = along z, ∂(ψ/w)/∂z = −along r, eq. (15).
        let ratio = if self.w == 0.0 { 1.0 } else { self.c / self.w };
        let along = ratio / (self.c * self.c * r * r + z * z);
        let across = if r == 0.0 { ratio / z } else { distorted / r };
        let excess = along * z - across;
        let jacobian = self.matrix.radial_jacobian(&n, across, excess, along, x_in_cam);
        Some((self.matrix.pixel(&(n * distorted)), jacobian))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let m = within(self.matrix.unpixel(pixel), self.radius_max)
            .ok_or_else(|| outside(pixel, Self::NAME, "distorted radius up to", self.radius_max))?;
        let distorted = m.norm();
        if distorted == 0.0 || self.w == 0.0 {
            return Ok(Unit::new_normalize(Vector3::new(m.x, m.y, 1.0)));
        }
        let (s, c) = (distorted * self.w).sin_cos();
        Ok(Unit::new_normalize(Vector3::new(s * m.x / distorted, s * m.y / distorted, self.c * c)))
    }

    /// Order: fx, fy, cx, cy, w.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (distorted, r) = self.radii(x)?;
        let n = Self::direction(x, r);
        let mut columns = self.matrix.columns(&(n * distorted));
        let w = self.w;
        let by_w = if w < SERIES_BELOW {
            let q = r / x.z;
            2.0 * w * q * (1.0 / 12.0 - q * q / 3.0)
        } else {
            // dc/dw = 1 + c²/4
            let c = self.c;
            (r * x.z * (1.0 + 0.25 * c * c) / (c * c * r * r + x.z * x.z) - distorted) / w
        };
        columns.push(self.matrix.stretch(&(n * by_w)));
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.push(("w", self.w));
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), values[4])
    }
}
