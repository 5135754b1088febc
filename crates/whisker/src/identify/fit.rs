//! Fits a hypothesis to the rows by robust Levenberg–Marquardt.

use super::outline::Place;
use super::row::{OUTLIER_COST, Row, robust};
use super::state::State;
use nalgebra::{DMatrix, DVector};
use resight_core::least_squares::dense::{DenseEquations, minimize_dense};

/// A hypothesis at its best parameters.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    /// Where.
    pub state: State,
    /// Σ of what the rows cost, eq. (8).
    pub cost: f64,
}

/// What each row has to say of a fit.
pub(super) struct Verdicts {
    /// Squared distances, row by row.
    pub squared: Vec<f64>,
    /// Where on the outline.
    pub places: Vec<Place>,
}

/// Costs and their derivatives by the outline's own parameters, eq. (7), then by the hypothesis's.
fn equations(rows: &[Row], state: &State, outlier_cost: f64) -> Option<DenseEquations> {
    let outline = state.outline()?;
    let mut own = DenseEquations::new(outline.n_parameters());
    for row in rows {
        let distance = outline.distance(row);
        let (cost, weight) = robust(distance.e.norm_squared(), outlier_cost);
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

/// A start far off is led by a bound twenty-five times as wide, five standard deviations for one.
const WIDE: f64 = 25.0;

/// The best fit from one start; none where the start is no outline.
pub(super) fn fit(rows: &[Row], start: &State) -> Option<Fit> {
    let moved = |state: &State, by: &DVector<f64>| state.moved(by);
    let wide = minimize_dense(start, |s| equations(rows, s, WIDE * OUTLIER_COST), moved)?;
    let narrow = minimize_dense(&wide.state, |s| equations(rows, s, OUTLIER_COST), moved)?;
    narrow.equations.chi2.is_finite().then_some(Fit { cost: narrow.equations.chi2, state: narrow.state })
}

/// The best of several starts.
pub(super) fn best_fit(rows: &[Row], starts: &[State]) -> Option<Fit> {
    starts.iter().filter_map(|start| fit(rows, start)).min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Covariance of the parameters at a fit; none where something is undetermined.
pub(super) fn covariance(rows: &[Row], state: &State) -> Option<DMatrix<f64>> {
    let information = equations(rows, state, OUTLIER_COST)?.information;
    let inverse = information.cholesky()?.inverse();
    inverse.iter().all(|v| v.is_finite()).then_some(inverse)
}

/// What the rows say of a state.
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

/// Those starts that cost least as they are.
pub(super) fn promising(rows: &[Row], starts: Vec<State>, kept: usize) -> Vec<State> {
    let cost = |state: &State| -> f64 {
        let squared = verdicts(rows, state).squared;
        let total: f64 = squared.iter().map(|squared| robust(*squared, WIDE * OUTLIER_COST).0).sum();
        if squared.is_empty() { f64::INFINITY } else { total }
    };
    let mut ranked: Vec<(f64, State)> = starts.into_iter().map(|state| (cost(&state), state)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().take(kept).map(|(_, state)| state).collect()
}
