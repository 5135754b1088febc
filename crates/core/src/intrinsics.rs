//! What uncertain intrinsics do to an answer: they widen its covariance, and they explain a part of its residual.
//!
//! ```text
//!   K  derivative of the predicted pixels by the parameters θ, whitened  ·  J  the same by the pose  ·  r  whitened residual
//!   G = JᵀK,  M = Kᵀ(1 − JΣJᵀ)K = KᵀK − GᵀΣG,  h = Kᵀr,  C = Cov(θ)
//! ```
//! Derivation: docs/math/refine.md eq. (9), docs/math/posterior.md eqs. (7)–(10).

use crate::camera::MAX_PARAMETERS;
use crate::choose::Minimum;
use crate::problem::Problem;
use crate::refine::information;
use crate::{Correspondence, Error, Matrix6, Vector6};
use nalgebra::{SMatrix, SVector};

type Square = SMatrix<f64, MAX_PARAMETERS, MAX_PARAMETERS>;
type Vector = SVector<f64, MAX_PARAMETERS>;

/// How the residual depends on the intrinsics at one minimum. Rows and columns beyond the camera's parameters are zero.
pub(crate) struct Dependence {
    /// Columns of G.
    by_parameter: [Vector6; MAX_PARAMETERS],
    /// KᵀK.
    information: Square,
    /// h.
    gradient: Vector,
    /// C.
    covariance: Square,
    n_parameters: usize,
}

impl Dependence {
    /// At a minimum. `covariance` is that of the parameters, row by row.
    pub(crate) fn at(m: &Minimum, problem: &Problem, covariance: &[f64]) -> Result<Self, Error> {
        let mut dependence = Dependence {
            by_parameter: [Vector6::zeros(); MAX_PARAMETERS],
            information: Square::zeros(),
            gradient: Vector::zeros(),
            covariance: Square::zeros(),
            n_parameters: 0,
        };
        for c in problem.seen {
            dependence.add(m, c, problem).ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
        }
        let n = dependence.n_parameters;
        check_intrinsics_covariance(covariance, n)?;
        for (index, entry) in covariance.iter().enumerate() {
            dependence.covariance[(index / n, index % n)] = *entry;
        }
        Ok(dependence)
    }

    fn add(&mut self, m: &Minimum, c: &Correspondence, problem: &Problem) -> Option<()> {
        let x = m.cam_from_target * c.x_in_target;
        let (pixel, jacobian) = problem.camera.project_with_jacobian(&x)?;
        let columns = problem.camera.intrinsics_jacobian(&x)?;
        let weight = information(c, &jacobian);
        self.n_parameters = columns.len();
        for (i, column) in columns.iter().enumerate() {
            let pull = weight * column;
            let force = jacobian.tr_mul(&pull);
            let torque = x.cross(&force);
            self.by_parameter[i] += Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
            self.gradient[i] += pull.dot(&(c.pixel - pixel));
            for (j, other) in columns.iter().enumerate() {
                self.information[(i, j)] += pull.dot(other);
            }
        }
        Some(())
    }

    /// What the parameters add to a pose's covariance: Σ G C Gᵀ Σ, docs/math/refine.md eq. (9).
    pub(crate) fn share(&self, covariance: &Matrix6) -> Matrix6 {
        let mut share = Matrix6::zeros();
        for i in 0..self.n_parameters {
            for j in 0..self.n_parameters {
                share += self.by_parameter[i] * self.by_parameter[j].transpose() * self.covariance[(i, j)];
            }
        }
        covariance * share * covariance
    }

    /// The part of χ² that the parameters explain: hᵀ C (1 + M C)⁻¹ h, docs/math/posterior.md eq. (10). `covariance` is
    /// that of the pose by the pixels.
    pub(crate) fn explained_chi2(&self, covariance: &Matrix6) -> f64 {
        let mut left = self.information;
        for i in 0..self.n_parameters {
            let pulled = covariance * self.by_parameter[i];
            for j in 0..self.n_parameters {
                left[(i, j)] -= pulled.dot(&self.by_parameter[j]);
            }
        }
        let system = Square::identity() + left * self.covariance;
        let solved = system.lu().solve(&self.gradient);
        let explained = solved.map_or(0.0, |x| self.gradient.dot(&(self.covariance * x)));
        if explained.is_finite() { explained.max(0.0) } else { 0.0 }
    }
}

/// Refuses a matrix that is no covariance: another size, not finite, a negative variance.
fn check_intrinsics_covariance(covariance: &[f64], n_parameters: usize) -> Result<(), Error> {
    let invalid = |parameter, seen, needed| Err(Error::InvalidCamera { parameter, seen, needed });
    if covariance.len() != n_parameters * n_parameters {
        let needed = "give its n × n covariance, n the number of parameters";
        return invalid("intrinsics covariance size", covariance.len() as f64, needed);
    }
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return invalid("intrinsics covariance", seen, "every entry must be finite");
    }
    let variances = (0..n_parameters).map(|i| covariance[i * n_parameters + i]);
    match variances.into_iter().find(|x| *x < 0.0) {
        Some(seen) => invalid("intrinsics covariance", seen, "no variance can be negative"),
        None => Ok(()),
    }
}
