//! The bent whisker as a line, for images.

use super::{Method, contact_in_hub};
use crate::{HubLoad, Rod};
use nalgebra::{Vector2, Vector3};

/// Steps between two points of the line: with a hundred points a fourth-order step then errs by less than 1e-9 of the length.
const STEPS: usize = 4;

/// Points of the centre line at equal arc lengths from clamp to tip, hub frame, metres: bent by the load up to the contact, in its natural
/// curvature beyond. Without a contact the moment acts to the tip; without a load the natural shape. At least two points.
pub fn shape_in_hub(rod: &Rod, load: &HubLoad, method: Method, points: usize) -> Vec<Vector2<f64>> {
    let bent_to_m = contact_in_hub(rod, load, method).map_or(rod.length_m, |at| at.s_m.min(rod.length_m));
    let pieces = points.max(2) - 1;
    let mut line = Vec::with_capacity(pieces + 1);
    let mut state = Vector3::zeros();
    line.push(Vector2::zeros());
    for piece in 0..pieces {
        let s_m = |i: usize| rod.length_m * i as f64 / pieces as f64;
        let (from, to) = (s_m(piece), s_m(piece + 1));
        let contact = bent_to_m.clamp(from, to);
        state = advanced(rod, load, state, from, contact);
        state = advanced(rod, &HubLoad::default(), state, contact, to);
        line.push(Vector2::new(state.x, state.y));
    }
    line
}

/// The state `[x, y, θ]` at `to_m` from that at `from_m`, by Runge's and Kutta's fourth-order steps.
fn advanced(rod: &Rod, load: &HubLoad, mut state: Vector3<f64>, from_m: f64, to_m: f64) -> Vector3<f64> {
    let step = (to_m - from_m) / STEPS as f64;
    if step <= 0.0 {
        return state;
    }
    for i in 0..STEPS {
        let s = from_m + i as f64 * step;
        let k1 = slope(rod, load, s, &state);
        let k2 = slope(rod, load, s + 0.5 * step, &(state + k1 * (0.5 * step)));
        let k3 = slope(rod, load, s + 0.5 * step, &(state + k2 * (0.5 * step)));
        let k4 = slope(rod, load, s + step, &(state + k3 * step));
        state += (k1 + (k2 + k3) * 2.0 + k4) * (step / 6.0);
    }
    state
}

/// d/ds of `[x, y, θ]`, whisker_contact.md eq. (1), (2).
fn slope(rod: &Rod, load: &HubLoad, s_m: f64, state: &Vector3<f64>) -> Vector3<f64> {
    let moment = load.mz_n_m - (state.x * load.fy_n - state.y * load.fx_n);
    let (sin, cos) = state.z.sin_cos();
    Vector3::new(cos, sin, rod.curvature_per_m_at(s_m) + moment / rod.ei_n_m2_at(s_m))
}
