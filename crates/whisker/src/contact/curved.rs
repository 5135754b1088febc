//! The contact of a uniform whisker of constant intrinsic curvature, by elliptic integrals of either kind of pendulum.
//!
//! ```text
//!   clamp state g, h, c and z = κ₀/2λ, m = c − z as in clamp.rs · k² = c² + g², k′² = 1 − k² = h² − c²: either sign
//!   contact state: sin, cos β_c/2 = g_c, h_c and z again: g_c² = k² − z² = g² + m (c + z)
//!   u = λ s, P = ∫₀ᵘ sin² β/2 dv = k² D(u) + g g_c sn u, a = u − 2P
//! ```
//! Derivation: docs/math/whisker_contact.md, sections 6 and 7.

use super::clamp::{Arc, Clamp};
use super::{ByLoad, HubContact, NoZero};
use crate::HubLoad;
use crate::elliptic::Jacobi;
use nalgebra::Matrix4x3;

/// The first zero of the moment, for bending stiffness `ei_n_m2` (N·m²) and intrinsic curvature `curvature_per_m` (1/m).
pub fn contact(ei_n_m2: f64, curvature_per_m: f64, load: &HubLoad) -> Result<HubContact, NoZero> {
    zero(ei_n_m2, curvature_per_m, load, 0)
}

/// The first zero of the moment and its derivatives by the load.
pub fn contact_with_derivatives(
    ei_n_m2: f64,
    curvature_per_m: f64,
    load: &HubLoad,
) -> Result<(HubContact, ByLoad), NoZero> {
    zero_with_derivatives(ei_n_m2, curvature_per_m, load, 0)
}

/// The zero of the moment after `later` others, also of a straight whisker (κ₀ = 0) and beyond any length; eq. (32).
pub fn zero(ei_n_m2: f64, curvature_per_m: f64, load: &HubLoad, later: usize) -> Result<HubContact, NoZero> {
    if super::MOST_ZEROS < later {
        return Err(NoZero::NeverVanishes);
    }
    let bent = Bent::of(Clamp::of(ei_n_m2, curvature_per_m, load)?)?;
    bent.clamp.contact(&bent.reach(later).arc())
}

/// Returns the contact with its derivatives with respect to the load.
pub fn zero_with_derivatives(
    ei_n_m2: f64,
    curvature_per_m: f64,
    load: &HubLoad,
    later: usize,
) -> Result<(HubContact, ByLoad), NoZero> {
    if super::MOST_ZEROS < later {
        return Err(NoZero::NeverVanishes);
    }
    let bent = Bent::of(Clamp::of(ei_n_m2, curvature_per_m, load)?)?;
    let arc = bent.reach(later).arc();
    let partials = bent.off_the_separatrix()?.reach(later).partials();
    Ok((bent.clamp.contact(&arc)?, bent.clamp.by_load(ei_n_m2, &arc, &partials)?))
}

/// Half the angle from −F by its sine and cosine, and half the curvature over λ.
#[derive(Debug, Clone, Copy)]
struct State {
    g: f64,
    h: f64,
    c: f64,
}

/// The clamp with the modulus of its elastica and the state at the contact.
#[derive(Debug, Clone, Copy)]
struct Bent {
    clamp: Clamp,
    k2: f64,
    complement2: f64,
    end: State,
}

impl Bent {
    fn of(clamp: Clamp) -> Result<Self, NoZero> {
        let Clamp { g, h, c, .. } = clamp;
        let (k2, complement2) = (c * c + g * g, (h - c) * (h + c));
        Ok(Bent { clamp, k2, complement2, end: first_zero(&clamp, 0.0 < complement2)? })
    }

    fn start(&self) -> State {
        State { g: self.clamp.g, h: self.clamp.h, c: self.clamp.c }
    }

    /// Integrates from the clamp to the zero after `later` others.
    fn reach(&self, later: usize) -> Reach {
        let (u, p) = self.between(&self.start(), &self.end);
        let mut reach = Reach { bent: *self, end: self.end, u, p, rotation_rad: self.turned() };
        for _ in 0..later {
            let to = self.next_zero(&reach.end);
            let (u, p) = self.between(&reach.end, &to);
            let rotation_rad = reach.rotation_rad + turned(&reach.end, &to);
            reach = Reach { end: to, u: reach.u + u, p: reach.p + p, rotation_rad, ..reach };
        }
        reach
    }

    /// c² − z² = g_c² − g² without the difference.
    fn lift(&self) -> f64 {
        self.clamp.m * (self.clamp.c + self.clamp.z)
    }

    /// Returns the angle from clamp to first contact, eq. (31).
    fn turned(&self) -> f64 {
        let (from, to) = (self.start(), self.end);
        let (one, other) = (to.g * from.h, from.g * to.h);
        if 0.0 < one * other {
            2.0 * (self.lift() / (one + other)).atan2(from.h * to.h + from.g * to.g)
        } else {
            turned(&from, &to)
        }
    }

    /// `(u, P)` between two states of this elastica, eq. (25)–(27).
    fn between(&self, from: &State, to: &State) -> (f64, f64) {
        let Bent { k2, complement2, .. } = *self;
        let below = to.c * to.c + (to.g * from.h) * (to.g * from.h);
        let (one, other) = (to.g * from.c * from.h, from.g * to.c * to.h);
        // Each the other's conjugate: the one that does not cancel.
        let sn = if 0.0 < one * other {
            let lift = if from.c == to.c { 0.0 } else { self.lift() };
            lift / (one + other)
        } else {
            (one - other) / below
        };
        let jacobi = Jacobi {
            sn,
            cn: (to.c * from.c + to.g * from.g * from.h * to.h) / below,
            dn: (k2 * from.h * to.h + to.g * from.g * from.c * to.c) / below,
            k2,
            complement2,
        };
        let (u, d) = jacobi.argument_and_d();
        (u, k2 * d + from.g * to.g * sn)
    }

    /// Returns the state at the next zero of the moment after `from`.
    fn next_zero(&self, from: &State) -> State {
        let swings = 0.0 < self.complement2;
        let turns_back = swings || ((0.0 < from.g * from.h) == (from.c < 0.0));
        if turns_back { State { g: -from.g, ..*from } } else { State { h: -from.h, ..*from } }
    }

    /// On the separatrix k = 1 the formulas of the derivatives are 0/0; a part in 10⁷ beside it they err by as much.
    fn off_the_separatrix(self) -> Result<Self, NoZero> {
        const BESIDE: f64 = 1e-7;
        let Clamp { h, m, z, c, .. } = self.clamp;
        if BESIDE * h * h < self.complement2.abs() {
            return Ok(self);
        }
        let by = 1.0 - BESIDE;
        Bent::of(Clamp { m: m * by, z: z * by, c: c * by, ..self.clamp })
    }
}

/// The arc from the clamp to a zero of the moment.
#[derive(Debug, Clone, Copy)]
struct Reach {
    bent: Bent,
    end: State,
    u: f64,
    p: f64,
    rotation_rad: f64,
}

impl Reach {
    fn arc(&self) -> Arc {
        let State { g, h, .. } = self.end;
        let pull = 2.0 * self.bent.lift() - self.bent.clamp.cos_beta;
        Arc {
            u: self.u,
            a: self.u - 2.0 * self.p,
            rotation_rad: self.rotation_rad,
            friction_angle_rad: pull.atan2(2.0 * (g * h).abs()),
            modulus_squared: g * g,
        }
    }

    /// Derivatives of `[u, a, β_c, friction angle]` by `[c, β₀, ρ]`, eq. (33)–(35).
    fn partials(&self) -> Matrix4x3<f64> {
        let Bent { clamp: Clamp { g, h, c, z, .. }, k2, complement2, .. } = self.bent;
        let State { g: g_c, h: h_c, .. } = self.end;
        let (both, end, gg) = (k2 * complement2, 1.0 / (g_c * h_c), g * g);
        let (u_p, w_p) = ((self.u * k2 - self.p) / both, -self.p / k2);
        let u_k = u_p + z * (complement2 - g_c * g_c) * end / both;
        let w_k = w_p + z * h_c / (g_c * k2);
        let u = [
            c * u_k + g * h / both,
            0.5 * (g * h * u_k - c * (complement2 - gg) / both),
            c * (c * u_p + g * h / both) - z * end * (gg * complement2 + c * c * g_c * g_c) / both,
        ];
        let w = [
            c * w_k + g * h / k2,
            0.5 * (g * h * w_k - c * h * h / k2),
            c * (c * w_p + g * h / k2) - z * h_c * gg / (g_c * k2),
        ];
        let angle = [2.0 * c * end, g * h * end, 2.0 * self.bent.lift() * end];
        Matrix4x3::from_fn(|row, i| match row {
            0 => u[i],
            1 => 2.0 * w[i] - u[i],
            2 => angle[i],
            _ => angle[i] * end.signum(),
        })
    }
}

/// Returns where κ first falls to κ₀, eq. (8), (30): for a pendulum that swings (k < 1) or rotates.
fn first_zero(clamp: &Clamp, swings: bool) -> Result<State, NoZero> {
    let Clamp { g, h, m, c, z, .. } = *clamp;
    let lift = m * (c + z);
    let (g_end2, h_end2) = (g * g + lift, h * h - lift);
    // A pendulum that turns over keeps the sign of its speed, so κ and κ₀ share it.
    let reached = swings || c < 0.0 || 0.0 < z;
    if !(reached && 0.0 <= g_end2 && 0.0 <= h_end2) {
        return Err(NoZero::NeverVanishes);
    }
    let sign = if !swings && c < 0.0 && g < 0.0 { -1.0 } else { 1.0 };
    Ok(State { g: sign * g_end2.sqrt(), h: sign * h_end2.sqrt(), c: z })
}

/// Returns the angle between two states, in (−2π, 2π].
fn turned(from: &State, to: &State) -> f64 {
    2.0 * (to.g * from.h - from.g * to.h).atan2(from.h * to.h + from.g * to.g)
}
