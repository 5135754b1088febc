//! Equilibria of the whisker on an arc: three equations for the load at a given hub, their Jacobian, their fold.
//!
//! ```text
//!   E₁,₂ = x(l, hub) − X(α(l, hub)) = 0, X the outline's point of normal α      E₃ = G(l) = 0 (friction, or s = L)      ∂E/∂l singular: no equilibrium beyond
//! ```
//!
//! docs/math/whisker_events.md eqs. (9)–(11).

use super::outline::{Arc, by_load_of, rotation_of_force};
use crate::contact::{Method, contact_with_derivatives};
use crate::friction::Constraint;
use crate::{HubContact, HubLoad, PlanarPose, Rod};
use nalgebra::{Matrix3, Vector2, Vector3};

/// An equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equilibrium {
    /// The load, hub axes.
    pub load: HubLoad,
    /// The contact.
    pub at: HubContact,
    /// ∂E/∂l in units of the whisker: E/L and G L²/EI, loads by EI/L² and EI/L.
    pub jacobian: Matrix3<f64>,
}

impl Equilibrium {
    /// The least singular value of the Jacobian, 0 at the fold.
    pub fn stability(&self) -> f64 {
        self.jacobian.singular_values().min()
    }

    /// Its determinant, which changes sign at the fold.
    pub fn determinant(&self) -> f64 {
        self.jacobian.determinant()
    }
}

/// The problem at one constraint.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The whisker.
    pub rod: &'a Rod,
    /// The feature that it touches.
    pub arc: Arc,
    /// How: friction angle between clamp and tip, or the tip.
    pub constraint: Constraint,
    /// φ_f, radians: at the tip too the force leaves the outline's normal by it.
    pub friction_rad: f64,
    /// How the elastica is solved.
    pub method: Method,
}

/// Newton's steps: quadratic from a start that lies a sample away.
const STEPS: usize = 25;
/// A residual below this share of the whisker's units is zero: next to 1e-12 of the contact itself.
const ZERO: f64 = 1e-10;
/// Leaning less than this, radians, is rounding where mid-whisker and tip contact meet.
const LEAN_RAD: f64 = 1e-6;

impl Problem<'_> {
    /// `[N, N, N·m]` of the whisker: EI/L², EI/L², EI/L.
    pub fn load_units(&self) -> Vector3<f64> {
        let force = self.rod.ei_base_n_m2() / self.rod.length_m.powi(2);
        Vector3::new(force, force, force * self.rod.length_m)
    }

    /// The equilibrium with the hub at `hub`, by Newton's method from `start`; none where it does not converge.
    pub fn solve(&self, hub: &PlanarPose, start: &HubLoad) -> Option<Equilibrium> {
        let units = self.load_units();
        let mut load = start.to_vector();
        for _ in 0..STEPS {
            let (residual, equilibrium) = self.evaluate(hub, &load)?;
            if residual.norm() < ZERO {
                return Some(equilibrium);
            }
            let step = equilibrium.jacobian.lu().solve(&residual)?;
            // Half a unit of load a step: beyond it the next equilibrium is not the neighbouring one.
            let share = (0.5 / step.norm()).min(1.0);
            load -= step.component_mul(&units) * share;
        }
        None
    }

    /// Whether the whisker stays out of a convex object: at the tip the force may not lean beyond friction towards the tip, for then
    /// the whisker before the tip would pass through the outline.
    pub fn is_admissible(&self, equilibrium: &Equilibrium) -> bool {
        match self.constraint {
            Constraint::Friction(_) => true,
            Constraint::Tip => equilibrium.at.friction_angle_rad <= self.friction_rad + LEAN_RAD,
        }
    }

    /// E and ∂E/∂l, both in the whisker's units.
    pub fn evaluate(&self, hub: &PlanarPose, load: &Vector3<f64>) -> Option<(Vector3<f64>, Equilibrium)> {
        let (units, length) = (self.load_units(), self.rod.length_m);
        let load = HubLoad::from_vector(load);
        let (at, by_load) = contact_with_derivatives(self.rod, &load, self.method).ok()?;
        let force = hub.rotate(load.force_n());
        let angle = force.y.atan2(force.x) + rotation_of_force(&load, self.friction_rad);
        let (outline_m, radius_m) = self.arc.at(angle);
        let off = hub.apply(at.x_in_hub) - outline_m;
        let moves = by_load_of(hub, &load, &by_load);
        let across = Vector2::new(-angle.sin(), angle.cos()) * radius_m;
        let g = self.constraint.gradient(self.rod, &load, &at, &by_load);
        let mut jacobian = Matrix3::zeros();
        for column in 0..3 {
            jacobian[(0, column)] = (moves[(0, column)] - across.x * moves[(2, column)]) / length;
            jacobian[(1, column)] = (moves[(1, column)] - across.y * moves[(2, column)]) / length;
            jacobian[(2, column)] = g[column] / units.x;
            jacobian.column_mut(column).scale_mut(units[column]);
        }
        let g = self.constraint.residual_n(self.rod, &load, &at) / units.x;
        let residual = Vector3::new(off.x / length, off.y / length, g);
        residual.iter().all(|v| v.is_finite()).then_some((residual, Equilibrium { load, at, jacobian }))
    }
}
