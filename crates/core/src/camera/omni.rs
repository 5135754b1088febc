//! Omnidirectional (unified) camera: a sphere, seen from a point ξ before its centre, then plane distortion.
//!
//! Papers: C. Geyer, K. Daniilidis, ECCV 2000; C. Mei, P. Rives, ICRA 2007. Kalibr: `omni` with `radtan` or `none`.
//!   d = |x|   q = (x, y)/(z + ξ d)   then k1 k2 p1 p2 as in Brown–Conrady   u = fx x + cx   v = fy y + cy
//! Valid field: z + ξ d > 0, for ξ > 1 also d + ξ z > 0 (beyond it the sphere folds), and the distortion's own disc.
//! Kalibr's order is ξ, fu, fv, pu, pv; ours puts the matrix first. Derivations: docs/math/camera.md section 5.

use super::field::{RESIDUAL_PX, SPHERE_RADIUS_CAP, depth_sum, distance_is_usable, outside, within};
use super::plane_distortion::PlaneDistortion;
use super::{CameraMatrix, IntrinsicsJacobian, Parameters, check_field, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

const NAMES: [&str; 4] = ["k1", "k2", "p1", "p2"];

/// The camera matrix, ξ and the distortion on the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Omni {
    matrix: CameraMatrix,
    xi: f64,
    distortion: [f64; 4],
    plane: PlaneDistortion,
}

impl Omni {
    /// The name in files and messages.
    pub const NAME: &'static str = "omni";

    /// Creates a camera; `distortion` is k1, k2, p1, p2 (Kalibr's `radtan`), or empty.
    ///
    /// # Errors
    /// `CoefficientCount`; `InvalidCamera` for a value that is not finite, f ≤ 0 or ξ ≤ −1.
    pub fn new(matrix: CameraMatrix, xi: f64, distortion: &[f64]) -> Result<Self, Error> {
        matrix.check()?;
        check_finite("xi", xi)?;
        if xi <= -1.0 {
            let needed = "xi of the omni model is above -1";
            return Err(Error::InvalidCamera { parameter: "xi", seen: xi, needed });
        }
        let distortion = match *distortion {
            [] => [0.0; 4],
            [k1, k2, p1, p2] => [k1, k2, p1, p2],
            _ => {
                let needed = "0 or 4 (k1, k2, p1, p2)";
                return Err(Error::CoefficientCount { model: Self::NAME, needed, seen: distortion.len() });
            }
        };
        for (name, value) in NAMES.into_iter().zip(distortion) {
            check_finite(name, value)?;
        }
        // For ξ > 1 the sphere's outline has radius 1/√(ξ² − 1) on the plane.
        let outline = if 1.0 < xi { 1.0 / (xi * xi - 1.0).sqrt() } else { SPHERE_RADIUS_CAP };
        let plane = PlaneDistortion::new(&distortion, outline);
        check_field(plane.radius_max())?;
        Ok(Omni { matrix, xi, distortion, plane })
    }

    /// Returns focal lengths and principal point.
    pub fn matrix(&self) -> CameraMatrix {
        self.matrix
    }

    /// Returns the mirror parameter ξ.
    pub fn xi(&self) -> f64 {
        self.xi
    }

    /// Returns k1, k2, p1, p2.
    pub fn distortion(&self) -> [f64; 4] {
        self.distortion
    }

    /// Returns q, d and the denominator z + ξ d; `None` outside the field.
    #[inline]
    fn on_plane(&self, x: &Point) -> Option<(Vector2<f64>, f64, f64)> {
        let r2 = x.x * x.x + x.y * x.y;
        let d2 = r2 + x.z * x.z;
        if !distance_is_usable(d2) {
            return None;
        }
        let d = d2.sqrt();
        let depth = depth_sum(self.xi, 1.0, d, x.z, r2);
        let q = Vector2::new(x.x / depth, x.y / depth);
        let before_fold = 0.0 < d + self.xi * x.z;
        (0.0 < depth && before_fold && q.norm_squared() <= self.plane.r2_max()).then_some((q, d, depth))
    }

    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let (q, _, _) = self.on_plane(x_in_cam)?;
        Some(self.matrix.pixel(&self.plane.apply(&q)))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let (q, d, depth) = self.on_plane(x_in_cam)?;
        let (distorted, by_q) = self.plane.apply_with_jacobian(&q);
        // ∂q/∂x = (e − q ∇depthᵀ)/depth, ∇depth = (0, 0, 1) + ξ x/d.
        let slope = x_in_cam * (self.xi / d) + Vector3::z();
        let s = 1.0 / depth;
        let q_by_x = Matrix2x3::new(
            s * (1.0 - q.x * slope.x),
            -s * q.x * slope.y,
            -s * q.x * slope.z,
            -s * q.y * slope.x,
            s * (1.0 - q.y * slope.y),
            -s * q.y * slope.z,
        );
        Some((self.matrix.pixel(&distorted), self.matrix.stretch_rows(by_q * q_by_x)))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let distorted = self.matrix.unpixel(pixel);
        let radius_max = self.plane.radius_max();
        let q = self
            .plane
            .invert(&distorted, RESIDUAL_PX / self.matrix.longest())
            .and_then(|q| within(q, radius_max))
            .ok_or_else(|| {
                outside(pixel, Self::NAME, "one-to-one up to the radius on the plane", radius_max)
            })?;
        let r2 = q.norm_squared();
        let root = (1.0 + (1.0 - self.xi * self.xi) * r2).max(0.0).sqrt();
        let lift = (self.xi + root) / (1.0 + r2);
        Ok(Unit::new_normalize(Vector3::new(lift * q.x, lift * q.y, lift - self.xi)))
    }

    /// Order: fx, fy, cx, cy, ξ, k1, k2, p1, p2.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let (q, d, depth) = self.on_plane(x)?;
        let (distorted, by_q) = self.plane.apply_with_jacobian(&q);
        let mut columns = self.matrix.columns(&distorted);
        columns.push(self.matrix.stretch(&(by_q * q * (-d / depth))));
        let by_coefficient = self.plane.coefficient_derivatives(&q).into_iter().take(4);
        columns.extend(by_coefficient.map(|by| self.matrix.stretch(&by)));
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        let mut parameters = self.matrix.parameters();
        parameters.push(("xi", self.xi));
        parameters.extend(NAMES.into_iter().zip(self.distortion));
        parameters
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(CameraMatrix::from_values(values), values[4], &values[5..])
    }
}
