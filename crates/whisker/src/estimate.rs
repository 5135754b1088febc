//! One sample's contact in the world, with its covariance and a verdict.

use crate::contact::{Method, contact_with_derivatives};
use crate::{Cell, HubContact, PlanarPose, Rod, Sample};
use nalgebra::{Matrix3, Vector2};

/// What can be said of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// A contact whose covariance holds.
    Ok,
    /// The load is within the noise: nothing is touched.
    NoContact,
    /// Something is touched, but too lightly to say where along the whisker.
    LowForce,
    /// The moment never vanishes: several contacts, a distributed one, or a wrong EI.
    NoZero,
    /// The moment vanishes beyond the whisker's tip by more than the noise explains.
    BeyondTip,
    /// The load contradicts what is known (friction, envelope, tip) by more than the noise explains.
    Inconsistent,
}

/// Where on the whisker the object touches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Nowhere.
    Free,
    /// Between clamp and tip, on a face, a curved outline or a corner: the force is normal to the whisker up to friction.
    Mid,
    /// At the tip: the force is normal to the object up to friction.
    Tip,
}

/// A contact in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// The point of the centre line, world, metres.
    pub x_in_world: Vector2<f64>,
    /// Direction of the whisker there, world, radians.
    pub theta_rad: f64,
    /// Arc length from the clamp, metres.
    pub s_m: f64,
    /// Standard deviation of the arc length, metres.
    pub s_sigma_m: f64,
    /// Force of the object on the whisker, across it and away from the object, newtons; not negative.
    pub f_normal_n: f64,
    /// Force along the whisker, positive towards the tip, newtons.
    pub f_tangent_n: f64,
    /// asin(F·t/|F|), radians.
    pub friction_angle_rad: f64,
    /// Standard deviation of the friction angle, radians.
    pub friction_angle_sigma_rad: f64,
    /// k² of the elastica.
    pub modulus_squared: f64,
    /// Covariance of `[x, y, θ]`, world, m², m·rad, rad².
    pub covariance: Matrix3<f64>,
}

impl Contact {
    /// Unit vector from the object to the whisker, across the whisker, world: n = sign(M₀)·(−sin θ, cos θ).
    pub fn normal_in_world(&self, moment_sign: f64) -> Vector2<f64> {
        let (sin, cos) = self.theta_rad.sin_cos();
        Vector2::new(-sin, cos) * moment_sign
    }
}

/// What one sample says.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimate {
    /// The verdict.
    pub status: Status,
    /// Where on the whisker.
    pub mode: Mode,
    /// Probability of that mode; 1 where it was not in question.
    pub mode_probability: f64,
    /// The contact, wherever the load has one: also with a status other than ok.
    pub contact: Option<Contact>,
    /// Further zeros of the moment on the whisker (S-shaped states), by arc length.
    pub branches: Vec<HubContact>,
}

/// Sample by sample, no constraint used. Never fails: a load without a contact says why in its status.
pub fn estimate(rod: &Rod, cell: &Cell, sample: &Sample, method: Method) -> ContactEstimate {
    let contact = contact_with_derivatives(rod, &sample.load, method)
        .ok()
        .map(|(at, by_load)| in_world(cell, sample, &at, &by_load));
    let (status, mode) = match contact {
        Some(_) => (Status::Ok, Mode::Mid),
        None => (Status::NoContact, Mode::Free),
    };
    ContactEstimate { status, mode, mode_probability: 1.0, contact, branches: Vec::new() }
}

fn in_world(cell: &Cell, sample: &Sample, at: &HubContact, by_load: &crate::contact::ByLoad) -> Contact {
    let hub = &sample.world_from_hub;
    let covariance_in_hub = by_load * cell.load_covariance() * by_load.transpose();
    let turn = world_from_hub_axes(hub);
    // Turning or shifting the hub moves the contact: by [x, y, angle] of the hub.
    let arm = hub.turn(at.x_in_hub);
    let by_hub = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
    let covariance = turn * covariance_in_hub.fixed_view::<3, 3>(0, 0) * turn.transpose()
        + by_hub * cell.hub_covariance() * by_hub.transpose();
    let force = sample.load.force_n().norm();
    Contact {
        x_in_world: hub.apply(at.x_in_hub),
        theta_rad: hub.angle_rad + at.theta_rad,
        s_m: at.s_m,
        s_sigma_m: covariance_in_hub[(3, 3)].sqrt(),
        f_normal_n: force * at.friction_angle_rad.cos(),
        f_tangent_n: force * at.friction_angle_rad.sin(),
        friction_angle_rad: at.friction_angle_rad,
        friction_angle_sigma_rad: covariance_in_hub[(4, 4)].sqrt(),
        modulus_squared: at.modulus_squared,
        covariance,
    }
}

/// Turns `[x, y, θ]` of the hub frame into world axes.
fn world_from_hub_axes(hub: &PlanarPose) -> Matrix3<f64> {
    let (sin, cos) = hub.angle_rad.sin_cos();
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}
