//! The whisker between two knots of its profiles: a cone of linearly varying curvature.

use crate::Rod;
use crate::rod::{IntrinsicCurvature, Stiffness};

/// Units in which the elastica is of size 1, and its series neither overflow nor vanish.
#[derive(Clone, Copy)]
pub(super) struct Units {
    pub length_m: f64,
    pub moment_n_m: f64,
    pub force_n: f64,
    ei_n_m2: f64,
}

impl Units {
    /// For a force of this size.
    pub fn of(rod: &Rod, force_n: f64) -> Self {
        let ei_n_m2 = rod.ei_base_n_m2();
        let length_m = rod.length_m.min((ei_n_m2 / force_n).sqrt());
        let moment_n_m = ei_n_m2 / length_m;
        Units { length_m, moment_n_m, force_n: moment_n_m / length_m, ei_n_m2 }
    }
}

/// From some s on: EI = EI(s) (1 − ρ t)⁴ and κ₀ = κ₀(s) + t κ₀′, t = 0 at s, in `Units`.
pub(super) struct Piece {
    /// Where it ends; infinite past the tip.
    pub end: f64,
    /// 1/EI at s.
    pub compliance: f64,
    /// ρ: how fast the diameter shrinks, as a share of the diameter at s.
    pub narrowing: f64,
    /// κ₀ at s.
    pub curvature: f64,
    /// κ₀′.
    pub curvature_slope: f64,
}

impl Piece {
    /// The piece that begins at s (a knot belongs to the piece behind it).
    #[inline]
    pub fn at(rod: &Rod, units: &Units, s: f64) -> Self {
        let (end, root, slope) = fourth_root(rod, units, s);
        let (curvature_end, curvature, curvature_slope) = curvature(rod, units, s);
        let compliance = 1.0 / (root * root * root * root);
        Piece {
            end: end.min(curvature_end),
            compliance,
            narrowing: -slope / root,
            curvature,
            curvature_slope,
        }
    }
}

/// End of the piece, EI^¼ at s, its slope: EI^¼ is the diameter of a round whisker up to a factor.
fn fourth_root(rod: &Rod, units: &Units, s: f64) -> (f64, f64, f64) {
    let tip = rod.length_m / units.length_m;
    match &rod.stiffness {
        Stiffness::Uniform { .. } => (f64::INFINITY, 1.0, 0.0),
        Stiffness::Taper { taper, .. } if s < tip => (tip, 1.0 - taper * s / tip, -taper / tip),
        Stiffness::Taper { taper, .. } => (f64::INFINITY, 1.0 - taper, 0.0),
        Stiffness::Profile { s_m, ei_n_m2 } => {
            let root = |i: usize| (ei_n_m2[i] / units.ei_n_m2).sqrt().sqrt();
            interpolate(s_m, root, units.length_m, s)
        }
    }
}

fn curvature(rod: &Rod, units: &Units, s: f64) -> (f64, f64, f64) {
    match &rod.intrinsic_curvature {
        IntrinsicCurvature::Constant { per_m } => (f64::INFINITY, per_m * units.length_m, 0.0),
        IntrinsicCurvature::Profile { s_m, per_m } => {
            interpolate(s_m, |i| per_m[i] * units.length_m, units.length_m, s)
        }
    }
}

/// Linear between knots, constant past the last and before the first: `(end of the piece, value, slope)`.
fn interpolate(s_m: &[f64], value: impl Fn(usize) -> f64, unit_m: f64, s: f64) -> (f64, f64, f64) {
    // Knots and s are compared after the same division, so a step that ends on a knot has passed it.
    let next = s_m.partition_point(|knot| knot / unit_m <= s);
    if next == s_m.len() {
        return (f64::INFINITY, value(next - 1), 0.0);
    }
    let end = s_m[next] / unit_m;
    if next == 0 {
        return (end, value(0), 0.0);
    }
    let start = s_m[next - 1] / unit_m;
    let slope = (value(next) - value(next - 1)) / (end - start);
    (end, value(next - 1) + slope * (s - start), slope)
}
