//! Weighted least squares whose errors are correlated in time, with a covariance from blocks of time: docs/math/vehicle.md section 3.
//!
//! ```text
//!   x  values, X regressors, w weights   ·   A = Σ w X Xᵀ + P   ·   g_b = Σ w X r over block b   ·   S = Σ g_b g_bᵀ + Σ (g_b g_{b+1}ᵀ + its transpose)⁺
//!   covariance = A⁻¹ (S n/(n − 2) · ν/(ν − 2) + P) A⁻¹, ν = n − 3
//! ```

use nalgebra::{SMatrix, SVector, SymmetricEigen};

/// One value of several components in time: each component has its own coefficients of the same regressors.
pub(super) struct Sample<const K: usize> {
    pub t_s: f64,
    /// The values.
    pub x: SVector<f64, K>,
    /// Weights of each.
    pub weight: SVector<f64, K>,
    /// Regressor besides the constant; zero where none is used.
    pub slope: f64,
}

/// The constants with their covariance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blocked<const K: usize> {
    pub constant: SVector<f64, K>,
    pub slope: SVector<f64, K>,
    /// Covariance by the scatter of the blocks.
    pub scatter: SMatrix<f64, K, K>,
    /// Covariance by the prior of the slope.
    pub prior: SMatrix<f64, K, K>,
    /// Seconds of a block.
    pub block_s: f64,
    pub n_blocks: usize,
}

/// Shortest block, seconds.
const SHORTEST_S: f64 = 1.0;
/// Blocks below which their scatter is not known.
pub(super) const LEAST_BLOCKS: usize = 8;

/// Fits constant and slope, the slope with the prior 0 ± `slope_sigma`. Blocks are doubled until neighbours are uncorrelated, as long as there are
/// enough. `None` for fewer than eight blocks.
pub(super) fn blocked<const K: usize>(samples: &[Sample<K>], slope_sigma: f64) -> Option<Blocked<K>> {
    let fits: Vec<Line> = (0..K).map(|k| Line::new(samples, k, slope_sigma)).collect::<Option<_>>()?;
    let mut block_s = SHORTEST_S;
    let mut scores = scores(samples, &fits, block_s);
    if scores.len() < LEAST_BLOCKS {
        return None;
    }
    while 2 * LEAST_BLOCKS <= scores.len() && are_correlated::<K>(&scores) {
        block_s *= 2.0;
        scores = self::scores(samples, &fits, block_s);
    }
    let [scatter, prior] = covariances(&scores, &fits)?;
    Some(Blocked {
        constant: SVector::from_fn(|k, _| fits[k].constant),
        slope: SVector::from_fn(|k, _| fits[k].slope),
        scatter,
        prior,
        block_s,
        n_blocks: scores.len(),
    })
}

/// The fit of one component.
struct Line {
    constant: f64,
    slope: f64,
    /// First row of A⁻¹.
    inverse: [f64; 2],
    prior: f64,
}

impl Line {
    fn new<const K: usize>(samples: &[Sample<K>], k: usize, slope_sigma: f64) -> Option<Self> {
        let prior = slope_sigma.powi(-2);
        let (mut a, mut c) = ([0.0, 0.0, prior], [0.0, 0.0]);
        for sample in samples {
            let (w, s, x) = (sample.weight[k], sample.slope, sample.x[k]);
            a = [a[0] + w, a[1] + w * s, a[2] + w * s * s];
            c = [c[0] + w * x, c[1] + w * s * x];
        }
        let determinant = a[0] * a[2] - a[1] * a[1];
        let line = Line {
            constant: (a[2] * c[0] - a[1] * c[1]) / determinant,
            slope: (a[0] * c[1] - a[1] * c[0]) / determinant,
            inverse: [a[2] / determinant, -a[1] / determinant],
            prior,
        };
        (0.0 < determinant && line.constant.is_finite() && line.slope.is_finite()).then_some(line)
    }

    /// What a sample adds to the error of the constant.
    fn influence<const K: usize>(&self, sample: &Sample<K>, k: usize) -> f64 {
        let residual = sample.x[k] - self.constant - self.slope * sample.slope;
        (self.inverse[0] + self.inverse[1] * sample.slope) * sample.weight[k] * residual
    }
}

/// Sums of the influences by block, with the number of the block.
fn scores<const K: usize>(samples: &[Sample<K>], fits: &[Line], block_s: f64) -> Vec<(i64, SVector<f64, K>)> {
    let mut scores: Vec<(i64, SVector<f64, K>)> = Vec::new();
    let begin_s = samples.first().map_or(0.0, |sample| sample.t_s);
    for sample in samples {
        let block = ((sample.t_s - begin_s) / block_s).floor() as i64;
        let influence = SVector::from_fn(|k, _| fits[k].influence(sample, k));
        match scores.last_mut() {
            Some((last, sum)) if *last == block => *sum += influence,
            _ => scores.push((block, influence)),
        }
    }
    scores
}

/// Sum of squares, and of products of neighbouring blocks.
fn products<const K: usize>(scores: &[(i64, SVector<f64, K>)]) -> [SMatrix<f64, K, K>; 2] {
    let own = scores.iter().map(|(_, g)| g * g.transpose()).sum();
    let neighbours = scores.windows(2).filter(|pair| pair[1].0 == pair[0].0 + 1);
    let lagged: SMatrix<f64, K, K> = neighbours.map(|pair| pair[0].1 * pair[1].1.transpose()).sum();
    [own, lagged + lagged.transpose()]
}

/// Whether neighbouring blocks of any component are positively correlated: a slow error beneath a fast one is a small correlation.
fn are_correlated<const K: usize>(scores: &[(i64, SVector<f64, K>)]) -> bool {
    let [_, lagged] = products(scores);
    (0..K).any(|k| 0.0 < lagged[(k, k)])
}

/// The two parts of eq. (8).
fn covariances<const K: usize>(
    scores: &[(i64, SVector<f64, K>)],
    fits: &[Line],
) -> Option<[SMatrix<f64, K, K>; 2]> {
    let n = scores.len() as f64;
    let [own, lagged] = products(scores);
    let of_blocks = own + positive_part(lagged, &own);
    // Constant and slope take two blocks, the correlation of neighbours a third.
    let freedom = n - 3.0;
    let widened = of_blocks * (n / (n - 2.0) * freedom / (freedom - 2.0));
    let prior = SVector::<f64, K>::from_fn(|k, _| fits[k].inverse[1].powi(2) * fits[k].prior);
    let prior = SMatrix::from_diagonal(&prior);
    let whole = widened + prior;
    (whole.sum().is_finite() && (0..K).all(|k| 0.0 < whole[(k, k)])).then_some([widened, prior])
}

impl<const K: usize> Blocked<K> {
    /// Covariance of the constants.
    pub fn covariance(&self) -> SMatrix<f64, K, K> {
        self.scatter + self.prior
    }
}

/// The part of a symmetric matrix with positive eigenvalues, in units of the standard deviations of another.
fn positive_part<const K: usize>(lagged: SMatrix<f64, K, K>, own: &SMatrix<f64, K, K>) -> SMatrix<f64, K, K> {
    let scale = SVector::<f64, K>::from_fn(|k, _| own[(k, k)].sqrt().max(f64::MIN_POSITIVE));
    let unit = nalgebra::DMatrix::from_fn(K, K, |i, j| lagged[(i, j)] / (scale[i] * scale[j]));
    let eigen = SymmetricEigen::new(unit);
    let kept = eigen.eigenvalues.map(|value| value.max(0.0));
    let positive =
        &eigen.eigenvectors * nalgebra::DMatrix::from_diagonal(&kept) * eigen.eigenvectors.transpose();
    SMatrix::from_fn(|i, j| positive[(i, j)] * scale[i] * scale[j])
}
