//! Covariance of an answer whose residuals share errors within clusters: cameras that are not synchronised, a bent board, corners that are all
//! displaced to one side. Such errors are estimated from the scatter of the clusters' scores.
//!
//! Every cluster gives its information and its score at the minimum; without it the answer would move by a known amount (leave one out, CR3:
//! Bell and McCaffrey 2002). The scatter of these moves is shrunk towards the inverse information according to its uncertainty (Ledoit and Wolf
//! 2004) and widened for the uncertainty of a variance from so few clusters. Derivation: docs/math/clustered.md.
//!
//!   P  inverse information of all unknowns   ·   S, s  a cluster's information and score   ·   B = S P  its leverage

use crate::statistics::chi_square::quick_quantile;
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};

/// Size of a block: a small motion.
const BLOCK: usize = 6;

/// The information of one cluster about the blocks of unknowns that it is connected to, with every other unknown eliminated.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    /// Indices of the blocks, ascending.
    pub(crate) blocks: Vec<usize>,
    /// Symmetric, six rows per block.
    pub(crate) information: DMatrix<f64>,
    /// Half the negative gradient of the cluster's χ² at the minimum; over all clusters it vanishes.
    pub(crate) score: DVector<f64>,
}

/// A covariance that includes the errors shared within clusters.
#[derive(Debug, Clone)]
pub(crate) struct Clustered {
    /// The covariance of all unknowns together.
    pub(crate) covariance: DMatrix<f64>,
    /// Factor on the variances of the unknowns that belong to one cluster only, and whose covariance is P.
    pub(crate) within: f64,
}

/// The parts of one block's covariance.
#[derive(Debug, Clone, Copy)]
struct Scatter {
    /// Factor on its inverse information.
    of_shape: f64,
    /// Factor on the scatter of the answers without one cluster.
    of_scatter: f64,
    /// Trace of its covariance divided by that of its inverse information, both whitened by the latter.
    total: f64,
}

/// A leverage this close to one is treated as one: the blocks then depend on this cluster alone.
const RIDGE: f64 = 1e-6;
/// Relative term added to a cluster's information, larger than the rounding that its elimination leaves where it does not cover all directions …
const ROUNDING: f64 = 1e-9;
/// … and the share that must remain of a direction that it covers.
const SEEN: f64 = 1e-8;
/// Standard normal quantile for one in a hundred: the probability that clusters without a shared error seem to contradict each other.
const QUANTILE: f64 = 2.326;
/// Standard normal quantile for one in a thousand: that one block seems to scatter although the clusters together do not contradict each other.
const ONE_BLOCK_QUANTILE: f64 = 3.09;
/// Blocks are not examined below the 84 % quantile of chance, because leaving clusters out costs as much as an elimination.
const WORTH_A_LOOK: f64 = 1.0;
/// With fewer equal clusters than this, one block alone is not determined.
const ENOUGH_CLUSTERS: f64 = 8.0;
/// The weight of the other blocks in the estimate for one, in clusters, at most.
const BORROWED_CLUSTERS: f64 = 2.0;
/// E|y|⁴ divided by (E|y|²)² for six normal numbers of equal variance.
const NORMAL_FOURTH: f64 = 1.0 + 2.0 / BLOCK as f64;

/// Computes the covariance of all unknowns from their inverse information and the clusters. `base` is the factor on the inverse information that
/// is known to be needed, and the least one returned.
pub(crate) fn clustered(inverse: &DMatrix<f64>, clusters: &[Cluster], base: f64) -> Clustered {
    let n_blocks = inverse.nrows() / BLOCK;
    let mut sums = Sums::new(inverse);
    clusters.iter().for_each(|cluster| sums.compare(inverse, cluster));
    if !sums.contradict(base, WORTH_A_LOOK) {
        return Clustered { covariance: inverse * base, within: base };
    }
    let mut pulls = Vec::with_capacity(clusters.len());
    for cluster in clusters {
        let pull = sums.add(inverse, cluster);
        pulls.push(pull);
    }
    let scatters = sums.scatters(clusters.len(), base);
    let mut of_scatter = DVector::zeros(inverse.nrows());
    let mut within = 0.0;
    for (block, s) in scatters.iter().enumerate() {
        of_scatter.rows_mut(BLOCK * block, BLOCK).fill((s.of_scatter / sums.excess()).sqrt());
        within += s.total / n_blocks as f64;
    }
    let of_shape: Vec<f64> = scatters.iter().map(|s| s.of_shape).collect();
    let mut covariance = shaped(inverse, &of_shape);
    if 0.0 < of_scatter.max() {
        let moved = inverse * meat(inverse.nrows(), clusters, &pulls) * inverse;
        covariance += scaled(moved, &of_scatter);
    }
    Clustered { covariance, within: within.max(base) }
}

/// Returns the inverse information times a factor for each block: what all blocks need, and what single ones need beyond is added to it. D P D alone
/// makes the blocks' relative motions, which are often known far better than the blocks, follow from the blocks' own errors.
fn shaped(inverse: &DMatrix<f64>, factors: &[f64]) -> DMatrix<f64> {
    let of_all = factors.iter().copied().fold(f64::INFINITY, f64::min);
    let beyond = DVector::from_fn(inverse.nrows(), |i, _| (factors[i / BLOCK] - of_all).sqrt());
    let mut covariance = inverse * of_all;
    if 0.0 < beyond.max() {
        covariance += scaled(inverse.clone(), &beyond);
    }
    covariance
}

/// Returns diag(by) · matrix · diag(by).
fn scaled(mut matrix: DMatrix<f64>, by: &DVector<f64>) -> DMatrix<f64> {
    for (j, mut column) in matrix.column_iter_mut().enumerate() {
        column.iter_mut().zip(by.iter()).for_each(|(x, b)| *x *= b * by[j]);
    }
    matrix
}

/// Returns Σ w wᵀ over the clusters, where w is the score without the cluster's own leverage.
fn meat(n: usize, clusters: &[Cluster], pulls: &[DVector<f64>]) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(n, n);
    for (cluster, w) in clusters.iter().zip(pulls) {
        for (i, row) in cluster.blocks.iter().enumerate() {
            for (j, column) in cluster.blocks.iter().enumerate() {
                let by: Matrix6<f64> = six(w, i) * six(w, j).transpose();
                let mut block = sum.fixed_view_mut::<BLOCK, BLOCK>(BLOCK * row, BLOCK * column);
                block += by;
            }
        }
    }
    sum
}

fn six(vector: &DVector<f64>, block: usize) -> Vector6<f64> {
    vector.fixed_rows::<BLOCK>(BLOCK * block).into()
}

/// Returns the blocks of the inverse information to which a cluster is connected.
pub(crate) fn restricted(inverse: &DMatrix<f64>, blocks: &[usize]) -> DMatrix<f64> {
    let at = |i: usize| BLOCK * blocks[i / BLOCK] + i % BLOCK;
    let n = BLOCK * blocks.len();
    DMatrix::from_fn(n, n, |i, j| inverse[(at(i), at(j))])
}

/// Sums over clusters.
struct Sums {
    /// For each block: the inverse of the Cholesky factor of its inverse information.
    whitening: Vec<Matrix6<f64>>,
    /// For each block: Σ y yᵀ, where y is the whitened move of the answer without the cluster.
    scatter: Vec<Matrix6<f64>>,
    /// For each block: Σ |y|⁴.
    fourth: Vec<f64>,
    /// Expected Σ|y|² without shared errors, relative to its ideal value: leaving clusters out exaggerates.
    expected: f64,
    nominal: f64,
    /// Σ sᵀ S⁻¹ s, and its degrees of freedom.
    chi2: f64,
    degrees_of_freedom: f64,
}

impl Sums {
    fn new(inverse: &DMatrix<f64>) -> Self {
        let n = inverse.nrows() / BLOCK;
        let whitening = |b: usize| {
            let block: Matrix6<f64> = inverse.fixed_view::<BLOCK, BLOCK>(BLOCK * b, BLOCK * b).into();
            block.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(Matrix6::zeros)
        };
        Sums {
            whitening: (0..n).map(whitening).collect(),
            scatter: vec![Matrix6::zeros(); n],
            fourth: vec![0.0; n],
            expected: 0.0,
            nominal: 0.0,
            chi2: 0.0,
            degrees_of_freedom: 0.0,
        }
    }

    fn excess(&self) -> f64 {
        if 0.0 < self.nominal { self.expected / self.nominal } else { 1.0 }
    }

    /// Adds a cluster; its score without its own leverage, docs/math/clustered.md eq. (3).
    fn add(&mut self, inverse: &DMatrix<f64>, cluster: &Cluster) -> DVector<f64> {
        let n = cluster.score.len();
        let leverage = &cluster.information * restricted(inverse, &cluster.blocks);
        let mut left = DMatrix::identity(n, n) * (1.0 + RIDGE) - &leverage;
        if !left.try_inverse_mut() {
            return DVector::zeros(n);
        }
        let (trace, squared) = (left.trace(), left.component_mul(&left.transpose()).sum());
        let seen = (1.0 + RIDGE) * trace - n as f64;
        self.expected += seen - RIDGE * ((1.0 + RIDGE) * squared - trace);
        self.nominal += leverage.trace() - RIDGE * seen;
        let pull = left * &cluster.score;
        for block in 0..self.scatter.len() {
            let mut moved = Vector6::zeros();
            for (i, touched) in cluster.blocks.iter().enumerate() {
                moved += inverse.fixed_view::<BLOCK, BLOCK>(BLOCK * block, BLOCK * touched) * six(&pull, i);
            }
            let y = self.whitening[block] * moved;
            self.scatter[block] += y * y.transpose();
            self.fourth[block] += y.norm_squared().powi(2);
        }
        pull
    }

    /// Compares the cluster's own answer with the common one, in the directions that the cluster determines.
    fn compare(&mut self, inverse: &DMatrix<f64>, cluster: &Cluster) {
        let mut information = cluster.information.clone();
        for i in 0..information.nrows() {
            information[(i, i)] *= 1.0 + ROUNDING;
        }
        let Some(factor) = information.cholesky() else { return };
        let is_seen = |i: &usize| SEEN * cluster.information[(*i, *i)] < factor.l_dirty()[(*i, *i)].powi(2);
        let rank = (0..cluster.score.len()).filter(is_seen).count() as f64;
        self.degrees_of_freedom += rank - cluster.information.dot(&restricted(inverse, &cluster.blocks));
        self.chi2 += cluster.score.dot(&factor.solve(&cluster.score));
    }

    /// Returns whether the clusters contradict each other by more than chance, docs/math/clustered.md eq. (8).
    fn contradict(&self, base: f64, quantile: f64) -> bool {
        let n = self.degrees_of_freedom;
        1.0 <= n && base * quick_quantile(n, quantile) < self.chi2
    }

    fn scatters(&self, n_clusters: usize, base: f64) -> Vec<Scatter> {
        let most = n_clusters.saturating_sub(1) as f64;
        let contradict = self.contradict(base, QUANTILE);
        let excess = self.excess();
        let seen = |(scatter, fourth): (&Matrix6<f64>, &f64)| {
            let sum = scatter.trace();
            let clusters = if 0.0 < *fourth { (NORMAL_FOURTH * sum * sum / fourth).min(most) } else { 0.0 };
            (sum / (BLOCK as f64 * excess), clusters)
        };
        let seen: Vec<(f64, f64)> = self.scatter.iter().zip(&self.fourth).map(seen).collect();
        let all =
            seen.iter().fold((0.0, 0.0), |s, (factor, clusters)| (s.0 + factor * clusters, s.1 + clusters));
        let of_block = |(own, scatter): (&(f64, f64), &Matrix6<f64>)| {
            let others = (all.0 - own.0 * own.1, all.1 - own.1);
            match contradict || scatters_alone(*own, base) {
                true => Scatter::new(*own, others, &(scatter / excess), base, most),
                false => Scatter::none(base),
            }
        };
        seen.iter().zip(&self.scatter).map(of_block).collect()
    }
}

impl Scatter {
    /// Returns the scatter without shared errors.
    fn none(base: f64) -> Self {
        Scatter { of_shape: base, of_scatter: 0.0, total: base }
    }

    /// Computes docs/math/clustered.md eqs. (6)–(11).
    fn new(own: (f64, f64), others: (f64, f64), scatter: &Matrix6<f64>, base: f64, most: f64) -> Self {
        let p = BLOCK as f64;
        let borrowed = others.1.min(BORROWED_CLUSTERS);
        let clusters = own.1 + borrowed;
        if clusters < 1.0 {
            return Scatter::none(base);
        }
        let mean = if 0.0 < borrowed { others.0 / others.1 } else { 0.0 };
        let factor = (own.0 * own.1 + mean * borrowed) / clusters;
        if factor <= base {
            return Scatter::none(base);
        }
        let apart = (scatter - Matrix6::identity() * own.0).norm_squared();
        let chance = (p * p + p - 2.0) * own.0 * own.0 / own.1.max(1.0);
        let share = (1.0 - chance / apart.max(chance)).min((factor - base) / own.0.max(factor));
        let uneven = (NORMAL_FOURTH / clusters - 1.0 / (most + 1.0)).max(0.0);
        let widening = 1.0 + share * share * (p + 1.0) / own.1.max(1.0) + 2.0 / (p * clusters) + uneven;
        Scatter {
            of_shape: (factor - share * own.0) * widening,
            of_scatter: share * widening,
            total: factor * widening,
        }
    }
}

/// Returns whether the factor of a block, from its number of clusters, exceeds chance.
fn scatters_alone(own: (f64, f64), base: f64) -> bool {
    let degrees_of_freedom = BLOCK as f64 * own.1;
    ENOUGH_CLUSTERS <= own.1
        && base * quick_quantile(degrees_of_freedom, ONE_BLOCK_QUANTILE) < own.0 * degrees_of_freedom
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two blocks whose difference is known a thousand times better than either, with factors that differ.
    #[test]
    fn factors_that_differ_take_nothing_from_the_inverse_information() {
        let inverse = DMatrix::from_fn(2 * BLOCK, 2 * BLOCK, |i, j| match (i == j, i % BLOCK == j % BLOCK) {
            (true, _) => 1.0,
            (false, true) => 1.0 - 1e-6,
            _ => 0.0,
        });
        let found = shaped(&inverse, &[1.2, 1.5]);
        let least = (&found - &inverse * 1.2).symmetric_eigenvalues().min();
        assert!(-1e-12 < least, "{least:e}");
        assert!((found[(0, 0)] - 1.2).abs() < 1e-12 && (found[(BLOCK, BLOCK)] - 1.5).abs() < 1e-12);
    }
}
