//! The loop for a state of any kind with up to a few hundred unknowns.
//!
//! ```text
//!   H  JᵀJ of whitened rows  ·  c  Jᵀr, r = observed − predicted  ·  δ  change of the unknowns
//! ```

use super::{LeastSquares, Minimum, Tolerance, minimize};
use core::marker::PhantomData;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The Gauss–Newton approximation of the cost.
#[derive(Debug, Clone)]
pub struct DenseEquations {
    /// Sum of squared whitened residuals.
    pub chi2: f64,
    /// c.
    pub gradient: DVector<f64>,
    /// H; both triangles.
    pub information: DMatrix<f64>,
}

impl DenseEquations {
    /// Starts without rows.
    pub fn new(n: usize) -> Self {
        DenseEquations { chi2: 0.0, gradient: DVector::zeros(n), information: DMatrix::zeros(n, n) }
    }

    /// Adds a whitened residual and the derivatives of what was predicted, by the unknowns they belong to (each once).
    pub fn add(&mut self, residual: f64, entries: &[(usize, f64)]) {
        self.chi2 += residual * residual;
        for (i, by_i) in entries {
            self.gradient[*i] += by_i * residual;
            for (j, by_j) in entries {
                self.information[(*i, *j)] += by_i * by_j;
            }
        }
    }

    /// Returns Cholesky's factor of H with its diagonal raised by `damping`; an unknown on which nothing depends is not changed.
    fn factor(&self, damping: f64) -> Option<Cholesky<f64, Dyn>> {
        let mut damped = self.information.clone();
        for i in 0..damped.nrows() {
            let diagonal = &mut damped[(i, i)];
            *diagonal = if *diagonal == 0.0 { 1.0 } else { *diagonal * (1.0 + damping) };
        }
        damped.cholesky()
    }

    /// Returns the damped step and its promise.
    pub fn step(&self, damping: f64) -> Option<(DVector<f64>, f64)> {
        let step = self.factor(damping)?.solve(&self.gradient);
        let promised = step.dot(&self.gradient);
        promised.is_finite().then_some((step, promised))
    }
}

/// The interface of the equations that the loop needs, independent of their storage.
pub trait NormalEquations {
    /// Returns the sum of squared whitened residuals.
    fn chi2(&self) -> f64;
    /// Returns the damped step and its promise.
    fn step(&self, damping: f64) -> Option<(DVector<f64>, f64)>;
}

impl NormalEquations for DenseEquations {
    fn chi2(&self) -> f64 {
        self.chi2
    }

    fn step(&self, damping: f64) -> Option<(DVector<f64>, f64)> {
        DenseEquations::step(self, damping)
    }
}

struct DenseCost<F, G, S, E> {
    evaluate: F,
    moved: G,
    max_steps: usize,
    state: PhantomData<(S, E)>,
}

impl<F, G, S, E> LeastSquares for DenseCost<F, G, S, E>
where
    F: Fn(&S) -> Option<E>,
    G: Fn(&S, &DVector<f64>) -> Option<S>,
    E: NormalEquations,
{
    type State = S;
    type Equations = E;
    type Step = DVector<f64>;

    fn max_steps(&self) -> usize {
        self.max_steps
    }

    fn evaluate(&self, state: &S) -> Option<E> {
        (self.evaluate)(state)
    }

    fn chi2(equations: &E) -> f64 {
        equations.chi2()
    }

    fn step(&self, equations: &E, damping: f64) -> Option<(DVector<f64>, f64)> {
        equations.step(damping)
    }

    fn apply(&self, state: &S, step: &DVector<f64>) -> Option<S> {
        (self.moved)(state, step)
    }
}

/// Number of evaluations after which the loop gives up.
pub const MAX_STEPS: usize = 200;

/// Minimises a cost. `evaluate` returns `None` where a point leaves a camera's field, `moved` where there is no valid state.
pub fn minimize_dense<S, E: NormalEquations>(
    start: S,
    evaluate: impl Fn(&S) -> Option<E>,
    moved: impl Fn(&S, &DVector<f64>) -> Option<S>,
) -> Option<Minimum<S, E>> {
    minimize_dense_within(MAX_STEPS, start, evaluate, moved)
}

/// Minimises a cost with a given number of evaluations at most.
pub fn minimize_dense_within<S, E: NormalEquations>(
    max_steps: usize,
    start: S,
    evaluate: impl Fn(&S) -> Option<E>,
    moved: impl Fn(&S, &DVector<f64>) -> Option<S>,
) -> Option<Minimum<S, E>> {
    minimize(&DenseCost { evaluate, moved, max_steps, state: PhantomData }, start, &Tolerance::FINE)
}
