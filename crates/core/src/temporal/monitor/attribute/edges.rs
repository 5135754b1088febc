//! Edges between nodes, and the motions of a set of nodes that fit them best.

use super::{Edge, Fit};
use crate::{Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, DVector};

/// An edge, and what is made of it once for all sets.
struct Weighted {
    edge: Edge,
    /// W, the inverse of its covariance.
    weight: Matrix6,
    /// ∂y/∂β = −Ad(a_from_b); ∂y/∂α is one.
    by_b: Matrix6,
}

/// All edges, and the normal equations of motions of all nodes; those of a set are blocks of them.
pub(super) struct Edges {
    edges: Vec<Weighted>,
    information: DMatrix<f64>,
    score: DVector<f64>,
    /// χ² when nothing moved.
    unexplained: f64,
}

/// (13) is solved exactly where its first order leaves no more than this share of χ²: elsewhere it would not explain the edges either.
const NEARLY: f64 = 0.1;
/// Steps of that; each leaves a share of the error that is about the motions' angle.
const STEPS: usize = 6;

impl Edges {
    pub fn new(nodes: usize, edges: &[Edge]) -> Self {
        let known = edges.iter().filter(|edge| edge.a < nodes && edge.b < nodes);
        let edges: Vec<Weighted> = known.filter_map(Weighted::new).collect();
        let n = 6 * nodes;
        let (mut information, mut score) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for edge in &edges {
            let sides = edge.sides();
            for (i, by_i) in &sides {
                let weighted = by_i.transpose() * edge.weight;
                let mut own = score.fixed_rows_mut::<6>(6 * i);
                own += weighted * edge.edge.motion;
                for (j, by_j) in &sides {
                    let mut block = information.fixed_view_mut::<6, 6>(6 * i, 6 * j);
                    block += weighted * by_j;
                }
            }
        }
        let unexplained = edges.iter().map(|edge| edge.chi2(&edge.edge.motion)).sum();
        Edges { edges, information, score, unexplained }
    }

    /// None where the edges do not determine the set's motions.
    pub fn fit(&self, set: &[usize]) -> Option<Fit> {
        let n = 6 * set.len();
        let at = |i: usize| 6 * set[i / 6] + i % 6;
        let score = DVector::from_fn(n, |i, _| self.score[at(i)]);
        let information = DMatrix::from_fn(n, n, |i, j| self.information[(at(i), at(j))]);
        let covariance = if n == 0 { information } else { scaled_inverse(&information)? };
        let motions = &covariance * &score;
        let chi2 = (self.unexplained - score.dot(&motions)).max(0.0);
        let degrees_of_freedom = (6 * self.edges.len()).saturating_sub(n);
        let fit = Fit { motions, covariance, chi2, degrees_of_freedom };
        // With one end in the set an edge is linear as it is.
        let is_linear =
            !self.edges.iter().any(|edge| set.contains(&edge.edge.a) && set.contains(&edge.edge.b));
        Some(if is_linear || NEARLY * self.unexplained < chi2 { fit } else { self.exact(set, fit) })
    }

    /// Gauss–Newton with the derivatives of no motion, until χ² falls no more.
    fn exact(&self, set: &[usize], linear: Fit) -> Fit {
        let (mut score, mut chi2) = self.residuals(set, &linear.motions);
        let mut best = Fit { chi2, ..linear };
        for _ in 0..STEPS {
            let motions = &best.motions + &best.covariance * &score;
            (score, chi2) = self.residuals(set, &motions);
            if !(chi2 < best.chi2) {
                break;
            }
            best = Fit { motions, chi2, ..best };
        }
        best
    }

    /// Score and χ² that motions of a set leave.
    fn residuals(&self, set: &[usize], motions: &DVector<f64>) -> (DVector<f64>, f64) {
        let (mut score, mut chi2) = (DVector::zeros(motions.len()), 0.0);
        let place = |node: usize| set.iter().position(|member| *member == node);
        let motion = |node: usize| -> Vector6 {
            place(node).map_or(Vector6::zeros(), |i| motions.fixed_rows::<6>(6 * i).into())
        };
        for edge in &self.edges {
            let residual = edge.edge.motion - edge.predicted(&motion(edge.edge.a), &motion(edge.edge.b));
            chi2 += edge.chi2(&residual);
            for (node, by_node) in edge.sides() {
                let Some(i) = place(node) else { continue };
                let mut own = score.fixed_rows_mut::<6>(6 * i);
                own += by_node.transpose() * edge.weight * residual;
            }
        }
        (score, chi2)
    }
}

impl Weighted {
    /// None where its covariance is none.
    fn new(edge: &Edge) -> Option<Self> {
        let weight = edge.covariance.cholesky()?.inverse();
        let is_finite = edge.motion.iter().chain(weight.iter()).all(|v| v.is_finite());
        is_finite.then(|| Weighted { edge: *edge, weight, by_b: -edge.a_from_b.adjoint() })
    }

    /// Both nodes and what y gains by their motions.
    fn sides(&self) -> [(usize, Matrix6); 2] {
        [(self.edge.a, Matrix6::identity()), (self.edge.b, self.by_b)]
    }

    /// y, (13).
    fn predicted(&self, alpha: &Vector6, beta: &Vector6) -> Vector6 {
        let a_from_b = &self.edge.a_from_b;
        (*a_from_b * Pose::exp(&-beta) * a_from_b.inverse() * Pose::exp(alpha)).log()
    }

    fn chi2(&self, residual: &Vector6) -> f64 {
        residual.dot(&(self.weight * residual))
    }
}

/// Inverse of a positive definite matrix of radians and metres, scaled first; none where it is singular.
fn scaled_inverse(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scaled = DMatrix::from_fn(information.nrows(), information.ncols(), |i, j| {
        information[(i, j)] * scale[i] * scale[j]
    });
    // A pair that only its own edge ties: its common motion is free.
    let factor = scaled.cholesky()?;
    let is_singular = factor.l_dirty().diagonal().iter().any(|pivot| *pivot < 1e-6);
    let inverse = (!is_singular).then(|| factor.inverse())?;
    Some(DMatrix::from_fn(inverse.nrows(), inverse.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}
