//! Errors that neighbouring views share, as of a zoom that was touched: docs/math/intrinsics.md eq. (16), as docs/math/hand_eye.md section 7.

use crate::least_squares::shared::Reduced;
use crate::multiview::shared_blocks::{mean_factor, numbers_of_blocks};
use nalgebra::{DMatrix, DVector};

/// Fewer views do not show what neighbours share.
const SHOWING_VIEWS: usize = 8;
/// Directions in which a view has less than this part of its share of the information are not compared: there the score is dominated by the
/// noise of the view's own pose (a frontal view seems to determine the focal length, but does not), docs/math/frames.md section 3.
const SEEN: f64 = 0.05;

/// Returns by which factor the covariance of independent views is too small: 1 where blocks of views in sequence differ from each other by no more than
/// single views do, or by no more than the noise makes them. `inverse` is the covariance for the stated noise, `noise` the factor on its variances.
pub(super) fn factor(by_view: &[Reduced], inverse: &DMatrix<f64>, noise: f64) -> f64 {
    let (n, k) = (by_view.len(), inverse.nrows());
    let Some(factor) = inverse.clone().cholesky().map(|c| c.l()).filter(|_| SHOWING_VIEWS <= n) else {
        return 1.0;
    };
    let disagreement = |parts: &[Reduced]| {
        let of = |one: &Reduced| alone(one, &factor, parts.len());
        let (chi2, rank) = parts.iter().map(of).fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        (chi2, rank.saturating_sub(k))
    };
    let (of_views, n_free) = disagreement(by_view);
    let single = f64::max(of_views / n_free.max(1) as f64, noise);
    if n_free == 0 || !(0.0 < single) {
        return 1.0;
    }
    let of_blocks = numbers_of_blocks(n).map(|count| {
        let (chi2, n_free) = disagreement(&blocks(by_view, count));
        (chi2 / single, n_free as f64)
    });
    mean_factor(&of_blocks.collect::<Vec<_>>())
}

fn blocks(by_view: &[Reduced], count: usize) -> Vec<Reduced> {
    let n = by_view.len();
    let block = |block: usize| {
        let members = &by_view[block * n / count..(block + 1) * n / count];
        let k = members[0].gradient.len();
        let nothing = Reduced { information: DMatrix::zeros(k, k), gradient: DVector::zeros(k) };
        members.iter().fold(nothing, |sum, one| Reduced {
            information: sum.information + &one.information,
            gradient: sum.gradient + &one.gradient,
        })
    };
    (0..count).map(block).collect()
}

/// Returns sᵀ S⁻¹ s, the distance of a view's own answer from the common one, and the number of directions that S determines, in units of L, P =
/// L Lᵀ.
pub(super) fn alone(one: &Reduced, factor: &DMatrix<f64>, n_views: usize) -> (f64, usize) {
    let information = factor.transpose() * &one.information * factor;
    let score = factor.transpose() * &one.gradient;
    if !information.iter().chain(score.iter()).all(|x| x.is_finite()) {
        return (0.0, 0);
    }
    let eigen = information.symmetric_eigen();
    let mut sum = (0.0, 0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if SEEN < *value * n_views as f64 {
            sum.0 += vector.dot(&score).powi(2) / value;
            sum.1 += 1;
        }
    }
    sum
}
