//! The loop for many poses together with parameters that all of them share (the camera's intrinsics).
//!
//! A view depends on its own pose and the shared parameters only. Each pose is therefore eliminated by its own 6×6 block (Schur complement), and
//! the remaining system has the size of the shared parameters. Derivation: docs/math/frames.md eqs. (2)–(6).
//!
//!   A  JᵀWJ of one pose, 6×6   ·   B  JᵀWK, 6×k   ·   C  Σ KᵀWK, k×k   ·   a, c  the gradients JᵀWr, Σ KᵀWr

use super::{LeastSquares, Minimum, PivotedPose, Tolerance, minimize};
use crate::camera::MAX_PARAMETERS;
use crate::{Matrix6, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x6, Vector2};

/// The largest number of shared parameters: those of a camera, and the three of a target's shape.
pub const MAX_SHARED: usize = MAX_PARAMETERS + 3;

/// The Gauss–Newton approximation of the whole cost.
#[derive(Debug, Clone)]
pub struct SharedEquations {
    /// Sum of squared whitened residuals over all views, and of the prior of the shared parameters.
    pub chi2: f64,
    /// The part of `chi2` due to prior knowledge.
    pub prior_chi2: f64,
    /// Prior information, k×k; part of C.
    pub prior_information: DMatrix<f64>,
    views: Vec<ViewBlocks>,
    /// c.
    gradient: DVector<f64>,
    /// C.
    information: DMatrix<f64>,
}

/// The contribution of one view.
#[derive(Debug, Clone)]
struct ViewBlocks {
    chi2: f64,
    pose_pose: Matrix6,
    pose_shared: ArrayVec<Vector6, MAX_SHARED>,
    gradient: Vector6,
}

/// The equations of the shared parameters alone, with every pose eliminated: (C − Σ BᵀA⁻¹B) η = c − Σ BᵀA⁻¹a.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// k×k, positive definite where the views determine all the parameters.
    pub information: DMatrix<f64>,
    /// k.
    pub gradient: DVector<f64>,
}

impl Reduced {
    /// Returns the equations of the first `n` parameters, with the others eliminated, and by how much the others lower χ²; `None` where the others
    /// are not determined.
    pub fn first(&self, n: usize) -> Option<(Reduced, f64)> {
        let rest = self.gradient.len().checked_sub(n)?;
        let crossed = self.information.view((0, n), (n, rest));
        let of_rest = self.gradient.rows(n, rest);
        let cholesky = self.information.view((n, n), (rest, rest)).into_owned().cholesky()?;
        let explained = cholesky.solve(&of_rest);
        let information =
            self.information.view((0, 0), (n, n)) - crossed * cholesky.solve(&crossed.transpose());
        let gradient = self.gradient.rows(0, n) - crossed * &explained;
        Some((Reduced { information, gradient }, of_rest.dot(&explained)))
    }
}

/// Many poses, and their shared parameters.
#[derive(Debug, Clone)]
pub struct SharedState {
    /// One pose for each view.
    pub places: Vec<PivotedPose>,
    /// The shared parameters, as changes from the start.
    pub change: DVector<f64>,
}

/// A minimum over poses and shared parameters.
pub type SharedMinimum = Minimum<SharedState, SharedEquations>;

/// A motion for each view, and a change of the shared parameters.
struct Step {
    motions: Vec<Vector6>,
    change: DVector<f64>,
}

struct SharedCost<F, S, const STEPS: usize> {
    evaluate: F,
    settle: S,
}

impl<F, S, const STEPS: usize> LeastSquares for SharedCost<F, S, STEPS>
where
    F: Fn(&SharedState) -> Option<SharedEquations>,
    S: Fn(SharedState) -> SharedState,
{
    type State = SharedState;
    type Equations = SharedEquations;
    type Step = Step;
    const MAX_STEPS: usize = STEPS;

    fn evaluate(&self, state: &SharedState) -> Option<SharedEquations> {
        (self.evaluate)(state)
    }

    fn chi2(equations: &SharedEquations) -> f64 {
        equations.chi2
    }

    fn step(&self, equations: &SharedEquations, damping: f64) -> Option<(Step, f64)> {
        equations.step(damping)
    }

    fn apply(&self, state: &SharedState, step: &Step) -> Option<SharedState> {
        let places = state.places.iter().zip(&step.motions).map(|(place, motion)| place.moved(motion));
        Some((self.settle)(SharedState { places: places.collect(), change: &state.change + &step.change }))
    }
}

/// Minimises a cost over all poses and `n_shared` parameters that start at zero change. `evaluate` returns `None` where a point leaves the
/// camera's field, or where the parameters are invalid.
pub fn minimize_shared(
    places: Vec<PivotedPose>,
    n_shared: usize,
    evaluate: impl Fn(&SharedState) -> Option<SharedEquations>,
) -> Option<SharedMinimum> {
    let start = SharedState { places, change: DVector::zeros(n_shared) };
    minimize(&SharedCost::<_, _, STEPS> { evaluate, settle: |state| state }, start, &Tolerance::FINE)
}

/// Largest number of steps.
const STEPS: usize = 100;

/// Minimises from a state, with `settle` moving each pose to its own minimum after every step. A frontal view of a plane, between its two
/// solutions, is far from quadratic: the damping that it requires would slow all other poses and the shared parameters to a crawl.
pub fn minimize_settled(
    start: SharedState,
    evaluate: impl Fn(&SharedState) -> Option<SharedEquations>,
    settle: impl Fn(SharedState) -> SharedState,
) -> Option<SharedMinimum> {
    minimize(&SharedCost::<_, _, STEPS> { evaluate, settle }, start, &Tolerance::FINE)
}

impl SharedEquations {
    /// Returns zeros, without views.
    pub fn new(n_shared: usize) -> Self {
        let (gradient, information) = (DVector::zeros(n_shared), DMatrix::zeros(n_shared, n_shared));
        SharedEquations {
            chi2: 0.0,
            prior_chi2: 0.0,
            prior_information: information.clone(),
            views: Vec::new(),
            gradient,
            information,
        }
    }

    /// Returns the number of shared parameters.
    pub fn n_shared(&self) -> usize {
        self.gradient.len()
    }

    /// Begins the next view, to which everything added from now on belongs.
    pub fn next_view(&mut self) {
        let pose_shared = self.gradient.iter().map(|_| Vector6::zeros()).collect();
        let (pose_pose, gradient) = (Matrix6::zeros(), Vector6::zeros());
        self.views.push(ViewBlocks { chi2: 0.0, pose_pose, pose_shared, gradient });
    }

    /// Adds a point of the current view: its residual (observed − predicted), the inverse covariance W of it, and the derivatives
    /// of the prediction by the motion (J) and by the shared parameters (the rows of K, so that sums run along the processor's lanes).
    pub fn add(
        &mut self,
        residual: &Vector2<f64>,
        weight: &Matrix2<f64>,
        by_motion: &Matrix2x6<f64>,
        by_shared: [&[f64]; 2],
    ) {
        let Some(view) = self.views.last_mut() else { return };
        let (wr, wj) = (weight * residual, weight * by_motion);
        let chi2 = residual.dot(&wr);
        self.chi2 += chi2;
        view.chi2 += chi2;
        view.gradient += by_motion.tr_mul(&wr);
        view.pose_pose += by_motion.tr_mul(&wj);
        let [u, v] = by_shared;
        let wj: [[f64; 6]; 2] = [0, 1].map(|row| core::array::from_fn(|i| wj[(row, i)]));
        let columns = self.information.as_mut_slice().chunks_exact_mut(u.len().max(1));
        let gradient = self.gradient.as_mut_slice();
        for ((((x, y), crossed), pull), column) in
            u.iter().zip(v).zip(&mut view.pose_shared).zip(gradient).zip(columns)
        {
            for i in 0..6 {
                crossed[i] += wj[0][i] * x + wj[1][i] * y;
            }
            *pull += x * wr.x + y * wr.y;
            let (wx, wy) = (weight.m11 * x + weight.m12 * y, weight.m21 * x + weight.m22 * y);
            // Computing the whole column is as fast as one triangle.
            for ((entry, u), v) in column.iter_mut().zip(u).zip(v) {
                *entry += u * wx + v * wy;
            }
        }
    }

    /// Adds prior knowledge of the shared parameters: a residual (known − current), the inverse variance of it, and its
    /// derivatives by the shared parameters.
    pub fn add_known(&mut self, residual: f64, weight: f64, by_shared: &DVector<f64>) {
        let chi2 = weight * residual * residual;
        self.chi2 += chi2;
        self.prior_chi2 += chi2;
        self.gradient += by_shared * (weight * residual);
        let information = by_shared * by_shared.transpose() * weight;
        self.information += &information;
        self.prior_information += information;
    }

    /// Returns χ² of each view.
    pub fn chi2_of_views(&self) -> impl Iterator<Item = f64> + '_ {
        self.views.iter().map(|view| view.chi2)
    }

    /// Returns the equations of the shared parameters alone; `None` where a view does not determine its pose.
    pub fn reduced(&self) -> Option<Reduced> {
        self.eliminated(0.0).map(|(reduced, _)| reduced)
    }

    /// Covariance of the motion of each view's pose about its pivot, the shared parameters having `covariance`.
    pub fn pose_covariances(&self, covariance: &DMatrix<f64>) -> Option<Vec<Matrix6>> {
        let of_view = |view: &ViewBlocks| {
            let inverse = view.pose_pose.cholesky()?.inverse();
            let by_shared: Vec<Vector6> = view.pose_shared.iter().map(|column| inverse * column).collect();
            let mut total = inverse;
            for (i, left) in by_shared.iter().enumerate() {
                for (j, right) in by_shared.iter().enumerate() {
                    total += left * right.transpose() * covariance[(i, j)];
                }
            }
            Some(total)
        };
        self.views.iter().map(of_view).collect()
    }

    /// Returns the reduced equations and A⁻¹ of each view, damped.
    fn eliminated(&self, damping: f64) -> Option<(Reduced, Vec<Matrix6>)> {
        let mut reduced = Reduced { information: self.information.clone(), gradient: self.gradient.clone() };
        for i in 0..self.gradient.len() {
            reduced.information[(i, i)] *= 1.0 + damping;
        }
        let mut inverses = Vec::with_capacity(self.views.len());
        for view in &self.views {
            let mut pose_pose = view.pose_pose;
            for i in 0..6 {
                pose_pose[(i, i)] *= 1.0 + damping;
            }
            let inverse = pose_pose.cholesky()?.inverse();
            for (i, column) in view.pose_shared.iter().enumerate() {
                let solved = inverse * column;
                reduced.gradient[i] -= solved.dot(&view.gradient);
                for (j, other) in view.pose_shared.iter().enumerate() {
                    reduced.information[(i, j)] -= solved.dot(other);
                }
            }
            inverses.push(inverse);
        }
        Some((reduced, inverses))
    }

    fn step(&self, damping: f64) -> Option<(Step, f64)> {
        let (reduced, inverses) = self.eliminated(damping)?;
        let change = reduced.information.cholesky()?.solve(&reduced.gradient);
        let motion = |(view, inverse): (&ViewBlocks, &Matrix6)| {
            let mut pull = view.gradient;
            for (column, change) in view.pose_shared.iter().zip(change.iter()) {
                pull -= column * *change;
            }
            inverse * pull
        };
        let motions: Vec<Vector6> = self.views.iter().zip(&inverses).map(motion).collect();
        let of_poses: f64 = self.views.iter().zip(&motions).map(|(view, m)| view.gradient.dot(m)).sum();
        let promised = of_poses + self.gradient.dot(&change);
        promised.is_finite().then_some((Step { motions, change }, promised))
    }
}
