//! The loop for the position of one point.

use super::{LeastSquares, Minimum, Tolerance, minimize};
use crate::Point;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// The Gauss–Newton approximation of the cost of one point.
#[derive(Debug, Clone, Copy)]
pub struct PointEquations {
    /// Sum of squared whitened residuals.
    pub chi2: f64,
    /// Jᵀ W r, r = observed − predicted.
    pub gradient: Vector3<f64>,
    /// Jᵀ W J, m⁻².
    pub information: Matrix3<f64>,
}

/// A minimum over the positions of a point.
pub type PointMinimum = Minimum<Point, PointEquations>;

impl PointEquations {
    /// Starts without views.
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

    /// Returns the damped step and its promise.
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

struct PointCost<F>(F);

impl<F: Fn(&Point) -> Option<PointEquations>> LeastSquares for PointCost<F> {
    type State = Point;
    type Equations = PointEquations;
    type Step = Vector3<f64>;

    fn evaluate(&self, place: &Point) -> Option<PointEquations> {
        self.0(place)
    }

    fn chi2(equations: &PointEquations) -> f64 {
        equations.chi2
    }

    fn step(&self, equations: &PointEquations, damping: f64) -> Option<(Vector3<f64>, f64)> {
        equations.step(damping)
    }

    fn apply(&self, place: &Point, step: &Vector3<f64>) -> Option<Point> {
        Some(place + step)
    }
}

/// Minimises a cost over the position of a point. `evaluate` returns `None` where the point leaves a camera's field.
pub fn minimize_point(
    start: &Point,
    evaluate: impl Fn(&Point) -> Option<PointEquations>,
) -> Option<PointMinimum> {
    minimize(&PointCost(evaluate), *start, &Tolerance::FINE)
}
