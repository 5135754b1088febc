//! A whole record under constraints: modes and the coefficient of friction together.
//!
//! The friction angle and the modes depend on each other: expectation and maximisation in turn, eqs. (15), (16) of
//! docs/math/whisker_friction.md. Which way the whisker slides (one way throughout, or both with sticking between) is chosen by the
//! evidence of the record.

use super::modes::{TO_TIP_UNKNOWN, log_evidence, posterior, to_tip};
use super::states::{PRIOR_RAD, States, Tests, both_ways, is_sticking, sliding};
use super::{Constraint, FrictionAngle, Projection, project, sound};
use crate::contact::Method;
use crate::estimate::{Mode, Status, estimate};
use crate::{Cell, ContactEstimate, Error, Rod, Sample};

/// The prior of the coefficient of friction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Mu {
    /// Nothing: it is estimated from the record.
    #[default]
    Auto,
    /// Its value; the direction of slip is still found from the record.
    Known(f64),
}

/// The estimate of a record under constraints.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// One answer per sample, in the order given.
    pub estimates: Vec<ContactEstimate>,
    /// The tests of every sample in contact, in the same order; none where nothing is touched.
    pub tests: Vec<Option<Tests>>,
    /// φ_f, signed, and its standard deviation; 0 ± 0.5 of a record that says nothing of it.
    pub friction: FrictionAngle,
    /// μ = |tan φ_f|.
    pub mu: f64,
    /// Standard deviation of μ; 0 where μ was given.
    pub mu_sigma: f64,
    /// The states that were compared at every sample.
    pub states: Vec<Constraint>,
    /// How many samples the friction angle rests on: the sum of their mid-whisker probabilities.
    pub mid_samples: f64,
}

/// Rounds of expectation and maximisation; three to six are taken.
const ROUNDS: usize = 25;
/// A change of φ_f below this share of its standard deviation is the last.
const LAST_CHANGE: f64 = 1e-3;
/// A residual of more than this χ² pulls no harder than at it: tip samples mistaken for mid ones, second contacts.
pub(crate) const HUBER_CHI2: f64 = 9.0;
/// What a state more has to gain in ln evidence before it is believed.
const STATE_COST: f64 = 10.0;

/// Solves a record, all sweeps with one coefficient of friction. Every sample gets an answer; those that touch nothing keep their raw
/// one. Fails where the rod is none or a known μ is negative or not a number.
pub fn solve_record(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    mu: Mu,
    method: Method,
) -> Result<Record, Error> {
    rod.check()?;
    let cell = sound(rod, cell);
    let touched = Touched::new(rod, &cell, samples, method);
    let solved = match mu {
        Mu::Known(mu) => touched.with_known(checked(mu)?),
        Mu::Auto => touched.with_estimated(),
    };
    Ok(touched.record(solved))
}

pub(crate) fn checked(mu: f64) -> Result<f64, Error> {
    match mu {
        mu if !mu.is_finite() => Err(Error::NotFinite { what: "the coefficient of friction" }),
        mu if mu < 0.0 => Err(Error::NotPositive { what: "the coefficient of friction", seen: mu }),
        mu => Ok(mu),
    }
}

/// The samples in contact, with what does not depend on friction.
struct Touched<'a> {
    rod: &'a Rod,
    cell: Cell,
    samples: &'a [Sample],
    method: Method,
    raw: Vec<ContactEstimate>,
    tip: Vec<Option<Projection>>,
    /// Index ranges of uninterrupted contact within one sweep.
    runs: Vec<std::ops::Range<usize>>,
}

/// Projections and posteriors under one set of states.
struct Solved {
    states: Vec<Constraint>,
    friction: FrictionAngle,
    /// By sample and state; none outside contact.
    projections: Vec<Vec<Option<Projection>>>,
    probabilities: Vec<Vec<f64>>,
    ln_evidence: f64,
}

impl<'a> Touched<'a> {
    fn new(rod: &'a Rod, cell: &Cell, samples: &'a [Sample], method: Method) -> Self {
        let raw: Vec<_> = samples.iter().map(|sample| estimate(rod, cell, sample, method)).collect();
        let tip = samples
            .iter()
            .zip(&raw)
            .map(|(sample, raw)| {
                touches(raw).then(|| project(rod, cell, sample, Constraint::Tip, method).ok()).flatten()
            })
            .collect();
        let runs = runs(samples, &raw);
        Touched { rod, cell: *cell, samples, method, raw, tip, runs }
    }

    fn with_known(&self, mu: f64) -> Solved {
        let angle = |sign| FrictionAngle::of_mu(mu, 0.0, sign);
        if mu == 0.0 {
            return self.solve(sliding(angle(1.0)), angle(1.0));
        }
        let one_way = better(
            self.solve(sliding(angle(1.0)), angle(1.0)),
            self.solve(sliding(angle(-1.0)), angle(-1.0)),
        );
        better(one_way, self.solve(both_ways(angle(1.0)), angle(1.0)))
    }

    fn with_estimated(&self) -> Solved {
        let one_way = self.fit(self.median(|angle| angle), sliding);
        let start = self.median(f64::abs);
        // Turning round can be reported only where the friction angle is well above its own noise.
        if start < 5.0 * one_way.friction.sigma_rad.max(self.median_sigma() / 5.0) {
            return one_way;
        }
        better(one_way, self.fit(start, both_ways))
    }

    /// Eqs. (15), (16): the friction angle of maximum likelihood under the states it gives rise to.
    fn fit(&self, start_rad: f64, states: fn(FrictionAngle) -> Vec<Constraint>) -> Solved {
        let mut friction = FrictionAngle { rad: start_rad, sigma_rad: 0.0 };
        let mut solved = self.solve(states(friction), friction);
        for _ in 0..ROUNDS {
            let next = self.maximised(&solved);
            let change = (next.rad - friction.rad).abs();
            friction = FrictionAngle { sigma_rad: 0.0, ..next };
            solved = self.solve(states(friction), next);
            if change < LAST_CHANGE * next.sigma_rad {
                break;
            }
        }
        self.solve(states(solved.friction), solved.friction)
    }

    /// Eq. (15): one Gauss–Newton step of φ_f on the robust sum of mid-whisker χ².
    fn maximised(&self, solved: &Solved) -> FrictionAngle {
        let mut information = PRIOR_RAD.powi(-2);
        let mut gradient = -solved.friction.rad * information;
        for i in self.runs.iter().cloned().flatten() {
            for (projection, p) in solved.projections[i].iter().zip(&solved.probabilities[i]) {
                let Some(projection) = projection else { continue };
                let Constraint::Friction(angle) = projection.constraint else { continue };
                // A stick state spreads over the cone: it says nothing sharp of its edge.
                if is_sticking(&projection.constraint) {
                    continue;
                }
                let by_angle = projection.load.force_n().norm() * angle.rad.cos();
                let way = if angle.rad * solved.friction.rad < 0.0 { -1.0 } else { 1.0 };
                let weight =
                    p * (HUBER_CHI2 / projection.chi2).sqrt().min(1.0) / projection.innovation_variance_n2;
                information += weight * by_angle * by_angle;
                gradient += weight * by_angle * way * projection.innovation_n;
            }
        }
        FrictionAngle {
            rad: (solved.friction.rad + gradient / information).clamp(-1.4, 1.4),
            sigma_rad: information.powf(-0.5),
        }
    }

    fn solve(&self, states: Vec<Constraint>, friction: FrictionAngle) -> Solved {
        let mut projections = vec![Vec::new(); self.samples.len()];
        let mut probabilities = vec![Vec::new(); self.samples.len()];
        let mut ln_evidence = 0.0;
        for run in &self.runs {
            let (mut ln_of_run, mut to_tip) = (Vec::with_capacity(run.len()), Vec::with_capacity(run.len()));
            for i in run.clone() {
                projections[i] = states.iter().map(|state| self.project(i, state)).collect();
                to_tip.push(self.to_tip(&projections[i]));
                ln_of_run.push(projections[i].iter().map(|p| self.ln_evidence(p.as_ref())).collect());
            }
            let (run_probabilities, ln) = posterior(&states, &ln_of_run, &to_tip);
            ln_evidence += ln;
            run.clone().zip(run_probabilities).for_each(|(i, p)| probabilities[i] = p);
        }
        Solved { states, friction, projections, probabilities, ln_evidence }
    }

    fn project(&self, i: usize, state: &Constraint) -> Option<Projection> {
        match state {
            Constraint::Tip => self.tip[i].clone(),
            friction => project(self.rod, &self.cell, &self.samples[i], *friction, self.method).ok(),
        }
    }

    /// By the mid-whisker state that fits best.
    fn to_tip(&self, projections: &[Option<Projection>]) -> f64 {
        let mids = projections.iter().flatten().filter(|p| p.constraint.mode() == Mode::Mid);
        mids.min_by(|a, b| a.chi2.total_cmp(&b.chi2)).map_or(TO_TIP_UNKNOWN, |mid| to_tip(self.rod, mid))
    }

    fn ln_evidence(&self, projection: Option<&Projection>) -> f64 {
        projection.map_or(f64::NEG_INFINITY, |projection| log_evidence(self.rod, projection))
    }

    /// Median of a function of the raw friction angles, each weighted by its information.
    fn median(&self, of: fn(f64) -> f64) -> f64 {
        let weighted = self.angles().map(|(angle, sigma)| (of(angle), sigma.powi(-2))).collect();
        weighted_median(weighted)
    }

    fn median_sigma(&self) -> f64 {
        weighted_median(self.angles().map(|(_, sigma)| (sigma, sigma.powi(-2))).collect())
    }

    fn angles(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.runs.iter().cloned().flatten().filter_map(|i| {
            let contact = self.raw[i].contact.as_ref()?;
            let sigma = contact.friction_angle_sigma_rad;
            (sigma.is_finite() && 0.0 < sigma).then_some((contact.friction_angle_rad, sigma))
        })
    }

    fn record(&self, solved: Solved) -> Record {
        let mut record = Record {
            estimates: self.raw.clone(),
            tests: vec![None; self.samples.len()],
            friction: solved.friction,
            mu: solved.friction.mu(),
            mu_sigma: solved.friction.mu_sigma(),
            mid_samples: 0.0,
            states: solved.states.clone(),
        };
        for i in self.runs.iter().cloned().flatten() {
            let states = States {
                constraints: &solved.states,
                projections: &solved.projections[i],
                probabilities: &solved.probabilities[i],
            };
            let tests = states.tests(self.rod);
            record.mid_samples += 1.0 - tests.tip_probability;
            record.tests[i] = Some(tests);
            let sample = &self.samples[i];
            record.estimates[i] = states.blended(self.rod, &self.cell, sample, self.method, &self.raw[i]);
        }
        record
    }
}

/// The second only where its evidence pays for the states it has more.
fn better(first: Solved, second: Solved) -> Solved {
    let cost = STATE_COST * (second.states.len() - first.states.len()) as f64;
    if first.ln_evidence + cost < second.ln_evidence { second } else { first }
}

fn touches(raw: &ContactEstimate) -> bool {
    raw.status != Status::NoContact
}

fn runs(samples: &[Sample], raw: &[ContactEstimate]) -> Vec<std::ops::Range<usize>> {
    let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
    for i in 0..samples.len() {
        if !touches(&raw[i]) || !samples[i].load.is_finite() {
            continue;
        }
        match runs.last_mut() {
            Some(run) if run.end == i && samples[i].sweep == samples[i - 1].sweep => run.end = i + 1,
            _ => runs.push(i..i + 1),
        }
    }
    runs
}

fn weighted_median(mut weighted: Vec<(f64, f64)>) -> f64 {
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * weighted.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    for (value, weight) in weighted {
        sum += weight;
        if half <= sum {
            return value;
        }
    }
    0.0
}
