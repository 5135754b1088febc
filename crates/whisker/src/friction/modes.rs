//! Which mode a sample is in: evidence of each by itself, and along a sweep by a hidden Markov chain.
//!
//! Every mode is a surface in the space of loads, crossed by the measured load at a distance; the evidence is the density of the
//! measured load under a mode that is uniform along its surface (docs/math/whisker_friction.md eqs. (9)–(11)), the chain is the
//! forward–backward recursion, eqs. (12)–(14).

use super::{Constraint, Projection};
use crate::Rod;
use resight_core::statistics::normal::ln_upper_tail;
use std::f64::consts::PI;

/// Probability per sample that a contact far from the tip is at the tip next: whiskers slide there, they do not leap.
const TO_TIP_FAR: f64 = 0.002;
/// The same of a contact within a step of the tip: a sweep takes a handful of samples over the last steps.
const TO_TIP_NEAR: f64 = 0.2;
/// A step: what a contact moves along the whisker from one sample to the next, as a share of its length.
const STEP_SHARE: f64 = 0.01;
/// Probability per sample that a tip contact becomes a mid-whisker contact: it slips off instead, save when the hub goes back.
const FROM_TIP: f64 = 1e-4;
/// Probability per sample that a sliding whisker turns round or sticks.
const TURN: f64 = 0.01;
/// Probability that a contact begins at the tip.
const FIRST_AT_TIP: f64 = 0.1;

/// ln of the density of the measured load under the projection's mode, up to what all modes share.
///
/// Mid: φ is normal around φ_f, s uniform on the whisker. Tip: s is normal around L, φ uniform over the half turn.
pub fn log_evidence(rod: &Rod, projection: &Projection) -> f64 {
    let force = projection.load.force_n().norm();
    let sigma_n = projection.innovation_variance_n2.sqrt();
    let (sigma, uniform) = match projection.constraint {
        Constraint::Friction(friction) => {
            (sigma_n / (force * friction.rad.cos()), on_whisker(rod, projection))
        }
        Constraint::Tip => (sigma_n * rod.length_m / force, -PI.ln()),
    };
    -0.5 * (projection.chi2 + (2.0 * PI).ln()) - sigma.ln() + uniform
}

/// ln of the density 1/L of s times the share of its uncertainty that lies on the whisker, eq. (10).
fn on_whisker(rod: &Rod, projection: &Projection) -> f64 {
    let beyond = (projection.at.s_m - rod.length_m) / projection.s_sigma_m().max(1e-9 * rod.length_m);
    ln_upper_tail(beyond) - rod.length_m.ln()
}

/// Probability that the sample after this mid-whisker projection is at the tip, eq. (13).
pub fn to_tip(rod: &Rod, mid: &Projection) -> f64 {
    let short = rod.length_m * (1.0 - STEP_SHARE) - mid.at.s_m;
    let near = ln_upper_tail(short / mid.s_sigma_m().max(1e-9 * rod.length_m)).exp();
    TO_TIP_FAR + (TO_TIP_NEAR - TO_TIP_FAR) * near
}

/// What `to_tip` is where nothing is known of the arc length.
pub const TO_TIP_UNKNOWN: f64 = 0.01;

/// Forward–backward: `ln_evidence[sample][state]` to the posterior of every state at every sample, and ln of the evidence of the
/// whole run; `to_tip[sample]` is the probability that the next one is at the tip. States are `constraints`. A state without evidence (−∞) is impossible there.
pub fn posterior(
    constraints: &[Constraint],
    ln_evidence: &[Vec<f64>],
    to_tip: &[f64],
) -> (Vec<Vec<f64>>, f64) {
    let mut forward: Vec<Vec<f64>> = Vec::with_capacity(ln_evidence.len());
    let mut ln_total = 0.0;
    for (i, ln_here) in ln_evidence.iter().enumerate() {
        let predicted = match i {
            0 => first(constraints),
            _ => moved(constraints, &forward[i - 1], to_tip[i - 1]),
        };
        let (state, ln_scale) = updated(&predicted, ln_here);
        ln_total += ln_scale;
        forward.push(state);
    }
    (smoothed(constraints, ln_evidence, to_tip, forward), ln_total)
}

/// One step of the filter alone: the state before and its `to_tip`, none at touch, to the state after and ln of the sample's evidence.
pub fn filter(
    constraints: &[Constraint],
    before: Option<(&[f64], f64)>,
    ln_evidence: &[f64],
) -> (Vec<f64>, f64) {
    let predicted =
        before.map_or_else(|| first(constraints), |(before, to_tip)| moved(constraints, before, to_tip));
    updated(&predicted, ln_evidence)
}

fn smoothed(
    constraints: &[Constraint],
    ln_evidence: &[Vec<f64>],
    to_tip: &[f64],
    mut forward: Vec<Vec<f64>>,
) -> Vec<Vec<f64>> {
    let mut later = vec![1.0; constraints.len()];
    for i in (0..forward.len()).rev() {
        for (state, later) in forward[i].iter_mut().zip(&later) {
            *state *= later;
        }
        normalise(&mut forward[i]);
        if i == 0 {
            break;
        }
        let (weighed, _) = updated(&later, &ln_evidence[i]);
        for (from, later) in later.iter_mut().enumerate() {
            *later = (0..constraints.len())
                .map(|to| transition(constraints, from, to, to_tip[i - 1]) * weighed[to])
                .sum();
        }
    }
    forward
}

/// Prior times likelihood, normalised, and ln of the norm; the prior where no state explains the sample at all.
fn updated(predicted: &[f64], ln_evidence: &[f64]) -> (Vec<f64>, f64) {
    let most = ln_evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return (predicted.to_vec(), 0.0);
    }
    let mut state: Vec<f64> =
        predicted.iter().zip(ln_evidence).map(|(p, ln)| p * (ln - most).exp()).collect();
    let norm = normalise(&mut state);
    (state, most + norm.max(f64::MIN_POSITIVE).ln())
}

fn normalise(state: &mut [f64]) -> f64 {
    let norm: f64 = state.iter().sum();
    if 0.0 < norm {
        state.iter_mut().for_each(|p| *p /= norm);
    }
    norm
}

fn is_tip(constraint: &Constraint) -> bool {
    matches!(constraint, Constraint::Tip)
}

/// Prior at touch: mid-whisker states share what the tip leaves.
fn first(constraints: &[Constraint]) -> Vec<f64> {
    let mids = constraints.iter().filter(|c| !is_tip(c)).count().max(1) as f64;
    constraints.iter().map(|c| if is_tip(c) { FIRST_AT_TIP } else { (1.0 - FIRST_AT_TIP) / mids }).collect()
}

fn moved(constraints: &[Constraint], before: &[f64], to_tip: f64) -> Vec<f64> {
    (0..before.len())
        .map(|to| {
            before.iter().enumerate().map(|(from, p)| p * transition(constraints, from, to, to_tip)).sum()
        })
        .collect()
}

/// P(to | from), eq. (12).
fn transition(constraints: &[Constraint], from: usize, to: usize, to_tip: f64) -> f64 {
    let mids = constraints.iter().filter(|c| !is_tip(c)).count() as f64;
    match (is_tip(&constraints[from]), is_tip(&constraints[to])) {
        (true, true) => 1.0 - FROM_TIP,
        (true, false) => FROM_TIP / mids,
        (false, true) => to_tip,
        (false, false) if from == to => 1.0 - to_tip - TURN * (mids - 1.0),
        (false, false) => TURN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::FrictionAngle;

    fn states() -> Vec<Constraint> {
        let at = |rad| Constraint::Friction(FrictionAngle { rad, sigma_rad: 0.0 });
        vec![at(0.3), at(-0.3), Constraint::Tip]
    }

    /// The chain against the sum over all paths.
    #[test]
    fn posterior_is_the_sum_over_all_paths() {
        const TO: [f64; 4] = [0.01, 0.3, 0.002, 0.1];
        let constraints = states();
        let ln_evidence: Vec<Vec<f64>> =
            vec![vec![1.0, 0.3, 2.0], vec![0.2, 3.0, -1.0], vec![-2.0, 0.5, 4.0], vec![0.0, 1.0, 5.0]];
        let (n, len) = (constraints.len(), ln_evidence.len());
        let (mut expected, mut total) = (vec![vec![0.0; n]; len], 0.0);
        for path in 0..n.pow(len as u32) {
            let states: Vec<usize> = (0..len).map(|i| path / n.pow(i as u32) % n).collect();
            let mut p = first(&constraints)[states[0]];
            for i in 0..len {
                p *= ln_evidence[i][states[i]].exp();
                p *= if 0 < i { transition(&constraints, states[i - 1], states[i], TO[i - 1]) } else { 1.0 };
            }
            total += p;
            (0..len).for_each(|i| expected[i][states[i]] += p);
        }
        let (found, ln_total) = posterior(&constraints, &ln_evidence, &TO);
        assert!((ln_total - f64::ln(total)).abs() < 1e-12, "{ln_total} {}", f64::ln(total));
        for i in 0..len {
            for k in 0..n {
                assert!((found[i][k] - expected[i][k] / total).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn transitions_sum_to_one() {
        let constraints = states();
        for from in 0..3 {
            let sum: f64 = (0..3).map(|to| transition(&constraints, from, to, 0.2)).sum();
            assert!((sum - 1.0).abs() < 1e-15);
        }
    }
}
