//! Cross-validation: each half of the views is predicted by the camera of the other half.

use super::adjust::{Fit, Seen, Shared, fit};
use crate::statistics::chi_square::tail;

/// The results for two halves, which have every other view each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// Residuals of views under the camera of the other half, with only their poses free: root mean square, px of one coordinate.
    pub rms_px: f64,
    /// Residuals of the same views under the camera of all views.
    pub with_all_px: f64,
    /// Probability that two halves of one camera's views differ as much, according to their covariances.
    pub p: f64,
}

/// Fewer views are not divided.
const LEAST_VIEWS: usize = 6;

/// Compares both halves; `widening` is the factor on the inverse information of the answer. `None` with few views, or an undetermined half.
pub(super) fn held_out(whole: &Fit, widening: f64) -> Option<HeldOut> {
    if whole.seen.len() < LEAST_VIEWS {
        return None;
    }
    let half = |odd: usize| -> Vec<Seen> { whole.seen.iter().skip(odd).step_by(2).cloned().collect() };
    let halves = [fit(half(0), whole.shared.clone())?, fit(half(1), whole.shared.clone())?];
    let mut sum = 0.0;
    for (camera_of, views_of) in [(0, 1), (1, 0)] {
        let shared = Shared { directions: Vec::new(), ..halves[camera_of].shared.clone() };
        // The target's shape, if estimated, remains free, because it belongs to the target; the camera is fixed.
        let predicted = fit(half(views_of), shared)?;
        sum += squared(&predicted);
    }
    let n = whole.n_numbers().max(1) as f64;
    let values =
        |fit: &Fit| -> Vec<f64> { fit.shared.camera.parameters().iter().map(|(_, value)| *value).collect() };
    let (a, b) = (values(&halves[0]), values(&halves[1]));
    let k = whole.shared.directions.len();
    let difference = nalgebra::DVector::from_fn(k, |i, _| {
        let (index, _) = whole.shared.directions[i][0];
        a[index] - b[index]
    });
    let mut covariance = nalgebra::DMatrix::zeros(k, k);
    for half in &halves {
        let inverse = half.reduced()?.information.cholesky()?.inverse();
        covariance += inverse.view((0, 0), (k, k)) * widening;
    }
    let chi2 = difference.dot(&covariance.cholesky()?.solve(&difference));
    Some(HeldOut { rms_px: (sum / n).sqrt(), with_all_px: (squared(whole) / n).sqrt(), p: tail(k, chi2) })
}

fn squared(fit: &Fit) -> f64 {
    let of_view = |view: &Seen| -> f64 {
        let residuals = fit.residuals(view);
        let used = residuals.iter().zip(&view.weights).filter(|(_, weight)| 0.0 < **weight);
        used.filter_map(|(residual, _)| residual.map(|(e, _)| e.norm_squared())).sum()
    };
    fit.seen.iter().map(of_view).sum()
}
