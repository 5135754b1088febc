//! Where the whisker touches, from one load: the first arc length at which the bending moment vanishes.

pub mod closed_form;
pub mod integrate;

use crate::{HubLoad, Rod};
use nalgebra::{SMatrix, Vector2};

/// A contact in the hub frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HubContact {
    /// Arc length from the clamp, metres; beyond the whisker's length where the load says so.
    pub s_m: f64,
    /// The point of the centre line, hub frame, metres.
    pub x_in_hub: Vector2<f64>,
    /// Direction of the whisker there, from the clamped direction, counter-clockwise, radians.
    pub theta_rad: f64,
    /// Angle from the whisker's normal to the force, positive where the force pulls towards the tip, radians:
    /// asin(F·t / |F|). Zero without friction, except at the tip.
    pub friction_angle_rad: f64,
    /// k² = (1 + H/|F|)/2, the squared modulus of the elastica; ½ without friction.
    pub modulus_squared: f64,
}

/// Derivatives of `[x, y, θ, s, friction angle]` (hub frame; m, m, rad, m, rad) by `[fx, fy, mz]` (N, N, N·m).
pub type ByLoad = SMatrix<f64, 5, 3>;

/// Why a load has no contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoZero {
    /// No load at all: nothing bends the whisker.
    Free,
    /// The moment never vanishes (k ≥ 1): several contacts, a distributed one, or a wrong EI.
    NeverVanishes,
    /// A load that is not a number.
    NotFinite,
}

/// How the elastica is integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Elliptic integrals where stiffness and intrinsic curvature are constant, otherwise integration.
    #[default]
    Auto,
    /// Always integrate from the hub until the moment vanishes, as Scholz and Rahn do.
    Integrate,
}

/// The contact of `load`.
pub fn contact_in_hub(rod: &Rod, load: &HubLoad, method: Method) -> Result<HubContact, NoZero> {
    let _ = method;
    closed_form::straight(rod.ei_base_n_m2(), load)
}

/// The contact of `load` and its derivatives by the load.
pub fn contact_with_derivatives(
    rod: &Rod,
    load: &HubLoad,
    method: Method,
) -> Result<(HubContact, ByLoad), NoZero> {
    let at = contact_in_hub(rod, load, method)?;
    let mut by_load = ByLoad::zeros();
    let scales = [load.force_n().norm(), load.force_n().norm(), load.force_n().norm() * rod.length_m];
    for (column, scale) in scales.into_iter().enumerate() {
        let step = 6e-6 * scale;
        let mut ends = [at, at];
        for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
            let mut moved = load.to_vector();
            moved[column] += sign * step;
            *end = contact_in_hub(rod, &HubLoad::from_vector(&moved), method)?;
        }
        let values = ends.map(|c| [c.x_in_hub.x, c.x_in_hub.y, c.theta_rad, c.s_m, c.friction_angle_rad]);
        for row in 0..5 {
            by_load[(row, column)] = (values[0][row] - values[1][row]) / (2.0 * step);
        }
    }
    Ok((at, by_load))
}
