//! Which of several cameras and targets moved: the smallest set whose motion explains all that is seen between them.
//!
//! ```text
//!   α, β  old_from_new of nodes a, b      y = α − Ad(a_from_b) β        docs/math/monitor.md eq. (13)
//! ```

use crate::frames::chi_square::tail;
use crate::{Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, DVector};

/// What one monitor says of frames a and b since a common time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// A camera, by its number among the nodes.
    pub a: usize,
    /// Another camera, or a target.
    pub b: usize,
    /// The reference.
    pub a_from_b: Pose,
    /// y: `Monitor::jump_since`.
    pub motion: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
}

/// A node that moved.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedNode {
    /// Which.
    pub node: usize,
    /// Where its frame now is in its own old frame, `[rotation_rad; translation_m]`.
    pub old_from_new: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Attribution {
    /// The set that explains the edges best among those of least size; empty when nothing needs to have moved.
    pub moved: Vec<MovedNode>,
    /// χ² that it leaves.
    pub chi2: f64,
    /// Other sets as small that explain them about as well: when there are any, it is not decided which of them moved.
    pub rivals: Vec<Vec<usize>>,
    /// Whether any set was good enough; if not, `moved` is the best of the largest looked at.
    pub is_explained: bool,
}

/// A set is good enough when chance leaves a larger χ² this often,
const ACCEPTED: f64 = 1e-4;
/// or when it leaves no more than this share of what there was to explain: small motions are linear to that.
const NEGLIGIBLE: f64 = 0.02;
/// A rival's χ² may be larger by this much: odds of 8000 to 1.
const ABOUT_AS_WELL: f64 = 18.0;
/// Sets looked at.
const MAX_SETS: usize = 20_000;

/// Which of `nodes` nodes moved. Edges must name nodes below `nodes`; others are left out.
pub fn attribute(nodes: usize, edges: &[Edge]) -> Attribution {
    let edges: Vec<&Edge> = edges.iter().filter(|edge| edge.a < nodes && edge.b < nodes).collect();
    let all: Vec<usize> = (0..nodes).collect();
    smallest(&all, 0..=nodes, |set| fit(set, &edges))
}

/// The smallest set of `nodes`, of a size in `sizes`, that `fit` finds to explain everything; sets it has no fit for are left out.
pub(super) fn smallest(
    nodes: &[usize],
    sizes: std::ops::RangeInclusive<usize>,
    fit: impl Fn(&[usize]) -> Option<Fit>,
) -> Attribution {
    let (mut best, mut looked_at) = (Attribution::default(), 0);
    let unexplained = fit(&[]).map_or(0.0, |none| none.chi2);
    for size in sizes {
        let mut fits: Vec<(Vec<usize>, Fit)> = Vec::new();
        for set in sets(nodes.len(), size, MAX_SETS.saturating_sub(looked_at)) {
            looked_at += 1;
            let set: Vec<usize> = set.iter().map(|i| nodes[*i]).collect();
            fits.extend(fit(&set).map(|fit| (set, fit)));
        }
        fits.sort_by(|x, y| x.1.chi2.total_cmp(&y.1.chi2));
        let Some((set, first)) = fits.first() else { continue };
        best = answer(set, first, &fits, unexplained);
        if best.is_explained || MAX_SETS <= looked_at {
            break;
        }
    }
    best
}

fn answer(set: &[usize], first: &Fit, fits: &[(Vec<usize>, Fit)], unexplained: f64) -> Attribution {
    let moved = set.iter().enumerate().map(|(i, node)| first.node(i, *node)).collect();
    let rivals = fits[1..].iter().take_while(|(_, fit)| fit.chi2 < first.chi2 + ABOUT_AS_WELL);
    let is_likely = 0 < first.degrees_of_freedom && ACCEPTED < tail(first.degrees_of_freedom, first.chi2);
    Attribution {
        moved,
        chi2: first.chi2,
        rivals: rivals.map(|(set, _)| set.clone()).collect(),
        is_explained: is_likely
            || first.chi2 == 0.0
            || (!set.is_empty() && first.chi2 < NEGLIGIBLE * unexplained),
    }
}

/// The motions of a set that fit best.
pub(super) struct Fit {
    pub motions: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub chi2: f64,
    pub degrees_of_freedom: usize,
}

impl Fit {
    fn node(&self, i: usize, node: usize) -> MovedNode {
        MovedNode {
            node,
            old_from_new: self.motions.fixed_rows::<6>(6 * i).into(),
            covariance: self.covariance.fixed_view::<6, 6>(6 * i, 6 * i).into(),
        }
    }
}

/// None where the edges do not determine the set's motions.
fn fit(set: &[usize], edges: &[&Edge]) -> Option<Fit> {
    let n = 6 * set.len();
    let (mut information, mut score, mut chi2) = (DMatrix::zeros(n, n), DVector::zeros(n), 0.0);
    for edge in edges {
        let weight = edge.covariance.cholesky()?.inverse();
        let mut by_motions = DMatrix::zeros(6, n);
        let mut put = |node: usize, block: Matrix6| {
            if let Some(i) = set.iter().position(|member| *member == node) {
                by_motions.fixed_view_mut::<6, 6>(0, 6 * i).copy_from(&block);
            }
        };
        put(edge.a, Matrix6::identity());
        put(edge.b, -edge.a_from_b.adjoint());
        information += by_motions.transpose() * weight * &by_motions;
        score += by_motions.transpose() * weight * edge.motion;
        chi2 += edge.motion.dot(&(weight * edge.motion));
    }
    let (motions, covariance) = match n {
        0 => (score.clone(), information),
        _ => {
            let factor = scaled_cholesky(&information)?;
            (&factor * &score, factor)
        }
    };
    let chi2 = (chi2 - score.dot(&motions)).max(0.0);
    Some(Fit { motions, covariance, chi2, degrees_of_freedom: (6 * edges.len()).saturating_sub(n) })
}

/// Inverse of a positive definite matrix of radians and metres, scaled first; none where it is singular.
fn scaled_cholesky(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
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

/// The first `at_most` sets of `size` numbers below `n`, in lexical order.
fn sets(n: usize, size: usize, at_most: usize) -> Vec<Vec<usize>> {
    if n < size {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut set: Vec<usize> = (0..size).collect();
    while found.len() < at_most {
        found.push(set.clone());
        let Some(i) = (0..size).rev().find(|i| set[*i] < n - size + i) else { break };
        set[i] += 1;
        for j in i + 1..size {
            set[j] = set[j - 1] + 1;
        }
    }
    found
}
