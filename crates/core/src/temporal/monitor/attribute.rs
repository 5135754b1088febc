//! Finds which of several cameras and targets moved: the smallest set whose motion explains all relative motions between them.
//!
//! ```text
//!   α, β  old_from_new of nodes a, b      y = Log(a_from_b Exp(−β) a_from_b⁻¹ Exp(α)) ≈ α − Ad(a_from_b) β
//!         docs/math/monitor.md eq. (13)
//! ```

mod edges;

use crate::statistics::chi_square::tail;
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Pose, Vector6};
use edges::Edges;
use nalgebra::{DMatrix, DVector};

/// The relative motion of frames a and b since a common time, by one monitor.
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
    /// Its number.
    pub node: usize,
    /// The pose of its frame in its own old frame, `[rotation_rad; translation_m]`.
    pub old_from_new: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
}

/// The nodes that moved, and the alternatives.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Attribution {
    /// The set that explains the edges best among those of least size; empty when nothing needs to have moved.
    pub moved: Vec<MovedNode>,
    /// χ² that it leaves.
    pub chi2: f64,
    /// Other sets as small that explain them about as well: when there are any, it is not decided which of them moved.
    pub alternatives: Vec<Vec<usize>>,
    /// Whether any set was good enough; if not, `moved` is the best of the largest looked at.
    pub is_explained: bool,
}

/// A set is good enough when chance leaves a larger χ² this often,
const ACCEPTED: f64 = 1e-4;
/// or when it leaves no more than this share of what there was to explain, and no larger set is clearly better: two hundredths of the
/// motion, which grow with it (a lens, the size of a target). It is a square: 2 % of χ² would hide a motion of a seventh.
const NEGLIGIBLE: f64 = 4e-4;
/// An alternative's χ² may be larger by this much: odds of 8000 to 1.
const ABOUT_AS_WELL: f64 = 18.0;
/// Sets looked at.
const MAX_SETS: usize = 20_000;

/// Returns which of `nodes` nodes moved. Edges must name nodes below `nodes`; others are left out, and those whose covariance is none.
pub fn attribute(nodes: usize, edges: &[Edge]) -> Attribution {
    let edges = Edges::new(nodes, edges);
    let all: Vec<usize> = (0..nodes).collect();
    smallest(&all, 0..=nodes, |set| edges.fit(set))
}

/// Returns the smallest set of `nodes`, of a size in `sizes`, that explains everything by `fit`; sets without a fit are left out.
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
        if best.is_explained {
            // It leaves little, but more than chance does: another that moved a little beside it?
            let is_better = first.is_likely() && first.chi2 + first.worth(size, &best) < best.chi2;
            return if is_better { answer(set, first, &fits, unexplained) } else { best };
        }
        best = answer(set, first, &fits, unexplained);
        let is_settled = best.is_explained && (first.is_likely() || first.chi2 < ABOUT_AS_WELL);
        if is_settled || MAX_SETS <= looked_at {
            break;
        }
    }
    best
}

fn answer(set: &[usize], first: &Fit, fits: &[(Vec<usize>, Fit)], unexplained: f64) -> Attribution {
    let moved = set.iter().enumerate().map(|(i, node)| first.node(i, *node)).collect();
    let alternatives = fits[1..].iter().take_while(|(_, fit)| fit.chi2 < first.chi2 + ABOUT_AS_WELL);
    let is_little = !set.is_empty() && first.chi2 < NEGLIGIBLE * unexplained;
    Attribution {
        moved,
        chi2: first.chi2,
        alternatives: alternatives.map(|(set, _)| set.clone()).collect(),
        is_explained: first.is_likely() || first.chi2 == 0.0 || is_little,
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

    fn is_likely(&self) -> bool {
        0 < self.degrees_of_freedom && ACCEPTED < tail(self.degrees_of_freedom, self.chi2)
    }

    /// χ² that a set of `size` must save over a smaller one: more than its further numbers do by chance.
    fn worth(&self, size: usize, smaller: &Attribution) -> f64 {
        ABOUT_AS_WELL + 6.0 * size.saturating_sub(smaller.moved.len()) as f64
    }
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

numbers!(MovedNode { node, old_from_new, covariance });
numbers!(Attribution { moved, chi2, alternatives, is_explained });
