//! The unloaded whisker: its shape, its intersections, the beginning of a contact.

use super::TruthContact;
use super::equilibrium::{Outline, State, Touching, wrapped};
use crate::{PlanarPose, Rod};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Segments of a whisker that is drawn or tested against the object.
const SEGMENTS: usize = 48;
/// Cuts no deeper than this part of the length are a touch.
const GRAZE: f64 = 1e-9;
/// A cut up to this part of the length may be left at the end of a step, too shallow for a contact: 1e-5 of the force of 1 mm.
const SHALLOW: f64 = 5e-8;
/// How near to the outline, in parts of the length, a feature counts as touched when the whisker arrives.
const NEAR: f64 = 2.0 * SHALLOW;

/// Whether the rod is straight while unloaded.
pub(super) fn is_straight(rod: &Rod) -> bool {
    rod.constant_curvature_per_m() == Some(0.0)
}

/// The centre line of the unloaded whisker from the hub to the tip, world, metres.
pub(super) fn free_line(rod: &Rod, hub: &PlanarPose) -> Vec<Vector2<f64>> {
    let start = [hub.x_m, hub.y_m, hub.angle_rad];
    if is_straight(rod) {
        let tip = hub.apply(Vector2::new(rod.length_m, 0.0));
        return vec![Vector2::new(hub.x_m, hub.y_m), tip];
    }
    march(rod, start, 0.0, rod.length_m, |_, _| 0.0).iter().map(|p| Vector2::new(p[0], p[1])).collect()
}

/// The centre line of a loaded whisker: back from the contact to the hub, and on from it to the tip, hub first, metres.
pub(super) fn loaded_line(rod: &Rod, contact: &TruthContact) -> Vec<Vector2<f64>> {
    let (x_c, force) = (contact.x_in_world, contact.force_in_world_n);
    let moment = |x: f64, y: f64| (x_c.x - x) * force.y - (x_c.y - y) * force.x;
    let start = [x_c.x, x_c.y, contact.theta_rad];
    let mut line = march(rod, start, contact.s_m, 0.0, moment);
    line.reverse();
    if contact.s_m < rod.length_m {
        line.extend(march(rod, start, contact.s_m, rod.length_m, |_, _| 0.0).into_iter().skip(1));
    }
    line.iter().map(|p| Vector2::new(p[0], p[1])).collect()
}

/// Runge–Kutta of fourth order: 1e-7 of the length, for drawing and for what a whisker cuts.
fn march(rod: &Rod, start: [f64; 3], from: f64, to: f64, moment: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
    let step = (to - from) / SEGMENTS as f64;
    let slope = |s: f64, at: [f64; 3]| {
        let bend = rod.curvature_per_m_at(s) + moment(at[0], at[1]) / rod.ei_n_m2_at(s);
        [at[2].cos(), at[2].sin(), bend]
    };
    let shifted = |at: [f64; 3], by: [f64; 3], h: f64| [0, 1, 2].map(|i| at[i] + h * by[i]);
    let mut line = vec![start];
    let mut at = start;
    for i in 0..SEGMENTS {
        let s = from + i as f64 * step;
        let k1 = slope(s, at);
        let k2 = slope(s + 0.5 * step, shifted(at, k1, 0.5 * step));
        let k3 = slope(s + 0.5 * step, shifted(at, k2, 0.5 * step));
        let k4 = slope(s + step, shifted(at, k3, step));
        at = [0, 1, 2].map(|j| at[j] + step / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]));
        line.push(at);
    }
    line
}

/// Whether the unloaded whisker cuts the object.
pub(super) fn is_blocked(rod: &Rod, outline: &Outline, hub: &PlanarPose) -> bool {
    cuts(outline, &free_line(rod, hub), GRAZE * rod.length_m)
}

/// Whether the unloaded whisker cuts the object so deep that it cannot count as free.
pub(super) fn is_deep(rod: &Rod, outline: &Outline, hub: &PlanarPose) -> bool {
    cuts(outline, &free_line(rod, hub), SHALLOW * rod.length_m)
}

/// Whether a line enters the object by more than `depth_m`.
pub(super) fn cuts(outline: &Outline, line: &[Vector2<f64>], depth_m: f64) -> bool {
    line.windows(2).any(|pair| outline.shape.is_cut_by(pair[0], pair[1], depth_m))
}

/// How the contact may begin at a pose where the unloaded whisker touches: mid-whisker first, nearest to the hub first.
pub(super) fn first_contacts(rod: &Rod, outline: &Outline, hub: &PlanarPose) -> Vec<State> {
    let start =
        |touching, side, unknowns| State { touching, side, friction_rad: 0.0, sticks: false, unknowns };
    let (tip, theta_rad) = match is_straight(rod) {
        true => (hub.apply(Vector2::new(rod.length_m, 0.0)), hub.angle_rad),
        false => {
            let line = march(rod, [hub.x_m, hub.y_m, hub.angle_rad], 0.0, rod.length_m, |_, _| 0.0);
            let last = line[SEGMENTS];
            (Vector2::new(last[0], last[1]), last[2])
        }
    };
    let mut found = match is_straight(rod) {
        true => mid_of_straight(rod, outline, hub, &start),
        false => mid_of_curved(rod, outline, hub, &start),
    };
    let heading = Vector2::new(theta_rad.cos(), theta_rad.sin());
    for (touching, normal_rad, parameter) in touched_by_tip(rod, outline, tip) {
        let normal = Vector2::new(normal_rad.cos(), normal_rad.sin());
        if heading.dot(&normal) < 0.0 {
            let side = heading.perp(&normal).signum();
            found.push(start(touching, side, Vector3::new(0.0, theta_rad, parameter)));
        }
    }
    found
}

/// Supporting lines of the object along the straight whisker.
fn mid_of_straight(
    rod: &Rod,
    outline: &Outline,
    hub: &PlanarPose,
    start: &impl Fn(Touching, f64, Vector3<f64>) -> State,
) -> Vec<State> {
    let mut found = Vec::new();
    for side in [1.0, -1.0] {
        let normal_rad = hub.angle_rad + side * FRAC_PI_2;
        let normal = Vector2::new(normal_rad.cos(), normal_rad.sin());
        let level = normal.dot(&hub.apply(Vector2::zeros()));
        if NEAR * rod.length_m < (level - outline.shape.support_m(normal)).abs() {
            continue;
        }
        let mut touched: Vec<(f64, Touching, f64)> = Vec::new();
        if let Some((x, _)) = outline.shape.smooth_point_m(normal_rad) {
            touched.push((hub.apply_inverse(x).x, Touching::Tangent, normal_rad));
        }
        for (i, corner) in outline.corners.iter().enumerate() {
            if (level - normal.dot(corner)).abs() <= NEAR * rod.length_m {
                let parameter = wrapped(normal_rad - outline.normals_rad[outline.before(i)]);
                let parameter = parameter.clamp(0.0, outline.rotation_rad(i));
                touched.push((hub.apply_inverse(*corner).x, Touching::Corner(i), parameter));
            }
        }
        touched.retain(|(s, ..)| 0.0 < *s && *s < rod.length_m);
        touched.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.extend(touched.into_iter().map(|(s, t, p)| start(t, side, Vector3::new(0.0, s, p))));
    }
    found
}

/// The part of a curved whisker that lies deepest, if it is not the tip.
fn mid_of_curved(
    rod: &Rod,
    outline: &Outline,
    hub: &PlanarPose,
    start: &impl Fn(Touching, f64, Vector3<f64>) -> State,
) -> Vec<State> {
    let at = |s: f64| {
        let line = march(rod, [hub.x_m, hub.y_m, hub.angle_rad], 0.0, s, |_, _| 0.0);
        line[SEGMENTS]
    };
    let outside = |s: f64| {
        let p = at(s);
        outline.shape.outside_m(Vector2::new(p[0], p[1]))
    };
    let line = march(rod, [hub.x_m, hub.y_m, hub.angle_rad], 0.0, rod.length_m, |_, _| 0.0);
    let step = rod.length_m / SEGMENTS as f64;
    let mut found = Vec::new();
    let depth: Vec<f64> = line.iter().map(|p| outline.shape.outside_m(Vector2::new(p[0], p[1]))).collect();
    for i in 1..SEGMENTS {
        if depth[i - 1] < depth[i] || depth[i + 1] < depth[i] || step < depth[i] {
            continue;
        }
        let s = lowest(&outside, (i - 1) as f64 * step, (i + 1) as f64 * step);
        let p = at(s);
        let x = Vector2::new(p[0], p[1]);
        let inward = outline.shape.centre_m() - x;
        let side = -Vector2::new(p[2].cos(), p[2].sin()).perp(&inward).signum();
        let normal_rad = p[2] + side * FRAC_PI_2;
        match nearest_corner(outline, x) {
            Some(corner) => {
                let parameter = wrapped(normal_rad - outline.normals_rad[outline.before(corner)]);
                let parameter = parameter.clamp(0.0, outline.rotation_rad(corner));
                found.push(start(Touching::Corner(corner), side, Vector3::new(0.0, s, parameter)));
            }
            None => found.push(start(Touching::Tangent, side, Vector3::new(0.0, s, normal_rad))),
        }
    }
    found
}

/// The argument of the least value between two ends, by golden section.
fn lowest(value: &impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    // 40 rounds shrink the interval by 4e-9: the rounding of a minimum's place.
    for _ in 0..40 {
        let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        if value(a) < value(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

fn nearest_corner(outline: &Outline, x: Vector2<f64>) -> Option<usize> {
    let far = |i: &usize| (outline.corners[*i] - x).norm();
    (0..outline.count()).min_by(|i, j| far(i).total_cmp(&far(j)))
}

/// The outline at a tip that lies on it: what is touched, the normal's direction, the parameter.
fn touched_by_tip(rod: &Rod, outline: &Outline, tip: Vector2<f64>) -> Vec<(Touching, f64, f64)> {
    let near = NEAR * rod.length_m;
    if near < outline.shape.outside_m(tip).abs() {
        return Vec::new();
    }
    if outline.count() == 0 {
        let normal_rad = outline.shape.normal_near_rad(tip);
        return vec![(Touching::Tip, normal_rad, normal_rad)];
    }
    let on_face = |i: &usize| {
        let (sin, cos) = outline.normals_rad[*i].sin_cos();
        let from_corner = tip - outline.corners[*i];
        let along = Vector2::new(-sin, cos).dot(&from_corner);
        let off = Vector2::new(cos, sin).dot(&from_corner).abs();
        (off <= near && -near <= along && along <= outline.lengths_m[*i] + near).then_some((*i, along))
    };
    (0..outline.count())
        .filter_map(|i| on_face(&i))
        .map(|(i, along)| {
            (Touching::TipOnFace(i), outline.normals_rad[i], along.clamp(0.0, outline.lengths_m[i]))
        })
        .collect()
}
