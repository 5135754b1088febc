//! The end of a kind of contact, and the kind that follows.

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
            all.push((Boundary::Last, outline.rotation_rad(i) - z.z));
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

/// The same whisker, seen as another kind of contact, where a boundary passes into one; eq. (12).
pub(super) fn neighbour(rod: &Rod, outline: &Outline, state: &State, boundary: Boundary) -> Option<State> {
    let parameter = state.unknowns.z;
    let found = match (state.touching, boundary) {
        (_, Boundary::SlideBack | Boundary::SlideOn) => State { sticks: false, ..*state },
        (Touching::Tangent, Boundary::ReachTip) => as_tip(rod, outline, state, Touching::Tip, parameter),
        (Touching::Face(i), Boundary::ReachTip) => {
            as_tip(rod, outline, state, Touching::TipOnFace(i), parameter)
        }
        (Touching::Tip, Boundary::Flat) => as_mid(rod, state, Touching::Tangent, parameter),
        (Touching::TipOnFace(i), Boundary::Flat) => as_mid(rod, state, Touching::Face(i), parameter),
        (Touching::Corner(i), Boundary::First) => {
            let before = outline.before(i);
            as_mid(rod, state, Touching::Face(before), outline.lengths_m[before])
        }
        (Touching::Corner(i), Boundary::Last) => as_mid(rod, state, Touching::Face(i), 0.0),
        (Touching::Face(i), Boundary::First) => {
            as_mid(rod, state, Touching::Corner(i), outline.rotation_rad(i))
        }
        (Touching::Face(i), Boundary::Last) => as_mid(rod, state, Touching::Corner(outline.after(i)), 0.0),
        _ => return None,
    };
    Some(found)
}

/// Starts for other whiskers to which this one may jump at the same pose. A tip pressed on a corner stands on a peak: every slide
/// along either face lets it relax. So a contact that reaches the tip on a corner, or the end of a face on the tip, jumps.
pub(super) fn jumps(rod: &Rod, outline: &Outline, state: &State, boundary: Boundary) -> Vec<State> {
    // Newton's method finds the landing from one of these places of a face, in shares of it from the corner.
    let shares = [0.0, 0.1, 0.3, 0.6];
    let onto = |face: usize, from_last: bool| {
        let at = move |share: f64| if from_last { 1.0 - share } else { share };
        let start = |share| at(share) * outline.lengths_m[face];
        shares.map(|share| as_tip(rod, outline, state, Touching::TipOnFace(face), start(share)))
    };
    let corner = |i: usize| as_mid(rod, state, Touching::Corner(i), 0.5 * outline.rotation_rad(i));
    match (state.touching, boundary) {
        (Touching::Corner(i), Boundary::ReachTip) => [onto(i, false), onto(outline.before(i), true)].concat(),
        (Touching::TipOnFace(i), Boundary::First) => {
            [&onto(outline.before(i), true)[..], &[corner(i)]].concat()
        }
        (Touching::TipOnFace(i), Boundary::Last) => {
            let next = outline.after(i);
            [&onto(next, false)[..], &[corner(next)]].concat()
        }
        _ => Vec::new(),
    }
}

fn as_mid(rod: &Rod, state: &State, touching: Touching, parameter: f64) -> State {
    let s_m = if state.touching.is_tip() { rod.length_m } else { state.unknowns.y };
    State { touching, unknowns: Vector3::new(state.unknowns.x, s_m, parameter), ..*state }
}

fn as_tip(rod: &Rod, outline: &Outline, state: &State, touching: Touching, parameter: f64) -> State {
    let theta_rad = state.seen(rod, outline).theta_rad;
    State { touching, unknowns: Vector3::new(state.unknowns.x, theta_rad, parameter), ..*state }
}
