//! One sample as a node of the chain: its unknowns, its point of the outline and the tangent there, its own constraint.
//!
//! ```text
//!   z = [fx/σ_F, fy/σ_F, mz/σ_M, ε/σ_ε] · x = hub · contact(fx, fy, mz) + ε n(α) · α direction of the object's tangent
//!   touch: z = [(τ − ½)√12, (r − L/2)/(L/2), 0, 0], x = hub(τ) + r t(α), the whisker straight
//! ```
//! Derivation: docs/math/whisker_sweep.md, sections 1–3.

use super::chain::Local;
use crate::contact::{ByLoad, Method, contact_with_derivatives};
use crate::friction::sound;
use crate::{Cell, Error, HubContact, HubLoad, PlanarPose, Rod};
use nalgebra::{Matrix2x4, Vector2, Vector3, Vector4};

/// How exactly the friction angle of sliding is held, radians: far below the 0.01 rad a single sample knows it to.
const FRICTION_TOLERANCE_RAD: f64 = 1e-4;
/// How exactly a tip contact is at the tip: a part in 25 000 of the length, 10 µm of a quarter metre.
const TIP_TOLERANCE: f64 = 4e-5;

/// The whisker and its instruments, checked.
#[derive(Debug, Clone)]
pub struct Instrument {
    /// The whisker.
    pub rod: Rod,
    /// How its elastica is solved.
    pub method: Method,
    /// Standard deviations of `[fx, fy, mz]`, N, N, N·m.
    pub load_sigma: Vector3<f64>,
    /// Of either hub coordinate, metres.
    pub xy_sigma_m: f64,
    /// Of the hub's angle where its reading changes from sample to sample, radians.
    pub angle_sigma_rad: f64,
    /// Of the hub's angle where its reading stays: noise without rounding, radians.
    pub angle_noise_rad: f64,
    /// The rounding all samples of an unchanging reading share, radians.
    pub angle_step_sigma_rad: f64,
}

impl Instrument {
    /// Fails where the rod is none or a noise is no number. A load cell that claims to be exact is taken as good to a millionth of EI/L².
    pub fn new(rod: &Rod, cell: &Cell, method: Method) -> Result<Self, Error> {
        rod.check()?;
        let cell = &sound(rod, cell);
        let load_sigma = cell.load_covariance().diagonal().map(f64::sqrt);
        for (what, seen) in [("the force noise", load_sigma.x), ("the torque noise", load_sigma.z)] {
            if !(0.0 < seen && seen.is_finite()) {
                return Err(Error::NotPositive { what, seen });
            }
        }
        let hub = cell.hub_covariance();
        Ok(Instrument {
            rod: rod.clone(),
            method,
            load_sigma,
            xy_sigma_m: hub[(0, 0)].sqrt(),
            angle_sigma_rad: hub[(2, 2)].sqrt(),
            angle_noise_rad: cell.hub_angle_sigma_rad,
            angle_step_sigma_rad: cell.hub_angle_step_rad / 12.0_f64.sqrt(),
        })
    }

    /// Contact and derivatives by the whitened load; none where the load has no contact.
    pub fn contact(&self, whitened: &Vector3<f64>) -> Option<(HubContact, ByLoad)> {
        let load = HubLoad::from_vector(&whitened.component_mul(&self.load_sigma));
        let (at, mut by_load) = contact_with_derivatives(&self.rod, &load, self.method).ok()?;
        for column in 0..3 {
            by_load.column_mut(column).scale_mut(self.load_sigma[column]);
        }
        let finite = by_load.iter().all(|v| v.is_finite()) && at.s_m.is_finite();
        finite.then_some((at, by_load))
    }
}

/// What holds at a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// Between clamp and tip, sliding towards the clamp (+1) or the tip (−1): the friction angle is ±φ.
    Slides(f64),
    /// Between clamp and tip, friction angle unknown: sticking, or something friction does not explain.
    Sticks,
    /// At the tip, sliding.
    Tip,
    /// The moment of touch: no load yet, the whisker straight, the hub between the pose before and that of the first contact.
    Touch {
        /// The hub at the last sample without contact.
        before: PlanarPose,
    },
}

/// A sample in the chain.
#[derive(Debug, Clone, Copy)]
pub struct Node {
    /// The hub's pose as read.
    pub hub: PlanarPose,
    /// The load as read, whitened; zero for a touch.
    pub measured: Vector3<f64>,
    /// +1 where the moment is positive (object on the right), else −1.
    pub side: f64,
    /// What holds.
    pub role: Role,
    /// How far noise of the hub's pose moves the contact across the whisker, metres.
    pub offset_sigma_m: f64,
    /// Whether the hub's angle changes here, so that its rounding is fresh.
    pub fresh_angle: bool,
}

/// A node at a value of its unknowns.
#[derive(Debug, Clone, Copy)]
pub struct Linear {
    /// The point of the outline, world, metres.
    pub x: Vector2<f64>,
    /// Its derivatives.
    pub x_by: Matrix2x4<f64>,
    /// α, world, radians.
    pub alpha_rad: f64,
    /// Its derivatives.
    pub alpha_by: Vector4<f64>,
    /// Its derivative by the shared friction angle φ.
    pub alpha_by_shared: f64,
    /// The node's own constraint: residual, derivatives, derivative by φ, all in its standard deviations.
    pub constraint: Option<(f64, Vector4<f64>, f64)>,
    /// The contact in the hub frame; none of a touch.
    pub contact: Option<(HubContact, ByLoad)>,
}

/// (cos, sin) of a direction.
pub fn direction(angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector2::new(cos, sin)
}

/// A quarter turn counter-clockwise.
pub fn left_of(v: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-v.y, v.x)
}

impl Node {
    /// Deviation of the unknowns from what was measured, each in its standard deviation.
    pub fn deviation(&self, z: &Local) -> Local {
        z - self.measured.push(0.0)
    }

    /// Point, tangent and constraint at `z` for the friction angle `shared_rad`; none where the load has no contact.
    pub fn linear(&self, with: &Instrument, z: &Local, shared_rad: f64) -> Option<Linear> {
        match self.role {
            Role::Touch { before } => Some(self.touch(with, before, z)),
            _ => self.contact(with, z, shared_rad),
        }
    }

    /// Eqs. (1)–(4).
    fn contact(&self, with: &Instrument, z: &Local, shared_rad: f64) -> Option<Linear> {
        let (at, by_load) = with.contact(&z.xyz())?;
        let (alpha_rad, alpha_by, alpha_by_shared) = self.tangent(with, z, &at, &by_load, shared_rad)?;
        let normal = left_of(direction(alpha_rad));
        let offset = z.w * self.offset_sigma_m;
        let mut x_by = Matrix2x4::zeros();
        for column in 0..3 {
            let in_hub = by_load.fixed_view::<2, 1>(0, column).into_owned();
            x_by.set_column(column, &self.hub.rotate(in_hub));
        }
        x_by -= direction(alpha_rad) * offset * alpha_by.transpose();
        x_by.set_column(3, &(normal * self.offset_sigma_m));
        Some(Linear {
            x: self.hub.apply(at.x_in_hub) + normal * offset,
            x_by,
            alpha_rad,
            alpha_by,
            alpha_by_shared,
            constraint: self.constraint(with, &at, &by_load, shared_rad),
            contact: Some((at, by_load)),
        })
    }

    /// The object's tangent: the whisker's own between clamp and tip; at the tip that to which the force stands at φ.
    fn tangent(
        &self,
        with: &Instrument,
        z: &Local,
        at: &HubContact,
        by_load: &ByLoad,
        shared_rad: f64,
    ) -> Option<(f64, Vector4<f64>, f64)> {
        if self.role != Role::Tip {
            let by = by_load.row(2);
            return Some((self.hub.angle_rad + at.theta_rad, Vector4::new(by[0], by[1], by[2], 0.0), 0.0));
        }
        let force = z.xyz().component_mul(&with.load_sigma).xy();
        let squared = force.norm_squared();
        if !(0.0 < squared) {
            return None;
        }
        let alpha = force.y.atan2(force.x) + self.hub.angle_rad
            - self.side * (std::f64::consts::FRAC_PI_2 - shared_rad);
        let by = Vector4::new(-force.y * with.load_sigma.x, force.x * with.load_sigma.y, 0.0, 0.0) / squared;
        Some((alpha, by, self.side))
    }

    fn constraint(
        &self,
        with: &Instrument,
        at: &HubContact,
        by_load: &ByLoad,
        shared_rad: f64,
    ) -> Option<(f64, Vector4<f64>, f64)> {
        let (residual, row, by_shared, sigma) = match self.role {
            Role::Slides(sign) => {
                (at.friction_angle_rad - sign * shared_rad, 4, -sign, FRICTION_TOLERANCE_RAD)
            }
            Role::Tip => (at.s_m - with.rod.length_m, 3, 0.0, TIP_TOLERANCE * with.rod.length_m),
            Role::Sticks | Role::Touch { .. } => return None,
        };
        let by = by_load.row(row);
        Some((residual / sigma, Vector4::new(by[0], by[1], by[2], 0.0) / sigma, by_shared / sigma))
    }

    /// Eq. (5).
    fn touch(&self, with: &Instrument, before: PlanarPose, z: &Local) -> Linear {
        let (tau_step, r_step) = (1.0 / 12.0_f64.sqrt(), 0.5 * with.rod.length_m);
        let (tau, r) = (0.5 + tau_step * z.x, r_step * (1.0 + z.y));
        let turn = wrapped(self.hub.angle_rad - before.angle_rad);
        let shift = Vector2::new(self.hub.x_m - before.x_m, self.hub.y_m - before.y_m);
        let alpha_rad = before.angle_rad + tau * turn;
        let along = direction(alpha_rad);
        let mut x_by = Matrix2x4::zeros();
        x_by.set_column(0, &((shift + left_of(along) * (r * turn)) * tau_step));
        x_by.set_column(1, &(along * r_step));
        x_by.set_column(3, &(left_of(along) * self.offset_sigma_m));
        Linear {
            x: Vector2::new(before.x_m, before.y_m)
                + shift * tau
                + along * r
                + left_of(along) * (z.w * self.offset_sigma_m),
            x_by,
            alpha_rad,
            alpha_by: Vector4::new(turn * tau_step, 0.0, 0.0, 0.0),
            alpha_by_shared: 0.0,
            constraint: None,
            contact: None,
        }
    }
}

/// The same angle within (−π, π].
pub fn wrapped(angle_rad: f64) -> f64 {
    angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
}
