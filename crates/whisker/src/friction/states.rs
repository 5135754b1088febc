//! One sample under every state at once: the tests, and one answer of all.

use super::mixture::{NEGLIGIBLE, mixed};
use super::{Constraint, FrictionAngle, INCONSISTENT_CHI2, Projection, answer};
use crate::contact::Method;
use crate::estimate::{Mode, Status};
use crate::{Cell, ContactEstimate, Rod, Sample};

/// Standard deviation of the friction angle before any sample, radians: a record without mid-whisker contacts answers 0 ± this.
pub const PRIOR_RAD: f64 = 0.5;

/// The tests of one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tests {
    /// χ² (1 degree of freedom) against the best mid-whisker state, the part of it that lies beyond the tip included; none where
    /// no load near the measured one has such a contact.
    pub mid_chi2: Option<f64>,
    /// χ² (1 degree of freedom) against s = L.
    pub tip_chi2: Option<f64>,
    /// Posterior probability of the tip; what is left belongs to the mid-whisker states.
    pub tip_probability: f64,
    /// Posterior probability that the whisker sticks, where the record shows sticking at all.
    pub stick_probability: f64,
}

/// The states that a sample may be in.
pub(crate) struct States<'a> {
    /// What each demands.
    pub constraints: &'a [Constraint],
    /// The load under each; none where there is no such load near the measured one.
    pub projections: &'a [Option<Projection>],
    /// Their probabilities.
    pub probabilities: &'a [f64],
}

impl States<'_> {
    pub(crate) fn tests(&self, rod: &Rod) -> Tests {
        let sum = |of: &dyn Fn(&Constraint) -> bool| -> f64 {
            let pairs = self.constraints.iter().zip(self.probabilities);
            pairs.filter(|(state, _)| of(state)).fold(0.0, |sum, (_, p)| sum + p)
        };
        let best = |mode| {
            let of_mode = self.projections.iter().flatten().filter(|p| p.constraint.mode() == mode);
            of_mode.map(|p| fit_chi2(rod, p)).min_by(f64::total_cmp)
        };
        Tests {
            mid_chi2: best(Mode::Mid),
            tip_chi2: best(Mode::Tip),
            tip_probability: sum(&|state| state.mode() == Mode::Tip),
            // One sliding state of unknown friction spreads like a sticking one, but is none.
            stick_probability: if 2 < self.constraints.len() { sum(&is_sticking) } else { 0.0 },
        }
    }

    /// The mixture of all states by their probabilities; the mode is the more probable one. Where its constraint is contradicted: what the
    /// load says by itself, and the verdict.
    pub(crate) fn blended(
        &self,
        rod: &Rod,
        cell: &Cell,
        sample: &Sample,
        method: Method,
        raw: &ContactEstimate,
    ) -> ContactEstimate {
        let (mode, probability) = match self.tests(rod).tip_probability {
            tip if 0.5 < tip => (Mode::Tip, tip),
            tip => (Mode::Mid, 1.0 - tip),
        };
        let fitting = self.fitting(rod, mode);
        let under = |projection| answer(rod, cell, sample, method, raw, projection, probability);
        match fitting.first() {
            Some((_, first)) if first.constraint.mode() == mode => {
                let total: f64 = fitting.iter().map(|(p, _)| p).sum();
                let contacts = fitting.iter().filter_map(|(p, at)| Some((p / total, under(at).contact?)));
                ContactEstimate { contact: mixed(&contacts.collect::<Vec<_>>()), ..under(first) }
            }
            _ => contradicted(raw, mode, probability),
        }
    }

    /// What is neither contradicted nor negligible, the mode's own most probable state first.
    fn fitting(&self, rod: &Rod, mode: Mode) -> Vec<(f64, &Projection)> {
        let pairs = self.projections.iter().zip(self.probabilities);
        let mut fitting: Vec<(f64, &Projection)> = pairs
            .filter_map(|(projection, p)| Some((*p, projection.as_ref()?)))
            .filter(|(p, projection)| NEGLIGIBLE < *p && fit_chi2(rod, projection) <= INCONSISTENT_CHI2)
            .collect();
        let is_of = |projection: &Projection| projection.constraint.mode() == mode;
        fitting.sort_by(|(p, a), (q, b)| is_of(b).cmp(&is_of(a)).then(q.total_cmp(p)));
        fitting
    }
}

fn contradicted(raw: &ContactEstimate, mode: Mode, probability: f64) -> ContactEstimate {
    let status = if raw.status == Status::Ok { Status::Inconsistent } else { raw.status };
    ContactEstimate { status, mode, mode_probability: probability, ..raw.clone() }
}

/// χ² of a projection, and of its arc length where that lies beyond the tip.
fn fit_chi2(rod: &Rod, projection: &Projection) -> f64 {
    let beyond =
        (projection.at.s_m - rod.length_m).max(0.0) / projection.s_sigma_m().max(1e-9 * rod.length_m);
    match projection.constraint {
        Constraint::Friction(_) => projection.chi2 + beyond * beyond,
        Constraint::Tip => projection.chi2,
    }
}

/// Sliding one way, or at the tip.
pub(crate) fn sliding(friction: FrictionAngle) -> Vec<Constraint> {
    vec![Constraint::Friction(friction), Constraint::Tip]
}

/// Sliding either way, and sticking: anywhere in the cone, as a normal variable of the cone's second moment, φ_f²/3, eq. (17).
pub(crate) fn both_ways(friction: FrictionAngle) -> Vec<Constraint> {
    let sigma_rad = friction.sigma_rad.hypot(friction.rad / 3.0_f64.sqrt());
    [friction, FrictionAngle { rad: -friction.rad, ..friction }, FrictionAngle { rad: 0.0, sigma_rad }]
        .map(Constraint::Friction)
        .into_iter()
        .chain([Constraint::Tip])
        .collect()
}

/// Whether a state is the sticking one.
pub(crate) fn is_sticking(state: &Constraint) -> bool {
    matches!(state, Constraint::Friction(angle) if angle.rad == 0.0 && PRIOR_RAD * 1e-3 < angle.sigma_rad)
}
