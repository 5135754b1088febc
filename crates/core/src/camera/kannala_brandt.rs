//! Kannala–Brandt fisheye with four coefficients: OpenCV's fisheye, Kalibr's `equidistant`, `kb4`.
//!
//! Paper: J. Kannala, S. S. Brandt, IEEE Trans. Pattern Analysis and Machine Intelligence, 2006.
//!   r = √(x² + y²)   θ = atan2(r, z)   δ(θ) = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)   u = fx δ x/r + cx   v = fy δ y/r + cy
//! The field is an angle, up to 180° less the axis itself. Derivations: docs/math/camera.md section 4.

use super::field::{
    GREATEST_SLOPE, INSIDE, ON_EDGE, RESIDUAL_PX, distance_is_usable, first_zero, invert_monotone, outside,
};
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_field, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use core::f64::consts::PI;
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

const NAMES: [&str; 4] = ["k1", "k2", "k3", "k4"];

/// The camera matrix and k1 to k4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KannalaBrandt {
    matrix: CameraMatrix,
    k: [f64; 4],
    theta_max: f64,
    delta_max: f64,
}

impl KannalaBrandt {
    /// The name in files and messages.
    pub const NAME: &'static str = "kannala_brandt";

    /// Creates a camera; `coefficients` are k1, k2, k3, k4.
    ///
    /// # Errors
    /// `CoefficientCount`; `InvalidCamera` for a value that is not finite or f ≤ 0.
    pub fn new(matrix: CameraMatrix, coefficients: &[f64]) -> Result<Self, Error> {
        matrix.check()?;
        let &[k1, k2, k3, k4] = coefficients else {
            return Err(Error::CoefficientCount { model: Self::NAME, needed: "4", seen: coefficients.len() });
        };
        let k = [k1, k2, k3, k4];
        for (name, value) in NAMES.into_iter().zip(k) {
            check_finite(name, value)?;
        }
        let slope = [1.0, 0.0, 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3, 0.0, 9.0 * k4];
        let mut stretch = slope.map(|c| -c);
        stretch[0] += GREATEST_SLOPE;
        let theta_max = first_zero(&stretch, first_zero(&slope, PI));
        check_field(theta_max)?;
        let mut model = KannalaBrandt { matrix, k, theta_max, delta_max: 0.0 };
        model.delta_max = model.delta(theta_max).0;
        Ok(model)
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns k1, k2, k3, k4.
    pub fn coefficients(&self) -> [f64; 4] {
        self.k
    }

    /// Returns the angle from the optical axis up to which the model is one-to-one, rad.
    pub fn angle_max_rad(&self) -> f64 {
        self.theta_max
    }

    /// Returns δ(θ) and δ'(θ).
    #[inline]
    fn delta(&self, theta: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.k;
        let t = theta * theta;
        let value = theta * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4))));
        let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));
        (value, slope)
    }

    /// Returns the unit vector (x, y)/r (zero on the axis), r and θ; `None` outside the field.
    #[inline]
    fn polar(&self, x: &Point) -> Option<(Vector2<f64>, f64, f64)> {
        if !distance_is_usable(x.norm_squared()) {
            return None;
        }
        let r2 = x.x * x.x + x.y * x.y;
        if r2 < 1e-300 {
            // On the axis in front, the direction is zero; exactly behind, the direction of the image point is undefined.
            return (0.0 < x.z).then_some((Vector2::zeros(), 0.0, 0.0));
        }
        let r = r2.sqrt();
        let theta = r.atan2(x.z);
        (theta <= self.theta_max).then(|| (Vector2::new(x.x / r, x.y / r), r, theta))
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (n, _, theta) = self.polar(x_in_cam)?;
        Some(self.matrix.pixel(&(n * self.delta(theta).0)))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (n, r, theta) = self.polar(x_in_cam)?;
        let (delta, slope) = self.delta(theta);
        let along = slope / (r * r + x_in_cam.z * x_in_cam.z);
        let across = if r == 0.0 { 1.0 / x_in_cam.z } else { delta / r };
        // ∂(δ n)/∂(x, y) = (δ/r) I + (δ' z/d² − δ/r) n nᵀ; its n nᵀ part stays small near the axis, eq. (11).
        let excess = along * x_in_cam.z - across;
        let jacobian = self.matrix.radial_jacobian(&n, across, excess, along, x_in_cam);
        Some((self.matrix.pixel(&(n * delta)), jacobian))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let m = self.matrix.unpixel(pixel);
        let delta = m.norm();
        if delta == 0.0 {
            return Ok(Vector3::z_axis());
        }
        let theta = invert_monotone(|t| self.delta(t), delta, self.theta_max * INSIDE);
        let miss_px = (self.delta(theta).0 - delta).abs() * self.matrix.longest();
        if !(delta <= self.delta_max * ON_EDGE && miss_px <= RESIDUAL_PX) {
            return Err(outside(pixel, Self::NAME, "one-to-one up to the angle in rad", self.theta_max));
        }
        let (s, c) = theta.sin_cos();
        Ok(Unit::new_normalize(Vector3::new(s * m.x / delta, s * m.y / delta, c)))
    }

    /// Order: fx, fy, cx, cy, k1, k2, k3, k4.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (n, _, theta) = self.polar(x)?;
        let mut columns = self.matrix.columns(&(n * self.delta(theta).0));
        let t = theta * theta;
        let mut power = theta;
        for _ in 0..4 {
            power *= t;
            columns.push(self.matrix.stretch(&(n * power)));
        }
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.extend(NAMES.into_iter().zip(self.k));
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), &values[4..])
    }
}
