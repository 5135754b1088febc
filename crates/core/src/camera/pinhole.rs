//! Pinhole camera without distortion: u = fx x/z + cx, v = fy y/z + cy.

use super::{CameraMatrix, MAX_PARAMETERS};
use crate::{Bearing, Error, Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};

/// The camera matrix alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Focal lengths and principal point.
    pub matrix: CameraMatrix,
}

impl Pinhole {
    /// See `Camera::project`.
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        let k = &self.matrix;
        let iz = 1.0 / x_in_cam.z;
        let in_front = 0.0 < x_in_cam.z; // Behind the lens projects too, mirrored.
        in_front
            .then(|| Vector2::new(k.fx_px * x_in_cam.x * iz + k.cx_px, k.fy_px * x_in_cam.y * iz + k.cy_px))
    }

    /// See `Camera::project_with_jacobian`.
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let k = &self.matrix;
        if !(0.0 < x_in_cam.z) {
            return None;
        }
        let iz = 1.0 / x_in_cam.z;
        let (xn, yn) = (x_in_cam.x * iz, x_in_cam.y * iz);
        let (ax, ay) = (k.fx_px * iz, k.fy_px * iz);
        let pixel = Vector2::new(k.fx_px * xn + k.cx_px, k.fy_px * yn + k.cy_px);
        Some((pixel, Matrix2x3::new(ax, 0.0, -ax * xn, 0.0, ay, -ay * yn)))
    }

    /// See `Camera::bearing`.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let k = &self.matrix;
        Ok(Unit::new_normalize(Vector3::new(
            (pixel.x - k.cx_px) / k.fx_px,
            (pixel.y - k.cy_px) / k.fy_px,
            1.0,
        )))
    }

    /// Order: fx, fy, cx, cy.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<ArrayVec<Vector2<f64>, MAX_PARAMETERS>> {
        if !(0.0 < x.z) {
            return None;
        }
        let columns = [
            Vector2::new(x.x / x.z, 0.0),
            Vector2::new(0.0, x.y / x.z),
            Vector2::new(1.0, 0.0),
            Vector2::new(0.0, 1.0),
        ];
        Some(columns.into_iter().collect())
    }
}
