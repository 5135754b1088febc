//! A sensor tilted against the lens (Scheimpflug), OpenCV's τx, τy.
//!
//! R = R_y(τy) R_x(τx) turns the image plane, P projects it back along the optical axis (docs/math/camera.md eq. (8)):
//!   R_x = [1 0 0; 0 c s; 0 −s c]   R_y = [c 0 −s; 0 1 0; s 0 c]   P = [R33 0 −R13; 0 R33 −R23; 0 0 1]   H = P R

use super::field::{INSIDE, ON_EDGE};
use crate::Error;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The homography of the tilt and its inverse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tilt {
    sensor_from_plane: Matrix3<f64>,
    plane_from_sensor: Matrix3<f64>,
    least_depth: f64,
}

/// The field ends where a point's depth in the tilted frame has fallen to this share of the axis' own depth: at the horizon it is 0, and the
/// stretching grows as one over the square.
const HORIZON_MARGIN: f64 = 0.3;

impl Tilt {
    /// # Errors
    /// `InvalidCamera` for an angle of 90° or more.
    pub fn new(tau_x: f64, tau_y: f64) -> Result<Self, Error> {
        for (parameter, seen) in [("tau_x", tau_x), ("tau_y", tau_y)] {
            if !(seen.abs() < 1.55) {
                let needed = "a sensor tilt is an angle in radians within ±1.55 (89°)";
                return Err(Error::InvalidCamera { parameter, seen, needed });
            }
        }
        let rotation = rotation_y(tau_y) * rotation_x(tau_x);
        let sensor_from_plane = projection(&rotation) * rotation;
        let r33 = rotation.m33;
        // P⁻¹ in closed form; R⁻¹ = Rᵀ.
        let unproject = Matrix3::new(
            1.0 / r33,
            0.0,
            rotation.m13 / r33,
            0.0,
            1.0 / r33,
            rotation.m23 / r33,
            0.0,
            0.0,
            1.0,
        );
        Ok(Tilt {
            sensor_from_plane,
            plane_from_sensor: rotation.transpose() * unproject,
            least_depth: HORIZON_MARGIN * r33,
        })
    }

    /// Returns the depth in the tilted frame below which a point counts as being on the horizon.
    pub fn least_depth(&self) -> f64 {
        self.least_depth
    }

    /// Returns the point on the sensor.
    #[inline]
    pub fn apply(&self, q: &Vector2<f64>) -> Option<Vector2<f64>> {
        let h = self.sensor_from_plane * Vector3::new(q.x, q.y, 1.0);
        (self.least_depth <= h.z).then(|| Vector2::new(h.x / h.z, h.y / h.z))
    }

    /// Returns the point on the sensor and its derivative.
    #[inline]
    pub fn apply_with_jacobian(&self, q: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let p = self.apply(q)?;
        let h = &self.sensor_from_plane;
        let depth = h.m31 * q.x + h.m32 * q.y + h.m33;
        let jacobian =
            Matrix2::new(h.m11 - p.x * h.m31, h.m12 - p.x * h.m32, h.m21 - p.y * h.m31, h.m22 - p.y * h.m32);
        Some((p, jacobian / depth))
    }

    /// Returns the point of the untilted plane.
    pub fn invert(&self, p: &Vector2<f64>) -> Option<Vector2<f64>> {
        let h = self.plane_from_sensor * Vector3::new(p.x, p.y, 1.0);
        // h.z is 1/depth.
        let depth_ratio = self.least_depth * h.z;
        let q = Vector2::new(h.x / h.z, h.y / h.z);
        if !(0.0 < h.z && depth_ratio <= ON_EDGE) {
            return None;
        }
        // Towards the axis the depth increases, so that rounding cannot move the result across the edge.
        Some(if depth_ratio < INSIDE { q } else { q * (INSIDE * INSIDE) })
    }

    /// Returns the derivatives of the point on the sensor with respect to τx and τy.
    pub fn angle_derivatives(tau_x: f64, tau_y: f64, q: &Vector2<f64>) -> [Vector2<f64>; 2] {
        let (rx, ry) = (rotation_x(tau_x), rotation_y(tau_y));
        let rotation = ry * rx;
        let point = Vector3::new(q.x, q.y, 1.0);
        let h = projection(&rotation) * rotation * point;
        [ry * rotation_x_slope(tau_x), rotation_y_slope(tau_y) * rx].map(|slope| {
            // d(P R q) = dP R q + P dR q; P's constant last entry has no derivative.
            let mut projection_slope = projection(&slope);
            projection_slope.m33 = 0.0;
            let dh = projection_slope * (rotation * point) + projection(&rotation) * (slope * point);
            Vector2::new(dh.x - h.x / h.z * dh.z, dh.y - h.y / h.z * dh.z) / h.z
        })
    }
}

fn projection(r: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::new(r.m33, 0.0, -r.m13, 0.0, r.m33, -r.m23, 0.0, 0.0, 1.0)
}

fn rotation_x(angle_rad: f64) -> Matrix3<f64> {
    let (s, c) = angle_rad.sin_cos();
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, s, 0.0, -s, c)
}

fn rotation_x_slope(angle_rad: f64) -> Matrix3<f64> {
    let (s, c) = angle_rad.sin_cos();
    Matrix3::new(0.0, 0.0, 0.0, 0.0, -s, c, 0.0, -c, -s)
}

fn rotation_y(angle_rad: f64) -> Matrix3<f64> {
    let (s, c) = angle_rad.sin_cos();
    Matrix3::new(c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c)
}

fn rotation_y_slope(angle_rad: f64) -> Matrix3<f64> {
    let (s, c) = angle_rad.sin_cos();
    Matrix3::new(-s, 0.0, -c, 0.0, 0.0, 0.0, c, 0.0, -s)
}
