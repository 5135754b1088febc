//! Errors that neighbouring views share, as of cameras that are not synchronised and see a moving target: docs/math/rig.md section 17.

use crate::least_squares::clustered::Cluster;
use crate::multiview::shared_blocks::{mean_factor, numbers_of_blocks};
use crate::{Matrix6, Vector6};

/// Fewer views do not show what neighbours share.
const SHOWING_VIEWS: usize = 12;
/// A view whose score is shorter than this, squared, in units of the scatter of all, has it from rounding: nobody else sees its body.
const NOTHING: f64 = 1e-12;

/// Returns by which factor the covariance of independent views is too small, eq. (36); the views are in the order of time.
pub(super) fn factor(views: &[Cluster]) -> f64 {
    let n_shared = views.iter().flat_map(|view| &view.blocks).max().map_or(0, |last| last + 1);
    let of_unknown = |unknown: usize| {
        let scores = views.iter().filter_map(|view| {
            let at = view.blocks.binary_search(&unknown).ok()?;
            Some(view.score.fixed_rows::<6>(6 * at).into_owned())
        });
        divisions(scores.collect())
    };
    mean_factor(&(0..n_shared).flat_map(of_unknown).collect::<Vec<_>>())
}

/// Returns Q and its degrees of freedom, eq. (36), for each division of the views into blocks.
fn divisions(mut scores: Vec<Vector6>) -> Vec<(f64, f64)> {
    let scatter: Matrix6 = scores.iter().map(|score| score * score.transpose()).sum();
    let Some(scatter) = scatter.cholesky() else { return Vec::new() };
    let squared = |score: &Vector6| score.dot(&scatter.solve(score));
    scores.retain(|score| NOTHING < squared(score));
    let n = scores.len();
    if n < SHOWING_VIEWS {
        return Vec::new();
    }
    let division = |count: usize| {
        let block = |b: usize| scores[b * n / count..(b + 1) * n / count].iter().sum::<Vector6>();
        let chi2: f64 = (0..count).map(|b| squared(&block(b))).sum();
        (count as f64 * (1.0 - 1.0 / n as f64) * chi2, 6.0 * (count - 1) as f64)
    };
    numbers_of_blocks(n).map(division).collect()
}
