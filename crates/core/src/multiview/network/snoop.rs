//! Finds constraints that contradict the others: each residual is compared with its standard deviation given the others, docs/math/survey.md eq. (15).

use super::Constraint;
use super::rows::rows;
use super::state::{Layout, State};
use crate::least_squares::arrow::ArrowInverse;
use nalgebra::{DMatrix, DVector};

/// A constraint that the others contradict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suspect {
    /// Which constraint.
    pub constraint: usize,
    /// Its residual over the standard deviation that it should have.
    pub sigmas: f64,
    /// Estimated error of the constraint, given minus predicted by the others, in its own unit (px, m, rad); its norm for several numbers.
    pub off: f64,
    /// A known distance whose decimal point is misplaced according to the others.
    pub slip: Option<DecimalSlip>,
}

/// A distance that is right except for its decimal point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecimalSlip {
    /// The prediction of the others, m.
    pub expected_m: f64,
    /// Its standard deviation, m.
    pub sigma_m: f64,
    /// The given distance is about the expected one times ten to this power.
    pub power_of_ten: i32,
}

/// Probability that any constraint of a good network is called a suspect.
const FALSE_ALARM: f64 = 1e-3;
/// Redundancy below which the others do not check a constraint.
pub(super) const LEAST_REDUNDANCY: f64 = 1e-3;

/// Returns the statistic and the estimated error of one constraint; none where nothing checks it.
fn test(
    constraint: &Constraint,
    state: &State,
    layout: &Layout,
    covariance: &ArrowInverse,
) -> Option<(f64, f64)> {
    let rows = rows(constraint, state, layout)?;
    let k = rows.len();
    if k == 0 {
        return None;
    }
    let residual = DVector::from_iterator(k, rows.iter().map(|r| r.residual));
    let mut redundancy = DMatrix::identity(k, k);
    for i in 0..k {
        for j in 0..k {
            for (a, x) in &rows[i].entries {
                for (b, y) in &rows[j].entries {
                    redundancy[(i, j)] -= x * y * covariance.at(*a, *b);
                }
            }
        }
    }
    let eigen = redundancy.symmetric_eigen();
    // Only directions that the others check take part.
    let (mut statistic, mut error) = (0.0, DVector::zeros(k));
    let mut n_checked = 0;
    for i in (0..k).filter(|i| LEAST_REDUNDANCY < eigen.eigenvalues[*i]) {
        let along = eigen.eigenvectors.column(i).dot(&residual);
        statistic += along * along / eigen.eigenvalues[i];
        error += eigen.eigenvectors.column(i) * (along / eigen.eigenvalues[i]);
        n_checked += 1;
    }
    (0 < n_checked).then(|| (statistic, error.norm() * unit(constraint)))
}

/// Returns the statistic above which one of so many constraints is a suspect: χ² of one or two degrees of freedom exceeds 2 ln(1/p) with a chance
/// of at most p.
pub(super) fn suspect_above(n_tested: usize) -> f64 {
    2.0 * (n_tested.max(1) as f64 / FALSE_ALARM).ln()
}

/// Returns one standard deviation in the constraint's own unit.
pub(super) fn unit(constraint: &Constraint) -> f64 {
    match constraint {
        Constraint::ImagePoint { covariance_px2, .. } => covariance_px2.sigma_px(),
        Constraint::Place { sigma_m, .. } => sigma_m.max(),
        Constraint::Distance { sigma_m, .. } | Constraint::OnPlane { sigma_m, .. } => *sigma_m,
        Constraint::Upright { sigma_rad, .. } | Constraint::Gravity { sigma_rad, .. } => *sigma_rad,
        Constraint::Pose { .. } => 1.0,
    }
}

/// Compares a constraint that took no part with the prediction of the others. Returns its residual in standard deviations (its own and that of
/// the prediction), given minus predicted, and the standard deviation of the prediction, both in the constraint's unit. None where the others do
/// not predict it.
pub(super) fn against_the_rest(
    constraint: &Constraint,
    state: &State,
    layout: &Layout,
    covariance: &ArrowInverse,
) -> Option<(f64, f64, f64)> {
    if !layout.has(constraint) {
        return None;
    }
    let rows = rows(constraint, state, layout)?;
    let residual = DVector::from_iterator(rows.len(), rows.iter().map(|r| r.residual));
    let predicted = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        let of = |(a, x): &(usize, f64)| {
            rows[j].entries.iter().map(|(b, y)| x * y * covariance.at(*a, *b)).sum::<f64>()
        };
        rows[i].entries.iter().map(of).sum()
    });
    let scatter = DMatrix::identity(rows.len(), rows.len()) + &predicted;
    let sigmas = residual.dot(&scatter.cholesky()?.solve(&residual)).sqrt();
    let off = if rows.len() == 1 { residual[0] } else { residual.norm() };
    Some((sigmas, off * unit(constraint), predicted.trace().max(0.0).sqrt() * unit(constraint)))
}

/// Returns the suspects, worst first. `covariance` is that of the unknowns by the constraints as stated.
pub(super) fn suspects(
    constraints: &[Constraint],
    state: &State,
    layout: &Layout,
    covariance: &ArrowInverse,
) -> Vec<Suspect> {
    let tested: Vec<(usize, f64, f64)> = constraints
        .iter()
        .enumerate()
        .filter(|(_, f)| layout.has(f))
        .filter_map(|(i, f)| test(f, state, layout, covariance).map(|(t, off)| (i, t, off)))
        .collect();
    let limit = suspect_above(tested.len());
    let mut found: Vec<Suspect> = tested
        .into_iter()
        .filter(|(_, t, _)| limit < *t)
        .map(|(constraint, t, off)| Suspect { constraint, sigmas: t.sqrt(), off, slip: None })
        .collect();
    found.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
    found
}
