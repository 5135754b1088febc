//! The readings of a whisker: the quasi-static forward model.
//!
//! A rod, a convex object, a path of the hub, a coefficient of friction; out come exact readings with the contact behind each.
//! The whisker touches at one point at a time, slides (friction at its limit, against the slip) or sticks where the hub turns back, changes kind of contact
//! along the outline, and slips off where no equilibrium is left. Which side the object is on is found at the touch. Two simultaneous contacts are not simulated: where a whisker would
//! need them the answer is [`Error::NoRest`].
//!
//! Derivation: docs/math/whisker_simulate.md.

mod integrate;
mod elastica;
mod equilibrium;
mod boundary;
mod free;
mod follow;
mod noise;
mod path;
#[cfg(test)]
mod tests;

pub use equilibrium::Touching;
pub use noise::add_noise;
pub use path::{MOST_SAMPLES, Motion, Spacing, standard_sweeps, sweep};

use crate::{Error, HubLoad, PlanarPose, Rod, Sample, Shape};
use equilibrium::{Outline, State};
use follow::{Follower, Now};
use nalgebra::Vector2;

/// A reading without noise, and its cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulated {
    /// The reading.
    pub sample: Sample,
    /// The contact; none while the whisker is free.
    pub truth: Option<TruthContact>,
}

/// A contact as the simulator knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthContact {
    /// The point of the centre line, world, metres.
    pub x_in_world: Vector2<f64>,
    /// Arc length from the clamp, metres.
    pub s_m: f64,
    /// Direction of the whisker there, world, radians.
    pub theta_rad: f64,
    /// Force of the object on the whisker, world axes, newtons.
    pub force_in_world_n: Vector2<f64>,
    /// asin(F·t/|F|) with t the whisker's direction, radians.
    pub friction_angle_rad: f64,
    /// What touches what.
    pub touching: Touching,
    /// Whether the whisker stands still on the object, or rolls, instead of sliding: after the hub turns back, with friction.
    pub sticks: bool,
}

/// Something that happened between two poses of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// When: number of the pose before, plus the share of the way to the next.
    pub pose: f64,
    /// Where the hub was.
    pub world_from_hub: PlanarPose,
    /// What.
    pub change: Change,
}

/// The events along a path, besides one kind of contact becoming the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// The free whisker meets the object.
    Touch {
        /// How it does.
        touching: Touching,
    },
    /// The contact leaps at one pose of the hub.
    Jump {
        /// From there.
        from: Touching,
        /// To here.
        to: Touching,
    },
    /// No equilibrium is left: the whisker straightens.
    SlipOff,
    /// A whisker that stood still on the object begins to slide.
    Slide,
    /// The force falls to zero: the hub moved back.
    LiftOff,
}

/// Readings and events of one path.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// One for each pose.
    pub samples: Vec<Simulated>,
    /// In order.
    pub events: Vec<Event>,
}

/// Follows the whisker along a path whose poses are joined by straight motions (coordinates and angle interpolated). `mu` is the
/// coefficient of friction. Samples carry `sweep` and their number, and no time.
///
/// # Errors
/// What [`Rod::check`] and [`Shape::check`] refuse; a negative `mu`; a pose that is not finite; a whisker that is not free at the
/// first pose; a hub inside the object; a pose without rest against a single point.
pub fn record(rod: &Rod, object: &Shape, mu: f64, sweep: u32, path: &[PlanarPose]) -> Result<Record, Error> {
    check(rod, object, mu)?;
    let outline = Outline::new(object);
    let mut record = Record::default();
    let mut follower: Option<Follower> = None;
    for (number, pose) in path.iter().enumerate() {
        check_pose(object, number, pose)?;
        match &mut follower {
            None => follower = Some(start(rod, &outline, mu, pose)?),
            Some(follower) => follower.advance(pose)?,
        }
        if let Some(follower) = &follower {
            record.samples.push(reading(follower, sweep, number as u32));
        }
    }
    record.events = follower.map(|follower| follower.events).unwrap_or_default();
    Ok(record)
}

/// The centre line of the whisker from hub to tip for drawing, world, metres; as straight as it is where nothing touches.
pub fn centre_line(rod: &Rod, simulated: &Simulated) -> Vec<Vector2<f64>> {
    match &simulated.truth {
        None => free::free_line(rod, &simulated.sample.world_from_hub),
        Some(truth) => free::loaded_line(rod, truth),
    }
}

fn check(rod: &Rod, object: &Shape, mu: f64) -> Result<(), Error> {
    rod.check()?;
    object.check()?;
    if !mu.is_finite() {
        return Err(Error::NotFinite { what: "the coefficient of friction" });
    }
    if mu < 0.0 { Err(Error::Negative { what: "the coefficient of friction", seen: mu }) } else { Ok(()) }
}

fn check_pose(object: &Shape, pose: usize, hub: &PlanarPose) -> Result<(), Error> {
    if ![hub.x_m, hub.y_m, hub.angle_rad].iter().all(|v| v.is_finite()) {
        return Err(Error::NotFinite { what: "a pose of the hub" });
    }
    let inside = object.outside_m(Vector2::new(hub.x_m, hub.y_m)) < 0.0;
    if inside { Err(Error::HubInside { pose }) } else { Ok(()) }
}

fn start<'a>(
    rod: &'a Rod,
    outline: &'a Outline<'a>,
    mu: f64,
    hub: &PlanarPose,
) -> Result<Follower<'a>, Error> {
    if free::is_deep(rod, outline, hub) {
        return Err(Error::StartsInside);
    }
    Ok(Follower {
        rod,
        outline,
        limit_rad: mu.atan(),
        hub: *hub,
        now: Now::Free,
        pose: 0,
        events: Vec::new(),
    })
}

fn reading(follower: &Follower, sweep: u32, sample: u32) -> Simulated {
    let hub = follower.hub;
    let (load, truth) = match &follower.now {
        Now::Free => (HubLoad::default(), None),
        Now::Touching(solved) => felt(follower.rod, follower.outline, &solved.state, &hub),
    };
    Simulated { sample: Sample { sweep, sample, t_s: None, world_from_hub: hub, load }, truth }
}

/// The load at the hub and the contact behind it.
fn felt(rod: &Rod, outline: &Outline, state: &State, hub: &PlanarPose) -> (HubLoad, Option<TruthContact>) {
    let truth = state.truth(rod, outline);
    let in_hub = hub.rotate_back(truth.force_in_world_n);
    let arm = truth.x_in_world - Vector2::new(hub.x_m, hub.y_m);
    let mz_n_m = arm.perp(&truth.force_in_world_n);
    (HubLoad { fx_n: in_hub.x, fy_n: in_hub.y, mz_n_m }, Some(truth))
}

/// Number of the pose, with the share of the way to the next, at which the free whisker meets the object.
fn first_touch(
    rod: &Rod,
    object: &Shape,
    mut path: impl Iterator<Item = PlanarPose>,
) -> Result<Option<f64>, Error> {
    check(rod, object, 0.0)?;
    let outline = Outline::new(object);
    let Some(first) = path.next() else { return Ok(None) };
    let mut follower = start(rod, &outline, 0.0, &first)?;
    for pose in path {
        if let Some(touch) = follower.next_touch(&pose) {
            return Ok(Some(touch));
        }
    }
    Ok(None)
}
