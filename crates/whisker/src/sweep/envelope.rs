//! Between two contacts of one sweep: the contact moves along the object's tangent.
//!
//! ```text
//!   Δ = x₂ − x₁ · ᾱ = α₁ + (α₂ − α₁)/2 · t̄, n̄ along and left of ᾱ · n̄·Δ = 0 ± |Δ| |α₂ − α₁|/√12
//! ```
//! Derivation: docs/math/whisker_sweep.md, section 2.

use super::node::{Linear, direction, left_of, wrapped};
use nalgebra::{Vector2, Vector4};

/// Below this an outline's bow between two contacts is not distinguished from straight, metres: far below what the hub's pose is known to.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Method;
    use crate::sweep::node::{Instrument, Node, Role};
    use crate::{Cell, PlanarPose, Rod};
    use nalgebra::Vector3;

    fn instrument() -> Instrument {
        let rod = Rod::uniform(0.25, 0.009_817).expect("a rod");
        let cell = Cell {
            force_sigma_n: 3e-3,
            torque_sigma_n_m: 1.5e-5,
            hub_xy_sigma_m: 1e-5,
            hub_angle_sigma_rad: 1e-4,
            ..Cell::default()
        };
        Instrument::new(&rod, &cell, Method::Auto).expect("instruments")
    }

    /// A node of each role with a value of its unknowns; loads bent to either side.
    fn nodes(with: &Instrument) -> Vec<(Node, Vector4<f64>)> {
        let hub = PlanarPose { x_m: 0.02, y_m: -0.01, angle_rad: 1.2 };
        let before = PlanarPose { x_m: 0.015, y_m: -0.01, angle_rad: 1.18 };
        let whitened = |load: [f64; 3]| Vector3::from(load).component_div(&with.load_sigma);
        let node = |role, side, load: [f64; 3]| {
            let measured = whitened(load);
            let node = Node { hub, measured, side, role, offset_sigma_m: 2e-5, fresh_angle: true };
            (node, measured.push(0.7))
        };
        let (mut touch, _) = node(Role::Touch { before }, 1.0, [0.0; 3]);
        touch.measured = Vector3::zeros();
        vec![
            (touch, Vector4::new(0.4, 0.2, 0.0, -0.3)),
            node(Role::Slides(1.0), 1.0, [-0.15, 0.36, 0.054]),
            node(Role::Slides(-1.0), -1.0, [-0.11, -0.35, -0.052]),
            node(Role::Sticks, 1.0, [-0.05, 0.36, 0.054]),
            node(Role::Tip, -1.0, [-0.35, -0.2, -0.08]),
            node(Role::Tip, 1.0, [-0.35, 0.2, 0.08]),
        ]
    }

    /// Point, tangent, constraint, envelope and slide, by all unknowns of two nodes and the shared angle: 2e-6 relative, the
    /// error of central differences with a step of 1e-4 standard deviations.
    #[test]
    fn derivatives_match_central_differences() {
        let with = instrument();
        let nodes = nodes(&with);
        for pair in nodes.windows(2) {
            let [(a, za), (b, zb)] = pair else { unreachable!("windows of two") };
            let values = |za: &Vector4<f64>, zb: &Vector4<f64>, shared: f64| {
                let (la, lb) = (a.linear(&with, za, shared), b.linear(&with, zb, shared));
                let (la, lb) = (la.expect("a contact"), lb.expect("a contact"));
                let constraint = lb.constraint.map_or(0.0, |c| c.0);
                let (envelope, slide) = (Pair::envelope(&la, &lb), Pair::slide(&la, &lb));
                [envelope.residual_m, slide.residual_m, constraint * 1e-4, lb.x.x, lb.x.y, lb.alpha_rad]
            };
            let shared = 0.1;
            let la = a.linear(&with, za, shared).expect("a contact");
            let lb = b.linear(&with, zb, shared).expect("a contact");
            let (envelope, slide) = (Pair::envelope(&la, &lb), Pair::slide(&la, &lb));
            let (by_constraint, by_shared) = lb.constraint.map_or((Vector4::zeros(), 0.0), |c| (c.1, c.2));
            let check = |stated: [f64; 6], plus: [f64; 6], minus: [f64; 6], step: f64, what: &str| {
                for k in 0..6 {
                    let measured = (plus[k] - minus[k]) / (2.0 * step);
                    // The smallest derivatives in play are of 10 µm; rounding of values of 0.2 m over the step is 1e-12.
                    let scale = 1e-5 + stated[k].abs();
                    assert!(
                        (measured - stated[k]).abs() < 1e-5 * scale + 1e-11 / step,
                        "{what} {k} of {:?}: {measured:e} {:e}",
                        b.role,
                        stated[k]
                    );
                }
            };
            let step = 1e-4;
            for i in 0..4 {
                let unit = Vector4::ith(i, step);
                let stated = [envelope.by[0][i], slide.by[0][i], 0.0, 0.0, 0.0, 0.0];
                check(
                    stated,
                    values(&(za + unit), zb, shared),
                    values(&(za - unit), zb, shared),
                    step,
                    "first",
                );
                let constraint = by_constraint[i] * 1e-4;
                let (x, y, alpha) = (lb.x_by[(0, i)], lb.x_by[(1, i)], lb.alpha_by[i]);
                let stated = [envelope.by[1][i], slide.by[1][i], constraint, x, y, alpha];
                check(
                    stated,
                    values(za, &(zb + unit), shared),
                    values(za, &(zb - unit), shared),
                    step,
                    "second",
                );
            }
            let stated = [
                envelope.by_shared,
                slide.by_shared,
                by_shared * 1e-4,
                f64::NAN,
                f64::NAN,
                lb.alpha_by_shared,
            ];
            let (plus, minus) = (values(za, zb, shared + 1e-5), values(za, zb, shared - 1e-5));
            // The small offset ε turns with the tangent; its place does not enter the normal equations by φ.
            for k in [2, 5] {
                let measured = (plus[k] - minus[k]) / 2e-5;
                assert!(
                    (measured - stated[k]).abs() < 1e-6 * (1.0 + stated[k].abs()),
                    "φ {k} of {:?}",
                    b.role
                );
            }
        }
    }

    /// Points of a circle and of a corner lie on the mean of their tangents; of a face that starts at a corner within the cone.
    #[test]
    fn outlines_satisfy_the_envelope_condition() {
        let contact = |x: Vector2<f64>, alpha_rad: f64| Linear {
            x,
            x_by: nalgebra::Matrix2x4::zeros(),
            alpha_rad,
            alpha_by: Vector4::zeros(),
            alpha_by_shared: 0.0,
            constraint: None,
            contact: None,
        };
        let circle =
            |a: f64| contact(Vector2::new(a.cos(), a.sin()) * 0.025, a + std::f64::consts::FRAC_PI_2);
        assert!(Pair::envelope(&circle(0.3), &circle(0.35)).residual_m.abs() < 1e-15);
        let (corner, face) = (contact(Vector2::zeros(), 0.0), contact(Vector2::new(0.004, 4e-5), 0.01));
        let residual_m = Pair::envelope(&corner, &face).residual_m.abs();
        assert!(residual_m < 3.0_f64.sqrt() * 1.0001 * sigma_m(&corner, &face));
        assert!(sigma_m(&circle(0.3), &circle(0.3)) == FLOOR_M);
    }
}
