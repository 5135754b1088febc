//! Friction and the tip as constraints on a load: modes, the coefficient of friction.
//!
//! A load has three numbers and an equilibrium with one point force at a known mode only two degrees of freedom: between clamp and
//! tip the force makes the friction angle with the whisker's normal, at the tip the arc length is the whisker's.
//!
//! ```text
//!   mid:  G(l) = |F| (sin φ(l) − sin φ_f) = 0      tip:  G(l) = |F| (s(l)/L − 1) = 0      docs/math/whisker_friction.md eqs. (1), (2)
//! ```

mod mixture;
pub mod modes;
pub mod projection;
mod states;
pub mod record;
pub mod online;

pub use online::Online;
pub use projection::{Constraint, Projection, project};
pub use record::{Mu, Record, solve_record};
pub use states::Tests;

use crate::contact::{Method, NoZero};
use crate::estimate::{Contact, LEAST_FORCE_SIGMAS, MOST_ALONG_SHARE, Mode, Status, estimate};
use crate::{Cell, ContactEstimate, Rod, Sample};
use nalgebra::{Matrix3, Vector3};
use projection::bend;

/// The angle from the whisker's normal to the force while the whisker slides: tan φ_f = ± μ, positive where the force pulls towards
/// the tip, that is where the whisker is drawn towards its hub along the object.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrictionAngle {
    /// φ_f, radians.
    pub rad: f64,
    /// Its standard deviation, radians.
    pub sigma_rad: f64,
}

impl FrictionAngle {
    /// The angle of a coefficient of friction and its standard deviation; `sign` is the direction of the pull (+1: towards the tip).
    pub fn of_mu(mu: f64, mu_sigma: f64, sign: f64) -> Self {
        FrictionAngle { rad: sign * mu.atan(), sigma_rad: mu_sigma / (1.0 + mu * mu) }
    }

    /// μ = |tan φ_f|.
    pub fn mu(&self) -> f64 {
        self.rad.tan().abs()
    }

    /// Standard deviation of μ: σ_φ / cos² φ_f.
    pub fn mu_sigma(&self) -> f64 {
        self.sigma_rad / self.rad.cos().powi(2)
    }
}

/// A sample whose χ² (1 degree of freedom) exceeds this under every mode is `Inconsistent`: one right sample in 10 000 does.
pub const INCONSISTENT_CHI2: f64 = 15.137;

/// One sample under one mode: the contact of maximum likelihood that fulfils the mode's constraint, its covariance, and the χ² of the
/// load against it in `Projection` (use [`project`] for that alone). `Mode::Free` constrains nothing. The status is the raw one, or
/// `Inconsistent` where χ² exceeds [`INCONSISTENT_CHI2`]. Fails where neither the load nor its neighbourhood has a contact.
pub fn constrain(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    mode: Mode,
    friction: FrictionAngle,
    method: Method,
) -> Result<ContactEstimate, NoZero> {
    let constraint = match mode {
        Mode::Free => return Ok(estimate(rod, cell, sample, method)),
        Mode::Mid => Constraint::Friction(friction),
        Mode::Tip => Constraint::Tip,
    };
    let cell = sound(rod, cell);
    let projection = project(rod, &cell, sample, constraint, method)?;
    let raw = estimate(rod, &cell, sample, method);
    Ok(answer(rod, &cell, sample, method, &raw, &projection, 1.0))
}

/// The instruments, with no reading taken as better than a millionth of the whisker's stiffness EI/L², EI/L: a record without noise
/// then has a metric too.
pub(crate) fn sound(rod: &Rod, cell: &Cell) -> Cell {
    let force_n = 1e-6 * rod.ei_base_n_m2() / rod.length_m.powi(2);
    Cell {
        force_sigma_n: cell.force_sigma_n.max(force_n),
        torque_sigma_n_m: cell.torque_sigma_n_m.max(force_n * rod.length_m),
        ..*cell
    }
}

/// The contact of a projected load, in the world.
pub(crate) fn answer(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    method: Method,
    raw: &ContactEstimate,
    projection: &Projection,
    probability: f64,
) -> ContactEstimate {
    let contact = contact_of(rod, cell, sample, method, projection);
    ContactEstimate {
        status: status(rod, cell, raw, projection, &contact),
        mode: projection.constraint.mode(),
        mode_probability: probability,
        contact: Some(contact),
        branches: raw.branches.clone(),
    }
}

/// A projected load's contact. What the constraint fixes has no spread left, of either sign; what the tangent does not show of a light
/// touch's long uncertainty, the bend of the contact's way, counts as uncertain too: ¾ b bᵀ, whisker_friction.md eq. (8).
fn contact_of(rod: &Rod, cell: &Cell, sample: &Sample, method: Method, projection: &Projection) -> Contact {
    let Projection { load, covariance, at, by_load, .. } = projection;
    let hub = &sample.world_from_hub;
    let moved = Sample { load: *load, ..*sample };
    let in_hub = by_load * covariance * by_load.transpose();
    let contact = Contact::in_world(&moved, &cell.hub_covariance(), at, &in_hub);
    let bent = bend(rod, projection, method).map_or(Matrix3::zeros(), |bend| {
        let turned = hub.rotate(bend.fixed_rows::<2>(0).into_owned());
        let bend = Vector3::new(turned.x, turned.y, bend.z);
        bend * bend.transpose() * 0.75
    });
    Contact {
        s_sigma_m: contact.s_sigma_m.max(0.0),
        friction_angle_sigma_rad: contact.friction_angle_sigma_rad.max(0.0),
        covariance: contact.covariance + bent,
        ..contact
    }
}

/// What the constraint explains is ok, however far past the tip or past k = 1 the noise had carried the load; what it contradicts is
/// `Inconsistent`, or what the load by itself is worse. Light touches stay `LowForce` unless the constraint places them.
fn status(
    rod: &Rod,
    cell: &Cell,
    raw: &ContactEstimate,
    projection: &Projection,
    contact: &Contact,
) -> Status {
    let sigma_n = cell.load_covariance()[(0, 0)].sqrt();
    let is_weak = projection.load.force_n().norm() < LEAST_FORCE_SIGMAS * sigma_n;
    match raw.status {
        Status::NoContact => Status::NoContact,
        _ if !contact.is_sound() => Status::NoZero,
        Status::NoZero | Status::BeyondTip if INCONSISTENT_CHI2 < projection.chi2 => raw.status,
        _ if INCONSISTENT_CHI2 < projection.chi2 => Status::Inconsistent,
        _ if is_weak || MOST_ALONG_SHARE * rod.length_m < contact.s_sigma_m => Status::LowForce,
        _ => Status::Ok,
    }
}
