//! Errors that the points of the view share, a bent board say, and what they do to pose and focal length together, docs/math/focal.md eq. (29).

use super::cost::{Descent, FocalProblem, JointCovariance, UNKNOWNS};
use crate::locate::choose::Minimum;
use crate::locate::problem::Problem;
use crate::locate::refine::residual_sums;
use crate::locate::shared_error::{FUNCTIONS, Scale, SharedError};
use nalgebra::{DMatrix, SVector};

/// A polynomial of which the lower ones leave less than this part is not one of its own.
const NEW: f64 = 1e-4;

/// Its covariance, and the root mean square of the displacement along one axis of the image, px. None where nothing shows.
pub(super) fn shared(
    problem: &FocalProblem,
    descent: &Descent,
    minimum: &Minimum,
    view: &Problem,
) -> Option<(JointCovariance, f64)> {
    let (chi2, _) = residual_sums(&minimum.cam_from_target, view);
    let shared = SharedError::at(&Minimum { chi2, ..*minimum }, view)?;
    let rows = problem.all_rows(&descent.state)?;
    let scale = Scale::of(problem.seen);
    let functions: Vec<[f64; FUNCTIONS]> =
        rows.iter().map(|row| scale.polynomials(&row.pixel, row.weight)).collect();
    let basis = DMatrix::from_fn(rows.len(), FUNCTIONS, |i, k| functions[i][k]);
    // Householder's columns are Gram and Schmidt's but for the sign, which does not matter.
    let qr = basis.clone().qr();
    let (q, r) = (qr.q(), qr.r());
    let mut scores = JointCovariance::zeros();
    for k in (0..FUNCTIONS.min(rows.len())).filter(|k| NEW * basis.column(*k).norm() < r[(*k, *k)].abs()) {
        for axis in 0..2 {
            let mut score = SVector::<f64, UNKNOWNS>::zeros();
            for (i, row) in rows.iter().enumerate() {
                score += SVector::from(row.by_unknown[axis]) * q[(i, k)];
            }
            scores += score * score.transpose() * shared.variance_of(k);
        }
    }
    Some((problem.of_scores(descent, &scores)?, shared.amplitude_px))
}
