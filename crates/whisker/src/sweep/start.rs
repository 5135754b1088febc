//! Where the minimisation starts: the load nearest to the one read that satisfies the constraint, in its standard deviations.

use super::node::{Instrument, Role};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

/// A contact less certain than this share of the length takes its place from its neighbours.
pub const WEAK: f64 = 0.08;
/// Newton steps at most; from a load as read three suffice.
const STEPS: usize = 12;

/// What a start is to satisfy.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// What holds at the sample.
    pub role: Role,
    /// The friction angle of sliding, radians.
    pub shared_rad: f64,
    /// Where along the whisker, where the sample itself does not say, metres.
    pub s_m: Option<f64>,
}

/// A whitened load with a contact that satisfies `goal` to a hundredth of a standard deviation of its own, or as near as found.
pub fn load(with: &Instrument, measured: &Vector3<f64>, goal: &Goal) -> Option<Vector3<f64>> {
    let mut at = if goal.s_m.is_none() && with.contact(measured).is_some() {
        *measured
    } else {
        linear_beam(with, measured, goal.s_m.unwrap_or(0.6 * with.rod.length_m))
    };
    for _ in 0..STEPS {
        let Some(step) = newton(with, &at, goal) else { break };
        // Halved until the load has a contact at all.
        let mut share = 1.0;
        while share > 1e-3 && with.contact(&(at + step * share)).is_none() {
            share *= 0.5;
        }
        at += step * share;
        if step.amax() < 1e-3 {
            break;
        }
    }
    with.contact(&at).map(|_| at)
}

/// The torque as read and the force a slightly bent whisker would have for it, touched at `s_m` without friction.
fn linear_beam(with: &Instrument, measured: &Vector3<f64>, s_m: f64) -> Vector3<f64> {
    let moment = measured.z * with.load_sigma.z;
    let force = Vector3::new(-moment * moment / (2.0 * with.rod.ei_base_n_m2()), moment / s_m, moment);
    force.component_div(&with.load_sigma)
}

/// The shortest step, in standard deviations, to where the linearised constraints hold.
fn newton(with: &Instrument, at: &Vector3<f64>, goal: &Goal) -> Option<Vector3<f64>> {
    let (contact, by) = with.contact(at)?;
    let friction = match goal.role {
        Role::Slides(sign) => Some(contact.friction_angle_rad - sign * goal.shared_rad),
        _ => None,
    };
    let target = if goal.role == Role::Tip { Some(with.rod.length_m) } else { goal.s_m };
    let place = target.map(|s| contact.s_m - s);
    let rows = Matrix2x3::from_rows(&[by.row(4).into_owned(), by.row(3).into_owned()]);
    match (friction, place) {
        (Some(f), Some(p)) => {
            let gram: Matrix2<f64> = rows * rows.transpose();
            Some(-rows.transpose() * gram.try_inverse()? * Vector2::new(f, p))
        }
        (Some(residual), None) => Some(along(&rows, 0, residual)),
        (None, Some(residual)) => Some(along(&rows, 1, residual)),
        (None, None) => Some(Vector3::zeros()),
    }
}

fn along(rows: &Matrix2x3<f64>, row: usize, residual: f64) -> Vector3<f64> {
    let g = rows.row(row).transpose();
    -g * (residual / g.norm_squared().max(f64::MIN_POSITIVE))
}
