//! From the contact back to the hub where no elliptic integral reaches: taper, profiles, intrinsic curvature.
//!
//! Butcher's sixth-order Runge–Kutta method over equal steps between the nodes of the profiles, the derivatives by force,
//! arc length and friction angle carried along (docs/math/whisker_simulate.md eq. (9)–(10)).

use crate::Rod;
use crate::rod::{IntrinsicCurvature, Stiffness};
use nalgebra::{Matrix3, SVector, Vector3};

/// The hub as the contact sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shot {
    /// The hub in the frame of the contact: x, y in metres, direction of the clamped whisker in radians.
    pub hub_in_contact: Vector3<f64>,
    /// Derivatives of that by `[F, s, φ]` (N, m, rad).
    pub by: Matrix3<f64>,
}

/// Steps per length of even width. Against 1600 steps, a taper of 1:3 bent by 2.2 rad is then right to 2e-12 of its length.
const STEPS_PER_LENGTH: f64 = 64.0;
/// Most steps between two nodes: sixty-four lengths, far beyond where any trial is kept.
const MOST_STEPS: f64 = 64.0 * STEPS_PER_LENGTH;

/// x, y, θ and their derivatives by F, by s and by φ, one after the other.
type Line = SVector<f64, 12>;

struct Load {
    force: [f64; 2],
    by_force: [f64; 2],
    by_phi: [f64; 2],
}

/// As `elastica::shoot`.
pub(super) fn integrated(rod: &Rod, side: f64, force_n: f64, s_m: f64, friction_angle_rad: f64) -> Shot {
    let (sin, cos) = friction_angle_rad.sin_cos();
    let load = Load {
        force: [force_n * sin, force_n * cos],
        by_force: [sin, cos],
        by_phi: [force_n * cos, -force_n * sin],
    };
    // The contact is the origin wherever it lies on the whisker: a longer whisker starts one step further back.
    let mut line = Line::zeros();
    line[6] = -1.0;
    line[8] = -side * rod.curvature_per_m_at(s_m);
    let mut from = s_m;
    for to in nodes_below(rod, s_m) {
        let taper_per_m = taper_per_m(rod).filter(|_| from <= rod.length_m);
        let (start, end) = (graded(taper_per_m, from), graded(taper_per_m, to));
        let count = ((start - end) / rod.length_m * STEPS_PER_LENGTH).ceil().max(1.0);
        if !(count <= MOST_STEPS) {
            let nowhere = f64::NAN; // A trial of no use: who asks finds nothing finite.
            return Shot { hub_in_contact: Vector3::repeat(nowhere), by: Matrix3::from_element(nowhere) };
        }
        let mut s = from;
        for i in 1..=count as usize {
            let share = i as f64 / count;
            let next = if share == 1.0 { to } else { ungraded(taper_per_m, start + (end - start) * share) };
            line = runge_kutta(rod, side, &load, s, next - s, &line);
            s = next;
        }
        from = to;
    }
    let column = |i: usize| Vector3::new(line[i], line[i + 1], line[i + 2]);
    Shot { hub_in_contact: column(0), by: Matrix3::from_columns(&[column(3), column(6), column(9)]) }
}

/// ∫ ds/w with w = 1 − τ s/L the width: equal steps of it are steps in proportion to the width, where the curvature changes.
fn graded(taper_per_m: Option<f64>, s: f64) -> f64 {
    taper_per_m.map_or(s, |per_m| -(-per_m * s).ln_1p() / per_m)
}

fn ungraded(taper_per_m: Option<f64>, graded: f64) -> f64 {
    taper_per_m.map_or(graded, |per_m| -(-per_m * graded).exp_m1() / per_m)
}

/// τ/L where the rod tapers, 1/m.
fn taper_per_m(rod: &Rod) -> Option<f64> {
    match &rod.stiffness {
        Stiffness::Taper { taper, .. } if *taper != 0.0 => Some(taper / rod.length_m),
        _ => None,
    }
}

/// Butcher's seven stages of order six: the rows of the tableau, then the weights.
const ROWS: [&[f64]; 7] = [
    &[],
    &[1.0 / 3.0],
    &[0.0, 2.0 / 3.0],
    &[1.0 / 12.0, 1.0 / 3.0, -1.0 / 12.0],
    &[-1.0 / 16.0, 9.0 / 8.0, -3.0 / 16.0, -3.0 / 8.0],
    &[0.0, 9.0 / 8.0, -3.0 / 8.0, -3.0 / 4.0, 1.0 / 2.0],
    &[9.0 / 44.0, -9.0 / 11.0, 63.0 / 44.0, 18.0 / 11.0, 0.0, -16.0 / 11.0],
];
const WEIGHTS: [f64; 7] =
    [11.0 / 120.0, 0.0, 27.0 / 40.0, 27.0 / 40.0, -4.0 / 15.0, -4.0 / 15.0, 11.0 / 120.0];
const PLACES: [f64; 7] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0, 1.0 / 2.0, 1.0 / 2.0, 1.0];

fn runge_kutta(rod: &Rod, side: f64, load: &Load, s: f64, step: f64, line: &Line) -> Line {
    let mut stages = [Line::zeros(); 7];
    for i in 0..7 {
        let mut at = *line;
        for (weight, stage) in ROWS[i].iter().zip(&stages) {
            if *weight != 0.0 {
                at += stage * (step * weight);
            }
        }
        stages[i] = slope(rod, side, load, s + PLACES[i] * step, &at);
    }
    let mut end = *line;
    for (weight, stage) in WEIGHTS.iter().zip(&stages) {
        end += stage * (step * weight);
    }
    end
}

/// x′ = cos θ, y′ = sin θ, θ′ = κ₀ + M/EI with M = y F_x − x F_y, and the same differentiated.
fn slope(rod: &Rod, side: f64, load: &Load, s: f64, line: &Line) -> Line {
    let (sin, cos) = line[2].sin_cos();
    let compliance = 1.0 / rod.ei_n_m2_at(s);
    let moment = line[1] * load.force[0] - line[0] * load.force[1];
    let mut out = Line::zeros();
    (out[0], out[1]) = (cos, sin);
    out[2] = side * rod.curvature_per_m_at(s) + moment * compliance;
    let still = [0.0, 0.0];
    for (column, by) in [(3, &load.by_force), (6, &still), (9, &load.by_phi)] {
        let (dx, dy, dtheta) = (line[column], line[column + 1], line[column + 2]);
        let moment = dy * load.force[0] - dx * load.force[1] + line[1] * by[0] - line[0] * by[1];
        (out[column], out[column + 1]) = (-sin * dtheta, cos * dtheta);
        out[column + 2] = moment * compliance;
    }
    out
}

/// Arc lengths below `s_m` where a profile bends, from the tip's side down to the hub.
fn nodes_below(rod: &Rod, s_m: f64) -> Vec<f64> {
    // Beyond the tip, where only trials go, the rod is even.
    let mut nodes = vec![0.0, rod.length_m];
    if let Stiffness::Profile { s_m, .. } = &rod.stiffness {
        nodes.extend(s_m);
    }
    if let IntrinsicCurvature::Profile { s_m, .. } = &rod.intrinsic_curvature {
        nodes.extend(s_m);
    }
    nodes.retain(|&node| 0.0 <= node && node < s_m);
    nodes.sort_by(|a, b| b.total_cmp(a));
    nodes.dedup();
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::elastica::shoot;

    fn rods() -> [Rod; 4] {
        let uniform = Rod::uniform(0.25, 9.8e-3).expect("a rod");
        let taper = |taper| Stiffness::Taper { ei_base_n_m2: 2e-2, taper };
        let bent = IntrinsicCurvature::Profile { s_m: vec![0.0, 0.11, 0.25], per_m: vec![1.0, -1.0, 3.0] };
        let steps = Stiffness::Profile { s_m: vec![0.0, 0.05, 0.25], ei_n_m2: vec![2e-2, 1.5e-2, 4e-3] };
        [
            uniform.clone(),
            Rod { stiffness: taper(0.667), ..uniform.clone() },
            Rod { stiffness: taper(0.3), intrinsic_curvature: bent.clone(), ..uniform.clone() },
            Rod { stiffness: steps, intrinsic_curvature: bent, ..uniform },
        ]
    }

    /// Places F, s, φ of weak and strong contacts, with friction either way.
    const PLACES: [[f64; 3]; 4] = [[0.05, 0.1, 0.0], [0.3, 0.24, 0.3], [0.6, 0.2, -0.6], [1.1, 0.12, 0.9]];

    /// Two ways to the same hub, elliptic integrals and Runge–Kutta steps: 1e-11 m, the steps' error over 2 rad.
    #[test]
    fn elliptic_integrals_and_integration_agree() {
        let rod = &rods()[0];
        for [force, s, phi] in PLACES {
            let (closed, steps) = (shoot(rod, 1.0, force, s, phi), integrated(rod, 1.0, force, s, phi));
            let off = (closed.hub_in_contact - steps.hub_in_contact).norm();
            let by = (closed.by - steps.by).norm() / steps.by.norm();
            assert!(off < 1e-11 && by < 1e-10, "{force} {s} {phi}: {off:e} {by:e}");
        }
    }

    /// Central differences of steps of 1e-5 err by 1e-10 of what a force of EI/L², a length L or a radian move the hub by; the
    /// bound leaves room for the third derivatives.
    #[test]
    fn derivatives_match_central_differences() {
        for rod in rods() {
            for side in [1.0, -1.0] {
                for place in PLACES {
                    let shot = |p: [f64; 3]| shoot(&rod, side, p[0], p[1], p[2]);
                    let by = shot(place).by;
                    for i in 0..3 {
                        let scale = [0.2, 0.25, 1.0][i];
                        let step = 1e-5 * scale;
                        let moved = |sign: f64| {
                            let mut p = place;
                            p[i] += sign * step;
                            shot(p).hub_in_contact
                        };
                        let slope = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                        let off = (slope - by.column(i)).norm() * scale;
                        assert!(off < 1e-8, "{rod:?} {place:?} {i}: {off:e}");
                    }
                }
            }
        }
    }

    /// Hub of a cone of τ = 0.667 for F = 0.3 N, s = 0.23 m, φ = 0.2 by Taylor series at 40 digits (docs/math/check).
    #[test]
    fn a_cone_matches_many_digits() {
        let cone = Rod {
            stiffness: Stiffness::Taper { ei_base_n_m2: 0.0204, taper: 0.667 },
            ..Rod::uniform(0.25, 1.0).expect("a rod")
        };
        let hub = integrated(&cone, 1.0, 0.3, 0.23, 0.2).hub_in_contact;
        let golden =
            Vector3::new(-0.138_370_920_407_322_87, 0.154_319_958_845_428_33, -1.423_895_852_491_598);
        assert!((hub - golden).norm() < 2e-12, "{hub:?}");
    }
}
