//! The unknown error of a camera's intrinsics, eliminated from its equations: it affects the weights, the covariance and the verdict.
//!
//! ```text
//!   of one camera, whitened: J by the rig's motion about the pivot, K by its parameters θ, C = Cov θ, r residual
//!   N = JᵀJ, g = Jᵀr, G = JᵀK, M = KᵀK, h = Kᵀr,   E = C (1 + M C)⁻¹
//! ```
//! Derivation: docs/math/rig_pose.md eqs. (8)–(10).

use super::RigView;
use crate::camera::MAX_PARAMETERS;
use crate::covariance::is_covariance;
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::common::check_intrinsics_covariance;
use crate::locate::problem::Problem;
use crate::locate::refine::{held_jacobian, information};
use crate::{Correspondence, Error, Matrix6, Point, Pose, Vector6};
use nalgebra::{SMatrix, SVector};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

type Square = SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>;

/// The dependence of the residual of one camera on its own parameters. Rows and columns beyond them are zero.
pub(super) struct UncertainLens {
    /// G, about the pivot.
    by_motion: SMatrix<f64, 6, MAX_PARAMETERS>,
    /// M.
    information: Square,
    /// h.
    gradient: SVector<f64, MAX_PARAMETERS>,
    /// C.
    covariance: Square,
    n_parameters: usize,
}

/// Refuses a matrix that is no covariance of a camera's intrinsics.
pub(super) fn check(view: &RigView) -> Result<(), Error> {
    let Some(rows) = view.intrinsics_covariance else { return Ok(()) };
    let n_parameters = view.camera.parameters().len();
    check_intrinsics_covariance(rows, n_parameters)?;
    let covariance = square(rows, n_parameters);
    if !is_covariance(&covariance) {
        let seen = covariance.symmetric_eigenvalues().min();
        let needed = "it must be symmetric, and its least eigenvalue not negative";
        return Err(Error::InvalidCamera { parameter: "intrinsics covariance", seen, needed });
    }
    Ok(())
}

fn square(rows: &[f64], n: usize) -> Square {
    let mut covariance = Square::zeros();
    for (index, entry) in rows.iter().enumerate() {
        covariance[(index / n, index % n)] = *entry;
    }
    covariance
}

impl UncertainLens {
    /// Builds the terms of a camera at a pose of the rig, with its uncertain points weighted as at `weights_at`. The outer option is none where
    /// a point leaves its field; the inner one where its intrinsics are exact or it observes nothing.
    pub(super) fn at(
        view: &RigView,
        weights_at: Option<Pose>,
        place: &PivotedPose,
        pivot: &Point,
    ) -> Option<Option<Self>> {
        let Some(rows) = view.intrinsics_covariance.filter(|_| !view.seen.is_empty()) else {
            return Some(None);
        };
        let n_parameters = view.camera.parameters().len();
        let mut lens = UncertainLens {
            by_motion: SMatrix::zeros(),
            information: Square::zeros(),
            gradient: SVector::zeros(),
            covariance: square(rows, n_parameters),
            n_parameters,
        };
        let problem = Problem { weights_at: weights_at.as_ref(), ..Problem::new(view.seen, view.camera) };
        for c in view.seen {
            lens.add(c, view, &problem, place, pivot)?;
        }
        Some(Some(lens))
    }

    fn add(
        &mut self,
        c: &Correspondence,
        view: &RigView,
        problem: &Problem,
        place: &PivotedPose,
        pivot: &Point,
    ) -> Option<()> {
        let y = place.rotation * (c.x_in_target - pivot);
        let x_in_cam = view.cam_from_rig * (y + place.pivot_in_cam);
        let (pixel, jacobian) = view.camera.project_with_jacobian(&x_in_cam)?;
        let columns = view.camera.intrinsics_jacobian(&x_in_cam)?;
        let weight = information(c, &held_jacobian(c, problem)?.unwrap_or(jacobian));
        let by_rig = jacobian * view.cam_from_rig.rotation;
        for (i, column) in columns.iter().enumerate() {
            let pull = weight * column;
            let force = by_rig.tr_mul(&pull);
            let torque = y.cross(&force);
            let mut by_motion = self.by_motion.column_mut(i);
            by_motion += Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
            self.gradient[i] += pull.dot(&(c.pixel - pixel));
            for (j, other) in columns.iter().enumerate() {
                self.information[(i, j)] += pull.dot(other);
            }
        }
        Some(())
    }

    /// Returns the same terms where the camera's pose is uncertain too, with its unknown motion eliminated first, as in eqs. (5), (6); `normal`
    /// are the equations with the pose as stated. None where the inverse does not exist.
    pub(super) fn with_uncertain_motion(
        mut self,
        normal: &NormalEquations,
        motion: &Matrix6,
    ) -> Option<Self> {
        let left = (Matrix6::identity() + normal.information() * motion).try_inverse()?;
        let pulled = (motion * left).transpose() * self.by_motion;
        self.information -= pulled.tr_mul(&self.by_motion);
        self.gradient -= pulled.tr_mul(&normal.gradient());
        self.by_motion = left * self.by_motion;
        Some(self)
    }

    /// Returns the camera's equations with its parameters eliminated, eqs. (8), (9). None where the inverse does not exist.
    pub(super) fn eliminated_from(&self, normal: &NormalEquations) -> Option<NormalEquations> {
        let (share, _) = self.share()?;
        let n = self.n_parameters;
        let (mut chi2, mut gradient, mut information) =
            (normal.chi2, normal.gradient(), normal.information());
        for j in 0..n {
            let (mut pulled, mut pull) = (Vector6::zeros(), 0.0);
            for i in 0..n {
                let entry = 0.5 * (share[(i, j)] + share[(j, i)]);
                pulled += self.by_motion.column(i) * entry;
                pull += self.gradient[i] * entry;
            }
            chi2 -= pull * self.gradient[j];
            gradient -= pulled * self.gradient[j];
            information -= pulled * self.by_motion.column(j).transpose();
        }
        Some(NormalEquations::from_parts(chi2.max(0.0), &gradient, &information))
    }

    /// Returns the logarithm of the factor by which the parameters increase the determinant of the residual's covariance, eq. (10).
    pub(super) fn log_determinant(&self) -> Option<f64> {
        let (_, determinant) = self.share()?;
        let log_determinant = determinant.abs().ln();
        log_determinant.is_finite().then_some(log_determinant.max(0.0))
    }

    /// Returns E = (1 + C M)⁻¹ C and the determinant, by elimination in as many rows as there are parameters: a square of the largest size would
    /// cost twenty times as much for a lens without distortion.
    fn share(&self) -> Option<(Square, f64)> {
        let n = self.n_parameters;
        let (mut left, mut right, mut determinant) = (Square::identity(), self.covariance, 1.0);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let entry = |k: usize| self.covariance[(i, k)] * self.information[(k, j)];
            left[(i, j)] += (0..n).map(entry).sum::<f64>();
        }
        for k in 0..n {
            let pivot = (k..n).max_by(|a, b| left[(*a, k)].abs().total_cmp(&left[(*b, k)].abs()))?;
            let size = left[(pivot, k)];
            if size == 0.0 || !size.is_finite() {
                return None;
            }
            determinant *= size;
            left.swap_rows(k, pivot);
            right.swap_rows(k, pivot);
            for i in (0..n).filter(|i| *i != k) {
                let factor = left[(i, k)] / size;
                for j in 0..n {
                    left[(i, j)] -= factor * left[(k, j)];
                    right[(i, j)] -= factor * right[(k, j)];
                }
            }
            for j in 0..n {
                left[(k, j)] /= size;
                right[(k, j)] /= size;
            }
        }
        Some((right, determinant))
    }
}
