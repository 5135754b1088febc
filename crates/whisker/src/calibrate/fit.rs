//! The maximum-likelihood fit: readings are corrected, each within its noise, until every sample fulfils what its role demands; the
//! parameters are those for which the corrections are the least likely to be larger.
//!
//! ```text
//!   r̂ = r + v corrected reading · g(r̂, θ) = 0 · G = ∂g/∂r̂, A = ∂g/∂θ, S = G Σ Gᵀ, w = g − G v
//!   k = S⁻¹ w, v = −Σ Gᵀ k (to convergence) · cost = Σ wᵀ S⁻¹ w + Σ (θ/σ)²             docs/math/whisker_calibrate.md (11)–(14)
//! ```

use super::constraints::{Constraint, Observed, Posed, Role, Setting, State, corrected};
use super::parameters::{COUNT, Covariance, Parameter, Priors, Values};
use crate::Sample;
use nalgebra::{DMatrix, DVector, Matrix6, RowSVector, SMatrix, SVector};
use resight_core::least_squares::dense::{DenseEquations, minimize_dense};

/// Corrections of one sample are found anew at most this often; contacts of eight σ and more settle in two or three.
const PROJECTIONS: usize = 6;
/// … and are settled when they move by less than this part of a σ: the cost then errs by its square.
const SETTLED: f64 = 1e-5;
/// How far an object may be from where it was said to be: σ of each of its free parameters, metres or radians. Wide enough to say
/// nothing, it keeps the equations solvable where nothing is said of one.
const OBJECT_SIGMA: f64 = 1.0;

/// What is fitted.
pub struct Problem<'a> {
    /// Rod, gravity, object.
    pub setting: Setting<'a>,
    /// All samples.
    pub samples: &'a [Sample],
    /// What each is taken for.
    pub roles: &'a [Role],
    /// Covariance of what is observed.
    pub noise: Matrix6<f64>,
    /// How well the parameters are known beforehand, about `centre`.
    pub priors: &'a Priors,
    /// Where the priors are centred.
    pub centre: Values,
}

/// Where it ends.
pub struct Fitted {
    /// The parameters.
    pub state: State,
    /// Covariance of the rig's parameters, priors included.
    pub covariance: Covariance,
    /// Covariance of the object's parameters.
    pub object_covariance: DMatrix<f64>,
    /// The cost, priors included.
    pub chi2: f64,
    /// Equations less the object's parameters: every prior is an equation too, which pays for its parameter.
    pub degrees_of_freedom: usize,
}

impl Problem<'_> {
    /// The minimum from `start`; none where the equations have no solution.
    pub fn solve(&self, start: &State) -> Option<Fitted> {
        let free = self.priors.free();
        let solution = minimize_dense(
            start,
            |state| self.equations(state, &free),
            |state, step| Some(self.moved(state, &free, step)),
        )?;
        let inverse = solution.equations.information.clone().cholesky()?.inverse();
        Some(self.fitted(solution.state, &free, &inverse, solution.equations.chi2))
    }

    fn fitted(&self, state: State, free: &[Parameter], inverse: &DMatrix<f64>, chi2: f64) -> Fitted {
        let mut covariance = Covariance::zeros();
        for (i, a) in free.iter().enumerate() {
            for (j, b) in free.iter().enumerate() {
                let scale = self.priors.sigma(*a) * self.priors.sigma(*b);
                covariance[(a.index(), b.index())] = inverse[(i, j)] * scale;
            }
        }
        let object = state.object.len();
        let object_covariance = inverse.view((free.len(), free.len()), (object, object)).into_owned();
        let equations: usize = (0..self.samples.len()).map(|i| self.equations_of(i)).sum();
        Fitted { state, covariance, object_covariance, chi2, degrees_of_freedom: equations - object.min(equations) }
    }

    /// How many equations the i-th sample gives.
    fn equations_of(&self, i: usize) -> usize {
        match self.roles[i] {
            Role::Free => 3,
            Role::Mid | Role::Tip => 1 + usize::from(self.setting.outline.is_some()),
            Role::Unused => 0,
        }
    }

    /// The unknowns are the free parameters in units of their prior σ, then the object's.
    fn moved(&self, state: &State, free: &[Parameter], step: &DVector<f64>) -> State {
        let mut moved = state.clone();
        for (i, parameter) in free.iter().enumerate() {
            moved.values[parameter.index()] += step[i] * self.priors.sigma(*parameter);
        }
        for i in 0..state.object.len() {
            moved.object[i] += step[free.len() + i];
        }
        moved
    }

    fn equations(&self, state: &State, free: &[Parameter]) -> Option<DenseEquations> {
        let posed = Posed::new(self.setting, state);
        let mut equations = DenseEquations::new(free.len() + state.object.len());
        for (i, parameter) in free.iter().enumerate() {
            let off = state.values[parameter.index()] - self.centre[parameter.index()];
            equations.add(-off / self.priors.sigma(*parameter), &[(i, 1.0)]);
        }
        for (i, off) in state.object.iter().enumerate() {
            equations.add(-off / OBJECT_SIGMA, &[(free.len() + i, 1.0 / OBJECT_SIGMA)]);
        }
        for (sample, role) in self.samples.iter().zip(self.roles).filter(|(_, role)| **role != Role::Unused) {
            for row in projected(&posed, sample, *role, &self.noise)? {
                let mut entries: Vec<(usize, f64)> = free
                    .iter()
                    .enumerate()
                    .map(|(i, p)| (i, row.by_parameters[p.index()] * self.priors.sigma(*p)))
                    .collect();
                entries.extend(row.by_object.iter().enumerate().map(|(i, d)| (free.len() + i, *d)));
                equations.add(-row.value, &entries);
            }
        }
        Some(equations)
    }
}

/// The constraints of a sample at its corrected reading, whitened: their values independent and of unit variance where they hold.
/// None where the sample has no contact.
pub fn projected(posed: &Posed, sample: &Sample, role: Role, noise: &Matrix6<f64>) -> Option<Vec<Constraint>> {
    let mut correction = Observed::zeros();
    let mut rows = constraints(posed, sample, role)?;
    for _ in 0..PROJECTIONS {
        let next = correction_of(&rows, &correction, noise)?;
        let moved = next - correction;
        let Some(there) = constraints(posed, &corrected(sample, &next), role) else { break };
        (correction, rows) = (next, there);
        if scaled(&moved, noise) < SETTLED {
            break;
        }
    }
    whitened(rows, &correction, noise)
}

fn constraints(posed: &Posed, sample: &Sample, role: Role) -> Option<Vec<Constraint>> {
    if role == Role::Free { Some(posed.free(sample)) } else { posed.contact(sample, role) }
}

/// v = −Σ Gᵀ S⁻¹ (g − G v).
fn correction_of(rows: &[Constraint], correction: &Observed, noise: &Matrix6<f64>) -> Option<Observed> {
    let (w, s) = misclosure(rows, correction, noise);
    let k = s.cholesky()?.solve(&w);
    let back = rows.iter().zip(k.iter()).map(|(row, k)| row.by_observed.transpose() * *k);
    Some(-(noise * back.sum::<Observed>()))
}

fn misclosure(rows: &[Constraint], correction: &Observed, noise: &Matrix6<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let w = rows.iter().map(|row| row.value - (row.by_observed * correction)[0]);
    let s = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        (rows[i].by_observed * noise * rows[j].by_observed.transpose())[0]
    });
    (DVector::from_iterator(rows.len(), w), s)
}

fn whitened(rows: Vec<Constraint>, correction: &Observed, noise: &Matrix6<f64>) -> Option<Vec<Constraint>> {
    let (w, s) = misclosure(&rows, correction, noise);
    let factor = s.cholesky()?;
    let white = factor.l().solve_lower_triangular(&DMatrix::identity(rows.len(), rows.len()))?;
    let mix = |pick: &dyn Fn(&Constraint) -> DVector<f64>, i: usize| {
        rows.iter().enumerate().map(|(j, row)| pick(row) * white[(i, j)]).sum::<DVector<f64>>()
    };
    let whitened = (0..rows.len()).map(|i| Constraint {
        value: (white.row(i) * &w)[0],
        by_observed: RowSVector::from_iterator(mix(&|r| to_dynamic(&r.by_observed), i).iter().copied()),
        by_parameters: RowSVector::<f64, COUNT>::from_iterator(mix(&|r| to_dynamic(&r.by_parameters), i).iter().copied()),
        by_object: mix(&|r| DVector::from_column_slice(&r.by_object), i).iter().copied().collect(),
    });
    let whitened: Vec<Constraint> = whitened.collect();
    whitened.iter().all(|row| row.value.is_finite()).then_some(whitened)
}

fn to_dynamic<const N: usize>(row: &RowSVector<f64, N>) -> DVector<f64> {
    DVector::from_iterator(N, row.iter().copied())
}

/// The largest component of a correction, in σ of the noise; one without noise does not move.
fn scaled(moved: &Observed, noise: &Matrix6<f64>) -> f64 {
    let sigmas: SVector<f64, 6> = SMatrix::diagonal(noise).map(f64::sqrt);
    moved.iter().zip(sigmas.iter()).filter(|(_, s)| 0.0 < **s).map(|(v, s)| (v / s).abs()).fold(0.0, f64::max)
}
