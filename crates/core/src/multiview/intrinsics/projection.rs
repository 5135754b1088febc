//! The uncertainty of a camera's projection over its image, and the difference of two cameras: docs/math/intrinsics.md section 7.
//!
//! A small rotation of the camera looks like a shift of its principal point. The uncertainty of a projection is therefore computed after
//! removing the rotation that best keeps the observed corners in place, as in mrcal.

use crate::camera::ImageSize;
use crate::{Bearing, Camera, Pixel};
use nalgebra::{DMatrix, Dyn, Matrix2x3, Matrix3, OMatrix, Rotation3, U2, Vector2, Vector3};

type Rows = OMatrix<f64, U2, Dyn>;

/// Standard deviation of the projection at one position of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectionSigma {
    /// The position.
    pub pixel: Pixel,
    /// In the worse direction, px; `None` outside the lens model's field.
    pub sigma_px: Option<f64>,
}

/// Standard deviations of the projection over a grid of `columns` × `rows` positions, row by row, from corner to corner of the image.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectionUncertainty {
    /// Number of positions in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// All positions.
    pub places: Vec<ProjectionSigma>,
}

impl ProjectionUncertainty {
    /// Returns the root mean square over the image, px; `None` where no position is in the field.
    pub fn rms_px(&self) -> Option<f64> {
        let known: Vec<f64> = self.places.iter().filter_map(|place| place.sigma_px).collect();
        let sum: f64 = known.iter().map(|sigma| sigma * sigma).sum();
        (!known.is_empty()).then(|| (sum / known.len() as f64).sqrt())
    }

    /// Returns the largest, px.
    pub fn largest_px(&self) -> Option<f64> {
        self.places.iter().filter_map(|place| place.sigma_px).reduce(f64::max)
    }
}

/// The inputs of the projection's covariance: the covariance of the intrinsics, and the corners that fix the camera's rotation.
pub struct Projection<'a> {
    camera: &'a Camera,
    covariance: &'a DMatrix<f64>,
    /// The rotation that best compensates a change of the intrinsics, 3 × n: docs/math/intrinsics.md eq. (9).
    rotation_of_change: DMatrix<f64>,
}

/// The normal equations of the rotation that keeps corners in place: docs/math/intrinsics.md eq. (9).
#[derive(Debug, Clone)]
pub(super) struct Held {
    /// Σ RᵀR, R the derivative of a corner by the rotation.
    rotation: Matrix3<f64>,
    /// Σ RᵀK, 3 × n, K that by the parameters.
    parameters: DMatrix<f64>,
}

impl Held {
    pub(super) fn new(camera: &Camera, corners: impl IntoIterator<Item = Pixel>) -> Self {
        let parameters = DMatrix::zeros(3, camera.parameters().len());
        let mut held = Held { rotation: Matrix3::zeros(), parameters };
        for pixel in corners {
            held.add(camera, &pixel);
        }
        held
    }

    /// Adds a corner; one outside the field is ignored.
    pub(super) fn add(&mut self, camera: &Camera, pixel: &Pixel) {
        if let Some((by_rotation, by_parameters)) = derivatives(camera, pixel) {
            self.rotation += by_rotation.transpose() * by_rotation;
            self.parameters += by_rotation.transpose() * by_parameters;
        }
    }

    /// Returns the rotation that best compensates a change of the intrinsics, 3 × n.
    pub(super) fn rotation_of_change(&self) -> DMatrix<f64> {
        let inverse = self.rotation.try_inverse().unwrap_or_else(Matrix3::zeros);
        DMatrix::from_fn(3, self.parameters.ncols(), |i, j| {
            -(0..3).map(|k| inverse[(i, k)] * self.parameters[(k, j)]).sum::<f64>()
        })
    }
}

impl<'a> Projection<'a> {
    /// Prepares the covariance; `covariance` is that of all parameters, in the order of `Camera::parameters`, and `corners` are the pixels of
    /// the targets' points, of which those outside the field are ignored.
    pub fn new(
        camera: &'a Camera,
        covariance: &'a DMatrix<f64>,
        corners: impl IntoIterator<Item = Pixel>,
    ) -> Self {
        let rotation_of_change = Held::new(camera, corners).rotation_of_change();
        Projection { camera, covariance, rotation_of_change }
    }

    /// Returns the covariance of the projection at a pixel, px²; `None` outside the field.
    pub fn covariance_px2(&self, pixel: &Pixel) -> Option<nalgebra::Matrix2<f64>> {
        let d = self.by_parameters(pixel)?;
        Some(&d * self.covariance * d.transpose())
    }

    /// Returns the standard deviation of the projection at a pixel along the worse direction, px; `None` outside the field.
    pub fn sigma_px(&self, pixel: &Pixel) -> Option<f64> {
        let variance = worse_variance(&self.covariance_px2(pixel)?);
        Some(variance.max(0.0).sqrt()).filter(|sigma| sigma.is_finite())
    }

    /// Returns the derivative of the projection with respect to the parameters, without the rotation; `None` outside the field.
    pub fn by_parameters(&self, pixel: &Pixel) -> Option<Rows> {
        let (by_rotation, by_parameters) = derivatives(self.camera, pixel)?;
        Some(by_parameters + by_rotation * &self.rotation_of_change)
    }

    /// Evaluates a grid over the image.
    pub fn over_image(&self, size: ImageSize, columns: usize, rows: usize) -> ProjectionUncertainty {
        let places =
            grid(size, columns, rows).map(|pixel| ProjectionSigma { pixel, sigma_px: self.sigma_px(&pixel) });
        ProjectionUncertainty { columns, rows, places: places.collect() }
    }
}

/// Returns the variance along the worse direction.
pub(super) fn worse_variance(c: &nalgebra::Matrix2<f64>) -> f64 {
    let (mean, half) = (0.5 * (c.m11 + c.m22), 0.5 * (c.m11 - c.m22));
    mean + half.hypot(c.m12)
}

/// Returns positions from corner to corner of an image, row by row.
pub fn grid(size: ImageSize, columns: usize, rows: usize) -> impl Iterator<Item = Pixel> {
    let along =
        |n: usize, i: usize, side: u32| f64::from(side.saturating_sub(1)) * i as f64 / (n.max(2) - 1) as f64;
    (0..rows * columns).map(move |i| {
        Pixel::new(
            along(columns, i % columns.max(1), size.width_px),
            along(rows, i / columns.max(1), size.height_px),
        )
    })
}

/// Returns the derivatives of the pixel of a distant point with respect to a rotation of the camera frame's points, and to the parameters.
pub(super) fn derivatives(camera: &Camera, pixel: &Pixel) -> Option<(Matrix2x3<f64>, Rows)> {
    let x: Vector3<f64> = camera.bearing(pixel).ok()?.into_inner();
    let (_, jacobian) = camera.project_with_jacobian(&x)?;
    let columns = camera.intrinsics_jacobian(&x)?;
    let rows = Rows::from_fn(columns.len(), |i, j| columns[j][i]);
    Some((-jacobian * x.cross_matrix(), rows))
}

/// The difference of two cameras' projections over the image of the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectionDifference {
    /// Root mean square over the positions compared, px.
    pub rms_px: f64,
    /// The largest, px.
    pub largest_px: f64,
    /// Number of positions compared, of `of`: those in the fields of both cameras.
    pub n: usize,
    /// Number of positions of the grid.
    pub of: usize,
}

/// Largest number of steps of the search for the rotation, which converges quadratically from a small angle.
const MAX_STEPS: usize = 20;

/// Returns the difference that remains after the best rotation between two cameras; `None` where their fields hardly overlap (three positions
/// needed).
pub fn projection_difference(a: &Camera, b: &Camera, size: ImageSize) -> Option<ProjectionDifference> {
    let places: Vec<Pixel> = grid(size, 24, 18).collect();
    let off = difference_over(a, b, &places, &places)?;
    let off: Vec<f64> = off.into_iter().flatten().map(|off| off.norm()).collect();
    if off.len() < 3 {
        return None;
    }
    let sum: f64 = off.iter().map(|px| px * px).sum();
    let largest_px = off.iter().copied().fold(0.0, f64::max);
    Some(ProjectionDifference {
        rms_px: (sum / off.len() as f64).sqrt(),
        largest_px,
        n: off.len(),
        of: places.len(),
    })
}

/// Returns at each place by how much b projects elsewhere than a, px, after the rotation that keeps `corners` in place best; `None` outside the
/// fields.
pub(super) fn difference_over(
    a: &Camera,
    b: &Camera,
    corners: &[Pixel],
    places: &[Pixel],
) -> Option<Vec<Option<Vector2<f64>>>> {
    let seen: Vec<(Pixel, Bearing)> =
        corners.iter().filter_map(|pixel| Some((*pixel, a.bearing(pixel).ok()?))).collect();
    let mut b_from_a = Rotation3::identity();
    for _ in 0..MAX_STEPS {
        let (mut normal, mut pull) = (Matrix3::zeros(), Vector3::zeros());
        for (pixel, bearing) in &seen {
            let x = b_from_a * bearing.into_inner();
            let Some((there, jacobian)) = b.project_with_jacobian(&x) else { continue };
            let by_rotation = -jacobian * x.cross_matrix();
            normal += by_rotation.transpose() * by_rotation;
            pull += by_rotation.transpose() * (pixel - there);
        }
        let step = normal.try_inverse()? * pull;
        if !step.iter().all(|x| x.is_finite()) {
            return None;
        }
        b_from_a = Rotation3::from_scaled_axis(step) * b_from_a;
        if step.norm() < 1e-12 {
            break;
        }
    }
    let off = |pixel: &Pixel| {
        let x = b_from_a * a.bearing(pixel).ok()?.into_inner();
        Some(b.project(&x)? - pixel)
    };
    Some(places.iter().map(off).collect())
}
