//! Camera models: from a point in the camera frame to a pixel, back to a bearing, and the derivative.
//!
//! Each lens model is one file; `Lens` lists them. Derivations: docs/math/camera.md.

pub mod pinhole;

use crate::{Bearing, Error, Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x3, Vector2};
pub use pinhole::Pinhole;

/// Most intrinsic parameters a model has (Brown–Conrady: 4 + 14).
pub const MAX_PARAMETERS: usize = 18;

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

/// Width and height of the images the intrinsics belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageSize {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

/// A camera with known intrinsics.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The lens model with its parameters.
    pub lens: Lens,
    /// Size of the images it takes; none for normalised or photogrammetric coordinates.
    pub size: Option<ImageSize>,
}

/// The lens models.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Lens {
    /// No distortion.
    Pinhole(Pinhole),
}

impl Camera {
    /// The camera of undistorted coordinates on the plane z = 1: f = 1, principal point 0.
    pub fn normalized() -> Self {
        let matrix = CameraMatrix { fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    /// Pixel of a point given in the camera frame; none when it is not in the valid field (behind, beyond the fold).
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        match &self.lens {
            Lens::Pinhole(model) => model.project(x_in_cam),
        }
    }

    /// Pixel and its derivative by the point (2×3, px/m).
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        match &self.lens {
            Lens::Pinhole(model) => model.project_with_jacobian(x_in_cam),
        }
    }

    /// Unit vector towards the point seen at a pixel; an error outside the valid field.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        match &self.lens {
            Lens::Pinhole(model) => model.bearing(pixel),
        }
    }

    /// Derivative of the pixel by each intrinsic parameter, in the order of `parameters`.
    pub fn intrinsics_jacobian(&self, x_in_cam: &Point) -> Option<ArrayVec<Vector2<f64>, MAX_PARAMETERS>> {
        match &self.lens {
            Lens::Pinhole(model) => model.intrinsics_jacobian(x_in_cam),
        }
    }
}
