//! Between two contacts of one sweep: the contact moves along the object's tangent.
//!
//! ```text
//!   Δ = x₂ − x₁ · ᾱ = α₁ + (α₂ − α₁)/2 · t̄, n̄ along and left of ᾱ · n̄·Δ = 0 ± |Δ| |α₂ − α₁|/√12
//! ```
//! Derivation: docs/math/whisker_sweep.md, section 2.

use super::node::{Linear, direction, left_of, wrapped};
use nalgebra::{Vector2, Vector4};

/// Below this an outline's bow between two contacts is not told from straight, metres: far below what the hub's pose is known to.
pub const FLOOR_M: f64 = 5e-7;

/// A residual between two nodes with its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// The residual, metres.
    pub residual_m: f64,
    /// By the unknowns of both nodes.
    pub by: [Vector4<f64>; 2],
    /// By the shared friction angle.
    pub by_shared: f64,
}

impl Pair {
    /// The envelope condition, eq. (6).
    pub fn envelope(a: &Linear, b: &Linear) -> Self {
        let (shift, middle) = between(a, b);
        let along = direction(middle);
        let lever = -0.5 * along.dot(&shift);
        Pair::across(a, b, left_of(along), shift, lever)
    }

    /// How far the contact moved along the tangent, eq. (8): kept small between touch and first contact.
    pub fn slide(a: &Linear, b: &Linear) -> Self {
        let (shift, middle) = between(a, b);
        let along = direction(middle);
        let lever = 0.5 * left_of(along).dot(&shift);
        Pair::across(a, b, along, shift, lever)
    }

    fn across(a: &Linear, b: &Linear, axis: Vector2<f64>, shift: Vector2<f64>, lever: f64) -> Self {
        Pair {
            residual_m: axis.dot(&shift),
            by: [
                -a.x_by.transpose() * axis + a.alpha_by * lever,
                b.x_by.transpose() * axis + b.alpha_by * lever,
            ],
            by_shared: lever * (a.alpha_by_shared + b.alpha_by_shared),
        }
    }
}

/// Standard deviation of the envelope's residual, eq. (7): a convex outline stays between both tangents.
pub fn sigma_m(a: &Linear, b: &Linear) -> f64 {
    let (shift, _) = between(a, b);
    let turn = wrapped(b.alpha_rad - a.alpha_rad);
    FLOOR_M.hypot(shift.norm() * turn / 12.0_f64.sqrt())
}

fn between(a: &Linear, b: &Linear) -> (Vector2<f64>, f64) {
    (b.x - a.x, a.alpha_rad + 0.5 * wrapped(b.alpha_rad - a.alpha_rad))
}
