//! What friction and the tip say of a load: constraints, modes, the coefficient of friction.
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
pub mod record;

pub use projection::{Constraint, Projection, project};
pub use record::{Mu, Record, solve_record};

use crate::contact::{Method, NoZero};
use crate::estimate::{Mode, Status, estimate};
use crate::{Cell, ContactEstimate, Rod, Sample};
use projection::DownDate;

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
    let moved = Sample { load: projection.load, ..*sample };
    let mut answer = estimate(rod, cell, &moved, method);
    if let Some(contact) = answer.contact.as_mut() {
        DownDate::new(projection, sample).apply(contact);
    }
    answer.mode = projection.constraint.mode();
    answer.mode_probability = probability;
    answer.status = status(raw, projection);
    answer
}

/// The raw verdict stands, save where the constraint itself explains or contradicts the load.
fn status(raw: &ContactEstimate, projection: &Projection) -> Status {
    match raw.status {
        Status::NoContact | Status::LowForce => raw.status,
        _ if INCONSISTENT_CHI2 < projection.chi2 => match raw.status {
            Status::Ok => Status::Inconsistent,
            worse => worse,
        },
        // A load the noise carried past k = 1 or past the tip: the constraint brings it back within the noise.
        _ => Status::Ok,
    }
}
