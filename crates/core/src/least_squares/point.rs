//! Levenberg–Marquardt on the place of one point.

use super::{Damping, LAST_DAMPING, MAX_STEPS, TOLERANCE_CHI2, TOLERANCE_RELATIVE};
use crate::Point;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Gauss–Newton's view of the cost of one point.
#[derive(Debug, Clone, Copy)]
pub struct PointEquations {
    /// Sum of squared whitened residuals.
    pub chi2: f64,
    /// Jᵀ W r, r = observed − predicted.
    pub gradient: Vector3<f64>,
    /// Jᵀ W J, m⁻².
    pub information: Matrix3<f64>,
}

/// Where the loop ended.
#[derive(Debug, Clone, Copy)]
pub struct PointSolution {
    /// The minimum.
    pub place: Point,
    /// The equations one vanishing step before it.
    pub equations: PointEquations,
    /// Whether the last step promised less than the tolerance.
    pub converged: bool,
}

impl PointEquations {
    /// No view yet.
    pub fn zero() -> Self {
        PointEquations { chi2: 0.0, gradient: Vector3::zeros(), information: Matrix3::zeros() }
    }

    /// Adds a view: its residual (observed − predicted), the inverse covariance of it and the derivative of the prediction.
    pub fn add(&mut self, residual: &Vector2<f64>, weight: &Matrix2<f64>, by_point: &Matrix2x3<f64>) {
        let pull = weight * residual;
        self.chi2 += residual.dot(&pull);
        self.gradient += by_point.tr_mul(&pull);
        self.information += by_point.tr_mul(&(weight * by_point));
    }

    /// The damped step and what it promises.
    fn step(&self, damping: f64) -> Option<(Vector3<f64>, f64)> {
        let mut damped = self.information;
        for i in 0..3 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&self.gradient);
        let promised = step.dot(&self.gradient);
        promised.is_finite().then_some((step, promised))
    }
}

/// Minimises a cost over the place of a point. `evaluate` returns none where it leaves a camera's field.
pub fn minimize_point(
    start: &Point,
    evaluate: impl Fn(&Point) -> Option<PointEquations>,
) -> Option<PointSolution> {
    let (mut place, mut equations, mut damping) = (*start, evaluate(start)?, Damping::NONE);
    for _ in 0..MAX_STEPS {
        let Some((step, promised)) = equations.step(damping.value) else {
            if LAST_DAMPING <= damping.value {
                break;
            }
            damping.raise();
            continue;
        };
        if promised <= TOLERANCE_CHI2 + TOLERANCE_RELATIVE * equations.chi2 {
            return Some(PointSolution { place: place + step, equations, converged: true });
        }
        match evaluate(&(place + step)).filter(|e| e.chi2 < equations.chi2) {
            Some(better) => {
                damping.ease((equations.chi2 - better.chi2) / promised);
                (place, equations) = (place + step, better);
            }
            None if LAST_DAMPING <= damping.value => {
                return Some(PointSolution { place, equations, converged: true });
            }
            None => damping.raise(),
        }
    }
    Some(PointSolution { place, equations, converged: false })
}
