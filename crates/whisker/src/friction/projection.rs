//! The nearest load that fulfils a constraint: iterated projection in the metric of the noise.
//!
//! ```text
//!   l̂ measured, covariance Σ   ·   G(l) = 0 the constraint, g = ∇G, v variance of G at known l   ·   S = gᵀΣg + v
//!   l ← l̂ − Σ g (G(l) + gᵀ(l̂ − l)) / S      χ² = (G(l) + gᵀ(l̂ − l))² / S      Σ_l = Σ − Σ g gᵀ Σ / S
//! ```
//!
//! docs/math/whisker_friction.md eqs. (1)–(6).

use super::FrictionAngle;
use crate::contact::{ByLoad, Method, NoZero, contact_in_hub, contact_with_derivatives};
use crate::estimate::Mode;
use crate::{Cell, HubContact, HubLoad, Rod, Sample};
use nalgebra::{Matrix3, Vector3};

/// The constraint of a mode on a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Constraint {
    /// Between clamp and tip: the force makes this angle with the whisker's normal.
    Friction(FrictionAngle),
    /// At the tip: the moment vanishes at s = L.
    Tip,
}

impl Constraint {
    /// The mode it belongs to.
    pub fn mode(&self) -> Mode {
        match self {
            Constraint::Friction(_) => Mode::Mid,
            Constraint::Tip => Mode::Tip,
        }
    }

    /// G, newtons: eq. (1) between clamp and tip, eq. (2) at the tip. Multiplied by |F| so that it is nearly linear in a weak load.
    pub fn residual_n(&self, rod: &Rod, load: &HubLoad, at: &HubContact) -> f64 {
        load.force_n().norm() * self.share(rod, at)
    }

    /// ∂G/∂[fx, fy, mz] (1, 1, 1/m): the product rule on eqs. (1) and (2).
    pub fn gradient(&self, rod: &Rod, load: &HubLoad, at: &HubContact, by_load: &ByLoad) -> Vector3<f64> {
        let force = load.force_n();
        let by_size = Vector3::new(force.x, force.y, 0.0) / force.norm();
        let (row, factor) = match self {
            Constraint::Friction(_) => (4, at.friction_angle_rad.cos()),
            Constraint::Tip => (3, 1.0 / rod.length_m),
        };
        by_size * self.share(rod, at) + by_load.row(row).transpose() * (force.norm() * factor)
    }

    /// v, N²: what the uncertain friction angle adds to the variance of G.
    pub fn variance_n2(&self, load: &HubLoad) -> f64 {
        match self {
            Constraint::Friction(friction) => {
                (load.force_n().norm() * friction.rad.cos() * friction.sigma_rad).powi(2)
            }
            Constraint::Tip => 0.0,
        }
    }

    fn share(&self, rod: &Rod, at: &HubContact) -> f64 {
        match self {
            Constraint::Friction(friction) => at.friction_angle_rad.sin() - friction.rad.sin(),
            Constraint::Tip => at.s_m / rod.length_m - 1.0,
        }
    }
}

/// A load brought onto a constraint.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// What was demanded.
    pub constraint: Constraint,
    /// The load of maximum likelihood that fulfils it.
    pub load: HubLoad,
    /// Covariance of that load's `[fx, fy, mz]`, N², N²·m, N²·m².
    pub covariance: Matrix3<f64>,
    /// Squared distance from the measured load, 1 degree of freedom.
    pub chi2: f64,
    /// The measured load's own G, linearised at the answer, newtons: its square over S is χ².
    pub innovation_n: f64,
    /// S, N².
    pub innovation_variance_n2: f64,
    /// The contact.
    pub at: HubContact,
    /// Its derivatives by the load.
    pub by_load: ByLoad,
    /// Σ g / S: what the load moves by per newton of G.
    pub gain_per_n: Vector3<f64>,
}

impl Projection {
    /// Standard deviation of the arc length, metres.
    pub fn s_sigma_m(&self) -> f64 {
        let by = self.by_load.row(3);
        (by * self.covariance * by.transpose())[0].max(0.0).sqrt()
    }
}

/// How the contact bends away from its tangent, second differences of `[x, y, θ]` (hub axes; m, m, rad) over ± one standard deviation along
/// the direction in which the contact is known worst, on the constraint, eq. (7). None where a neighbour has no contact.
pub(crate) fn bend(rod: &Rod, projection: &Projection, method: Method) -> Option<Vector3<f64>> {
    let by = projection.by_load.fixed_rows::<2>(0);
    let spread = by * projection.covariance * by.transpose();
    let eigen = spread.symmetric_eigen();
    let worst = eigen.eigenvalues.imax();
    let along = projection.covariance * by.transpose() * eigen.eigenvectors.column(worst)
        / eigen.eigenvalues[worst].sqrt();
    let mut bend = -2.0 * place(&projection.at);
    for sign in [1.0, -1.0] {
        let mut load = projection.load.to_vector() + along * sign;
        // The constraint is a surface, not a plane: back onto it.
        let here = HubLoad::from_vector(&load);
        let at = contact_in_hub(rod, &here, method).ok()?;
        load -= projection.gain_per_n * projection.constraint.residual_n(rod, &here, &at);
        bend += place(&contact_in_hub(rod, &HubLoad::from_vector(&load), method).ok()?);
    }
    bend.iter().all(|v| v.is_finite()).then_some(bend)
}

fn place(at: &HubContact) -> Vector3<f64> {
    Vector3::new(at.x_in_hub.x, at.x_in_hub.y, at.theta_rad)
}

/// Steps of the projection; it converges in three or four, and a load that needs more is given as it is then.
const STEPS: usize = 30;
/// A step below this many standard deviations of the load is the last: a thousandth of what could be noticed.
const LAST_STEP: f64 = 1e-6;

/// Projects a sample's load onto a constraint. Fails where no load near it has a contact.
pub fn project(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    constraint: Constraint,
    method: Method,
) -> Result<Projection, NoZero> {
    let covariance = cell.load_covariance();
    let measured = sample.load.to_vector();
    let (mut load, mut found) = start(rod, &sample.load, method)?;
    let mut last = false;
    for _ in 0..STEPS {
        let step = Step::new(rod, &constraint, &covariance, &measured, &load, &found);
        if last {
            return Ok(step.finish(constraint, &covariance, load, found));
        }
        let (next, next_found) = towards(rod, &load, &step.target, method).ok_or(NoZero::NeverVanishes)?;
        last = distance(&(next - load), &covariance) < LAST_STEP;
        (load, found) = (next, next_found);
    }
    Ok(Step::new(rod, &constraint, &covariance, &measured, &load, &found).finish(
        constraint,
        &covariance,
        load,
        found,
    ))
}

type Found = (HubContact, ByLoad);

/// The measured load, or, where the noise left it without a contact, the frictionless load of the same torque and cross force:
/// fx = −M₀²/(2EI), eq. (4).
fn start(rod: &Rod, load: &HubLoad, method: Method) -> Result<(Vector3<f64>, Found), NoZero> {
    contact_with_derivatives(rod, load, method).map(|found| (load.to_vector(), found)).or_else(|why| {
        if !load.is_finite() {
            return Err(why);
        }
        let fx_n = -load.mz_n_m.powi(2) / (2.0 * rod.ei_base_n_m2());
        let fy_n = load.fy_n.abs().max(load.mz_n_m.abs() / rod.length_m).copysign(load.mz_n_m);
        let load = HubLoad { fx_n, fy_n, mz_n_m: load.mz_n_m };
        contact_with_derivatives(rod, &load, method).map(|found| (load.to_vector(), found))
    })
}

struct Step {
    target: Vector3<f64>,
    innovation_n: f64,
    innovation_variance_n2: f64,
    gain: Vector3<f64>,
}

impl Step {
    /// Eq. (5) at `load`.
    fn new(
        rod: &Rod,
        constraint: &Constraint,
        covariance: &Matrix3<f64>,
        measured: &Vector3<f64>,
        load: &Vector3<f64>,
        (at, by_load): &Found,
    ) -> Self {
        let here = HubLoad::from_vector(load);
        let g = constraint.gradient(rod, &here, at, by_load);
        let innovation_n = constraint.residual_n(rod, &here, at) + g.dot(&(measured - load));
        let gain = covariance * g;
        let innovation_variance_n2 = g.dot(&gain) + constraint.variance_n2(&here);
        let target = measured - gain * (innovation_n / innovation_variance_n2);
        Step { target, innovation_n, innovation_variance_n2, gain }
    }

    fn finish(
        self,
        constraint: Constraint,
        covariance: &Matrix3<f64>,
        load: Vector3<f64>,
        (at, by_load): Found,
    ) -> Projection {
        let gain_per_n = self.gain / self.innovation_variance_n2;
        Projection {
            constraint,
            load: HubLoad::from_vector(&load),
            covariance: covariance - self.gain * gain_per_n.transpose(),
            chi2: self.innovation_n.powi(2) / self.innovation_variance_n2,
            innovation_n: self.innovation_n,
            innovation_variance_n2: self.innovation_variance_n2,
            at,
            by_load,
            gain_per_n,
        }
    }
}

/// The whole step, or as many halvings of it as leave a load with a contact.
fn towards(
    rod: &Rod,
    from: &Vector3<f64>,
    target: &Vector3<f64>,
    method: Method,
) -> Option<(Vector3<f64>, Found)> {
    (0..12).find_map(|halvings| {
        let load = from + (target - from) * 0.5_f64.powi(halvings);
        let found = contact_with_derivatives(rod, &HubLoad::from_vector(&load), method).ok()?;
        Some((load, found))
    })
}

/// Length of a change of the load in standard deviations (Σ is diagonal).
fn distance(change: &Vector3<f64>, covariance: &Matrix3<f64>) -> f64 {
    (0..3).map(|i| change[i] * change[i] / covariance[(i, i)]).sum::<f64>().sqrt()
}
