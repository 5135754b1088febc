//! From the contact back to the hub: the shape of the whisker for a force at its contact, and its derivatives.
//!
//! Everything in the frame of the contact: origin there, x along the whisker's tangent towards the tip, y from the object to
//! the whisker; seen in the mirror where the object lies on the left, so that the whisker always turns left.
//!
//! ```text
//!   F force, φ friction angle: force F (sin φ, cos φ) · s arc length hub to contact · λ = √(F/EI), u = λ s
//!   k² = (1 + sin φ)/2 · a = am(u, k), Δ = dn u · ε = E(a, k) · S = sin φ₀ = cn/dn, C = cos φ₀ = k′ sn/dn
//! ```
//! Derivation: docs/math/whisker_simulate.md.

use super::integrate::{Shot, integrated};
use crate::Rod;
use crate::rod::{IntrinsicCurvature, Stiffness};
use nalgebra::{Matrix3, Vector2, Vector3};
use std::f64::consts::FRAC_PI_4;

/// The whisker from its contact at arc length `s_m` back to the hub. `side` is +1 with the object on the right.
pub(super) fn shoot(rod: &Rod, side: f64, force_n: f64, s_m: f64, friction_angle_rad: f64) -> Shot {
    match (&rod.stiffness, &rod.intrinsic_curvature) {
        (Stiffness::Uniform { ei_n_m2 }, IntrinsicCurvature::Constant { per_m: 0.0 }) => {
            closed_form(*ei_n_m2, force_n, s_m, friction_angle_rad)
        }
        _ => integrated(rod, side, force_n, s_m, friction_angle_rad),
    }
}

/// am(u, k) and E(am(u, k), k) for u ≥ 0 by the descending Landen transformation; eq. (5).
fn amplitude_and_second(u: f64, k2: f64, k_complement: f64) -> (f64, f64) {
    let mut rounds = [(1.0, 0.0); 10];
    let (mut a, mut b, mut power, mut sum_c2, mut last) = (1.0_f64, k_complement, 0.5, 0.5 * k2, 0);
    for (round, slot) in rounds.iter_mut().enumerate().skip(1) {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        power *= 2.0;
        sum_c2 += power * c * c;
        *slot = (a, c);
        last = round;
        // The mean converges quadratically: the next c would be below 1e-17 a.
        if c <= 1e-8 * a {
            break;
        }
    }
    let mut angle = 2.0 * power * a * u;
    let mut sum_sin = 0.0;
    for &(a, c) in rounds[1..=last].iter().rev() {
        let sin = angle.sin();
        sum_sin += c * sin;
        angle = 0.5 * (angle + (c / a * sin).asin());
    }
    (angle, u * (1.0 - sum_c2) + sum_sin)
}

fn closed_form(ei_n_m2: f64, force_n: f64, s_m: f64, friction_angle_rad: f64) -> Shot {
    let lambda = (force_n / ei_n_m2).sqrt();
    let u = lambda * s_m;
    let (k, kc) = (FRAC_PI_4 + 0.5 * friction_angle_rad).sin_cos();
    let k2 = k * k;
    let (am, e) = amplitude_and_second(u, k2, kc);
    let (sn, cn) = am.sin_cos();
    let delta = (1.0 - k2 * sn * sn).sqrt();
    let (s0, c0) = (cn / delta, kc * sn / delta);
    let w = e - k2 * sn * s0;
    // eq. (6): along the force A, across it B, the hub's direction β₀ − β_c.
    let (sin_phi, cos_phi) = friction_angle_rad.sin_cos();
    let (along, across) = (Vector2::new(sin_phi, cos_phi), Vector2::new(cos_phi, -sin_phi));
    let (a, b) = ((2.0 * w - u) / lambda, 2.0 * k * c0 / lambda);
    let x = along * a - across * b;
    let angle = 2.0 * ((k * s0).asin() - k.asin());
    // eq. (7): a longer whisker continues straight on behind the hub; a stronger force is a smaller whisker.
    let (sin, cos) = angle.sin_cos();
    let by_s = Vector3::new(-cos, -sin, -2.0 * k * c0 * lambda);
    let by_force = (by_s * s_m - Vector3::new(x.x, x.y, 0.0)) / (2.0 * force_n);
    // eq. (8): by the modulus, at constant u.
    let am_by_k = -delta * ((e - kc * kc * u) / (k * kc * kc) - k * sn * cn / (kc * kc * delta));
    let delta3 = delta * delta * delta;
    let s0_by_k = (k * cn * sn * sn - kc * kc * sn * am_by_k) / delta3;
    let c0_by_k = (kc * cn * am_by_k + kc * k * sn * sn * sn) / delta3 - k / kc * sn / delta;
    let w_by_k = delta * am_by_k + (e - u) / k - 2.0 * k * sn * s0 - k2 * (cn * am_by_k * s0 + sn * s0_by_k);
    let k_by_phi = 0.5 * kc;
    let (a_by_k, b_by_k) = (2.0 * w_by_k / lambda, 2.0 * (c0 + k * c0_by_k) / lambda);
    let x_by_phi = along * (a_by_k * k_by_phi + b) + across * (a - b_by_k * k_by_phi);
    let angle_by_phi = 2.0 * (s0 + k * s0_by_k) / (1.0 - k2 * s0 * s0).sqrt() * k_by_phi - 1.0;
    let by_phi = Vector3::new(x_by_phi.x, x_by_phi.y, angle_by_phi);
    Shot {
        hub_in_contact: Vector3::new(x.x, x.y, angle),
        by: Matrix3::from_columns(&[by_force, by_s, by_phi]),
    }
}
