//! The errors amid which the sizes of motions are estimated, by weighted least squares whose weights are those of one coordinate for all:
//! docs/math/fleet.md eq. (16).
//!
//! A slow motion that is none of those that are reported, such as an undeclared diurnal variation, shows in the coordinates that are measured
//! well and hides in the noise of the others. Where it shows, all coordinates are weighed as the one in which it shows most: what a mean of few
//! readings near a step cancels in one coordinate, it cancels in all.

use super::series::{Correlated, DAY_S, Jump, Ramp, Series};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A correlated error that is forgotten in less than this, seconds, is not mistaken for diurnal variation.
const LASTING_S: f64 = DAY_S / 16.0;

/// ln of the likelihood that a correlated error must gain to be one: the square of four standard deviations, by half.
const SHOWN: f64 = 8.0;

/// Errors of the whitened coordinates.
pub(super) struct Amid<'a> {
    series: Vec<Series<'a>>,
    errors: Vec<Correlated>,
    /// Variance of the diurnal variation, stated or possible.
    diurnal: Vec<f64>,
    /// A ramp that is removed, and the variance of its size in each coordinate.
    ramp: Option<(Ramp, [f64; 6])>,
    /// The coordinate in which a correlated error shows most, if it shows in any.
    worst: Option<usize>,
}

impl<'a> Amid<'a> {
    /// The likeliest errors of the first six series, which step by any size at some readings.
    pub fn of(series: &[Series<'a>], steps: &[usize], ramp: Option<(Ramp, [f64; 6])>) -> Self {
        let error = |series: &Series| {
            let wide = 1e6 * series.values.iter().map(|v| v * v).fold(series.typical_variance(), f64::max);
            let jumps: Vec<Jump> = steps.iter().map(|at| Jump { at: *at, variance: wide }).collect();
            let (log_p, error) = series.likeliest(&jumps, f64::INFINITY);
            let white = Correlated { sigma: 0.0, ..error };
            (error, SHOWN < log_p - series.log_likelihood(&white, &jumps))
        };
        let series: Vec<Series> = series[..6].to_vec();
        let (errors, is_shown): (Vec<Correlated>, Vec<bool>) = series.iter().map(error).unzip();
        let diurnal: Vec<f64> = (0..6)
            .map(|axis| {
                series[axis].diurnal_sigma.powi(2)
                    + if is_shown[axis] { diurnal(&series[axis], &errors[axis]) } else { 0.0 }
            })
            .collect();
        let size =
            |axis: &usize| (diurnal[*axis] + errors[*axis].sigma.powi(2)) / series[*axis].typical_variance();
        let worst = (0..6).filter(|axis| is_shown[*axis]).max_by(|a, b| size(a).total_cmp(&size(b)));
        Amid { series, errors, diurnal, ramp, worst }
    }

    /// Covariance of some readings along a coordinate.
    fn covariance(&self, axis: usize, used: &[usize]) -> DMatrix<f64> {
        let (series, error) = (&self.series[axis], &self.errors[axis]);
        let along = |i: usize| self.ramp.as_ref().map_or(0.0, |(ramp, _)| ramp.at(series.t_s[used[i]]));
        let ramp = self.ramp.as_ref().map_or(0.0, |(_, variances)| variances[axis]);
        DMatrix::from_fn(used.len(), used.len(), |i, j| {
            let apart_s = (series.t_s[used[i]] - series.t_s[used[j]]).abs();
            let own = if i == j { series.variances[used[i]] } else { 0.0 };
            own + error.sigma.powi(2) * (-apart_s / error.time_s).exp()
                + self.diurnal[axis] * (std::f64::consts::TAU * apart_s / DAY_S).cos()
                + ramp * along(i) * along(j)
        })
    }

    /// Least squares of these columns over some readings; `None` where they are not independent.
    pub fn fit(&self, used: &[usize], columns: &DMatrix<f64>) -> Option<LeastSquares> {
        let covariances: Vec<DMatrix<f64>> = (0..6).map(|axis| self.covariance(axis, used)).collect();
        let weighed_as: Vec<usize> = (0..6).map(|axis| self.worst.unwrap_or(axis)).collect();
        let of = |axis: usize| covariances[axis].clone().cholesky();
        let factors: Vec<Option<Cholesky<f64, Dyn>>> = match self.worst {
            Some(worst) => (0..6).map(|axis| if axis == worst { of(axis) } else { None }).collect(),
            None => (0..6).map(of).collect(),
        };
        LeastSquares { covariances, factors, weighed_as, solved: Vec::new() }.with(columns)
    }
}

/// Of what lasts as long as a day no more is known than that it may be diurnal variation: as large as the correlated error within the record.
fn diurnal(series: &Series, error: &Correlated) -> f64 {
    let within = -2.0 * error.sigma.powi(2) * (-series.span_s() / error.time_s).exp_m1();
    let lasting = error.time_s.powi(2) / (error.time_s.powi(2) + LASTING_S.powi(2));
    within * lasting
}

/// Columns, and the estimator of their coefficients.
struct Solved {
    columns: DMatrix<f64>,
    /// A row for each column: the weights of the readings in its coefficient.
    weights: DMatrix<f64>,
}

impl Solved {
    fn of(columns: &DMatrix<f64>, factor: &Cholesky<f64, Dyn>) -> Option<Self> {
        let weighed = factor.solve(columns);
        let inverse = (columns.transpose() * &weighed).try_inverse()?;
        let weights = inverse * weighed.transpose();
        weights.iter().all(|w| w.is_finite()).then(|| Solved { columns: columns.clone(), weights })
    }
}

/// Columns fitted to six coordinates at once.
pub(super) struct LeastSquares {
    covariances: Vec<DMatrix<f64>>,
    /// Of the coordinates that give weights.
    factors: Vec<Option<Cholesky<f64, Dyn>>>,
    /// The coordinate that gives the weights of each.
    weighed_as: Vec<usize>,
    solved: Vec<Option<Solved>>,
}

impl LeastSquares {
    /// The same readings with other columns.
    pub fn with(self, columns: &DMatrix<f64>) -> Option<Self> {
        let of = |factor: &Option<Cholesky<f64, Dyn>>| match factor {
            Some(factor) => Solved::of(columns, factor).map(Some),
            None => Some(None),
        };
        let solved = self.factors.iter().map(of).collect::<Option<Vec<Option<Solved>>>>()?;
        self.weighed_as.iter().all(|axis| solved[*axis].is_some()).then_some(LeastSquares { solved, ..self })
    }

    fn solved(&self, axis: usize) -> Option<&Solved> {
        self.solved[self.weighed_as[axis]].as_ref()
    }

    /// Coefficients of values, all as they are weighed in a coordinate.
    pub fn coefficients(&self, axis: usize, values: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        Some(&self.solved(axis)?.weights * values)
    }

    /// What the columns leave of values.
    pub fn residuals(&self, axis: usize, values: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        Some(values - &self.solved(axis)?.columns * self.coefficients(axis, values)?)
    }

    /// The inverse covariance of the weights, applied.
    pub fn weighed(&self, axis: usize, values: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        Some(self.factors[self.weighed_as[axis]].as_ref()?.solve(values))
    }

    /// Variance of a combination of coefficients of a coordinate.
    pub fn variance(&self, axis: usize, combination: &DVector<f64>) -> Option<f64> {
        let weights = self.solved(axis)?.weights.transpose() * combination;
        Some(weights.dot(&(&self.covariances[axis] * &weights)))
    }
}
