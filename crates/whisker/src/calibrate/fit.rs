//! The maximum-likelihood fit: readings are corrected, each within its noise, until every sample fulfils what its role demands; the
//! parameters are those for which the corrections are the least likely to be larger.
//!
//! ```text
//!   r̂ = r + v corrected reading · g(r̂, θ) = 0 · G = ∂g/∂r̂, A = ∂g/∂θ, S = G Σ Gᵀ, w = g − G v
//!   k = S⁻¹ w, v = −Σ Gᵀ k (to convergence) · cost = Σ wᵀ S⁻¹ w + Σ (θ/σ)²             docs/math/whisker_calibrate.md (11)–(14)
//! ```

use super::constraints::{Constraint, Observed, Plan, Posed, Role, Setting, State, corrected};
use super::parameters::{COUNT, Covariance, Parameter, Priors, Values};
use crate::Sample;
use nalgebra::{DMatrix, DVector, Matrix6, RowSVector, SMatrix, SVector};
use resight_core::least_squares::dense::{DenseEquations, minimize_dense};

/// Corrections of one sample are found anew at most this often; those that settle do so in two to four.
const PROJECTIONS: usize = 10;
/// … and are settled when they move by less than this part of a σ: the cost then errs by its square.
const SETTLED: f64 = 1e-5;
/// Prior of the object's pose: σ of each of its free parameters, metres or radians. It is wide enough to have no effect, and keeps the equations
/// solvable where no other prior is given.
const OBJECT_SIGMA: f64 = 1.0;

/// The problem to be fitted.
pub struct Problem<'a> {
    /// Rod, gravity, object.
    pub setting: Setting<'a>,
    /// All samples.
    pub samples: &'a [Sample],
    /// The equations of each sample.
    pub plans: &'a [Plan],
    /// The noise of the observations.
    pub noise: Noise,
    /// The prior of the parameters, about `centre`.
    pub priors: &'a Priors,
    /// The centre of the priors, and the start.
    pub centre: Values,
    /// Whether some roles may be wrong.
    pub roles_are_doubtful: bool,
}

/// The noise of the observations.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Covariance of the observations while the hub rotates.
    pub moving: Matrix6<f64>,
    /// Covariance while the angle is constant, without the encoder's rounding.
    pub still: Matrix6<f64>,
    /// The rounding's standard deviation, radians.
    pub rounding_rad: f64,
}

impl Noise {
    /// Returns the covariance of the observations at a sample.
    pub fn of(&self, plan: &Plan) -> &Matrix6<f64> {
        if plan.stretch.is_some_and(|stretch| stretch.is_still) { &self.still } else { &self.moving }
    }
}

/// The end of a fit.
pub struct Fitted {
    /// The parameters.
    pub state: State,
    /// Covariance of the rig's parameters, priors included.
    pub covariance: Covariance,
    /// Covariance of the object's parameters.
    pub object_covariance: DMatrix<f64>,
    /// The squared misfit of the samples.
    pub chi2: f64,
    /// Equations less the unknowns that the samples determine: docs/math/whisker_calibrate.md eq. (15).
    pub degrees_of_freedom: usize,
}

impl Problem<'_> {
    /// Finds the minimum from `start`; `None` where the equations have no solution.
    pub fn solve(&self, start: &State) -> Option<Fitted> {
        let layout = Layout::of(self, start);
        let solution = minimize_dense(
            start.clone(),
            |state| self.equations(state, &layout),
            |state, step| Some(layout.moved(state, step)),
        )?;
        let inverse = solution.equations.information.clone().cholesky()?.inverse();
        let of_priors: f64 = layout.offs(&solution.state, &self.centre).iter().map(|off| off * off).sum();
        Some(self.fitted(solution.state, &layout, &inverse, solution.equations.chi2 - of_priors))
    }

    fn fitted(&self, state: State, layout: &Layout, inverse: &DMatrix<f64>, chi2: f64) -> Fitted {
        let mut covariance = Covariance::zeros();
        for (i, (a, a_scale)) in layout.free.iter().enumerate() {
            for (j, (b, b_scale)) in layout.free.iter().enumerate() {
                covariance[(a.index(), b.index())] = inverse[(i, j)] * a_scale * b_scale;
            }
        }
        let (from, object) = (layout.free.len(), state.object.len());
        let object_covariance = inverse.view((from, from), (object, object)) * (OBJECT_SIGMA * OBJECT_SIGMA);
        let equations = self.equations_at(&state);
        // Every unknown has unit prior variance: the remaining share shows how much of it the samples determined.
        let determined = (inverse.nrows() as f64 - inverse.trace()).round() as usize;
        let degrees_of_freedom = equations - determined.min(equations);
        Fitted { state, covariance, object_covariance, chi2, degrees_of_freedom }
    }

    /// The number of equations of the samples at `state`.
    fn equations_at(&self, state: &State) -> usize {
        let posed = Posed::new(self.setting, state);
        let used = self.samples.iter().zip(self.plans).filter(|(_, plan)| plan.role != Role::Unused);
        used.map(|(sample, plan)| constraints(&posed, sample, plan).map_or(0, |rows| rows.len())).sum()
    }

    fn equations(&self, state: &State, layout: &Layout) -> Option<DenseEquations> {
        let posed = Posed::new(self.setting, state);
        let mut equations = DenseEquations::new(layout.count());
        for (i, off) in layout.offs(state, &self.centre).iter().enumerate() {
            equations.add(-off, &[(i, 1.0)]);
        }
        for (sample, plan) in
            self.samples.iter().zip(self.plans).filter(|(_, plan)| plan.role != Role::Unused)
        {
            for row in projected(&posed, sample, plan, &self.noise)? {
                self.add(&mut equations, &row, layout.entries(&row, plan));
            }
        }
        Some(equations)
    }
}

impl Problem<'_> {
    /// Adds a whitened equation; under doubt with Cauchy's loss c² ln(1 + r²/c²), which lets a few hundred wrong ones shout without
    /// being heard.
    fn add(&self, equations: &mut DenseEquations, row: &Constraint, mut entries: Vec<(usize, f64)>) {
        if !self.roles_are_doubtful {
            return equations.add(-row.value, &entries);
        }
        let squared = row.value * row.value / (LOSS_SCALE * LOSS_SCALE);
        let weight = 1.0 / (1.0 + squared);
        let root = weight.sqrt();
        entries.iter_mut().for_each(|(_, by)| *by *= root);
        equations.add(-row.value * root, &entries);
        equations.chi2 += LOSS_SCALE * LOSS_SCALE * (squared.ln_1p() - squared * weight);
    }
}

/// Residuals beyond this many σ count less and less under doubt.
const LOSS_SCALE: f64 = 3.0;

/// The unknowns, each in units of what it is uncertain by beforehand: free parameters, the object's, the encoder's roundings.
struct Layout {
    free: Vec<(Parameter, f64)>,
    object: usize,
    turns: usize,
    turn_scale: f64,
}

impl Layout {
    fn of(problem: &Problem, start: &State) -> Self {
        Layout {
            free: problem.priors.free().into_iter().map(|p| (p, problem.priors.sigma(p))).collect(),
            object: start.object.len(),
            turns: start.rotations_rad.len(),
            turn_scale: problem.noise.rounding_rad,
        }
    }

    fn count(&self) -> usize {
        self.free.len() + self.object + self.turns
    }

    fn moved(&self, state: &State, step: &DVector<f64>) -> State {
        let mut moved = state.clone();
        for (i, (parameter, scale)) in self.free.iter().enumerate() {
            moved.values[parameter.index()] += step[i] * scale;
        }
        let (object, turns) = (self.free.len(), self.free.len() + self.object);
        moved.object += step.rows(object, self.object) * OBJECT_SIGMA;
        moved.rotations_rad += step.rows(turns, self.turns) * self.turn_scale;
        moved
    }

    /// The distance of every unknown from its expected value.
    fn offs(&self, state: &State, centre: &Values) -> Vec<f64> {
        let free = self.free.iter().map(|(p, scale)| (state.values[p.index()] - centre[p.index()]) / scale);
        let object = state.object.iter().map(|off| off / OBJECT_SIGMA);
        free.chain(object).chain(state.rotations_rad.iter().map(|off| off / self.turn_scale)).collect()
    }

    fn entries(&self, row: &Constraint, plan: &Plan) -> Vec<(usize, f64)> {
        let free = self.free.iter().map(|(p, scale)| row.by_parameters[p.index()] * scale);
        let object = row.by_object.iter().map(|by| by * OBJECT_SIGMA);
        let mut entries: Vec<(usize, f64)> = free.chain(object).enumerate().collect();
        if let Some(stretch) = plan.stretch {
            let turn = row.by_parameters[Parameter::HubAngle.index()] * self.turn_scale;
            entries.push((self.free.len() + self.object + stretch.unknown, turn));
        }
        entries
    }
}

/// Returns the constraints of a sample at its corrected reading, whitened: independent and of unit variance where they hold. `None` where the
/// sample has no contact.
pub fn projected(posed: &Posed, sample: &Sample, plan: &Plan, noise: &Noise) -> Option<Vec<Constraint>> {
    let noise = noise.of(plan);
    let (rows, correction) = settled(posed, &posed.rotated(sample, plan), plan, noise)?;
    whitened(rows, &correction, noise)
}

/// The constraints at the corrected reading, and the correction: eq. (12).
fn settled(
    posed: &Posed,
    sample: &Sample,
    plan: &Plan,
    noise: &Matrix6<f64>,
) -> Option<(Vec<Constraint>, Observed)> {
    let mut correction = Observed::zeros();
    let mut rows = constraints(posed, sample, plan)?;
    for _ in 0..PROJECTIONS {
        let next = correction_of(&rows, &correction, noise)?;
        let moved = next - correction;
        let Some(there) = constraints(posed, &corrected(sample, &next), plan) else { break };
        (correction, rows) = (next, there);
        if scaled(&moved, noise) < SETTLED {
            break;
        }
    }
    Some((rows, correction))
}

fn constraints(posed: &Posed, sample: &Sample, plan: &Plan) -> Option<Vec<Constraint>> {
    if plan.role == Role::Free { Some(posed.free(sample)) } else { posed.contact(sample, plan) }
}

/// v = −Σ Gᵀ S⁻¹ (g − G v).
fn correction_of(rows: &[Constraint], correction: &Observed, noise: &Matrix6<f64>) -> Option<Observed> {
    let (w, s) = misclosure(rows, correction, noise);
    let k = s.cholesky()?.solve(&w);
    let back = rows.iter().zip(k.iter()).map(|(row, k)| row.by_observed.transpose() * *k);
    Some(-(noise * back.sum::<Observed>()))
}

fn misclosure(
    rows: &[Constraint],
    correction: &Observed,
    noise: &Matrix6<f64>,
) -> (DVector<f64>, DMatrix<f64>) {
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
        by_parameters: RowSVector::<f64, COUNT>::from_iterator(
            mix(&|r| to_dynamic(&r.by_parameters), i).iter().copied(),
        ),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Object;
    use crate::calibrate::constraints::Outlined;
    use crate::calibrate::outline::Outline;
    use crate::contact::Method;
    use crate::{HubLoad, Rod, Shape};
    use nalgebra::Vector2;

    /// The corrected reading fulfils every equation, and what the correction costs is what the fit counts: eq. (13).
    #[test]
    fn corrections_fulfil_the_equations_at_the_cost_counted() {
        let rod = Rod::uniform(0.25, 9.8e-3).expect("a rod");
        let circle = Shape::Circle { centre_m: Vector2::new(0.09, 0.14), radius_m: 0.025 };
        let outline = Outline::of(&Object::Known(circle)).expect("an outline");
        let setting = Setting {
            rod: &rod,
            gravity: None,
            outline: Some(&outline),
            method: Method::Auto,
            curvature_is_free: false,
        };
        let state = State::at(Values::zeros());
        let posed = Posed::new(setting, &state);
        // Coarse instruments, so that corrections are large enough for the curvature of the constraints to count.
        let noise = Matrix6::from_diagonal(&nalgebra::Vector6::new(4e-4, 4e-4, 1e-8, 1e-4, 1e-4, 1e-4));
        let load = HubLoad { fx_n: -0.22, fy_n: 0.36, mz_n_m: 0.068 };
        let mut sample = Sample { load, ..Sample::default() };
        sample.world_from_hub.angle_rad = 1.4;
        for (role, outlined) in
            [(Role::Mid, Outlined::Supports), (Role::Mid, Outlined::Not), (Role::Tip, Outlined::Not)]
        {
            let plan = Plan { role, outlined, stretch: None };
            let (rows, correction) = settled(&posed, &sample, &plan, &noise).expect("a contact");
            assert!(
                rows.iter().all(|row| row.value.abs() < 1e-9),
                "{:?}",
                rows.iter().map(|r| r.value).collect::<Vec<_>>()
            );
            let whitened = whitened(rows, &correction, &noise).expect("a covariance");
            let counted: f64 = whitened.iter().map(|row| row.value * row.value).sum();
            let cost = correction.dot(&(noise.try_inverse().expect("a covariance") * correction));
            assert!((counted / cost - 1.0).abs() < 1e-4 && 0.5 < cost, "{counted} {cost}");
        }
    }
}
