//! Where a kind of contact ends, and what follows.

use super::equilibrium::{Outline, State, Touching, least_force_n, wrapped};
use crate::Rod;
use arrayvec::ArrayVec;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// How a kind of contact ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Boundary {
    /// The force vanishes: the whisker lifts off.
    NoForce,
    /// The contact reaches the tip.
    ReachTip,
    /// The tip's direction becomes tangent to the outline.
    Flat,
    /// The first end of a face or of a corner's normals.
    First,
    /// The last end.
    Last,
    /// Friction reaches its limit while the whisker sticks, pulling towards the tip.
    SlideBack,
    /// The same, pulling towards the hub.
    SlideOn,
}

/// Every boundary of a kind of contact with a number that is positive inside: force in EI/L², lengths in L, angles in rad.
pub(super) fn boundaries(
    rod: &Rod,
    outline: &Outline,
    limit_rad: f64,
    state: &State,
) -> ArrayVec<(Boundary, f64), 6> {
    let z = &state.unknowns;
    let length = rod.length_m;
    let force = (z.x - least_force_n(rod)) * length * length / rod.ei_base_n_m2();
    let mut all = ArrayVec::new();
    all.push((Boundary::NoForce, force));
    if state.touching.is_tip() {
        let normal_rad = state.seen(rod, outline).normal_rad;
        all.push((Boundary::Flat, wrapped(state.side * (normal_rad - z.y) - FRAC_PI_2)));
    } else {
        all.push((Boundary::ReachTip, (length - z.y) / length));
    }
    match state.touching {
        Touching::Corner(i) => {
            all.push((Boundary::First, z.z));
            all.push((Boundary::Last, outline.turn_rad(i) - z.z));
        }
        Touching::Face(i) | Touching::TipOnFace(i) => {
            all.push((Boundary::First, z.z / length));
            all.push((Boundary::Last, (outline.lengths_m[i] - z.z) / length));
        }
        Touching::Tangent | Touching::Tip => {}
    }
    if state.sticks {
        all.push((Boundary::SlideBack, limit_rad - state.friction_rad));
        all.push((Boundary::SlideOn, limit_rad + state.friction_rad));
    }
    all
}

/// What may follow a boundary.
#[derive(Debug, Default)]
pub(super) struct Neighbours {
    /// The same whisker, seen as another kind of contact.
    pub continuous: Option<State>,
    /// Other whiskers to which it may jump at the same pose, as starts.
    pub jumps: Vec<State>,
}

/// A tip pressed on a corner stands on a peak: every slide along either face lets it relax. So a contact that reaches the tip
/// on a corner, or the end of a face on the tip, jumps or slips off.
pub(super) fn neighbours(rod: &Rod, outline: &Outline, state: &State, boundary: Boundary) -> Neighbours {
    let z = state.unknowns;
    let as_mid = |touching, parameter: f64| State {
        touching,
        unknowns: Vector3::new(z.x, if state.touching.is_tip() { rod.length_m } else { z.y }, parameter),
        ..*state
    };
    let as_tip = |touching, parameter: f64| State {
        touching,
        unknowns: Vector3::new(z.x, state.seen(rod, outline).theta_rad, parameter),
        ..*state
    };
    let on = |continuous| Neighbours { continuous: Some(continuous), jumps: Vec::new() };
    // Newton's method finds the landing from one of these places of a face, in shares of it from the corner.
    let shares = [0.0, 0.1, 0.3, 0.6];
    let onto = |face: usize, from_last: bool| {
        let at = move |share: f64| if from_last { 1.0 - share } else { share };
        shares.map(|share| as_tip(Touching::TipOnFace(face), at(share) * outline.lengths_m[face])).into_iter()
    };
    let jumps = |jumps: Vec<State>| Neighbours { continuous: None, jumps };
    match (state.touching, boundary) {
        (_, Boundary::SlideBack | Boundary::SlideOn) => on(State { sticks: false, ..*state }),
        (Touching::Tangent, Boundary::ReachTip) => on(as_tip(Touching::Tip, z.z)),
        (Touching::Face(i), Boundary::ReachTip) => on(as_tip(Touching::TipOnFace(i), z.z)),
        (Touching::Corner(i), Boundary::ReachTip) => {
            jumps(onto(i, false).chain(onto(outline.before(i), true)).collect())
        }
        (Touching::Tip, Boundary::Flat) => on(as_mid(Touching::Tangent, z.z)),
        (Touching::TipOnFace(i), Boundary::Flat) => on(as_mid(Touching::Face(i), z.z)),
        (Touching::Corner(i), Boundary::First) => {
            let before = outline.before(i);
            on(as_mid(Touching::Face(before), outline.lengths_m[before]))
        }
        (Touching::Corner(i), Boundary::Last) => on(as_mid(Touching::Face(i), 0.0)),
        (Touching::Face(i), Boundary::First) => on(as_mid(Touching::Corner(i), outline.turn_rad(i))),
        (Touching::Face(i), Boundary::Last) => on(as_mid(Touching::Corner(outline.after(i)), 0.0)),
        (Touching::TipOnFace(i), Boundary::First) => {
            let corner = as_mid(Touching::Corner(i), 0.5 * outline.turn_rad(i));
            jumps(onto(outline.before(i), true).chain([corner]).collect())
        }
        (Touching::TipOnFace(i), Boundary::Last) => {
            let next = outline.after(i);
            let corner = as_mid(Touching::Corner(next), 0.5 * outline.turn_rad(next));
            jumps(onto(next, false).chain([corner]).collect())
        }
        _ => Neighbours::default(),
    }
}
