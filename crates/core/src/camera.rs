//! Camera models: from a point in the camera frame to a pixel and its derivative, and back to a bearing.
//!
//! Each lens model is one file; `Lens` lists them. The constructor `new` of a model refuses invalid parameters and computes the valid field, the
//! part of space (or image) in which the model is one-to-one. Outside it `project` returns no pixel and `bearing` an error, never the result of
//! a folded model. Derivations: docs/math/camera.md.
//!
//! | model | file | Kalibr | OpenCV |
//! | --- | --- | --- | --- |
//! | `pinhole` | `pinhole.rs` | pinhole-none | no coefficients |
//! | `brown_conrady` | `brown_conrady.rs` | pinhole-radtan | 4, 5, 8, 12, 14 coefficients |
//! | `kannala_brandt` | `kannala_brandt.rs` | pinhole-equidistant | `fisheye` |
//! | `fov` | `fov.rs` | pinhole-fov | |
//! | `omni` | `omni.rs` | omni-none, omni-radtan | |
//! | `eucm`, `double_sphere` | `eucm.rs`, `double_sphere.rs` | eucm-none, ds-none | |
//! | `photogrammetric` | `photogrammetric.rs` | | |
//!
//! Kalibr's other combinations (omni-equidistant, ds-radtan, …) are not implemented.

// `!(a < b)` is intended: unlike `b <= a` it is also true for NaN, which is refused.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod field;
mod plane_distortion;
mod tilt;
mod matrix;
mod image;
pub mod pinhole;
pub mod brown_conrady;
pub mod kannala_brandt;
pub mod fov;
pub mod omni;
pub mod eucm;
pub mod double_sphere;
pub mod photogrammetric;

use crate::{Bearing, Error, Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x3, Vector2};

pub use brown_conrady::BrownConrady;
pub use double_sphere::DoubleSphere;
pub use eucm::Eucm;
pub use fov::Fov;
pub use image::ImageSize;
pub use kannala_brandt::KannalaBrandt;
pub use matrix::CameraMatrix;
use matrix::{check_alpha, check_field, check_finite};
pub use omni::Omni;
pub use photogrammetric::{Photogrammetric, PhotogrammetricParameters};
pub use pinhole::Pinhole;

/// Most intrinsic parameters a model has (Brown–Conrady: 4 + 14).
pub(crate) const MAX_PARAMETERS: usize = 18;

/// Names (as in camera.toml) and values of the intrinsic parameters.
pub type Parameters = ArrayVec<(&'static str, f64), MAX_PARAMETERS>;

/// Derivative of the pixel with respect to each intrinsic parameter, px per unit of the parameter.
pub type IntrinsicsJacobian = ArrayVec<Vector2<f64>, MAX_PARAMETERS>;

/// A camera with known intrinsics.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The lens model with its parameters.
    pub lens: Lens,
    /// Size of its images; `None` for normalised or photogrammetric coordinates.
    pub size: Option<ImageSize>,
}

/// The lens models.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[allow(clippy::large_enum_variant)] // A camera is built once and read in the hot loop; a box would cost a cache line there.
pub enum Lens {
    /// No distortion.
    Pinhole(Pinhole),
    /// OpenCV's 4 to 14 coefficients; Kalibr's `radtan`.
    BrownConrady(BrownConrady),
    /// OpenCV's fisheye; Kalibr's `equidistant`.
    KannalaBrandt(KannalaBrandt),
    /// Field of view of Devernay and Faugeras.
    Fov(Fov),
    /// Unified sphere (Mei), with or without `radtan`.
    Omni(Omni),
    /// Enhanced unified model.
    Eucm(Eucm),
    /// Double sphere.
    DoubleSphere(DoubleSphere),
    /// The model of Wang (2004), eq. (1).
    Photogrammetric(Photogrammetric),
}

/// Applies an expression to any of the models; a new model is one line here.
macro_rules! each_lens {
    ($lens:expr, $model:ident => $body:expr) => {
        match $lens {
            Lens::Pinhole($model) => $body,
            Lens::BrownConrady($model) => $body,
            Lens::KannalaBrandt($model) => $body,
            Lens::Fov($model) => $body,
            Lens::Omni($model) => $body,
            Lens::Eucm($model) => $body,
            Lens::DoubleSphere($model) => $body,
            Lens::Photogrammetric($model) => $body,
        }
    };
}

macro_rules! lens_from {
    ($($model:ident),*) => {$(
        impl From<$model> for Lens {
            fn from(model: $model) -> Self {
                Lens::$model(model)
            }
        }
    )*};
}
lens_from!(Pinhole, BrownConrady, KannalaBrandt, Fov, Omni, Eucm, DoubleSphere, Photogrammetric);

impl Lens {
    /// Returns the model's name, as in camera.toml.
    pub fn model_name(&self) -> &'static str {
        match self {
            Lens::Pinhole(_) => Pinhole::NAME,
            Lens::BrownConrady(_) => BrownConrady::NAME,
            Lens::KannalaBrandt(_) => KannalaBrandt::NAME,
            Lens::Fov(_) => Fov::NAME,
            Lens::Omni(_) => Omni::NAME,
            Lens::Eucm(_) => Eucm::NAME,
            Lens::DoubleSphere(_) => DoubleSphere::NAME,
            Lens::Photogrammetric(_) => Photogrammetric::NAME,
        }
    }
}

impl Camera {
    /// Returns the camera of undistorted coordinates on the plane z = 1: f = 1, principal point 0.
    pub fn normalized() -> Self {
        let matrix = CameraMatrix { fx_px: 1.0, fy_px: 1.0, cx_px: 0.0, cy_px: 0.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    /// Returns the pixel of a point in the camera frame; `None` outside the valid field (behind the camera, beyond the fold).
    #[inline]
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        each_lens!(&self.lens, model => model.project(x_in_cam))
    }

    /// Returns the pixel and its derivative with respect to the point (2×3, px/m).
    #[inline]
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        each_lens!(&self.lens, model => model.project_with_jacobian(x_in_cam))
    }

    /// Returns the unit vector towards the point at a pixel.
    ///
    /// # Errors
    /// `OutsideField` for a pixel (or NaN) to which no point of the valid field projects within 1e-9 px.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        each_lens!(&self.lens, model => model.bearing(pixel))
    }

    /// Returns the derivative of the pixel with respect to each intrinsic parameter, in the order of `parameters`; `None` outside the valid
    /// field.
    pub fn intrinsics_jacobian(&self, x_in_cam: &Point) -> Option<IntrinsicsJacobian> {
        each_lens!(&self.lens, model => model.intrinsics_jacobian(x_in_cam))
    }

    /// Names and values of the intrinsic parameters; the camera matrix (or f, xp, yp) comes first.
    pub fn parameters(&self) -> Parameters {
        each_lens!(&self.lens, model => model.parameters())
    }

    /// Returns the coefficients of the distortion alone, in the order of OpenCV and of the key `distortion` of camera.toml; empty for a pinhole.
    /// `None` for models without such a list (photogrammetric, fov, eucm, double sphere).
    pub fn distortion(&self) -> Option<ArrayVec<f64, 14>> {
        let own = match self.lens {
            Lens::Pinhole(_) | Lens::BrownConrady(_) | Lens::KannalaBrandt(_) => 4,
            Lens::Omni(_) => 5, // After xi.
            Lens::Photogrammetric(_) | Lens::Fov(_) | Lens::Eucm(_) | Lens::DoubleSphere(_) => return None,
        };
        Some(self.parameters().iter().skip(own).map(|(_, value)| *value).collect())
    }

    /// Returns the same model and image size with other parameter values, in the order of `parameters`.
    ///
    /// # Errors
    /// `CoefficientCount` when `values` has another length than `parameters`, and the errors of the model's `new`.
    pub fn with_parameters(&self, values: &[f64]) -> Result<Camera, Error> {
        let needed = "as many values as `parameters` lists, not only";
        if values.len() != self.parameters().len() {
            return Err(Error::CoefficientCount { model: self.model_name(), needed, seen: values.len() });
        }
        let lens = each_lens!(&self.lens, model => Lens::from(model.rebuilt(values)?));
        Ok(Camera { lens, size: self.size })
    }

    /// Returns the lens model's name, as in camera.toml.
    pub fn model_name(&self) -> &'static str {
        self.lens.model_name()
    }

    /// Returns focal lengths and principal point; `None` for the photogrammetric model, which has its own unit.
    pub fn matrix(&self) -> Option<CameraMatrix> {
        match &self.lens {
            Lens::Pinhole(model) => Some(model.matrix),
            Lens::BrownConrady(model) => Some(model.matrix()),
            Lens::KannalaBrandt(model) => Some(model.matrix()),
            Lens::Fov(model) => Some(model.matrix()),
            Lens::Omni(model) => Some(model.matrix()),
            Lens::Eucm(model) => Some(model.matrix()),
            Lens::DoubleSphere(model) => Some(model.matrix()),
            Lens::Photogrammetric(_) => None,
        }
    }
}
