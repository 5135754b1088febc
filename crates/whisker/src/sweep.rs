//! The contacts of whole sweeps estimated together.
//!
//! One sample determines its contact well across the whisker and badly along it; from sample to sample the contact can only move
//! along the object's tangent, which is the whisker's own. With the friction of sliding, one angle for the whole record, and
//! the length at the tip, that fixes the place along the whisker too, without any assumption on the object's shape.
//! Derivation: docs/math/whisker_sweep.md.

pub mod chain;
pub mod node;
pub mod envelope;
pub mod roles;
pub mod start;
pub mod batch;
pub mod tip;
pub mod record;
pub mod window;
pub mod fixed_lag;

use crate::contact::{ByLoad, Method};
use crate::estimate::{Contact, ContactEstimate, GATE_SIGMAS, MOST_ALONG_SHARE, Mode, Status};
use crate::{Cell, Error, HubContact, Rod, Sample};
use batch::{Prior, Smoothed};
use nalgebra::{Matrix3, Matrix3x4, Matrix4, Vector3};
use node::{Instrument, Linear, Node, Role, direction, left_of};
use record::{Chained, Run};
use tip::Undecided;

/// Standard deviation of the friction angle where nothing is known of it, radians: half of all pairings lie below 0.35.
const UNKNOWN_FRICTION_RAD: f64 = 0.5;
/// Standard deviation of a friction coefficient given as exact.
const EXACT_MU: f64 = 1e-7;
/// A contact leaves its tangent where the envelope condition is off by this many standard deviations: once in 2 million.
const JUMP: f64 = 5.0;
/// A jump across the tangent by less than this share of the length is no leap but a contradiction.
const LEAP: f64 = 0.002;
/// Friction that helps sliding, by this many standard deviations, is a wrong stiffness or gain.
const IMPOSSIBLE_FRICTION: f64 = 5.0;
/// χ² of the three readings against the smoothed load above which they contradict it: once in 15 000.
const INCONSISTENT: f64 = 22.0;

/// What is known of friction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Friction {
    /// Nothing: one coefficient for the record is estimated.
    #[default]
    Unknown,
    /// Its coefficient.
    Given {
        /// μ.
        mu: f64,
    },
}

/// How sweeps are smoothed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What is known of friction.
    pub friction: Friction,
    /// How the elastica is solved.
    pub method: Method,
    /// Samples the fixed-lag smoother waits before it settles one.
    pub lag_samples: usize,
}

impl Default for Options {
    fn default() -> Self {
        Options { friction: Friction::Unknown, method: Method::Auto, lag_samples: 20 }
    }
}

/// Where the contact left its tangent: the whisker let go of one place and caught on another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// The row after which the contact jumped.
    pub after_row: usize,
    /// The residual of the envelope condition in standard deviations.
    pub deviations: f64,
    /// The motion of the contact across its tangent, metres.
    pub across_m: f64,
}

/// A smoothed record.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// One estimate per sample, in the order given.
    pub estimates: Vec<ContactEstimate>,
    /// Coefficient of friction.
    pub mu: f64,
    /// Its standard deviation; 0 where given, infinite where no sample slides.
    pub mu_sigma: f64,
    /// Jumps, by row.
    pub jumps: Vec<Jump>,
    /// Sum of squares at the minimum.
    pub chi2: f64,
    /// Its expected value; chance deviates from it by √(2 × this).
    pub degrees_of_freedom: usize,
    /// Whether all this can be: the sum of squares chance, jumps true leaps and at most one per run of contacts, friction not negative. If not,
    /// no estimate has the status ok: stiffness, gains or zero are wrong. (A hub off by a fixed offset or angle moves the whole
    /// outline and cannot be reported here.)
    pub consistent: bool,
    /// Samples in contact.
    pub contacts: usize,
    /// Steps of the last minimisation.
    pub iterations: usize,
}

/// Smooths a whole record, one or several sweeps distinguished by `sweep`; one coefficient of friction for all of it.
/// Errors: a rod that is none, a load cell without noise, a negative μ. Rows that are no numbers get the status
/// `inconsistent`, rows without load `no_contact`.
pub fn smooth(rod: &Rod, cell: &Cell, samples: &[Sample], options: &Options) -> Result<Sweep, Error> {
    let with = Instrument::new(rod, cell, options.method)?;
    let prior = prior(&options.friction)?;
    let mut runs = record::runs(&with, samples);
    let first_rad = match options.friction {
        Friction::Given { .. } => prior.angle_rad,
        Friction::Unknown => record::first_friction_rad(&with, &runs),
    };
    for run in &mut runs {
        record::assign_roles(&with, run, first_rad);
    }
    let mut chained = record::chain(&with, samples, &runs, prior, first_rad);
    let mut jumps = Vec::new();
    let smoothed = settle(&mut chained, &mut jumps, &runs);
    Ok(report(&with, samples, &runs, &chained, smoothed, jumps, options))
}

/// The prior of the friction angle.
pub(crate) fn prior(friction: &Friction) -> Result<Prior, Error> {
    match *friction {
        Friction::Unknown => Ok(Prior { angle_rad: 0.0, sigma_rad: UNKNOWN_FRICTION_RAD }),
        Friction::Given { mu } if 0.0 <= mu && mu.is_finite() => {
            Ok(Prior { angle_rad: mu.atan(), sigma_rad: EXACT_MU })
        }
        Friction::Given { mu } => Err(Error::NotPositive { what: "the coefficient of friction", seen: mu }),
    }
}

/// Minimises; breaks the worst envelope condition that does not hold, moves the border between mid-whisker and tip where
/// that fits better, and again.
fn settle(chained: &mut Chained, jumps: &mut Vec<Jump>, runs: &[Run]) -> Option<Smoothed> {
    let mut smoothed = chained.problem.minimise()?;
    for _ in 0..chained.problem.nodes.len() {
        if tip::improve(&mut chained.problem, &smoothed) {
            smoothed = chained.problem.minimise()?;
            continue;
        }
        let tests = chained.problem.envelope_tests(&smoothed);
        let worst = (0..tests.len()).fold(0, |a, b| if tests[a].abs() < tests[b].abs() { b } else { a });
        if tests.get(worst).is_none_or(|t| t.abs() < JUMP) {
            break;
        }
        chained.problem.linked[worst] = false;
        if let Some((run, index)) = chained.place[worst] {
            let (after_row, deviations) = (runs[run][index].row, tests[worst].abs());
            jumps.push(Jump { after_row, deviations, across_m: 0.0 });
        }
        smoothed = chained.problem.minimise()?;
    }
    jumps.sort_by_key(|jump| jump.after_row);
    measure(jumps, chained, runs, &smoothed);
    Some(smoothed)
}

/// How far every jump went, once all is settled.
fn measure(jumps: &mut [Jump], chained: &Chained, runs: &[Run], smoothed: &Smoothed) {
    for (i, place) in chained.place.iter().enumerate() {
        let row = place.map(|(run, index)| runs[run][index].row);
        for jump in jumps.iter_mut().filter(|jump| Some(jump.after_row) == row) {
            let pair = envelope::Pair::envelope(&smoothed.linear[i], &smoothed.linear[i + 1]);
            jump.across_m = pair.residual_m.abs();
        }
    }
}

fn report(
    with: &Instrument,
    samples: &[Sample],
    runs: &[Run],
    chained: &Chained,
    smoothed: Option<Smoothed>,
    jumps: Vec<Jump>,
    options: &Options,
) -> Sweep {
    let problem = &chained.problem;
    let smoothed = smoothed.unwrap_or_default();
    let mut estimates = answers(with, samples, runs, chained, &smoothed);
    let degrees_of_freedom = problem.degrees_of_freedom(&smoothed.linear);
    let variance = if smoothed.linear.is_empty() { f64::INFINITY } else { smoothed.solution.shared_variance };
    let (mu, mu_sigma) = coefficient(problem.shared_rad, variance, &options.friction);
    let consistent = smoothed.chi2 < chi2_limit(degrees_of_freedom)
        && jumps.len() <= runs.len()
        && jumps.iter().all(|jump| LEAP * with.rod.length_m < jump.across_m)
        && -IMPOSSIBLE_FRICTION * mu_sigma <= mu;
    if !consistent {
        estimates.iter_mut().filter(|e| e.status == Status::Ok).for_each(|e| e.status = Status::Inconsistent);
    }
    Sweep {
        estimates,
        mu,
        mu_sigma,
        jumps,
        chi2: smoothed.chi2,
        degrees_of_freedom,
        consistent,
        contacts: runs.iter().map(Vec::len).sum(),
        iterations: smoothed.iterations,
    }
}

/// One estimate per sample.
fn answers(
    with: &Instrument,
    samples: &[Sample],
    runs: &[Run],
    chained: &Chained,
    smoothed: &Smoothed,
) -> Vec<ContactEstimate> {
    let problem = &chained.problem;
    let mut estimates: Vec<ContactEstimate> = samples.iter().map(without_contact).collect();
    for seen in runs.iter().flatten() {
        estimates[seen.row].status = Status::NoZero;
    }
    let undecided = if smoothed.linear.is_empty() { Vec::new() } else { tip::undecided(problem, smoothed) };
    for (i, linear) in smoothed.linear.iter().enumerate() {
        if let Some((run, index)) = chained.place[i] {
            let seen = &runs[run][index];
            let covariance = &smoothed.solution.covariances[i];
            let (node, state) = (&problem.nodes[i], &problem.states[i]);
            estimates[seen.row] = doubted(estimate(with, node, state, linear, covariance), &undecided[i]);
        }
    }
    estimates
}

/// χ² above which a record contradicts itself: five standard deviations, and never below that of few degrees of freedom.
fn chi2_limit(degrees_of_freedom: usize) -> f64 {
    let expected = degrees_of_freedom as f64;
    expected + 5.0 * (2.0 * expected).sqrt() + 10.0
}

/// μ = tan φ and its standard deviation.
pub(crate) fn coefficient(angle_rad: f64, variance: f64, friction: &Friction) -> (f64, f64) {
    match *friction {
        Friction::Given { mu } => (mu, 0.0),
        Friction::Unknown => (angle_rad.tan(), variance.sqrt() / angle_rad.cos().powi(2)),
    }
}

/// A row without contact: nothing touched, or no numbers.
pub(crate) fn without_contact(sample: &Sample) -> ContactEstimate {
    let status = if record::is_number(sample) { Status::NoContact } else { Status::Inconsistent };
    ContactEstimate { status, mode: Mode::Free, mode_probability: 1.0, contact: None, branches: Vec::new() }
}

/// A node at its minimum as an estimate.
pub(crate) fn estimate(
    with: &Instrument,
    node: &Node,
    z: &chain::Local,
    linear: &Linear,
    covariance: &Matrix4<f64>,
) -> ContactEstimate {
    let contact = linear.contact.as_ref().map(|c| contact_in_world(with, node, z, linear, c, covariance));
    let misfit = node.deviation(z).norm_squared();
    let status = match &contact {
        None => Status::NoZero,
        Some(c) if MOST_ALONG_SHARE * with.rod.length_m < c.s_sigma_m => Status::LowForce,
        Some(_) if INCONSISTENT < misfit => Status::Inconsistent,
        Some(c) if with.rod.length_m + GATE_SIGMAS * c.s_sigma_m < c.s_m && node.role != Role::Tip => {
            Status::BeyondTip
        }
        Some(_) => Status::Ok,
    };
    let mode = if node.role == Role::Tip { Mode::Tip } else { Mode::Mid };
    ContactEstimate { status, mode, mode_probability: 1.0, contact, branches: Vec::new() }
}

/// Widened by what the borders between mid-whisker and tip leave undecided.
fn doubted(mut estimate: ContactEstimate, undecided_node: &Undecided) -> ContactEstimate {
    estimate.mode_probability = undecided_node.probability;
    if let Some(contact) = &mut estimate.contact {
        contact.covariance += undecided_node.spread;
        let along = direction(contact.theta_rad).push(0.0);
        contact.s_sigma_m = contact.s_sigma_m.hypot(undecided_node.along(&along).max(0.0).sqrt());
    }
    estimate
}

/// Covariances, eq. (16): of the smoothed unknowns, and of the hub's pose where the unknowns do not carry it.
fn contact_in_world(
    with: &Instrument,
    node: &Node,
    z: &chain::Local,
    linear: &Linear,
    (at, by_load): &(HubContact, ByLoad),
    covariance: &Matrix4<f64>,
) -> Contact {
    let load = z.xyz().component_mul(&with.load_sigma);
    let force = load.xy().norm();
    let row = |index: usize| by_load.row(index).transpose().push(0.0);
    let variance = |by: nalgebra::Vector4<f64>| by.dot(&(covariance * by)).max(0.0);
    let mut by = Matrix3x4::zeros();
    by.fixed_view_mut::<2, 4>(0, 0).copy_from(&linear.x_by);
    by.set_row(2, &row(2).transpose());
    Contact {
        x_in_world: linear.x,
        theta_rad: node.hub.angle_rad + at.theta_rad,
        s_m: at.s_m,
        s_sigma_m: variance(row(3)).sqrt(),
        f_normal_n: force * at.friction_angle_rad.cos(),
        f_tangent_n: force * at.friction_angle_rad.sin(),
        friction_angle_rad: at.friction_angle_rad,
        friction_angle_sigma_rad: variance(row(4)).sqrt(),
        modulus_squared: at.modulus_squared,
        covariance: by * covariance * by.transpose() + pose_covariance(with, node, linear),
    }
}

/// What ε does not carry: the hub's noise along the tangent and in the angle, and the rounding a resting hub's angle keeps.
fn pose_covariance(with: &Instrument, node: &Node, linear: &Linear) -> Matrix3<f64> {
    let along = direction(linear.alpha_rad);
    let along = Vector3::new(along.x, along.y, 0.0) * with.xy_sigma_m;
    let arm = left_of(linear.x - nalgebra::Vector2::new(node.hub.x_m, node.hub.y_m));
    let kept = if node.fresh_angle { 0.0 } else { with.angle_step_sigma_rad };
    let turned = Vector3::new(arm.x, arm.y, 1.0) * kept;
    let angle =
        Vector3::new(0.0, 0.0, if node.fresh_angle { with.angle_sigma_rad } else { with.angle_noise_rad });
    along * along.transpose() + turned * turned.transpose() + angle * angle.transpose()
}
