//! The error budget of an answer: its covariance as a sum of parts, each from one source of error.
//!
//! An estimate is linear in the errors of what it is estimated from, so that the covariances of independent errors add up. Derivation:
//! docs/math/budget.md.

use crate::Matrix6;
use crate::pose::symmetric;
use arrayvec::ArrayVec;
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, DimDiff, DimSub, OMatrix, OVector, SymmetricEigen, U1};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A source of the errors of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorSource {
    /// Noise of single pixels, as stated.
    Pixels,
    /// Errors of poses of cameras and of relative poses of pairs, as their file states them or, where it does not, as the pairs show them.
    CameraPoses,
    /// What noise does beyond first order, where the likelihood is bent.
    Bend,
    /// Errors that the points of one view share: a bent board, corners that are all displaced to one side, cameras that are not synchronised.
    SharedInView,
    /// Errors that neighbouring views share, in time or in where the robot is.
    SharedInBlock,
    /// Intrinsics, as uncertain as stated or as the views show.
    Lens,
    /// The choice of the lens model: others that fit about as well give another answer.
    LensModel,
    /// The target's size and shape and the positions of its points.
    Target,
    /// Coordinates of control points, as uncertain as stated.
    ControlPoints,
    /// Measured lengths, as uncertain as stated.
    Distances,
    /// The robot's poses at the gripper: orientation about the gripper's own origin, and position; all of a stated noise of the robot.
    RobotAtGripper,
    /// The robot's poses in the base: orientation about the base's origin, as of the first joints of an arm.
    RobotInBase,
    /// When each camera of a rig saw a moving target.
    TimeOffsets,
    /// What is stated about the answer besides the observations.
    Priors,
    /// By how much observations disagree beyond the stated errors, or hide it because those beyond a threshold are left out.
    Residuals,
}

/// How many sources there are.
const N_SOURCES: usize = 15;

impl ErrorSource {
    /// All sources, in the order in which a budget lists them.
    pub const ALL: [ErrorSource; N_SOURCES] = [
        ErrorSource::Pixels,
        ErrorSource::CameraPoses,
        ErrorSource::Bend,
        ErrorSource::SharedInView,
        ErrorSource::SharedInBlock,
        ErrorSource::Lens,
        ErrorSource::LensModel,
        ErrorSource::Target,
        ErrorSource::ControlPoints,
        ErrorSource::Distances,
        ErrorSource::RobotAtGripper,
        ErrorSource::RobotInBase,
        ErrorSource::TimeOffsets,
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
            ErrorSource::SharedInBlock => "shared_in_block",
            ErrorSource::Lens => "lens",
            ErrorSource::LensModel => "lens_model",
            ErrorSource::Target => "target",
            ErrorSource::ControlPoints => "control_points",
            ErrorSource::Distances => "distances",
            ErrorSource::RobotAtGripper => "robot_at_gripper",
            ErrorSource::RobotInBase => "robot_in_base",
            ErrorSource::TimeOffsets => "time_offsets",
            ErrorSource::Priors => "priors",
            ErrorSource::Residuals => "residuals",
        }
    }
}

/// Where a sentence that doubts an answer is in the answer's numbers. Every sentence of a job has one by an exhaustive match, and a test requires
/// that the part is there, or that the status is not `ok`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accounted {
    /// At least one of these sources has a part in the covariance.
    Parts(&'static [ErrorSource]),
    /// The status of the answer is not `ok`.
    Status,
    /// The sentence doubts nothing: it says what took no part, what nothing checks, or what would make the answer better.
    Nothing,
}

/// Something that a job may say against its answer.
pub trait Warning {
    /// Returns where it is in the numbers.
    fn accounted(&self) -> Accounted;
}

impl Accounted {
    /// Returns whether an answer with this budget and status holds the doubt.
    pub fn is_held<M>(&self, budget: &Budget<M>, is_ok: bool) -> bool {
        match self {
            Accounted::Parts(sources) => !is_ok || sources.iter().any(|source| budget.has(*source)),
            Accounted::Status => !is_ok,
            Accounted::Nothing => true,
        }
    }
}

/// The part of a covariance that has one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BudgetPart<M = Matrix6> {
    /// The source.
    pub source: ErrorSource,
    /// What the source contributes to the covariance that the budget states, positive semidefinite; 6×6 of a small motion for a pose.
    pub covariance: M,
}

/// The parts of a covariance, in the order of [`ErrorSource::ALL`]; sources that contribute nothing have none.
#[derive(Debug, Clone, PartialEq)]
pub struct Budget<M = Matrix6> {
    parts: ArrayVec<BudgetPart<M>, N_SOURCES>,
}

/// Steps of the decomposition of a few rows; it needs two for each.
const MAX_STEPS: usize = 200;

impl<M> Default for Budget<M> {
    fn default() -> Self {
        Budget { parts: ArrayVec::new() }
    }
}

impl<M> Budget<M> {
    /// The parts.
    pub fn parts(&self) -> &[BudgetPart<M>] {
        &self.parts
    }

    /// Returns whether a source contributes anything.
    pub fn has(&self, source: ErrorSource) -> bool {
        self.parts.iter().any(|part| part.source == source)
    }

    /// The fraction that a part has of what `variance` returns, such as the sum over some axes.
    pub fn share_of(&self, part: &BudgetPart<M>, variance: impl Fn(&M) -> f64) -> f64 {
        let whole: f64 = self.parts.iter().map(|part| variance(&part.covariance)).sum();
        if 0.0 < whole { variance(&part.covariance) / whole } else { 0.0 }
    }
}

impl Budget {
    /// The whole covariance.
    pub fn covariance(&self) -> Matrix6 {
        self.parts.iter().map(|part| part.covariance).sum()
    }

    /// The fraction that a part has of the variance of the position, the sum over its three axes.
    pub fn position_share(&self, part: &BudgetPart) -> f64 {
        self.share_of(part, |covariance| (3..6).map(|i| covariance[(i, i)]).sum())
    }
}

impl<D: Dim> Budget<OMatrix<f64, D, D>>
where
    DefaultAllocator: Allocator<D, D>,
{
    /// Adds to the part of a source; nothing where the covariance is zero.
    pub fn add(&mut self, source: ErrorSource, covariance: &OMatrix<f64, D, D>) {
        if covariance.iter().all(|x| *x == 0.0) {
            return;
        }
        match self.parts.iter_mut().find(|part| part.source == source) {
            Some(part) => part.covariance += covariance,
            None => {
                let place = |s: ErrorSource| ErrorSource::ALL.iter().position(|known| *known == s);
                let at = self.parts.iter().take_while(|part| place(part.source) < place(source)).count();
                self.parts.insert(at, BudgetPart { source, covariance: covariance.clone() });
            }
        }
    }

    /// The budget of a linear function of these errors, `by` times them.
    pub fn transformed<E: Dim>(&self, by: &OMatrix<f64, E, D>) -> Budget<OMatrix<f64, E, E>>
    where
        DefaultAllocator: Allocator<E, E> + Allocator<E, D> + Allocator<D, E>,
    {
        let mut parts = ArrayVec::new();
        for BudgetPart { source, covariance } in &self.parts {
            let moved = by * covariance * by.transpose();
            parts.push(BudgetPart { source: *source, covariance: (&moved + moved.transpose()) * 0.5 });
        }
        Budget { parts }
    }

    /// The budget with every variance multiplied.
    #[cfg(feature = "std")]
    pub(crate) fn scaled(mut self, by: f64) -> Self {
        self.parts.iter_mut().for_each(|part| part.covariance *= by);
        self
    }
}

impl<D: Dim + DimSub<U1>> Budget<OMatrix<f64, D, D>>
where
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>>,
{
    /// The budget with its parts changed, each by the same linear map and no more than necessary, so that they add up to `whole`:
    /// docs/math/budget.md eq. (7). `None` where a covariance is singular, coordinates without any variance apart.
    pub(crate) fn adding_up_to(mut self, whole: &OMatrix<f64, D, D>) -> Option<Self> {
        let mut roots: ArrayVec<OMatrix<f64, D, D>, N_SOURCES> = ArrayVec::new();
        for part in &self.parts {
            roots.push(root(&part.covariance)?);
        }
        let mut sum = whole * 0.0;
        roots.iter().for_each(|root| sum += root * root.transpose());
        let held = OMatrix::from_diagonal(&sum.diagonal().map(|x| if x == 0.0 { 1.0 } else { 0.0 }));
        let (sum, whole) = (&sum + &held, whole + &held);
        let scale = OMatrix::from_diagonal(&sum.diagonal().map(|x| x.sqrt()));
        let unscale = OMatrix::from_diagonal(&sum.diagonal().map(|x| 1.0 / x.sqrt()));
        let factor = evened(&(&unscale * sum * &unscale)).cholesky()?.l();
        let inverse = factor.clone().try_inverse()?;
        let whitened = evened(&(&inverse * (&unscale * whole * &unscale) * inverse.transpose()));
        let eigen = eigen(&whitened)?;
        let middle = OMatrix::from_diagonal(&eigen.eigenvalues.map(|w| w.max(0.0).sqrt()));
        let middle = &eigen.eigenvectors * middle * eigen.eigenvectors.transpose();
        let map = scale * factor * middle * inverse * unscale;
        for (part, root) in self.parts.iter_mut().zip(&roots) {
            let moved = &map * root;
            part.covariance = evened(&(&moved * moved.transpose()));
        }
        Some(self)
    }
}

/// The symmetric part of a matrix.
fn evened<D: Dim>(matrix: &OMatrix<f64, D, D>) -> OMatrix<f64, D, D>
where
    DefaultAllocator: Allocator<D, D>,
{
    (matrix + matrix.transpose()) * 0.5
}

fn eigen<D: Dim + DimSub<U1>>(matrix: &OMatrix<f64, D, D>) -> Option<SymmetricEigen<f64, D>>
where
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>>,
{
    if !matrix.sum().is_finite() {
        return None;
    }
    SymmetricEigen::try_new(matrix.clone(), f64::EPSILON, MAX_STEPS)
}

/// B with B Bᵀ = a covariance, except for negative variances, which are rounding: each row is judged in its own unit.
fn root<D: Dim + DimSub<U1>>(covariance: &OMatrix<f64, D, D>) -> Option<OMatrix<f64, D, D>>
where
    DefaultAllocator: Allocator<D, D> + Allocator<D> + Allocator<DimDiff<D, U1>>,
{
    let sigma: OVector<f64, D> = covariance.diagonal().map(|x| if 0.0 < x { x.sqrt() } else { 1.0 });
    let unscale = OMatrix::from_diagonal(&sigma.map(|x| 1.0 / x));
    let eigen = eigen(&evened(&(&unscale * covariance * &unscale)))?;
    let roots = OMatrix::from_diagonal(&eigen.eigenvalues.map(|w| w.max(0.0).sqrt()));
    Some(OMatrix::from_diagonal(&sigma) * eigen.eigenvectors * roots)
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
