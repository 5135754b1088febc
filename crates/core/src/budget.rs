//! The error budget of a pose: its covariance as a sum of parts, each from one source of error.
//!
//! An estimate is linear in the errors of what it is estimated from, so that the covariances of independent errors add up. Derivation:
//! docs/math/budget.md.

use crate::Matrix6;
use crate::pose::symmetric;
use arrayvec::ArrayVec;
use nalgebra::SymmetricEigen;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A source of the errors of a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorSource {
    /// Noise of single pixels, as stated.
    Pixels,
    /// Errors of the camera's poses, as their file states them.
    CameraPoses,
    /// What noise does beyond first order, where the likelihood is bent.
    Bend,
    /// Errors that the points of one view share: a bent board, corners that are all displaced to one side, cameras that are not synchronised.
    SharedInView,
    /// Intrinsics, as uncertain as stated or as the views show.
    Lens,
    /// The target's size and the positions of its points.
    Target,
    /// The robot's poses.
    Robot,
    /// What is stated about the pose besides the observations.
    Priors,
    /// By how much observations disagree beyond the stated errors, or hide it because those beyond a threshold are left out.
    Residuals,
}

/// How many sources there are.
const N_SOURCES: usize = 9;

impl ErrorSource {
    /// All sources, in the order in which a budget lists them.
    pub const ALL: [ErrorSource; N_SOURCES] = [
        ErrorSource::Pixels,
        ErrorSource::CameraPoses,
        ErrorSource::Bend,
        ErrorSource::SharedInView,
        ErrorSource::Lens,
        ErrorSource::Target,
        ErrorSource::Robot,
        ErrorSource::Priors,
        ErrorSource::Residuals,
    ];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            ErrorSource::Pixels => "pixels",
            ErrorSource::CameraPoses => "camera_poses",
            ErrorSource::Bend => "bend",
            ErrorSource::SharedInView => "shared_in_view",
            ErrorSource::Lens => "lens",
            ErrorSource::Target => "target",
            ErrorSource::Robot => "robot",
            ErrorSource::Priors => "priors",
            ErrorSource::Residuals => "residuals",
        }
    }
}

/// The part of a covariance that has one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetPart {
    /// The source.
    pub source: ErrorSource,
    /// 6×6 covariance of the small motion whose whole covariance the budget states, positive semidefinite.
    pub covariance: Matrix6,
}

/// The parts of a covariance, in the order of [`ErrorSource::ALL`]; sources that contribute nothing have none.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Budget {
    parts: ArrayVec<BudgetPart, N_SOURCES>,
}

/// Steps of the decomposition of six rows; it needs a dozen.
const MAX_STEPS: usize = 200;

impl Budget {
    /// The parts.
    pub fn parts(&self) -> &[BudgetPart] {
        &self.parts
    }

    /// The whole covariance.
    pub fn covariance(&self) -> Matrix6 {
        self.parts.iter().map(|part| part.covariance).sum()
    }

    /// The fraction that a part has of the variance of the position, the sum over its three axes.
    pub fn position_share(&self, part: &BudgetPart) -> f64 {
        let variance = |covariance: &Matrix6| (3..6).map(|i| covariance[(i, i)]).sum::<f64>();
        let whole = variance(&self.covariance());
        if 0.0 < whole { variance(&part.covariance) / whole } else { 0.0 }
    }

    /// Adds to the part of a source; nothing where the covariance is zero.
    pub fn add(&mut self, source: ErrorSource, covariance: &Matrix6) {
        if *covariance == Matrix6::zeros() {
            return;
        }
        match self.parts.iter_mut().find(|part| part.source == source) {
            Some(part) => part.covariance += covariance,
            None => {
                let place = |s: ErrorSource| ErrorSource::ALL.iter().position(|known| *known == s);
                let at = self.parts.iter().take_while(|part| place(part.source) < place(source)).count();
                self.parts.insert(at, BudgetPart { source, covariance: *covariance });
            }
        }
    }

    /// The budget of another small motion, `by` times this one.
    pub(crate) fn transformed(mut self, by: &Matrix6) -> Self {
        for part in &mut self.parts {
            part.covariance = symmetric(&(by * part.covariance * by.transpose()));
        }
        self
    }

    /// The budget with every variance multiplied.
    #[cfg(feature = "std")]
    pub(crate) fn scaled(mut self, by: f64) -> Self {
        self.parts.iter_mut().for_each(|part| part.covariance *= by);
        self
    }

    /// The budget with its parts changed, each by the same linear map and no more than necessary, so that they add up to `whole`:
    /// docs/math/budget.md eq. (7). `None` where a covariance is singular.
    pub(crate) fn adding_up_to(mut self, whole: &Matrix6) -> Option<Self> {
        let mut roots: ArrayVec<Matrix6, N_SOURCES> = ArrayVec::new();
        for part in &self.parts {
            roots.push(root(&part.covariance)?);
        }
        let sum: Matrix6 = roots.iter().map(|root| root * root.transpose()).sum();
        let scale = Matrix6::from_diagonal(&sum.diagonal().map(|x| x.sqrt()));
        let unscale = Matrix6::from_diagonal(&sum.diagonal().map(|x| 1.0 / x.sqrt()));
        let factor = symmetric(&(unscale * sum * unscale)).cholesky()?.l();
        let inverse = factor.try_inverse()?;
        let whitened = symmetric(&(inverse * (unscale * whole * unscale) * inverse.transpose()));
        let eigen = eigen(&whitened)?;
        let middle = Matrix6::from_diagonal(&eigen.eigenvalues.map(|w| w.max(0.0).sqrt()));
        let middle = eigen.eigenvectors * middle * eigen.eigenvectors.transpose();
        let map = scale * factor * middle * inverse * unscale;
        for (part, root) in self.parts.iter_mut().zip(&roots) {
            let moved = map * root;
            part.covariance = symmetric(&(moved * moved.transpose()));
        }
        Some(self)
    }
}

fn eigen(matrix: &Matrix6) -> Option<SymmetricEigen<f64, nalgebra::U6>> {
    if !matrix.sum().is_finite() {
        return None;
    }
    SymmetricEigen::try_new(*matrix, f64::EPSILON, MAX_STEPS)
}

/// B with B Bᵀ = a covariance, except for negative variances, which are rounding: each row is judged in its own unit.
fn root(covariance: &Matrix6) -> Option<Matrix6> {
    let sigma = covariance.diagonal().map(|x| if 0.0 < x { x.sqrt() } else { 1.0 });
    let unscale = Matrix6::from_diagonal(&sigma.map(|x| 1.0 / x));
    let eigen = eigen(&symmetric(&(unscale * covariance * unscale)))?;
    let roots = Matrix6::from_diagonal(&eigen.eigenvalues.map(|w| w.max(0.0).sqrt()));
    Some(Matrix6::from_diagonal(&sigma) * eigen.eigenvectors * roots)
}

/// A direction in which a covariance exceeds another by less than this is one in which they are equal.
const ROUNDING: f64 = 1e-12;

/// What the smallest covariance of the form L (…) Lᵀ that is in every direction at least `least` = L Lᵀ and at least `whole` has beyond
/// `least`: docs/math/shared_error.md eq. (9). `None` where `least` is singular.
pub(crate) fn excess(whole: &Matrix6, least: &Matrix6) -> Option<Matrix6> {
    let factor = least.cholesky()?.l();
    let half = factor.solve_lower_triangular(whole)?;
    let whitened = symmetric(&factor.solve_lower_triangular(&half.transpose())?);
    let eigen = eigen(&whitened)?;
    let axes = factor * eigen.eigenvectors;
    let beyond = eigen.eigenvalues.map(|w| if ROUNDING < w - 1.0 { w - 1.0 } else { 0.0 });
    let excess = axes * Matrix6::from_diagonal(&beyond) * axes.transpose();
    excess.sum().is_finite().then(|| symmetric(&excess))
}
