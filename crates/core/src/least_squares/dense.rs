//! Levenberg–Marquardt on few poses that all touch each other: one dense system.
//!
//! The state is whatever `moved` can move by a step; the caller's equations are Gauss–Newton's view of its cost there.

use super::{Damping, LAST_DAMPING, MAX_STEPS, TOLERANCE_CHI2, TOLERANCE_RELATIVE};
use nalgebra::{DMatrix, DVector};

/// Gauss–Newton's view of a cost of n numbers.
#[derive(Debug, Clone)]
pub(crate) struct DenseEquations {
    /// Sum of squared whitened residuals, or of what a loss makes of them.
    pub chi2: f64,
    /// Jᵀr, n.
    pub gradient: DVector<f64>,
    /// JᵀJ, n×n.
    pub information: DMatrix<f64>,
}

/// Where the loop ended.
#[derive(Debug, Clone)]
pub(crate) struct DenseSolution<S> {
    /// The minimum.
    pub state: S,
    /// The equations one vanishing step before it.
    pub equations: DenseEquations,
    /// Steps taken.
    pub steps: usize,
    /// Whether the last step promised less than the tolerance.
    pub converged: bool,
}

impl DenseEquations {
    /// All zero.
    pub fn new(n: usize) -> Self {
        DenseEquations { chi2: 0.0, gradient: DVector::zeros(n), information: DMatrix::zeros(n, n) }
    }

    /// The damped step and the decrease of χ² it promises; none where the damped matrix is not positive.
    fn step(&self, damping: f64) -> Option<(DVector<f64>, f64)> {
        let mut damped = self.information.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&self.gradient);
        let promised = step.dot(&self.gradient);
        promised.is_finite().then_some((step, promised))
    }
}

/// Minimises a cost over a state. `evaluate` returns none where the cost has no value (a point leaves a camera's field).
pub(crate) fn minimize_dense<S>(
    start: S,
    evaluate: impl Fn(&S) -> Option<DenseEquations>,
    moved: impl Fn(&S, &DVector<f64>) -> S,
) -> Option<DenseSolution<S>> {
    let (mut state, mut damping) = (start, Damping::NONE);
    let mut equations = evaluate(&state)?;
    for steps in 1..=MAX_STEPS {
        if let Some((step, promised)) = equations.step(damping.value) {
            let trial = moved(&state, &step);
            if promised <= TOLERANCE_CHI2 + TOLERANCE_RELATIVE * equations.chi2 {
                return Some(DenseSolution { state: trial, equations, steps, converged: true });
            }
            if let Some(better) = evaluate(&trial).filter(|e| e.chi2 < equations.chi2) {
                damping.ease((equations.chi2 - better.chi2) / promised);
                (state, equations) = (trial, better);
                continue;
            }
        }
        if LAST_DAMPING <= damping.value {
            return Some(DenseSolution { state, equations, steps, converged: true });
        }
        damping.raise();
    }
    Some(DenseSolution { state, equations, steps: MAX_STEPS, converged: false })
}
