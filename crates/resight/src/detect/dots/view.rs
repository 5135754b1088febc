//! The plane in which straight lines are straight: z = 1 of the camera, or the image itself where no camera is given.

use nalgebra::{Matrix2, Vector2};
use resight_core::{Camera, Pixel, Point};

/// Maps between pixels and the plane z = 1.
pub(super) enum View<'a> {
    /// The lens is known: bearings.
    Calibrated(&'a Camera),
    /// The lens is unknown and assumed free of distortion: (pixel − centre)/scale. The scale only conditions the numbers.
    Nominal {
        /// Middle of the image.
        centre: Pixel,
        /// Width of the image, px.
        scale_px: f64,
    },
}

impl View<'_> {
    /// Returns whether angles are meaningful.
    pub fn is_calibrated(&self) -> bool {
        matches!(self, View::Calibrated(_))
    }

    /// Returns (x/z, y/z) of a pixel; `None` outside the valid field, or 90° and more off the axis.
    pub fn ray(&self, pixel: &Pixel) -> Option<Vector2<f64>> {
        match self {
            View::Calibrated(camera) => {
                let b = camera.bearing(pixel).ok()?;
                (1e-3 < b.z).then(|| Vector2::new(b.x / b.z, b.y / b.z))
            }
            View::Nominal { centre, scale_px } => Some((pixel - centre) / *scale_px),
        }
    }

    /// Returns the pixel of a homogeneous point; `None` behind the camera or outside the valid field.
    pub fn pixel(&self, x: &Point) -> Option<Pixel> {
        match self {
            View::Calibrated(camera) => camera.project(x),
            View::Nominal { centre, scale_px } => {
                (0.0 < x.z).then(|| centre + Vector2::new(x.x, x.y) * (*scale_px / x.z))
            }
        }
    }

    /// Returns the derivative of the pixel with respect to (x/z, y/z), px.
    pub fn pixel_by_view(&self, y: &Vector2<f64>) -> Option<Matrix2<f64>> {
        match self {
            View::Calibrated(camera) => {
                let (_, jacobian) = camera.project_with_jacobian(&Point::new(y.x, y.y, 1.0))?;
                Some(jacobian.fixed_view::<2, 2>(0, 0).into())
            }
            View::Nominal { scale_px, .. } => Some(Matrix2::identity() * *scale_px),
        }
    }
}
