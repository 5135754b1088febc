//! Normal equations with many small groups of unknowns that are connected only through a few shared ones, such as points beside the photographs
//! that show them. The groups are eliminated one by one, so that the work is proportional to their number instead of its cube.
//!
//! ```text
//!   ⎡ S    C₁ᵀ  C₂ᵀ … ⎤      D_b = L_b L_bᵀ   W_b = L_b⁻¹ C_b   v_b = L_b⁻¹ g_b
//!   ⎢ C₁   D₁         ⎥      (S − Σ W_bᵀW_b) x = g − Σ W_bᵀv_b
//!   ⎣ C₂        D₂    ⎦      x_b = L_b⁻ᵀ (v_b − W_b x)                                 docs/math/survey.md eqs. (25)–(26)
//!   g(x) = q  the level, a = ∇g:  δ = y + z (q − g − aᵀy)/(aᵀz),  H y = c,  H z = a                  eq. (12)
//! ```

use super::dense::NormalEquations;
use super::{Ending, Minimum};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::sync::Arc;

/// Position of an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum At {
    Shared(usize),
    Group(usize, usize),
}

/// The partition of the unknowns into shared ones and groups.
#[derive(Debug, Clone, Default)]
pub struct Arrow {
    at: Vec<At>,
    shared: Vec<usize>,
    groups: Vec<Vec<usize>>,
}

impl Arrow {
    /// Partitions `n` unknowns: each group has its own, and the rest are shared.
    pub fn new(n: usize, groups: Vec<Vec<usize>>) -> Self {
        let mut at = vec![At::Shared(0); n];
        let mut is_shared = vec![true; n];
        for (group, unknowns) in groups.iter().enumerate() {
            for (within, unknown) in unknowns.iter().enumerate() {
                at[*unknown] = At::Group(group, within);
                is_shared[*unknown] = false;
            }
        }
        let shared: Vec<usize> = (0..n).filter(|i| is_shared[*i]).collect();
        shared.iter().enumerate().for_each(|(k, unknown)| at[*unknown] = At::Shared(k));
        Arrow { at, shared, groups }
    }

    /// Returns the unknowns of each group.
    pub fn groups(&self) -> &[Vec<usize>] {
        &self.groups
    }
}

/// D, its gradient and C of one group; C is stored column by column, for the shared unknowns to which it is connected.
#[derive(Debug, Clone, Default)]
struct Group {
    information: Vec<f64>,
    gradient: Vec<f64>,
    columns: Vec<usize>,
    coupling: Vec<f64>,
}

impl Group {
    fn new(k: usize) -> Self {
        let (information, gradient) = (vec![0.0; k * k], vec![0.0; k]);
        Group { information, gradient, columns: Vec::new(), coupling: Vec::new() }
    }

    fn size(&self) -> usize {
        self.gradient.len()
    }

    /// Returns where C's column of a shared unknown begins.
    fn column(&mut self, shared: usize) -> usize {
        let k = self.size();
        let known = self.columns.iter().position(|column| *column == shared);
        let column = known.unwrap_or_else(|| {
            self.columns.push(shared);
            self.coupling.resize(self.columns.len() * k, 0.0);
            self.columns.len() - 1
        });
        column * k
    }

    /// Computes Cholesky's factor, L row by row, and W column by column; `diagonal` maps the elements of the diagonal.
    fn factor(&self, diagonal: impl Fn(f64) -> f64) -> Option<GroupFactor> {
        let k = self.size();
        let mut lower = self.information.clone();
        (0..k).for_each(|i| lower[i * k + i] = diagonal(lower[i * k + i]));
        for j in 0..k {
            let pivot = lower[j * k + j] - (0..j).map(|m| lower[j * k + m].powi(2)).sum::<f64>();
            if !(0.0 < pivot) {
                return None;
            }
            lower[j * k + j] = pivot.sqrt();
            for i in j + 1..k {
                let sum: f64 = (0..j).map(|m| lower[i * k + m] * lower[j * k + m]).sum();
                lower[i * k + j] = (lower[i * k + j] - sum) / lower[j * k + j];
            }
        }
        let mut w = self.coupling.clone();
        w.chunks_exact_mut(k).for_each(|column| forward(&lower, column));
        Some(GroupFactor { lower, w })
    }
}

#[derive(Debug, Clone)]
struct GroupFactor {
    lower: Vec<f64>,
    w: Vec<f64>,
}

/// Computes L⁻¹ b.
fn forward(lower: &[f64], b: &mut [f64]) {
    let k = b.len();
    for i in 0..k {
        let sum: f64 = (0..i).map(|m| lower[i * k + m] * b[m]).sum();
        b[i] = (b[i] - sum) / lower[i * k + i];
    }
}

/// Computes L⁻ᵀ b.
fn backward(lower: &[f64], b: &mut [f64]) {
    let k = b.len();
    for i in (0..k).rev() {
        let sum: f64 = (i + 1..k).map(|m| lower[m * k + i] * b[m]).sum();
        b[i] = (b[i] - sum) / lower[i * k + i];
    }
}

/// The equations.
#[derive(Debug, Clone)]
pub struct ArrowEquations {
    arrow: Arc<Arrow>,
    /// Sum of squared whitened residuals.
    pub chi2: f64,
    /// c for all unknowns, in their order.
    pub gradient: DVector<f64>,
    shared: DMatrix<f64>,
    groups: Vec<Group>,
}

impl ArrowEquations {
    /// Starts without rows.
    pub fn new(arrow: &Arc<Arrow>) -> Self {
        let m = arrow.shared.len();
        ArrowEquations {
            arrow: Arc::clone(arrow),
            chi2: 0.0,
            gradient: DVector::zeros(arrow.at.len()),
            shared: DMatrix::zeros(m, m),
            groups: arrow.groups.iter().map(|unknowns| Group::new(unknowns.len())).collect(),
        }
    }

    /// Adds a whitened residual and the derivatives of what was predicted, by the unknowns they belong to (each once), of one group at most.
    pub fn add(&mut self, residual: f64, entries: &[(usize, f64)]) {
        self.chi2 += residual * residual;
        let (at, m) = (&self.arrow.at, self.arrow.shared.len());
        for (unknown, by_j) in entries {
            self.gradient[*unknown] += by_j * residual;
            match at[*unknown] {
                At::Shared(j) => {
                    let column = &mut self.shared.as_mut_slice()[j * m..][..m];
                    let mut begin: Option<usize> = None;
                    for (other, by_i) in entries {
                        match at[*other] {
                            At::Shared(i) => column[i] += by_i * by_j,
                            At::Group(group, i) => {
                                let group = &mut self.groups[group];
                                let begin = *begin.get_or_insert_with(|| group.column(j));
                                group.coupling[begin + i] += by_i * by_j;
                            }
                        }
                    }
                }
                At::Group(group, j) => {
                    let k = self.groups[group].size();
                    let row = &mut self.groups[group].information[j * k..][..k];
                    for (other, by_i) in entries {
                        if let At::Group(of_other, i) = at[*other] {
                            debug_assert_eq!(group, of_other, "a row joins two groups");
                            row[i] += by_i * by_j;
                        }
                    }
                }
            }
        }
    }

    /// Returns the diagonal of H, in the order of the unknowns.
    pub fn diagonal(&self) -> Vec<f64> {
        let of = |at: &At| match *at {
            At::Shared(i) => self.shared[(i, i)],
            At::Group(group, i) => self.groups[group].information[i * self.groups[group].size() + i],
        };
        self.arrow.at.iter().map(of).collect()
    }

    /// Returns H x.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        let of_shared =
            DVector::from_iterator(self.arrow.shared.len(), self.arrow.shared.iter().map(|i| x[*i]));
        let mut by_shared = &self.shared * &of_shared;
        let mut product = DVector::zeros(x.len());
        for (group, unknowns) in self.groups.iter().zip(&self.arrow.groups) {
            let k = group.size();
            for (i, unknown) in unknowns.iter().enumerate() {
                product[*unknown] = (0..k).map(|j| group.information[i * k + j] * x[unknowns[j]]).sum();
            }
            for (column, coupling) in group.columns.iter().zip(group.coupling.chunks_exact(k)) {
                for (i, by) in coupling.iter().enumerate() {
                    product[unknowns[i]] += by * of_shared[*column];
                    by_shared[*column] += by * x[unknowns[i]];
                }
            }
        }
        self.arrow.shared.iter().enumerate().for_each(|(k, unknown)| product[*unknown] = by_shared[k]);
        product
    }

    /// Returns H, both triangles.
    pub fn dense(&self) -> DMatrix<f64> {
        let n = self.arrow.at.len();
        let unit = |i: usize| DVector::from_fn(n, |k, _| f64::from(u8::from(k == i)));
        DMatrix::from_columns(&(0..n).map(|i| self.times(&unit(i))).collect::<Vec<_>>())
    }

    /// Returns the equations with each unknown in a unit of its own.
    pub fn scaled(&self, unit: &[f64]) -> Self {
        let mut scaled = self.clone();
        let of = |k: usize| unit[self.arrow.shared[k]];
        for i in 0..self.shared.nrows() {
            for j in 0..self.shared.ncols() {
                scaled.shared[(i, j)] *= of(i) * of(j);
            }
        }
        for (group, unknowns) in scaled.groups.iter_mut().zip(&self.arrow.groups) {
            let k = group.size();
            for i in 0..k {
                for j in 0..k {
                    group.information[i * k + j] *= unit[unknowns[i]] * unit[unknowns[j]];
                }
                for (column, shared) in group.columns.iter().enumerate() {
                    group.coupling[column * k + i] *= unit[unknowns[i]] * of(*shared);
                }
            }
        }
        scaled
    }

    /// Returns the factor of H with its diagonal raised by `damping`; an unknown on which nothing depends is not changed.
    pub fn factor(&self, damping: f64) -> Option<ArrowFactor<'_>> {
        let diagonal = |x: f64| if x == 0.0 { 1.0 } else { x * (1.0 + damping) };
        let groups: Vec<GroupFactor> =
            self.groups.iter().map(|group| group.factor(diagonal)).collect::<Option<_>>()?;
        let mut shared = self.shared.clone();
        (0..shared.nrows()).for_each(|i| shared[(i, i)] = diagonal(shared[(i, i)]));
        for (group, factor) in self.groups.iter().zip(&groups) {
            let k = group.size();
            for (a, i) in factor.w.chunks_exact(k).zip(&group.columns) {
                for (b, j) in factor.w.chunks_exact(k).zip(&group.columns) {
                    shared[(*i, *j)] -= a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
                }
            }
        }
        Some(ArrowFactor { equations: self, groups, shared: shared.cholesky()? })
    }
}

impl NormalEquations for ArrowEquations {
    fn chi2(&self) -> f64 {
        self.chi2
    }

    fn step(&self, damping: f64) -> Option<(DVector<f64>, f64)> {
        let step = self.factor(damping)?.solve(&self.gradient);
        let promised = step.dot(&self.gradient);
        promised.is_finite().then_some((step, promised))
    }
}

/// The factor of H.
#[derive(Debug)]
pub struct ArrowFactor<'a> {
    equations: &'a ArrowEquations,
    groups: Vec<GroupFactor>,
    shared: Cholesky<f64, Dyn>,
}

impl ArrowFactor<'_> {
    fn parts(&self) -> impl Iterator<Item = (&Group, &GroupFactor, &Vec<usize>)> {
        let equations = self.equations;
        equations.groups.iter().zip(&self.groups).zip(&equations.arrow.groups).map(|((g, f), u)| (g, f, u))
    }

    /// Returns the least pivot.
    pub fn least_pivot(&self) -> f64 {
        let of_groups = self.parts().flat_map(|(group, factor, _)| {
            let k = group.size();
            (0..k).map(move |i| factor.lower[i * k + i])
        });
        let shared = self.shared.l_dirty();
        of_groups.chain((0..shared.nrows()).map(|i| shared[(i, i)])).fold(f64::INFINITY, f64::min)
    }

    /// Returns H⁻¹ b.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let shared = &self.equations.arrow.shared;
        let mut right = DVector::from_iterator(shared.len(), shared.iter().map(|i| b[*i]));
        let mut of_groups: Vec<Vec<f64>> = Vec::with_capacity(self.groups.len());
        for (group, factor, unknowns) in self.parts() {
            let mut v: Vec<f64> = unknowns.iter().map(|i| b[*i]).collect();
            forward(&factor.lower, &mut v);
            for (w, column) in factor.w.chunks_exact(v.len()).zip(&group.columns) {
                right[*column] -= w.iter().zip(&v).map(|(x, y)| x * y).sum::<f64>();
            }
            of_groups.push(v);
        }
        self.shared.solve_mut(&mut right);
        let mut x = DVector::zeros(b.len());
        shared.iter().enumerate().for_each(|(k, unknown)| x[*unknown] = right[k]);
        for ((group, factor, unknowns), mut v) in self.parts().zip(of_groups) {
            for (w, column) in factor.w.chunks_exact(v.len()).zip(&group.columns) {
                v.iter_mut().zip(w).for_each(|(v, w)| *v -= w * right[*column]);
            }
            backward(&factor.lower, &mut v);
            unknowns.iter().zip(&v).for_each(|(unknown, v)| x[*unknown] = *v);
        }
        x
    }

    /// Returns H⁻¹: docs/math/survey.md eq. (27).
    pub fn inverse(&self) -> ArrowInverse {
        let (shared, m) = (self.shared.inverse(), self.equations.arrow.shared.len());
        let of_group = |(group, factor, _): (&Group, &GroupFactor, _)| {
            let k = group.size();
            // −Y_bᵀ, from the columns of Y_b = D_b⁻¹ C_b.
            let mut carried = DMatrix::zeros(m, k);
            for (column, w) in group.columns.iter().zip(factor.w.chunks_exact(k)) {
                let mut y = w.to_vec();
                backward(&factor.lower, &mut y);
                (0..k).for_each(|i| carried[(*column, i)] = -y[i]);
            }
            let to_shared = &shared * &carried;
            let mut own = to_shared.tr_mul(&carried);
            for j in 0..k {
                let mut unit: Vec<f64> = (0..k).map(|i| f64::from(u8::from(i == j))).collect();
                forward(&factor.lower, &mut unit);
                backward(&factor.lower, &mut unit);
                (0..k).for_each(|i| own[(i, j)] += unit[i]);
            }
            GroupInverse { own, to_shared, carried }
        };
        let groups = self.parts().map(of_group).collect();
        ArrowInverse { arrow: Arc::clone(&self.equations.arrow), shared, groups }
    }
}

/// The part of H⁻¹ that belongs to one group.
#[derive(Debug, Clone)]
struct GroupInverse {
    /// Between its own unknowns.
    own: DMatrix<f64>,
    /// Between the shared unknowns (rows) and its own.
    to_shared: DMatrix<f64>,
    /// −Y_bᵀ: how its own unknowns follow the shared ones.
    carried: DMatrix<f64>,
}

/// H⁻¹, in parts whose size is proportional to the number of groups: what lies between two groups is computed where it is needed.
#[derive(Debug, Clone)]
pub struct ArrowInverse {
    arrow: Arc<Arrow>,
    shared: DMatrix<f64>,
    groups: Vec<GroupInverse>,
}

impl ArrowInverse {
    /// Returns the element of two unknowns.
    pub fn at(&self, a: usize, b: usize) -> f64 {
        match (self.arrow.at[a], self.arrow.at[b]) {
            (At::Shared(i), At::Shared(j)) => self.shared[(i, j)],
            (At::Shared(i), At::Group(group, j)) | (At::Group(group, j), At::Shared(i)) => {
                self.groups[group].to_shared[(i, j)]
            }
            (At::Group(group, i), At::Group(other, j)) if group == other => self.groups[group].own[(i, j)],
            (At::Group(group, i), At::Group(other, j)) => {
                self.groups[group].to_shared.column(i).dot(&self.groups[other].carried.column(j))
            }
        }
    }

    /// Returns H⁻¹ x.
    pub fn times(&self, x: &DVector<f64>) -> DVector<f64> {
        let shared = &self.arrow.shared;
        let of = |unknowns: &[usize]| DVector::from_iterator(unknowns.len(), unknowns.iter().map(|i| x[*i]));
        let parts = || self.groups.iter().zip(&self.arrow.groups);
        let mut moving = of(shared);
        parts().for_each(|(group, unknowns)| moving += &group.carried * of(unknowns));
        let mut product = DVector::zeros(x.len());
        let by_shared = &self.shared * &moving;
        shared.iter().enumerate().for_each(|(k, unknown)| product[*unknown] = by_shared[k]);
        for (group, unknowns) in parts() {
            let of_group = of(unknowns);
            // `own` has what the group itself brings to `moving`.
            let by_others = &moving - &group.carried * &of_group;
            let by_group = group.to_shared.tr_mul(&by_others) + &group.own * of_group;
            unknowns.iter().zip(by_group.iter()).for_each(|(unknown, value)| product[*unknown] = *value);
        }
        product
    }

    /// Returns it with all elements multiplied by a number.
    pub fn scaled(mut self, by: f64) -> Self {
        self.shared *= by;
        for group in &mut self.groups {
            group.own *= by;
            group.to_shared *= by;
        }
        self
    }
}

/// Largest number of steps on a level surface: near a minimum each squares the error.
const LEVEL_STEPS: usize = 30;
/// A step on a level surface that is shorter than this squared number of standard deviations is the last.
const LEVEL_TOLERANCE_CHI2: f64 = 1e-7;

/// Minimises a cost on a level surface; `level` returns how far its function is above the level, and its gradient. `None` where the steps do not
/// converge.
pub(crate) fn minimize_on_level<S: Clone>(
    start: &S,
    level: impl Fn(&S) -> Option<(f64, DVector<f64>)>,
    evaluate: impl Fn(&S) -> Option<ArrowEquations>,
    moved: impl Fn(&S, &DVector<f64>) -> Option<S>,
) -> Option<Minimum<S, ArrowEquations>> {
    let mut state = start.clone();
    let mut before = f64::INFINITY;
    let mut shortened = 1.0;
    for steps in 1..=LEVEL_STEPS {
        let (equations, (above, gradient)) = (evaluate(&state)?, level(&state)?);
        let factor = equations.factor(0.0)?;
        let (down, along) = (factor.solve(&equations.gradient), factor.solve(&gradient));
        let multiplier = (-above - gradient.dot(&down)) / gradient.dot(&along);
        let step = down + along * multiplier;
        let length2 = step.dot(&equations.times(&step));
        if !length2.is_finite() {
            return None;
        }
        if length2 <= LEVEL_TOLERANCE_CHI2 {
            return Some(Minimum { state, equations, steps, ending: Ending::Converged });
        }
        // Steps that do not shrink circle around the minimum: half of each converges.
        shortened = if 0.5 * before < length2 { 0.5 * shortened } else { shortened };
        before = length2;
        state = moved(&state, &(step * f64::max(shortened, 0.1)))?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::least_squares::dense::DenseEquations;

    /// Seven shared unknowns, some interleaved with the others, and groups of one to six that are connected to different shared ones.
    fn made() -> (ArrowEquations, DenseEquations) {
        let groups: Vec<Vec<usize>> =
            vec![vec![1], vec![3, 5, 7], vec![9, 10, 11, 12, 13, 14], vec![15, 16, 17]];
        let arrow = Arc::new(Arrow::new(20, groups.clone()));
        let (mut sparse, mut dense) = (ArrowEquations::new(&arrow), DenseEquations::new(20));
        let mut seed = 7u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        for group in groups.iter().map(Vec::as_slice).chain([[].as_slice()]) {
            for row in 0..3 * group.len() + 8 {
                let shared = arrow.shared.iter().filter(|i| (**i + row) % 3 != 0);
                let entries: Vec<(usize, f64)> = group.iter().chain(shared).map(|i| (*i, draw())).collect();
                let residual = draw();
                sparse.add(residual, &entries);
                dense.add(residual, &entries);
            }
        }
        (sparse, dense)
    }

    /// All results equal those of the whole matrix, except for rounding times its condition (below 1e4 here).
    #[test]
    fn groups_give_what_the_whole_matrix_gives() {
        let (sparse, dense) = made();
        assert!((sparse.dense() - &dense.information).amax() < 1e-13);
        assert_eq!(sparse.chi2, dense.chi2);
        for damping in [0.0, 0.3] {
            let (step, promised) = sparse.step(damping).expect("a step");
            let (expected, expected_promise) = NormalEquations::step(&dense, damping).expect("a step");
            assert!((step - expected).amax() < 1e-11 && (promised - expected_promise).abs() < 1e-11);
        }
        let expected = dense.information.clone().try_inverse().expect("an inverse");
        let factor = sparse.factor(0.0).expect("a factor");
        let inverse = factor.inverse();
        assert!((DMatrix::from_fn(20, 20, |i, j| inverse.at(i, j)) - &expected).amax() < 1e-11);
        let x = DVector::from_fn(20, |i, _| (i as f64).sin());
        assert!((inverse.times(&x) - &expected * &x).amax() < 1e-11);
        assert!((inverse.scaled(3.0).times(&x) - &expected * &x * 3.0).amax() < 3e-11);
        let unit: Vec<f64> = sparse.diagonal().iter().map(|d| d.sqrt().recip()).collect();
        let scaled = sparse.scaled(&unit);
        assert!(scaled.diagonal().iter().all(|d| (d - 1.0).abs() < 1e-14));
        assert!(
            (scaled.dense() - DMatrix::from_fn(20, 20, |i, j| dense.information[(i, j)] * unit[i] * unit[j]))
                .amax()
                < 1e-14
        );
        assert!(
            scaled
                .factor(0.0)
                .is_some_and(|factor| 1e-3 < factor.least_pivot() && factor.least_pivot() <= 1.0)
        );
    }

    #[test]
    fn what_nothing_determines_has_no_factor() {
        let (mut sparse, _) = made();
        sparse.groups[1].information[0] = -1.0;
        assert!(sparse.factor(0.0).is_none() && sparse.step(0.0).is_none());
    }

    /// Four times as many points need four times as many numbers: nothing is kept for each pair of them.
    #[test]
    fn an_inverse_grows_in_proportion_to_its_groups() {
        let numbers = |n_groups: usize| {
            let groups: Vec<Vec<usize>> =
                (0..n_groups).map(|g| (0..3).map(|k| 6 + 3 * g + k).collect()).collect();
            let arrow = Arc::new(Arrow::new(6 + 3 * n_groups, groups.clone()));
            let mut equations = ArrowEquations::new(&arrow);
            for (g, k) in (0..n_groups).flat_map(|g| (0..9).map(move |k| (g, k))) {
                let entries =
                    groups[g].iter().copied().chain(0..6).map(|i| (i, (((i + 1) * (k + 2)) as f64).sin()));
                equations.add(0.1, &entries.collect::<Vec<_>>());
            }
            let inverse = equations.factor(0.0).expect("a factor").inverse();
            let of_group =
                |group: &GroupInverse| group.own.len() + group.to_shared.len() + group.carried.len();
            inverse.groups.iter().map(of_group).sum::<usize>()
        };
        assert_eq!(numbers(40), 4 * numbers(10));
    }
}
