//! Decides for each sample whether it touches nothing, between clamp and tip, or at the tip: the most probable sequence along each sweep.
//!
//! Every role has a misfit d², in units of the noise and of what the parameters are uncertain by; changing role costs, so that one
//! sample that fits two roles takes its neighbours'. docs/math/whisker_calibrate.md section 5.

use super::constraints::{Constraint, Posed, Role};
use super::parameters::Covariance;
use crate::Sample;
use nalgebra::{Matrix3, Matrix6};

/// The squared misfit beyond which a contact is taken for neither role: 4 σ of one equation, 6 in 10⁵ of honest samples.
pub const GATE: f64 = 16.0;
/// What a contact costs over a free sample, as −ln of a density: a free load is one point within the noise, that of a contact anywhere
/// on a surface some hundred σ across each way, ln(100²/2π) ≈ 7.
const CONTACT_COST: f64 = 7.0;
/// What a change of role costs: one in e⁴ ≈ 50 samples, some five changes in a sweep of 120 being the rule; half as much again between
/// mid and tip, which change once at most.
const CHANGE_COST: f64 = 4.0;
/// Leaving out a single sample costs less, for such come singly.
const GAP_COST: f64 = 1.0;
/// Contacts lighter than this many σ of the force are left out: their derivatives change within the noise.
const LEAST_FORCE_SIGMAS: f64 = 8.0;
/// Free samples this near a contact are left out: they may touch without its showing.
const GUARD_SAMPLES: usize = 3;
/// A mid contact next to a tip contact that fits the tip to 3 σ is left out.
const AMBIGUOUS: f64 = 9.0;
/// A tip contact counts only where it cannot be mid, to 3.5 σ: mid contacts that near the tip fit both, and to hold them at the tip
/// would stretch every scale (a peg at 0.88 L: stiffness wrong by 1.7 % in one record of 40).
const SURELY_NOT_MID: f64 = 12.0;

const ROLES: [Role; 4] = [Role::Free, Role::Mid, Role::Tip, Role::Unused];

/// Returns whether a sample in `role` gives equations.
pub fn is_used(role: Role) -> bool {
    role != Role::Unused
}

/// The misfit of a sample in each role.
#[derive(Debug, Clone, Copy)]
struct Misfit {
    free: f64,
    mid: f64,
    tip: f64,
    is_light: bool,
}

/// Returns the role of every sample, under `posed` whose parameters have `covariance`; `noise` is that of the observations.
pub fn assign(posed: &Posed, covariance: &Covariance, noise: &Matrix6<f64>, samples: &[Sample]) -> Vec<Role> {
    let misfits: Vec<Misfit> = samples.iter().map(|s| misfit(posed, covariance, noise, s)).collect();
    let mut roles = Vec::with_capacity(samples.len());
    for sweep in samples.chunk_by(|a, b| a.sweep == b.sweep) {
        let own = &misfits[roles.len()..roles.len() + sweep.len()];
        roles.extend(guarded(&likeliest(own), own));
    }
    roles
}

fn misfit(posed: &Posed, covariance: &Covariance, noise: &Matrix6<f64>, sample: &Sample) -> Misfit {
    let meant = posed.meant(sample);
    if !meant.load.is_finite() || !meant.world_from_hub.angle_rad.is_finite() {
        return Misfit { free: f64::INFINITY, mid: f64::INFINITY, tip: f64::INFINITY, is_light: false };
    }
    let load = meant.load.to_vector();
    let reading_noise: Matrix3<f64> = noise.fixed_view::<3, 3>(0, 0).into();
    let of_noise = meant.load_by_reading * reading_noise * meant.load_by_reading.transpose();
    let by = &meant.load_by_parameters;
    let of_load = of_noise + by * covariance * by.transpose();
    let free = of_load.cholesky().map_or(f64::INFINITY, |factor| load.dot(&factor.solve(&load)));
    let is_light = load.xy().norm() < LEAST_FORCE_SIGMAS * of_noise[(0, 0)].max(of_noise[(1, 1)]).sqrt();
    let Some(touched) = posed.touched(sample).filter(|_| !is_light) else {
        // Too light to say: as good as any contact, so that the neighbours decide; without a zero of the moment: no contact fits.
        let fit = if is_light { 0.0 } else { f64::INFINITY };
        return Misfit { free, mid: fit, tip: fit, is_light };
    };
    let variance = |c: &Constraint| {
        (c.by_observed * noise * c.by_observed.transpose()
            + c.by_parameters * covariance * c.by_parameters.transpose())[0]
    };
    let (sliding, at_tip) = (posed.sliding(&touched), posed.at_tip(&touched));
    let tip = at_tip.value * at_tip.value / variance(&at_tip);
    let beyond = if 0.0 < at_tip.value { tip } else { 0.0 };
    let mid = sliding.value * sliding.value / variance(&sliding) + beyond;
    Misfit { free, mid, tip, is_light }
}

fn cost(misfit: &Misfit, role: Role) -> f64 {
    match role {
        Role::Free => 0.5 * misfit.free,
        Role::Mid => 0.5 * misfit.mid + CONTACT_COST,
        Role::Tip => 0.5 * misfit.tip + CONTACT_COST,
        Role::Unused => 0.5 * GATE + CONTACT_COST,
    }
}

fn change(from: Role, to: Role) -> f64 {
    match (from, to) {
        (a, b) if a == b => 0.0,
        (Role::Unused, _) | (_, Role::Unused) => GAP_COST,
        (Role::Mid, Role::Tip) | (Role::Tip, Role::Mid) => 1.5 * CHANGE_COST,
        _ => CHANGE_COST,
    }
}

/// The cheapest sequence (Viterbi).
fn likeliest(misfits: &[Misfit]) -> Vec<Role> {
    let mut costs = [0.0; 4];
    let mut from: Vec<[usize; 4]> = Vec::with_capacity(misfits.len());
    for misfit in misfits {
        let mut next = [f64::INFINITY; 4];
        let mut best = [0; 4];
        for to in 0..4 {
            for before in 0..4 {
                let total = costs[before] + change(ROLES[before], ROLES[to]);
                if total < next[to] {
                    (next[to], best[to]) = (total, before);
                }
            }
            next[to] += cost(misfit, ROLES[to]);
        }
        costs = next;
        from.push(best);
    }
    let mut at = (0..4).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
    let mut roles: Vec<Role> = from
        .iter()
        .rev()
        .map(|best| {
            let role = ROLES[at];
            at = best[at];
            role
        })
        .collect();
    roles.reverse();
    roles
}

/// Leaves out samples that are too near a change of role, and those with too small a force.
fn guarded(roles: &[Role], misfits: &[Misfit]) -> Vec<Role> {
    let near = |i: usize, reach: usize, other: &dyn Fn(Role) -> bool| {
        let end = (i + reach + 1).min(roles.len());
        roles[i.saturating_sub(reach)..end].iter().any(|role| other(*role))
    };
    (0..roles.len())
        .map(|i| {
            let leave = match roles[i] {
                Role::Free => near(i, GUARD_SAMPLES, &|r| matches!(r, Role::Mid | Role::Tip)),
                Role::Mid => {
                    misfits[i].is_light || misfits[i].tip < AMBIGUOUS && near(i, 2, &|r| r == Role::Tip)
                }
                Role::Tip => misfits[i].is_light || misfits[i].mid < SURELY_NOT_MID,
                Role::Unused => true,
            };
            if leave { Role::Unused } else { roles[i] }
        })
        .collect()
}
