//! Brown–Conrady camera with 4, 5, 8, 12 or 14 coefficients, as OpenCV orders them.
//!
//! Paper: D. C. Brown, Photogrammetric Engineering, 1966 and 1971; A. E. Conrady, 1919. Coefficients and tilt: OpenCV, calib3d.
//!   q = (x/z, y/z) → plane distortion (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4) → sensor tilt (τx, τy) → u = fx x + cx, v = fy y + cy
//! Also Kalibr's `radtan` (4) and ROS' `plumb_bob` (5) and `rational_polynomial` (8). Derivations: docs/math/camera.md section 3.

use super::field::{RESIDUAL_PX, distance_is_usable, outside};
use super::plane_distortion::PlaneDistortion;
use super::tilt::Tilt;
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_field, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};

const NAMES: [&str; 14] =
    ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y"];

/// The camera matrix and its distortion coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct BrownConrady {
    matrix: CameraMatrix,
    coefficients: ArrayVec<f64, 14>,
    plane: PlaneDistortion,
    tilt: Option<Tilt>,
}

impl BrownConrady {
    /// The name in files and messages.
    pub const NAME: &'static str = "brown_conrady";

    /// Creates a camera; `coefficients` are 4, 5, 8, 12 or 14 in OpenCV's order (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 τx τy, the angles in rad).
    ///
    /// # Errors
    /// `CoefficientCount`; `InvalidCamera` for a matrix or coefficient that is not finite, f ≤ 0, |τ| > 1.55 rad or no valid
    /// field.
    pub fn new(matrix: CameraMatrix, coefficients: &[f64]) -> Result<Self, Error> {
        matrix.check()?;
        let seen = coefficients.len();
        if ![4, 5, 8, 12, 14].contains(&seen) {
            return Err(Error::CoefficientCount { model: Self::NAME, needed: "4, 5, 8, 12 or 14", seen });
        }
        for (name, &value) in NAMES.iter().zip(coefficients) {
            check_finite(name, value)?;
        }
        let tilt = match coefficients {
            [.., tau_x, tau_y] if seen == 14 && (*tau_x != 0.0 || *tau_y != 0.0) => {
                Some(Tilt::new(*tau_x, *tau_y)?)
            }
            _ => None,
        };
        let plane = PlaneDistortion::new(&coefficients[..seen.min(12)], f64::INFINITY);
        check_field(plane.radius_max())?;
        Ok(BrownConrady { matrix, coefficients: coefficients.iter().copied().collect(), plane, tilt })
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns the coefficients as given, in OpenCV's order.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Returns the radius √(x² + y²)/z up to which the model is one-to-one.
    pub fn radius_max(&self) -> f64 {
        self.plane.radius_max()
    }

    /// Returns (x/z, y/z) if it is in the field.
    #[inline]
    fn normalized(&self, x: &Point) -> Option<(Vector2<f64>, f64)> {
        let iz = 1.0 / x.z;
        let q = Vector2::new(x.x * iz, x.y * iz);
        let inside = 0.0 < x.z && q.norm_squared() <= self.plane.r2_max() && distance_is_usable(x.z * x.z);
        inside.then_some((q, iz))
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (q, _) = self.normalized(x_in_cam)?;
        let distorted = self.plane.apply(&q);
        let on_sensor = match &self.tilt {
            None => distorted,
            Some(tilt) => tilt.apply(&distorted)?,
        };
        Some(self.matrix.pixel(&on_sensor))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (q, iz) = self.normalized(x_in_cam)?;
        let (mut on_sensor, mut by_q) = self.plane.apply_with_jacobian(&q);
        if let Some(tilt) = &self.tilt {
            let (tilted, by_distorted) = tilt.apply_with_jacobian(&on_sensor)?;
            on_sensor = tilted;
            by_q = by_distorted * by_q;
        }
        let (ax, ay) = (self.matrix.fx_px * iz, self.matrix.fy_px * iz);
        let (a, b, c, d) = (ax * by_q.m11, ax * by_q.m12, ay * by_q.m21, ay * by_q.m22);
        let jacobian = Matrix2x3::new(a, b, -(a * q.x + b * q.y), c, d, -(c * q.x + d * q.y));
        Some((self.matrix.pixel(&on_sensor), jacobian))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let on_sensor = self.matrix.unpixel(pixel);
        let distorted = match &self.tilt {
            None => on_sensor,
            Some(tilt) => tilt.invert(&on_sensor).ok_or_else(|| {
                outside(pixel, Self::NAME, "horizon of the tilted sensor, sensor depth", tilt.least_depth())
            })?,
        };
        let tolerance = RESIDUAL_PX / self.matrix.longest();
        let q = self.plane.invert(&distorted, tolerance).ok_or_else(|| {
            outside(pixel, Self::NAME, "one-to-one up to the radius x/z =", self.plane.radius_max())
        })?;
        Ok(Unit::new_normalize(Vector3::new(q.x, q.y, 1.0)))
    }

    /// Order: fx, fy, cx, cy, then the coefficients given.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (q, _) = self.normalized(x)?;
        let distorted = self.plane.apply(&q);
        let (on_sensor, by_distorted) = match &self.tilt {
            None => (distorted, nalgebra::Matrix2::identity()),
            Some(tilt) => tilt.apply_with_jacobian(&distorted)?,
        };
        let mut columns = self.matrix.columns(&on_sensor);
        let by_coefficient = self.plane.coefficient_derivatives(&q).into_iter().take(self.coefficients.len());
        columns.extend(by_coefficient.map(|by| self.matrix.stretch(&(by_distorted * by))));
        if let [.., tau_x, tau_y] = self.coefficients[..]
            && self.coefficients.len() == 14
        {
            for by_angle in Tilt::angle_derivatives(tau_x, tau_y, &distorted) {
                columns.push(self.matrix.stretch(&by_angle));
            }
        }
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.extend(NAMES.iter().copied().zip(self.coefficients.iter().copied()));
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), &values[4..])
    }
}
