//! Parameters that all points of a view share, intrinsics and the scale of a printed target: their uncertainty widens an answer's covariance,
//! and it explains a part of the residual.
//!
//! ```text
//!   K  derivative of the predicted pixels by the parameters θ, whitened  ·  J  the same by the pose  ·  r  whitened residual
//!   G = JᵀK,  M = Kᵀ(1 − JΣJᵀ)K = KᵀK − GᵀΣG,  h = Kᵀr,  C = Cov(θ)
//! ```
//! Derivation: docs/math/refine.md eq. (9), docs/math/posterior.md eqs. (7)–(10), docs/math/printed_scale.md eqs. (3), (4).

use crate::camera::MAX_PARAMETERS;
use crate::covariance::is_covariance;
use crate::least_squares::PivotedPose;
use crate::locate::choose::Minimum;
use crate::locate::group::RigidGroup;
use crate::locate::problem::Problem;
use crate::locate::refine::{information, normal_equations};
use crate::{Correspondence, Error, Matrix6, Point, Vector6};
use arrayvec::ArrayVec;
use core::ops::Range;
use nalgebra::{SMatrix, SVector, Vector2};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The camera's, and the target's scale along x and y.
const MOST_COMMON: usize = MAX_PARAMETERS + 2;

type Square = SMatrix<f64, MOST_COMMON, MOST_COMMON>;
type Vector = SVector<f64, MOST_COMMON>;

/// What all points of a view share, and how well it is known.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Common<'a> {
    /// Covariance of the camera's parameters, row by row; none: exact.
    pub(crate) intrinsics: Option<&'a [f64]>,
    /// Standard deviations of the target's scale along its x and y, relative; 0 when exact.
    pub(crate) scale_sigma: [f64; 2],
}

impl Common<'_> {
    /// Whether there is nothing to allow for.
    pub(crate) fn is_exact(&self) -> bool {
        self.intrinsics.is_none() && self.scale_sigma == [0.0; 2]
    }

    /// # Errors
    /// `InvalidTarget` for standard deviations that cannot be. The intrinsics' covariance is checked where the camera's parameters are counted.
    pub(crate) fn check(&self) -> Result<(), Error> {
        match self.scale_sigma.into_iter().find(|sigma| !(0.0 <= *sigma && (sigma * sigma).is_finite())) {
            Some(seen) => {
                let needed = "the standard deviation of a printed scale is zero or positive";
                Err(Error::InvalidTarget { parameter: "printed_scale sigma", seen, needed })
            }
            None => Ok(()),
        }
    }
}

/// How the residual depends on the common parameters at one minimum. Rows and columns beyond them are zero.
#[derive(Clone)]
pub(crate) struct Dependence {
    /// Columns of G.
    by_parameter: [Vector6; MOST_COMMON],
    /// KᵀK.
    information: Square,
    /// h.
    gradient: Vector,
    /// C.
    covariance: Square,
    n_parameters: usize,
    /// Whether the camera's parameters come first.
    has_intrinsics: bool,
}

impl Dependence {
    /// At a minimum: the camera's parameters first, if they are uncertain, then the two of the scale.
    pub(crate) fn at(m: &Minimum, problem: &Problem, common: &Common) -> Result<Self, Error> {
        let mut dependence = Dependence::none(common.intrinsics.is_some());
        dependence.add_all(m, problem).ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
        let n = dependence.n_parameters.saturating_sub(common.scale_sigma.len());
        for (i, sigma) in common.scale_sigma.iter().enumerate() {
            dependence.covariance[(n + i, n + i)] = sigma * sigma;
        }
        let Some(covariance) = common.intrinsics else { return Ok(dependence) };
        check_intrinsics_covariance(covariance, n)?;
        for (index, entry) in covariance.iter().enumerate() {
            dependence.covariance[(index / n, index % n)] = *entry;
        }
        if !is_covariance(&dependence.covariance) {
            let seen = dependence.covariance.symmetric_eigenvalues().min();
            let needed = "it must be symmetric, and its least eigenvalue not negative";
            return Err(Error::InvalidCamera { parameter: "intrinsics covariance", seen, needed });
        }
        Ok(dependence)
    }

    /// With one more point; none where it leaves the field.
    #[cfg(feature = "std")]
    pub(crate) fn and(&self, m: &Minimum, c: &Correspondence, problem: &Problem) -> Option<Self> {
        let mut more = self.clone();
        more.add(m, c, problem)?;
        Some(more)
    }

    /// Columns of G by the camera's parameters; none where these are exact.
    #[cfg(feature = "std")]
    pub(crate) fn by_intrinsics(&self) -> &[Vector6] {
        let n = if self.has_intrinsics { self.n_parameters.saturating_sub(2) } else { 0 };
        &self.by_parameter[..n]
    }

    fn none(has_intrinsics: bool) -> Self {
        Dependence {
            by_parameter: [Vector6::zeros(); MOST_COMMON],
            information: Square::zeros(),
            gradient: Vector::zeros(),
            covariance: Square::zeros(),
            n_parameters: 0,
            has_intrinsics,
        }
    }

    fn add_all(&mut self, m: &Minimum, problem: &Problem) -> Option<()> {
        let mut next = 0;
        for group in problem.groups {
            self.add_each(m, problem.seen.get(next..group.first)?, problem)?;
            self.add_group(m, group, problem)?;
            next = group.end();
        }
        self.add_each(m, problem.seen.get(next..)?, problem)
    }

    fn add_each(&mut self, m: &Minimum, seen: &[Correspondence], problem: &Problem) -> Option<()> {
        seen.iter().try_for_each(|c| self.add(m, c, problem))
    }

    /// Points displaced together: with E = S (I + N S)⁻¹ of the group, its G becomes (I + N S)⁻¹ G, KᵀK loses GᵀEG and h loses GᵀEg,
    /// docs/math/tag_map.md eq. (6).
    fn add_group(&mut self, m: &Minimum, group: &RigidGroup, problem: &Problem) -> Option<()> {
        let seen = problem.seen.get(group.first..group.end())?;
        let mut own = Dependence::none(self.has_intrinsics);
        own.add_each(m, seen, problem)?;
        let left = Problem { seen, priors: &[], groups: &[], ..*problem };
        let origin =
            PivotedPose { rotation: m.cam_from_target.rotation, pivot_in_cam: m.cam_from_target.translation };
        let normal = normal_equations(&origin, &Point::zeros(), &left)?;
        let normal_gradient = normal.gradient_at_camera(&origin.pivot_in_cam);
        let mut to_camera = Matrix6::identity();
        to_camera.fixed_view_mut::<3, 3>(0, 3).copy_from(&origin.pivot_in_cam.cross_matrix());
        let information = to_camera * normal.information() * to_camera.transpose();
        let motion = group.motion_covariance(&(m.cam_from_target * group.centre_in_target));
        let share = (Matrix6::identity() + information * motion).try_inverse()?;
        let explained = motion * share;
        for i in 0..own.n_parameters {
            let pulled = explained.tr_mul(&own.by_parameter[i]);
            self.gradient[i] += own.gradient[i] - pulled.dot(&normal_gradient);
            for j in 0..own.n_parameters {
                self.information[(i, j)] += own.information[(i, j)] - pulled.dot(&own.by_parameter[j]);
            }
            self.by_parameter[i] += share * own.by_parameter[i];
        }
        self.n_parameters = own.n_parameters;
        Some(())
    }

    fn add(&mut self, m: &Minimum, c: &Correspondence, problem: &Problem) -> Option<()> {
        let x = m.cam_from_target * c.x_in_target;
        let (pixel, jacobian) = problem.camera.project_with_jacobian(&x)?;
        let mut columns: ArrayVec<Vector2<f64>, MOST_COMMON> = ArrayVec::new();
        if self.has_intrinsics {
            columns.extend(problem.camera.intrinsics_jacobian(&x)?);
        }
        // docs/math/printed_scale.md eq. (3): a longer print moves a point along the target's axis by its own coordinate.
        let rotation = &m.cam_from_target.rotation;
        columns.extend([0, 1].map(|axis| jacobian * rotation.column(axis) * c.x_in_target[axis]));
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
        self.share_of(0..self.n_parameters, covariance)
    }

    /// The shares of the intrinsics and of the scale, whose errors are independent.
    pub(crate) fn shares(&self, covariance: &Matrix6) -> [Matrix6; 2] {
        let n = if self.has_intrinsics { self.n_parameters.saturating_sub(2) } else { 0 };
        [0..n, n..self.n_parameters].map(|range| self.share_of(range, covariance))
    }

    fn share_of(&self, parameters: Range<usize>, covariance: &Matrix6) -> Matrix6 {
        let mut share = Matrix6::zeros();
        for i in parameters.clone() {
            for j in parameters.clone() {
                share += self.by_parameter[i] * self.by_parameter[j].transpose() * self.covariance[(i, j)];
            }
        }
        covariance * share * covariance
    }

    /// The part of χ² that the parameters explain, hᵀ C (1 + M C)⁻¹ h, docs/math/posterior.md eq. (10), and how much larger they make
    /// the residual's covariance, log det(1 + M C), eq. (10a). `covariance` is that of the pose by the pixels.
    pub(crate) fn explained(&self, covariance: &Matrix6) -> (f64, f64) {
        let mut left = self.information;
        for i in 0..self.n_parameters {
            let pulled = covariance * self.by_parameter[i];
            for j in 0..self.n_parameters {
                left[(i, j)] -= pulled.dot(&self.by_parameter[j]);
            }
        }
        let system = Square::identity() + left * self.covariance;
        let system = system.lu();
        let solved = system.solve(&self.gradient);
        let explained = solved.map_or(0.0, |x| self.gradient.dot(&(self.covariance * x)));
        let log_determinant = system.determinant().ln();
        let number = |x: f64| if x.is_finite() { x.max(0.0) } else { 0.0 };
        (number(explained), number(log_determinant))
    }
}

/// Refuses a matrix that is no covariance: another size, not finite, a negative variance.
pub(crate) fn check_intrinsics_covariance(covariance: &[f64], n_parameters: usize) -> Result<(), Error> {
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
