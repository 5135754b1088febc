//! Views and minima, transposed: a column holds one number of each, one view or start per lane.

use super::lanes::{Column, Lanes, Matrix, Symmetric, Vector};
use super::refine::{Minimum, ObservedPoints, Place};
use crate::camera::CameraMatrix;
use crate::{Matrix6, Pixel, Point, Pose, locate::choose};
use nalgebra::{Matrix3, Vector3};
use pulp::Simd;

/// The pixels of the N points of each view.
pub(super) struct Group<const N: usize> {
    pub pivot: [Column; 3],
    from_pivot: [[Column; 3]; N],
    pixel: [[Column; 2]; N],
    sigma_px: [Column; N],
    /// fx, fy, cx, cy.
    matrix: [Column; 4],
}

impl<const N: usize> Default for Group<N> {
    fn default() -> Self {
        let zero = Column::default();
        Group {
            pivot: [zero; 3],
            from_pivot: [[zero; 3]; N],
            pixel: [[zero; 2]; N],
            sigma_px: [zero; N],
            matrix: [zero; 4],
        }
    }
}

impl<const N: usize> Group<N> {
    /// Sets the points of a view, in the order of its pixels and sigmas.
    #[inline(always)]
    pub fn set_points(&mut self, lane: usize, points: &[Point; N]) {
        let pivot = points.iter().sum::<Point>() / N as f64;
        for i in 0..3 {
            self.pivot[i][lane] = pivot[i];
            for k in 0..N {
                self.from_pivot[k][i][lane] = points[k][i] - pivot[i];
            }
        }
    }

    #[inline(always)]
    pub fn set_pixel(&mut self, lane: usize, k: usize, pixel: &Pixel) {
        (self.pixel[k][0][lane], self.pixel[k][1][lane]) = (pixel.x, pixel.y);
    }

    #[inline(always)]
    pub fn set_sigma(&mut self, lane: usize, k: usize, sigma_px: f64) {
        self.sigma_px[k][lane] = sigma_px;
    }

    #[inline(always)]
    pub fn set_matrix(&mut self, lane: usize, matrix: &CameraMatrix) {
        let CameraMatrix { fx_px, fy_px, cx_px, cy_px } = *matrix;
        for (column, value) in self.matrix.iter_mut().zip([fx_px, fy_px, cx_px, cy_px]) {
            column[lane] = value;
        }
    }

    #[inline(always)]
    pub fn seen<S: Simd>(&self, simd: S) -> ObservedPoints<S, N> {
        let [fx, fy, cx, cy] = &self.matrix;
        let zero = Lanes::splat(simd, 0.0);
        let mut seen = ObservedPoints {
            from_pivot: [Vector::new(zero, zero, zero); N],
            pixel: [[zero; 2]; N],
            weight: [zero; N],
            focal: [Lanes::load(simd, fx), Lanes::load(simd, fy)],
            principal: [Lanes::load(simd, cx), Lanes::load(simd, cy)],
        };
        for k in 0..N {
            seen.from_pivot[k] = load(simd, &self.from_pivot[k]);
            seen.pixel[k] = [Lanes::load(simd, &self.pixel[k][0]), Lanes::load(simd, &self.pixel[k][1])];
            seen.weight[k] = Lanes::load(simd, &self.sigma_px[k]).recip();
        }
        seen
    }
}

#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, [x, y, z]: &[Column; 3]) -> Vector<S> {
    Vector::new(Lanes::load(simd, x), Lanes::load(simd, y), Lanes::load(simd, z))
}

#[inline(always)]
fn store<S: Simd>(v: &Vector<S>, columns: &mut [Column; 3]) {
    v.x.store(&mut columns[0]);
    v.y.store(&mut columns[1]);
    v.z.store(&mut columns[2]);
}

#[inline(always)]
fn store_rows<S: Simd>(m: &Matrix<S>, columns: &mut [[Column; 3]; 3]) {
    for i in 0..3 {
        store(&m.rows[i], &mut columns[i]);
    }
}

#[inline(always)]
fn store_triangle<S: Simd>(m: &Symmetric<S>, columns: &mut [Column; 6]) {
    for i in 0..6 {
        m.0[i].store(&mut columns[i]);
    }
}

/// A pose of each view.
#[derive(Default)]
pub(super) struct KeptPlace {
    rotation: [[Column; 3]; 3],
    translation: [Column; 3],
}

impl KeptPlace {
    /// Returns the translation.
    #[inline(always)]
    pub fn keep<S: Simd>(&mut self, place: &Place<S>, pivot: Vector<S>) -> Vector<S> {
        let translation = place.pivot_in_cam - place.rotation.apply(pivot);
        store_rows(&place.rotation, &mut self.rotation);
        store(&translation, &mut self.translation);
        translation
    }

    #[inline(always)]
    pub fn cam_from_target(&self, lane: usize) -> Pose {
        let rotation = Matrix3::from_fn(|i, j| self.rotation[i][j][lane]);
        Pose { rotation, translation: Vector3::from_fn(|i, _| self.translation[i][lane]) }
    }
}

/// A minimum of each view.
#[derive(Default)]
pub(super) struct Kept {
    place: KeptPlace,
    rotation_rotation: [Column; 6],
    rotation_translation: [[Column; 3]; 3],
    translation_translation: [Column; 6],
    pub chi2: Column,
    rms_px: Column,
}

impl Kept {
    /// Keeps a minimum over `n_points` points. Returns a sum that is finite only where every number in it is.
    #[inline(always)]
    pub fn keep<S: Simd>(&mut self, m: &Minimum<S>, pivot: Vector<S>, n_points: usize) -> Lanes<S> {
        let Minimum { place, covariance, chi2, sum, .. } = m;
        let translation = self.place.keep(place, pivot);
        let mean = *sum * (1.0 / n_points as f64);
        store_triangle(&covariance.rotation, &mut self.rotation_rotation);
        store_rows(&covariance.cross, &mut self.rotation_translation);
        store_triangle(&covariance.translation, &mut self.translation_translation);
        chi2.store(&mut self.chi2);
        mean.sqrt().store(&mut self.rms_px);
        translation.norm_squared() + covariance.translation.0[5] + covariance.rotation.0[5] + mean
    }

    #[inline(always)]
    pub fn minimum(&self, lane: usize) -> choose::Minimum {
        choose::Minimum {
            cam_from_target: self.place.cam_from_target(lane),
            covariance: self.covariance(lane),
            chi2: self.chi2[lane],
            rms_px: self.rms_px[lane],
            log_determinant: 0.0,
        }
    }

    #[inline(always)]
    fn covariance(&self, lane: usize) -> Matrix6 {
        /// Position of (i, j) in the upper triangle.
        const PLACE: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let mut covariance = Matrix6::zeros();
        for i in 0..3 {
            for j in 0..3 {
                covariance[(i, j)] = self.rotation_rotation[PLACE[i][j]][lane];
                covariance[(3 + i, 3 + j)] = self.translation_translation[PLACE[i][j]][lane];
                covariance[(i, 3 + j)] = self.rotation_translation[i][j][lane];
                covariance[(3 + j, i)] = self.rotation_translation[i][j][lane];
            }
        }
        covariance
    }
}
