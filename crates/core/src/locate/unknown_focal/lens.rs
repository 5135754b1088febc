//! A lens of which the focal length is not known, and the rest as well as one knows it of lenses in general.
//!
//!   f  focal length  ·  a  log fy/fx  ·  c  principal point  ·  κ  displacement of the image's corner over its distance from the middle
//!   ρ  half of the image's diagonal, px: k₁ = κ (f/ρ)², docs/math/focal.md eq. (20)

use crate::camera::ImageSize;
use crate::camera::{BrownConrady, IntrinsicsJacobian};
use crate::{Camera, CameraMatrix};
use nalgebra::{DMatrix, SMatrix, Vector2};

/// What is known of a lens without a calibration: square pixels, the principal point in the middle of the image, no distortion, each to
/// its standard deviation. Nothing is known of the focal length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensPrior {
    /// Of the images.
    pub size: ImageSize,
    /// Of each coordinate of the principal point.
    pub principal_point_sigma_px: f64,
    /// Of log fy/fx.
    pub aspect_sigma: f64,
    /// Of the relative displacement of the image's corner by distortion, per radian of horizontal field of view.
    pub bend_sigma_per_rad: f64,
}

/// How many unknowns a lens has here.
pub(super) const LENS: usize = 5;
/// A covariance of [log f, a, c_u, c_v, κ].
pub(super) type LensCovariance = SMatrix<f64, LENS, LENS>;
/// fx, fy, cx, cy, k1, k2, p1, p2.
const PARAMETERS: usize = 8;

/// Where the unknowns of the lens are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LensState {
    pub(super) log_focal: f64,
    pub(super) aspect: f64,
    pub(super) centre_px: Vector2<f64>,
    pub(super) bend: f64,
}

impl LensState {
    pub(super) fn focal_px(&self) -> f64 {
        self.log_focal.exp()
    }

    pub(super) fn values(&self) -> [f64; LENS] {
        [self.log_focal, self.aspect, self.centre_px.x, self.centre_px.y, self.bend]
    }

    pub(super) fn moved(&self, step: &[f64]) -> Option<Self> {
        let [log_focal, aspect, u, v, bend] = *step else { return None };
        Some(LensState {
            log_focal: self.log_focal + log_focal,
            aspect: self.aspect + aspect,
            centre_px: self.centre_px + Vector2::new(u, v),
            bend: self.bend + bend,
        })
    }
}

impl LensPrior {
    /// The lens in general, with a focal length.
    pub(super) fn state(&self, focal_px: f64) -> LensState {
        LensState { log_focal: focal_px.ln(), aspect: 0.0, centre_px: self.centre_px(), bend: 0.0 }
    }

    pub(super) fn centre_px(&self) -> Vector2<f64> {
        Vector2::new(self.width_px() - 1.0, f64::from(self.size.height_px) - 1.0) * 0.5
    }

    pub(super) fn width_px(&self) -> f64 {
        f64::from(self.size.width_px)
    }

    /// From the left to the right edge of the image, radians.
    pub(super) fn field_of_view_rad(&self, focal_px: f64) -> f64 {
        2.0 * (0.5 * self.width_px()).atan2(focal_px)
    }

    /// Which gives this field of view.
    pub(super) fn focal_of_field_px(&self, field_of_view_rad: f64) -> f64 {
        0.5 * self.width_px() / (0.5 * field_of_view_rad).tan()
    }

    fn radius_px(&self) -> f64 {
        0.5 * self.width_px().hypot(f64::from(self.size.height_px))
    }

    /// k₁ over κ.
    fn k1_by_bend(&self, focal_px: f64) -> f64 {
        (focal_px / self.radius_px()).powi(2)
    }

    /// The camera; none where numbers leave their range.
    pub(super) fn camera(&self, lens: &LensState) -> Option<Camera> {
        let f = lens.focal_px();
        let half = (0.5 * lens.aspect).exp();
        let matrix = CameraMatrix {
            fx_px: f / half,
            fy_px: f * half,
            cx_px: lens.centre_px.x,
            cy_px: lens.centre_px.y,
        };
        let k1 = lens.bend * self.k1_by_bend(f);
        let model = BrownConrady::new(matrix, &[k1, 0.0, 0.0, 0.0]).ok()?;
        Camera::new(model, Some(self.size)).ok()
    }

    /// Derivatives of the camera's parameters by the unknowns, docs/math/focal.md eq. (21).
    fn by_state(&self, lens: &LensState) -> SMatrix<f64, PARAMETERS, LENS> {
        let (f, half) = (lens.focal_px(), (0.5 * lens.aspect).exp());
        let (fx, fy, k1_by_bend) = (f / half, f * half, self.k1_by_bend(f));
        let mut by = SMatrix::zeros();
        (by[(0, 0)], by[(0, 1)]) = (fx, -0.5 * fx);
        (by[(1, 0)], by[(1, 1)]) = (fy, 0.5 * fy);
        (by[(2, 2)], by[(3, 3)]) = (1.0, 1.0);
        (by[(4, 0)], by[(4, 4)]) = (2.0 * lens.bend * k1_by_bend, k1_by_bend);
        by
    }

    /// Derivatives of a pixel by the unknowns.
    pub(super) fn pixel_by_state(
        &self,
        lens: &LensState,
        by_parameter: &IntrinsicsJacobian,
    ) -> [Vector2<f64>; LENS] {
        let by_state = self.by_state(lens);
        let mut columns = [Vector2::zeros(); LENS];
        for (j, column) in columns.iter_mut().enumerate() {
            for (i, by) in by_parameter.iter().enumerate().take(PARAMETERS) {
                *column += by * by_state[(i, j)];
            }
        }
        columns
    }

    /// Residuals of what is known of the lens, in standard deviations: which unknown, the residual, and its derivative.
    pub(super) fn residuals(&self, lens: &LensState, bend_sigma: f64) -> [(usize, f64, f64); LENS - 1] {
        let off = lens.centre_px - self.centre_px();
        let row = |i: usize, value: f64, sigma: f64| (i, -value / sigma, sigma.recip());
        [
            row(1, lens.aspect, self.aspect_sigma),
            row(2, off.x, self.principal_point_sigma_px),
            row(3, off.y, self.principal_point_sigma_px),
            row(4, lens.bend, bend_sigma),
        ]
    }

    /// Standard deviation of κ for a focal length: wide lenses bend more.
    pub(super) fn bend_sigma(&self, focal_px: f64) -> f64 {
        self.bend_sigma_per_rad * self.field_of_view_rad(focal_px)
    }

    /// That of the camera's parameters.
    pub(super) fn parameter_covariance(&self, lens: &LensState, covariance: &LensCovariance) -> DMatrix<f64> {
        let by = self.by_state(lens);
        let product: SMatrix<f64, PARAMETERS, PARAMETERS> = by * covariance * by.transpose();
        DMatrix::from_fn(PARAMETERS, PARAMETERS, |i, j| 0.5 * (product[(i, j)] + product[(j, i)]))
    }

    /// Whether its standard deviations are some.
    pub(super) fn is_usable(&self) -> bool {
        let sigmas = [self.principal_point_sigma_px, self.aspect_sigma, self.bend_sigma_per_rad];
        sigmas.into_iter().all(|s| 0.0 < s && s.is_finite())
            && 0 < self.size.width_px
            && 0 < self.size.height_px
    }
}
