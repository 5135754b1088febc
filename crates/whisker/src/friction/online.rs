//! Friction sample by sample, each answered before the next: the chain's filter instead of its smoother, and the friction angle as known at that
//! time. docs/math/whisker_friction.md eqs. (20), (21).

use super::modes::{TO_TIP_UNKNOWN, filter, log_evidence, to_tip};
use super::record::{HUBER_CHI2, checked};
use super::states::{PRIOR_RAD, States, Tests, both_ways, sliding};
use super::{Constraint, FrictionAngle, Mu, Projection, project, sound};
use crate::contact::Method;
use crate::estimate::{Mode, Status, estimate};
use crate::{Cell, ContactEstimate, Error, Rod, Sample};

/// Constrained contacts of a stream. Constant memory.
#[derive(Debug, Clone)]
pub struct Online {
    rod: Rod,
    cell: Cell,
    method: Method,
    mu: Mu,
    friction: FrictionAngle,
    sweep: Option<u32>,
    /// The last sample's states and its chance to reach the tip; none where it touched nothing.
    before: Option<(Vec<f64>, f64)>,
}

impl Online {
    /// A stream that has seen nothing. Fails where the rod is none or a known μ is negative or not a number.
    pub fn new(rod: &Rod, cell: &Cell, mu: Mu, method: Method) -> Result<Self, Error> {
        rod.check()?;
        let friction = match mu {
            Mu::Known(mu) => FrictionAngle::of_mu(checked(mu)?, 0.0, 1.0),
            Mu::Auto => FrictionAngle { rad: 0.0, sigma_rad: PRIOR_RAD },
        };
        let (rod, cell) = (rod.clone(), sound(rod, cell));
        Ok(Online { rod, cell, method, mu, friction, sweep: None, before: None })
    }

    /// φ_f as far as the stream has shown it.
    pub fn friction(&self) -> FrictionAngle {
        self.friction
    }

    /// Answers a sample; tests where something is touched.
    pub fn push(&mut self, sample: &Sample) -> (ContactEstimate, Option<Tests>) {
        let raw = estimate(&self.rod, &self.cell, sample, self.method);
        if self.sweep.replace(sample.sweep) != Some(sample.sweep) {
            self.before = None;
        }
        if raw.status == Status::NoContact || !sample.load.is_finite() {
            self.before = None;
            return (raw, None);
        }
        let constraints = self.states();
        let projections: Vec<Option<Projection>> = constraints
            .iter()
            .map(|state| project(&self.rod, &self.cell, sample, *state, self.method).ok())
            .collect();
        let probabilities = self.filtered(&constraints, &projections);
        let states =
            States { constraints: &constraints, projections: &projections, probabilities: &probabilities };
        let tests = states.tests(&self.rod);
        let answer = states.blended(&self.rod, &self.cell, sample, self.method, &raw);
        self.learn(&projections, &probabilities);
        (answer, Some(tests))
    }

    /// A known coefficient leaves the direction open; an unknown one is taken with its sign.
    fn states(&self) -> Vec<Constraint> {
        match self.mu {
            Mu::Known(mu) if 0.0 < mu => both_ways(self.friction),
            _ => sliding(self.friction),
        }
    }

    fn filtered(&mut self, constraints: &[Constraint], projections: &[Option<Projection>]) -> Vec<f64> {
        let ln_evidence: Vec<f64> = projections
            .iter()
            .map(|projection| projection.as_ref().map_or(f64::NEG_INFINITY, |p| log_evidence(&self.rod, p)))
            .collect();
        let before = self.before.as_ref().map(|(states, to_tip)| (states.as_slice(), *to_tip));
        let (probabilities, _) = filter(constraints, before, &ln_evidence);
        let mids = projections.iter().flatten().filter(|p| p.constraint.mode() == Mode::Mid);
        let best = mids.min_by(|a, b| a.chi2.total_cmp(&b.chi2));
        let next = best.map_or(TO_TIP_UNKNOWN, |mid| to_tip(&self.rod, mid));
        self.before = Some((probabilities.clone(), next));
        probabilities
    }

    /// Eqs. (20), (21): the friction angle after the sample, by the mid state's share of it.
    fn learn(&mut self, projections: &[Option<Projection>], probabilities: &[f64]) {
        if self.mu != Mu::Auto {
            return;
        }
        for (projection, p) in projections.iter().zip(probabilities) {
            let Some(projection) = projection else { continue };
            let Constraint::Friction(angle) = projection.constraint else { continue };
            let by_angle = projection.load.force_n().norm() * angle.rad.cos();
            let share = p * (HUBER_CHI2 / projection.chi2).sqrt().min(1.0);
            let gain = share * angle.sigma_rad.powi(2) * by_angle / projection.innovation_variance_n2;
            self.friction.rad = (self.friction.rad + gain * projection.innovation_n).clamp(-1.4, 1.4);
            self.friction.sigma_rad *= (1.0 - gain * by_angle).max(0.0).sqrt();
        }
    }
}
