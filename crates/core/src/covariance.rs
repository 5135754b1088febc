//! The test whether a matrix is a covariance.

use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, Matrix, Storage};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Allowed rounding of correlations: that of a matrix written with nine digits.
const ROUNDING: f64 = 1e-8;

/// Returns whether a square matrix is finite, symmetric and, except for rounding, without a direction of negative variance. Directions of zero
/// variance are allowed (exact values): where the inverse is needed, that is tested separately. Each row is judged in its own unit, so that
/// radians beside metres, and kilometres beside micrometres, are treated alike.
pub fn is_covariance<D: Dim, S: Storage<f64, D, D>>(matrix: &Matrix<f64, D, D, S>) -> bool
where
    DefaultAllocator: Allocator<D, D>,
{
    let n = matrix.nrows();
    let is_mirrored = || (0..n).all(|i| (0..i).all(|j| matrix[(i, j)] == matrix[(j, i)]));
    if matrix.sum().is_finite() && is_mirrored() && has_positive_pivots(matrix.clone_owned()) {
        return true;
    }
    let mut rest = matrix.clone_owned();
    for i in 0..n {
        for j in 0..n {
            let scale = matrix[(i, i)].sqrt() * matrix[(j, j)].sqrt();
            // A direction without variance is not correlated with any other.
            let entry = if scale == 0.0 && matrix[(i, j)] == 0.0 { 0.0 } else { matrix[(i, j)] / scale };
            if !entry.is_finite() {
                return false;
            }
            rest[(i, j)] = entry;
        }
    }
    let is_symmetric = (0..n).all(|i| (0..i).all(|j| (rest[(i, j)] - rest[(j, i)]).abs() <= ROUNDING));
    is_symmetric && has_no_negative_direction(rest)
}

/// Eliminates in the given order, without square roots: nearly every covariance passes this fast test.
#[inline]
fn has_positive_pivots<D: Dim, S: nalgebra::StorageMut<f64, D, D>>(mut rest: Matrix<f64, D, D, S>) -> bool {
    let n = rest.nrows();
    for done in 0..n {
        let pivot = rest[(done, done)];
        // The negated comparison is also true for NaN, which is not positive.
        if !(0.0 < pivot) {
            return false;
        }
        let inverse = 1.0 / pivot;
        for j in done + 1..n {
            let gain = rest[(j, done)] * inverse;
            for i in j..n {
                rest[(i, j)] -= gain * rest[(i, done)];
            }
        }
    }
    true
}

/// Eliminates with the largest pivot first: the remainder is never negative where the matrix is positive semidefinite.
fn has_no_negative_direction<D: Dim, S: nalgebra::StorageMut<f64, D, D>>(
    mut rest: Matrix<f64, D, D, S>,
) -> bool {
    let n = rest.nrows();
    // Cross terms of rows that are zero except for rounding are below the square root of the product.
    let cross = ROUNDING.sqrt();
    for done in 0..n {
        let largest =
            (done..n).fold(done, |best, i| if rest[(best, best)] < rest[(i, i)] { i } else { best });
        rest.swap_rows(done, largest);
        rest.swap_columns(done, largest);
        let pivot = rest[(done, done)];
        if pivot <= ROUNDING {
            return (done..n)
                .all(|i| -ROUNDING <= rest[(i, i)] && (done..i).all(|j| rest[(i, j)].abs() <= cross));
        }
        for i in done + 1..n {
            let gain = rest[(i, done)] / pivot;
            for j in done + 1..n {
                rest[(i, j)] -= gain * rest[(done, j)];
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Matrix6, Vector6};

    #[test]
    fn covariances_are_reported_from_matrices_that_are_none() {
        let factor =
            Matrix6::from_fn(|i, j| ((i * 7 + j * 3) % 5) as f64 - 1.7 + if i == j { 3.0 } else { 0.0 });
        let units = Matrix6::from_diagonal(&Vector6::new(1e-6, 1e-5, 1e-6, 1e3, 1e4, 1e-9));
        let covariance = units * factor * factor.transpose() * units;
        assert!(is_covariance(&covariance) && is_covariance(&Matrix6::zeros()));
        // A matrix of rank one, as for one uncertain parameter.
        let direction = Vector6::new(1.0, -2.0, 0.0, 1e-3, 5.0, 1e4);
        assert!(is_covariance(&(direction * direction.transpose())));
        let mut skew = covariance;
        skew[(0, 4)] *= 1.001;
        let mut beyond = covariance;
        beyond[(1, 2)] = 1.01 * (covariance[(1, 1)] * covariance[(2, 2)]).sqrt();
        beyond[(2, 1)] = beyond[(1, 2)];
        assert!(!is_covariance(&skew) && !is_covariance(&beyond) && !is_covariance(&-covariance));
        for none in [f64::NAN, f64::INFINITY, -1e-30] {
            let mut broken = covariance;
            broken[(3, 3)] = none;
            assert!(!is_covariance(&broken), "{none}");
        }
        assert!(!is_covariance(&Matrix2::new(0.0, 1e-9, 1e-9, 1.0)));
    }

    /// No correlation exceeds 1, but one direction has a negative variance.
    #[test]
    fn an_indefinite_matrix_of_small_correlations_is_no_covariance() {
        let r = 0.6;
        assert!(!is_covariance(&Matrix3::new(1.0, -r, -r, -r, 1.0, -r, -r, -r, 1.0)));
        assert!(is_covariance(&Matrix3::new(1.0, r, r, r, 1.0, r, r, r, 1.0)));
    }
}
