//! The smallest set of cameras whose motions explain what the moments since an onset say, correlations between cameras included.
//!
//! ```text
//!   χ² left by the set s:  cᵀ D⁻¹ c − c_sᵀ (D_ss)⁻¹ c_s        docs/math/monitor.md eq. (25)
//! ```

use super::evidence::Gathered;
use crate::monitor::attribute::{Attribution, Fit, smallest};
use nalgebra::{DMatrix, DVector};

/// Information added to every coordinate, 1/rad² and 1/m²: a hundred radians or metres. It makes the common motion of all cameras,
/// which no camera sees, zero.
const FREE: f64 = 1e-4;

/// Nobody or some of the cameras that were seen; with `at_least` one, somebody.
pub(super) fn which(gathered: &Gathered, at_least: usize) -> Attribution {
    let seen = seen(gathered);
    let all = motions(gathered, &seen).map_or(0.0, |(_, _, explained)| explained);
    let determined = seen.len().saturating_sub(1);
    smallest(&seen, at_least..=determined, |set| {
        let (motions, covariance, explained) = motions(gathered, set)?;
        let degrees_of_freedom = 6 * determined.saturating_sub(set.len());
        Some(Fit { motions, covariance, chi2: (all - explained).max(0.0), degrees_of_freedom })
    })
}

/// Cameras that took part.
pub(super) fn seen(gathered: &Gathered) -> Vec<usize> {
    let has_information = |camera: &usize| 0.0 < gathered.information[(6 * camera, 6 * camera)];
    (0..gathered.score.len() / 6).filter(has_information).collect()
}

/// The motions of a set, their covariance and how much χ² they explain.
fn motions(gathered: &Gathered, set: &[usize]) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let n = 6 * set.len();
    let at = |i: usize| 6 * set[i / 6] + i % 6;
    let score = DVector::from_fn(n, |i, _| gathered.score[at(i)]);
    let information =
        DMatrix::from_fn(n, n, |i, j| gathered.information[(at(i), at(j))] + if i == j { FREE } else { 0.0 });
    let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = if n == 0 { scaled } else { scaled.cholesky()?.inverse() };
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    let motions = &covariance * &score;
    let explained = score.dot(&motions);
    explained.is_finite().then_some((motions, covariance, explained))
}
