//! Fits a hypothesis to the rows under a robust loss.

use super::outline::Place;
use super::row::{Loss, OUTLIER_COST, Row};
use super::state::State;
use nalgebra::{DMatrix, DVector};
use resight_core::least_squares::dense::DenseEquations;
use resight_core::least_squares::{LeastSquares, Tolerance, minimize};

/// A hypothesis at its best parameters.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// Where.
    pub state: State,
    /// Σ of the rows' costs, eq. (9).
    pub cost: f64,
}

/// The terms of each row in a fit.
pub(super) struct Verdicts {
    /// Squared distances, row by row.
    pub squared: Vec<f64>,
    /// Where on the outline.
    pub places: Vec<Place>,
}

/// Costs and their derivatives by the outline's own parameters, eq. (6), then by the hypothesis's.
pub(super) fn equations(rows: &[Row], state: &State, loss: Loss) -> Option<DenseEquations> {
    let outline = state.outline()?;
    let mut own = DenseEquations::new(outline.n_parameters());
    for row in rows {
        let distance = outline.distance(row);
        let (cost, weight) = loss.of(distance.e.norm_squared());
        own.chi2 += cost;
        for (i, by_i) in &distance.by {
            own.gradient[*i] += weight * by_i.dot(&distance.e);
            for (j, by_j) in &distance.by {
                own.information[(*i, *j)] += weight * by_i.dot(by_j);
            }
        }
    }
    let by = state.outline_by_parameters();
    Some(DenseEquations {
        chi2: own.chi2,
        gradient: by.tr_mul(&own.gradient),
        information: by.tr_mul(&own.information) * &by,
    })
}

/// Evaluations allowed each of the two searches: what needs more zigzags at the edges of a wrong hypothesis.
const BUDGET: usize = 25;
/// Further starts are not tried once a fit costs no more than this per row, less than two free directions cost on average.
const EXPLAINED_PER_ROW: f64 = 1.5;
/// Rows that lead a start near its minimum; all rows then find it.
const LEADING: usize = 100;
/// A hypothesis this much worse per row than the best so far is not brought to its end: nothing could save it.
const HOPELESS_PER_ROW: f64 = 1.5;

/// The rows, and every few of them for the first steps.
pub(super) struct Search<'a> {
    rows: &'a [Row],
    leading: Vec<Row>,
}

impl<'a> Search<'a> {
    pub fn new(rows: &'a [Row]) -> Self {
        let stride = rows.len().div_ceil(LEADING).max(1);
        Search { rows, leading: rows.iter().step_by(stride).copied().collect() }
    }

    /// The best fit from one start, brought to its end unless it is hopeless beside a cost of `best`; none where the start is no
    /// outline.
    pub fn fit(&self, start: &State, best: f64) -> Option<Fit> {
        let wide = minimum(&self.leading, start, Loss::Leading)?;
        let cost = equations(self.rows, &wide.state, Loss::Final)?.chi2;
        if !cost.is_finite() {
            return None;
        }
        if best + HOPELESS_PER_ROW * (self.rows.len() as f64) < cost {
            return Some(Fit { cost, state: wide.state });
        }
        minimum(self.rows, &wide.state, Loss::Final)
    }

    /// The best of several starts; one that explains the rows ends the search.
    pub fn best_fit(&self, starts: &[State], best: f64) -> Option<Fit> {
        let mut found: Option<Fit> = None;
        for start in starts {
            let bar = found.as_ref().map_or(best, |fit| fit.cost.min(best));
            let fit = self.fit(start, bar);
            found = [found, fit].into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost));
            if found.as_ref().is_some_and(|fit| fit.cost <= EXPLAINED_PER_ROW * self.rows.len() as f64) {
                break;
            }
        }
        found
    }

    /// Those starts, of a ring of neighbours, that cost less as they are than the ones beside them: the best `kept`.
    pub fn promising(&self, ring: &[State], kept: usize) -> Vec<State> {
        let costs: Vec<f64> = ring.iter().map(|state| self.cost_as_is(state)).collect();
        let n = ring.len();
        let beside = |k: usize| costs[(k + 1) % n].min(costs[(k + n - 1) % n]);
        let mut least: Vec<usize> = (0..n).filter(|k| costs[*k] <= beside(*k)).collect();
        least.sort_by(|i, j| costs[*i].total_cmp(&costs[*j]));
        least.into_iter().take(kept).map(|k| ring[k].clone()).collect()
    }

    fn cost_as_is(&self, state: &State) -> f64 {
        let squared = verdicts(&self.leading, state).squared;
        let total: f64 = squared.iter().map(|squared| Loss::Leading.of(*squared).0).sum();
        if squared.is_empty() { f64::INFINITY } else { total }
    }
}

/// The rows' cost under a loss.
struct Cost<'a> {
    rows: &'a [Row],
    loss: Loss,
}

impl LeastSquares for Cost<'_> {
    type State = State;
    type Equations = DenseEquations;
    type Step = DVector<f64>;
    const MAX_STEPS: usize = BUDGET;

    fn evaluate(&self, state: &State) -> Option<DenseEquations> {
        equations(self.rows, state, self.loss)
    }

    fn chi2(equations: &DenseEquations) -> f64 {
        equations.chi2
    }

    fn step(&self, equations: &DenseEquations, damping: f64) -> Option<(DVector<f64>, f64)> {
        equations.step(damping)
    }

    fn apply(&self, state: &State, step: &DVector<f64>) -> Option<State> {
        state.moved(step)
    }
}

fn minimum(rows: &[Row], start: &State, loss: Loss) -> Option<Fit> {
    let found = minimize(&Cost { rows, loss }, start.clone(), &Tolerance::FINE)?;
    let cost = found.equations.chi2;
    cost.is_finite().then_some(Fit { cost, state: found.state })
}

/// Covariance of the parameters at a fit; none where something is undetermined.
pub(super) fn covariance(rows: &[Row], state: &State) -> Option<DMatrix<f64>> {
    let information = equations(rows, state, Loss::Final)?.information;
    let inverse = information.cholesky()?.inverse();
    inverse.iter().all(|v| v.is_finite()).then_some(inverse)
}

/// Factor by which errors common to neighbours in a sweep widen what the rows say together, at least 1: eq. (16), (17). Smoothed
/// contacts share their errors, and a calibration or a friction that is off errs for a whole sweep.
pub(super) fn correlation(rows: &[Row], state: &State) -> f64 {
    let Some(outline) = state.outline() else { return 1.0 };
    let all = || rows.iter().map(|row| (row.sweep, outline.distance(row).e));
    let kept: Vec<_> = all().filter(|(_, e)| e.norm_squared() < OUTLIER_COST).collect();
    // Of rows `lag` apart in their sweep.
    let mean_product = |lag: usize| {
        let pairs = kept.iter().zip(kept.iter().skip(lag)).filter(|((i, _), (j, _))| i == j);
        let (sum, n) = pairs.fold((0.0, 0), |(sum, n), ((_, a), (_, b))| (sum + a.dot(b), n + 1));
        (FEWEST_PAIRS <= n).then(|| sum / f64::from(n))
    };
    let Some(variance) = mean_product(0) else { return 1.0 };
    // Noise makes late sums fall below zero, where what is left is no more than noise: they end there.
    let sums = (0..).step_by(2).map_while(|lag| {
        let sum = mean_product(lag)? + mean_product(lag + 1)?;
        (0.0 < sum).then_some(sum)
    });
    let later = sums.sum::<f64>() - variance;
    (1.0 + 2.0 * later / (variance + ROUNDING)).max(1.0)
}

/// Residuals of a tenth of a standard deviation in either direction are rounding, whatever their correlation.
const ROUNDING: f64 = 0.02;

/// Pairs of rows whose mean product says anything.
const FEWEST_PAIRS: u32 = 12;

/// The cost of the rows at a state.
pub(super) fn verdicts(rows: &[Row], state: &State) -> Verdicts {
    let Some(outline) = state.outline() else {
        return Verdicts { squared: Vec::new(), places: Vec::new() };
    };
    let distances: Vec<_> = rows.iter().map(|row| outline.distance(row)).collect();
    Verdicts {
        squared: distances.iter().map(|d| d.e.norm_squared()).collect(),
        places: distances.iter().map(|d| d.place).collect(),
    }
}
