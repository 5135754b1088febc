//! Three rays of a rig: up to eight poses. Own derivation, docs/math/gp3p.md; equation numbers refer to it.
//!
//! The triangle is hung on one side, A–B, as in `p3p`. The rays of A and B need not meet: the part of A–B along their common
//! perpendicular is fixed, the rest turns by an angle φ. Two linear equations then give the rotation (u, v) of C about A–B, and
//! u² + v² = 1
//! is of degree 8 in the half angle. Its roots are sought only on the arcs where A and B lie in front of their cameras.
//!
//!   A, B, C  the points, |AB| = 1 after scaling   ·   a, b, c  their bearings   ·   γ angle between a and b, g = cot γ
//!   s, h     C along and across A–B: C = A + s e + h m   ·   (e, m, k), (p, q, n)  frames of the triangle, of the rays
//!   δ, r     distance of the rays of A and B, r² + δ² = 1   ·   f_a, f_b  depths of the feet of their common perpendicular
//!   w        perpendicular to c   ·   K, U, V  functions k₀ + k₁ cos φ + k₂ sin φ, eq. (5)   ·   u + iv = exp(iθ)

use super::p3p::p3p;
use crate::polynomial::arc::{Arc, Wave, arcs_above};
use crate::polynomial::bernstein::{Coefficients, roots_in_unit_interval};
use crate::{Bearing, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Candidate poses `rig_from_target`, on the stack; no order promised.
pub type RigCandidates = ArrayVec<Pose, 8>;

/// An observation of a rig's camera: a half-line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// The camera centre, rig frame, metres.
    pub origin_in_rig: Point,
    /// Unit vector towards the point, rig frame.
    pub bearing_in_rig: Bearing,
}

/// A height below this part of the longest side is a straight line, as for `p3p`.
const MIN_HEIGHT: f64 = 1e-10;
/// Coordinates carry a relative rounding ε; a height below this multiple of it is rounding too.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Rays closer to parallel than this (sine of the angle) fix no place along them.
const MIN_SINE: f64 = 1e-12;
/// δ may exceed 1 by rounding: the feet themselves are then A and B.
const DISTANCE_ROUNDING: f64 = 1e-12;
/// Two roots closer than this (in φ and θ) are one, split by rounding: √ε, with margin.
const MERGE: f64 = 3e-8;
/// Newton's error after a step this small is rounding.
const SMALL_STEP: f64 = 1e-8;
/// Steps towards a simple root; towards a double one each step halves the distance.
const MAX_STEPS: usize = 30;
/// A double root that rounding has made complex passes C's ray at this distance, lengths of A–B, and is taken.
const MAX_MISS: f64 = 1e-12;
/// |D| below this (its terms are of the order of 1): the two linear equations for (u, v) are nearly the same one, or one says nothing.
const DEPENDENT: f64 = 1e-4;
/// A point nearer to its camera than this, lengths of A–B, has no bearing to 1e-9: it is not in front.
const MIN_DEPTH: f64 = 1e-7;

/// Every pose that puts the three points onto their rays, in front of their cameras; none when the points are on a line or the
/// rays parallel.
pub fn gp3p(rays: &[Ray; 3], points_in_target: &[Point; 3]) -> RigCandidates {
    let mut poses = RigCandidates::new();
    let [a, b, c] = rays;
    if a.origin_in_rig == b.origin_in_rig && a.origin_in_rig == c.origin_in_rig {
        return through_one_centre(rays, points_in_target);
    }
    let order = most_oblique_pair_first(rays);
    let triangle = Triangle::new(&order.map(|i| points_in_target[i]));
    let Some(hinge) = triangle.and_then(|triangle| Hinge::new(triangle, order.map(|i| &rays[i]))) else {
        return poses;
    };
    let mut taken = ArrayVec::<Turn, 8>::new();
    let turn = Vector2::new(hinge.cosine, hinge.sine);
    // Eq. (7): A and B in front.
    let (least_a, least_b) = (-hinge.foot_a * hinge.sine / hinge.r, -hinge.foot_b * hinge.sine / hinge.r);
    for arc in arcs_above(least_b, least_a, &turn) {
        for place in roots_in_unit_interval(&hinge.octic(&arc)) {
            for start in hinge.turns(&arc.direction(place)) {
                let Some(turn) = hinge.polished(start) else { continue };
                if !taken.is_full()
                    && hinge.all_in_front(&turn)
                    && !taken.iter().any(|t| t.is_duplicate(&turn))
                {
                    poses.push(hinge.pose(&turn));
                    taken.push(turn);
                }
            }
        }
    }
    poses
}

/// One camera: the same equations with half the roots, in a third of the time.
fn through_one_centre(rays: &[Ray; 3], points_in_target: &[Point; 3]) -> RigCandidates {
    let poses = p3p(&[0, 1, 2].map(|i| rays[i].bearing_in_rig), points_in_target);
    let moved = |p: Pose| Pose { translation: p.translation + rays[0].origin_in_rig, ..p };
    poses.into_iter().map(moved).collect()
}

/// Order in which the first two rays enclose the angle of largest sine.
#[inline]
fn most_oblique_pair_first(rays: &[Ray; 3]) -> [usize; 3] {
    let [a, b, c] = [0, 1, 2].map(|i| rays[i].bearing_in_rig.into_inner());
    let sine2 = |x: &Vector3<f64>, y: &Vector3<f64>| x.cross(y).norm_squared();
    let (ab, bc, ca) = (sine2(&a, &b), sine2(&b, &c), sine2(&c, &a));
    if bc <= ab && ca <= ab {
        [0, 1, 2]
    } else if ca <= bc {
        [1, 2, 0]
    } else {
        [2, 0, 1]
    }
}

/// The triangle in the target.
struct Triangle {
    origin: Point,
    base_length: f64,
    frame: Matrix3<f64>,
    s: f64,
    h: f64,
}

impl Triangle {
    #[inline]
    fn new([a, b, c]: &[Point; 3]) -> Option<Self> {
        let (ab, ac) = (b - a, c - a);
        let base_length = ab.norm();
        let e = ab / base_length;
        let normal = e.cross(&ac);
        let height = normal.norm();
        let coordinates = a.amax().max(b.amax()).max(c.amax());
        let longest = base_length.max(ac.amax());
        let is_open =
            MIN_HEIGHT * longest < height && ROUNDING * coordinates < height && longest < f64::INFINITY;
        let m = (normal / height).cross(&e);
        let frame = Matrix3::from_columns(&[e, m, e.cross(&m)]);
        let (s, h) = (e.dot(&ac) / base_length, height / base_length);
        is_open.then_some(Triangle { origin: *a, base_length, frame, s, h })
    }
}

/// K + h (U u + V v) = 0: C has no part along one of the two perpendiculars of its ray, eqs. (4)–(5).
struct Equation {
    k: Wave,
    u: Wave,
    v: Wave,
}

/// The family left when A and B are on their rays. Lengths in units of A–B.
struct Hinge {
    triangle: Triangle,
    origin_a: Point,
    frame: Matrix3<f64>,
    cosine: f64,
    sine: f64,
    distance: f64,
    r: f64,
    foot_a: f64,
    foot_b: f64,
    c: Vector3<f64>,
    /// Origin of the ray of C from the foot on the ray of A, frame (p, q, n).
    origin_c: Vector3<f64>,
    equations: [Equation; 2],
}

impl Hinge {
    #[inline]
    fn new(triangle: Triangle, [a, b, c]: [&Ray; 3]) -> Option<Self> {
        let p = a.bearing_in_rig.into_inner();
        // Differences of bearings are exact to their own size; products of bearings are not.
        let (ab, ac) = (b.bearing_in_rig.into_inner() - p, c.bearing_in_rig.into_inner() - p);
        let normal = p.cross(&ab);
        let sine = normal.norm();
        let frame = Matrix3::from_columns(&[p, (normal / sine).cross(&p), normal / sine]);
        let from_a = |ray: &Ray| frame.tr_mul(&(ray.origin_in_rig - a.origin_in_rig)) / triangle.base_length;
        let in_frame = |difference: Vector3<f64>| frame.tr_mul(&difference) + Vector3::new(1.0, 0.0, 0.0);
        let (origin_b, cosine, c_in_frame) = (from_a(b), in_frame(ab).x, in_frame(ac));
        // Eq. (1): the feet of the common perpendicular.
        let foot_b = -origin_b.y / sine;
        let foot_a = origin_b.x + foot_b * cosine;
        let is_possible =
            MIN_SINE < sine && origin_b.z.abs() <= 1.0 + DISTANCE_ROUNDING && foot_a.is_finite();
        let distance = origin_b.z.clamp(-1.0, 1.0);
        let r = ((1.0 - distance) * (1.0 + distance)).sqrt().max(f64::EPSILON);
        let origin_c = from_a(c) - Vector3::new(foot_a, 0.0, 0.0);
        let equations = perpendiculars(&c_in_frame)
            .map(|w| Equation::new(&w, triangle.s, cosine / sine, (distance, r), &origin_c));
        is_possible.then_some(Hinge {
            triangle,
            origin_a: a.origin_in_rig,
            frame,
            cosine,
            sine,
            distance,
            r,
            foot_a,
            foot_b,
            c: c_in_frame,
            origin_c,
            equations,
        })
    }
}

/// Two vectors of equal length perpendicular to c and to each other; the first lies in the plane of p and q unless c is near n.
#[inline]
fn perpendiculars(c: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = if c.z.abs() < 0.9 { Vector3::new(c.y, -c.x, 0.0) } else { Vector3::new(0.0, c.z, -c.y) };
    [first, c.cross(&first)]
}

impl Equation {
    /// Eq. (5).
    #[inline]
    fn new(w: &Vector3<f64>, s: f64, g: f64, (distance, r): (f64, f64), origin_c: &Vector3<f64>) -> Self {
        Equation {
            k: Wave([w.z * s * distance - w.dot(origin_c), w.x * r * (s - 1.0), r * (w.x * g + w.y * s)]),
            u: Wave([0.0, w.y, -w.x]),
            v: Wave([w.z * r, -distance * w.x, -distance * w.y]),
        }
    }

    #[inline(always)]
    fn at(&self, direction: &Vector2<f64>) -> [f64; 3] {
        [self.k.at(direction), self.u.at(direction), self.v.at(direction)]
    }

    /// Value and derivatives by φ and θ.
    #[inline(always)]
    fn linearised(&self, turn: &Turn, h: f64) -> [f64; 3] {
        let [k, u, v] = self.at(&turn.direction);
        let [k_phi, u_phi, v_phi] = [&self.k, &self.u, &self.v].map(|wave| wave.slope(&turn.direction));
        let (x, y) = (turn.circle.x * h, turn.circle.y * h);
        [k + u * x + v * y, k_phi + u_phi * x + v_phi * y, v * x - u * y]
    }
}

/// The two angles of a pose.
#[derive(Clone, Copy)]
struct Turn {
    /// (cos φ, sin φ).
    direction: Vector2<f64>,
    /// (u, v) = (cos θ, sin θ).
    circle: Vector2<f64>,
}

impl Turn {
    #[inline]
    fn is_duplicate(&self, other: &Turn) -> bool {
        (self.direction - other.direction).amax() < MERGE && (self.circle - other.circle).amax() < MERGE
    }
}

/// Rotated by an angle, given by its half's tangent times two: equal to second order, and a rotation.
#[inline]
fn turned(direction: &Vector2<f64>, angle: f64) -> Vector2<f64> {
    let t = 0.5 * angle;
    let scale = 1.0 / (1.0 + t * t);
    let (c, s) = ((1.0 - t * t) * scale, 2.0 * t * scale);
    Vector2::new(c * direction.x - s * direction.y, s * direction.x + c * direction.y)
}

/// x y′ − x′ y of two quadratics each, coefficients of a quartic.
#[inline(always)]
fn minor(x: &[f64; 3], y1: &[f64; 3], x1: &[f64; 3], y: &[f64; 3]) -> [f64; 5] {
    let mut product = [0.0; 5];
    for i in 0..3 {
        for j in 0..3 {
            product[i + j] += x[i] * y1[j] - x1[i] * y[j];
        }
    }
    product
}

impl Hinge {
    /// Scaled Bernstein coefficients on an arc of N_u² + N_v² − h² D², eqs. (6), (8)–(9).
    #[inline]
    fn octic(&self, arc: &Arc) -> Coefficients {
        let [[k1, u1, v1], [k2, u2, v2]] =
            [0, 1].map(|i| &self.equations[i]).map(|e| [&e.k, &e.u, &e.v].map(|wave| arc.quadratic(wave)));
        let (nu, nv, d) = (minor(&k2, &v1, &k1, &v2), minor(&u2, &k1, &u1, &k2), minor(&u1, &v2, &u2, &v1));
        let hh = self.triangle.h * self.triangle.h;
        let mut sum = [0.0; 9];
        for i in 0..5 {
            for j in 0..5 {
                sum[i + j] += nu[i] * nu[j] + nv[i] * nv[j] - hh * (d[i] * d[j]);
            }
        }
        sum
    }

    /// (u, v) at a direction φ: the solution of the two linear equations, eq. (6), or, where they are nearly the same one, both places
    /// where its line meets the circle.
    #[inline]
    fn turns(&self, direction: &Vector2<f64>) -> ArrayVec<Turn, 2> {
        let [[k1, u1, v1], [k2, u2, v2]] = [0, 1].map(|i| self.equations[i].at(direction));
        let d = u1 * v2 - u2 * v1;
        let turn = |u: f64, v: f64| Turn {
            direction: *direction,
            circle: Vector2::new(u, v) / (u * u + v * v).sqrt().max(f64::MIN_POSITIVE),
        };
        let mut turns = ArrayVec::new();
        if DEPENDENT < d.abs() {
            let side = d.signum();
            turns.push(turn((k2 * v1 - k1 * v2) * side, (u2 * k1 - u1 * k2) * side));
        } else {
            let first_is_longer = u2 * u2 + v2 * v2 < u1 * u1 + v1 * v1;
            let (k, u, v) = if first_is_longer { (k1, u1, v1) } else { (k2, u2, v2) };
            let k = k / self.triangle.h;
            let along = (u * u + v * v - k * k).max(0.0).sqrt();
            turns.push(turn(-k * u - along * v, -k * v + along * u));
            turns.push(turn(-k * u + along * v, -k * v - along * u));
        }
        turns
    }

    /// Newton's steps on both equations (4) in (φ, θ); none when they do not end on a pose.
    #[inline]
    fn polished(&self, mut turn: Turn) -> Option<Turn> {
        let mut best = (MAX_MISS, None);
        for _ in 0..MAX_STEPS {
            let [[f1, phi1, theta1], [f2, phi2, theta2]] =
                [0, 1].map(|i| self.equations[i].linearised(&turn, self.triangle.h));
            let inverse = 1.0 / (phi1 * theta2 - phi2 * theta1);
            let (phi, theta) = ((f2 * theta1 - f1 * theta2) * inverse, (f1 * phi2 - f2 * phi1) * inverse);
            let miss = f1.abs() + f2.abs();
            if miss < best.0 {
                best = (miss, Some(turn));
            }
            let step = phi.abs() + theta.abs();
            if !step.is_finite() {
                break;
            }
            turn = Turn { direction: turned(&turn.direction, phi), circle: turned(&turn.circle, theta) };
            if step < SMALL_STEP {
                return Some(turn);
            }
        }
        best.1
    }

    /// Place of C in the frame (p, q, n), from the foot on the ray of A; depths of A and B beyond their feet. Eqs. (2)–(4).
    #[inline]
    fn all_in_front(&self, turn: &Turn) -> bool {
        let (x, y) = (turn.direction.x, turn.direction.y);
        let beyond_a = self.r * (self.cosine * y - self.sine * x) / self.sine;
        let beyond_b = self.r * y / self.sine;
        let [e, m] = self.base_and_height(turn);
        let place = e * self.triangle.s + m * self.triangle.h + Vector3::new(beyond_a, 0.0, 0.0);
        MIN_DEPTH < beyond_a + self.foot_a
            && MIN_DEPTH < beyond_b + self.foot_b
            && MIN_DEPTH < self.c.dot(&(place - self.origin_c))
    }

    /// Images of e and m in the frame (p, q, n), eqs. (2)–(3).
    #[inline]
    fn base_and_height(&self, turn: &Turn) -> [Vector3<f64>; 2] {
        let (x, y, r, distance) = (turn.direction.x, turn.direction.y, self.r, self.distance);
        let e = Vector3::new(r * x, r * y, distance);
        let (first, second) = (Vector3::new(-y, x, 0.0), Vector3::new(-distance * x, -distance * y, r));
        [e, first * turn.circle.x + second * turn.circle.y]
    }

    /// Eq. (10).
    #[inline]
    fn pose(&self, turn: &Turn) -> Pose {
        let [e, m] = self.base_and_height(turn);
        let turned = Matrix3::from_columns(&[e, m, e.cross(&m)]);
        let rotation = self.frame * turned * self.triangle.frame.transpose();
        let (x, y) = (turn.direction.x, turn.direction.y);
        let depth_a = self.foot_a + self.r * (self.cosine * y - self.sine * x) / self.sine;
        let a_in_rig = self.origin_a + self.frame.column(0) * (depth_a * self.triangle.base_length);
        Pose { rotation, translation: a_in_rig - rotation * self.triangle.origin }
    }
}
