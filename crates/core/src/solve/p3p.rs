//! Three points: up to four poses. Own derivation, docs/math/p3p.md; equation numbers refer to it.
//!
//! The triangle is hung on one side, A–B. Two angles remain: φ turns A–B within the plane of its two rays, θ turns C about A–B.
//! Given x = h cos θ, φ is rational; x itself is a root of a quartic, of which only roots in [−h, h] are poses.
//! Nothing is squared that vanishes with the triangle's height, so a nearly straight triple keeps its digits.
//!
//!   A, B, C  the points, |AB| = 1 after scaling   ·   a, b, c  their bearings   ·   γ angle between a and b, g = cot γ
//!   s, h     C along and across A–B: C = A + s e + h m   ·   (e, m, k), (p, q, n)  frames of the triangle, of the rays
//!   c₁ c₂ c₃ c in the frame (p, q, n), p = a, n ⟂ a, b   ·   u + iv = exp(iθ)

use super::Candidates;
use crate::polynomial::{polished_factor, quartic_factors};
use crate::{Bearing, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};

/// A height below this part of the base is a straight line: the rotation about it has lost all digits but five.
const MIN_HEIGHT: f64 = 1e-10;
/// Coordinates carry a relative rounding ε; a height below this multiple of it is rounding too.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Two roots closer than this (as cos θ) are one, split by rounding: √ε, with margin.
const MERGE: f64 = 3e-8;
/// Largest |u² + v² − 1| of a root: a pose off by this misses C by half of it times h.
const MAX_DEFECT: f64 = 1e-9;
/// A defect above this is more than rounding.
const NEEDS_POLISH: f64 = 1e-12;
/// Imaginary part, as cos θ, up to which a complex pair may be a double root split by rounding; the defect decides.
const BLUR: f64 = 0.01;

/// Every pose that puts the three points onto their rays, in front of the camera; none when the points are on a line.
pub fn p3p(bearings: &[Bearing; 3], points_in_target: &[Point; 3]) -> Candidates {
    let mut poses = Candidates::new();
    let [i, j, k] = widest_pair_first(bearings);
    let triangle = Triangle::new(&points_in_target[i], &points_in_target[j], &points_in_target[k]);
    let rays = Rays::new(&bearings[i], &bearings[j], &bearings[k]);
    if triangle.is_open && rays.are_distinct {
        push_poses(&mut poses, &triangle, &rays);
    }
    poses
}

#[inline]
fn push_poses(poses: &mut Candidates, triangle: &Triangle, rays: &Rays) {
    let hinge = Hinge::new(triangle, rays);
    let mut taken = ArrayVec::<[f64; 2], 4>::new();
    for x in hinge.roots() {
        if !(x.abs() < hinge.h * (1.0 + BLUR)) {
            continue;
        }
        let Some(turn) = hinge.accepted(hinge.turn(x)) else { continue };
        let twin = |other: &[f64; 2]| (other[0] - turn.u).abs() + (other[1] - turn.v).abs() < MERGE;
        if !taken.iter().any(twin) {
            poses.push(hinge.pose(&turn, triangle, rays));
            taken.push([turn.u, turn.v]);
        }
    }
}

/// Order in which the first two rays enclose the largest angle.
#[inline]
fn widest_pair_first(bearings: &[Bearing; 3]) -> [usize; 3] {
    let chord2 = |i: usize, j: usize| (bearings[i].into_inner() - bearings[j].into_inner()).norm_squared();
    let (ab, bc, ca) = (chord2(0, 1), chord2(1, 2), chord2(2, 0));
    let (apex, widest) = if ab < bc { (0, bc) } else { (2, ab) };
    let apex = if widest < ca { 1 } else { apex };
    [NEXT[apex], NEXT[apex + 1], apex]
}

const NEXT: [usize; 4] = [1, 2, 0, 1];

/// The triangle in the target.
struct Triangle {
    origin: Point,
    base_length: f64,
    frame: Matrix3<f64>,
    s: f64,
    h: f64,
    is_open: bool,
}

impl Triangle {
    #[inline]
    fn new(a: &Point, b: &Point, c: &Point) -> Self {
        let (ab, ac) = (b - a, c - a);
        let base_length = ab.norm();
        let e = ab / base_length;
        let normal = e.cross(&ac);
        let height = normal.norm();
        let coordinates = a.amax().max(b.amax()).max(c.amax());
        let longest = base_length.max(ac.amax());
        let is_open =
            MIN_HEIGHT * longest < height && ROUNDING * coordinates < height && longest < f64::INFINITY;
        // A thin triangle's normal is off by ε/h; m and then k are perpendicular to e whatever the normal.
        let m = (normal / height).cross(&e);
        let frame = Matrix3::from_columns(&[e, m, e.cross(&m)]);
        let (s, h) = (e.dot(&ac) / base_length, height / base_length);
        Triangle { origin: *a, base_length, frame, s, h, is_open }
    }
}

/// The three rays.
struct Rays {
    frame: Matrix3<f64>,
    g: f64,
    c: Vector3<f64>,
    are_distinct: bool,
}

impl Rays {
    #[inline]
    fn new(a: &Bearing, b: &Bearing, c: &Bearing) -> Self {
        let p = a.into_inner();
        // Differences of bearings are exact to their own size; products of bearings are not.
        let (ab, ac) = (b.into_inner() - p, c.into_inner() - p);
        let normal = p.cross(&ab);
        let sine = normal.norm();
        let n = normal / sine;
        let q = n.cross(&p);
        let c = Vector3::new(1.0 + p.dot(&ac), q.dot(&ac), n.dot(&ac));
        let frame = Matrix3::from_columns(&[p, q, n]);
        Rays { frame, g: (1.0 + p.dot(&ab)) / sine, c, are_distinct: 0.0 < sine }
    }
}

/// The one-parameter family left when A and B are on their rays.
struct Hinge {
    /// N = n₀ + c₁ x, D = d₀ − c₂ x, eq. (5): (cos φ, sin φ) ∝ (D, N).
    n0: f64,
    d0: f64,
    s1: f64,
    g: f64,
    h: f64,
    inverse_h: f64,
    c: Vector3<f64>,
}

impl Hinge {
    #[inline]
    fn new(triangle: &Triangle, rays: &Rays) -> Self {
        let (s, g, c) = (triangle.s, rays.g, rays.c);
        Hinge {
            n0: c.y * (1.0 - s),
            d0: c.y * g - c.x * s,
            s1: s * (1.0 - s),
            g,
            h: triangle.h,
            inverse_h: 1.0 / triangle.h,
            c,
        }
    }

    /// The quartic in x, eq. (8).
    #[inline]
    fn quartic(&self) -> [f64; 4] {
        let (c, g, s1, hh) = (&self.c, self.g, self.s1, self.h * self.h);
        let cc = c.z * c.z;
        let r2 = c.x * c.x + c.y * c.y;
        let r1 = c.x * self.n0 - c.y * self.d0;
        let r0 = self.n0 * self.n0 + self.d0 * self.d0;
        // Leading coefficient |c|² = 1.
        [
            cc * s1 * s1 - hh * r0,
            2.0 * (cc * g * s1 - hh * r1),
            r0 - hh * r2 + cc * (g * g - 2.0 * s1),
            2.0 * (r1 - cc * g),
        ]
    }

    /// Real roots, NaN where there is none.
    #[inline]
    fn roots(&self) -> [f64; 4] {
        let quartic = self.quartic();
        let [first, second] = quartic_factors(&quartic);
        let blur = BLUR * self.h;
        let [w, x] = polished_factor(&quartic, first).real_roots(blur);
        let [y, z] = polished_factor(&quartic, second).real_roots(blur);
        [w, x, y, z]
    }

    /// (cos θ, sin θ) of a root x and how far it is off the circle, eq. (7).
    #[inline]
    fn turn(&self, x: f64) -> Turn {
        let n = self.n0 + self.c.x * x;
        let d = self.d0 - self.c.y * x;
        let depth = self.s1 + x * (self.g - x);
        let square = n * n + d * d;
        let inverse_radius = 1.0 / square.sqrt();
        let u = x * self.inverse_h;
        let v = self.c.z * depth.abs() * (inverse_radius * self.inverse_h);
        Turn { n, d, depth, inverse_radius, u, v, defect: u * u + v * v - 1.0 }
    }

    /// Newton steps on the defect, for roots that share a factor of the quartic with a near neighbour.
    #[cold]
    fn polished(&self, mut best: Turn) -> Turn {
        for _ in 0..8 {
            let Turn { n, d, depth, u, v, defect, .. } = best;
            let x = u * self.h;
            let log_slope = (self.g - 2.0 * x) / depth - (n * self.c.x - d * self.c.y) / (n * n + d * d);
            let slope = 2.0 * (u / self.h + v * v * log_slope);
            let next = self.turn(u * self.h - defect / slope);
            if !(next.defect.abs() < best.defect.abs()) {
                break;
            }
            best = next;
        }
        best
    }

    /// The turn, polished where it must be, if it reprojects and every depth is positive.
    #[inline]
    fn accepted(&self, mut turn: Turn) -> Option<Turn> {
        if NEEDS_POLISH < turn.defect.abs() {
            turn = self.polished(turn);
        }
        // A or B would lie behind the camera, eq. (3).
        let in_front = 0.0 < turn.n * turn.depth && 0.0 < (turn.n * self.g - turn.d) * turn.depth;
        (in_front && turn.defect.abs() < MAX_DEFECT).then_some(turn)
    }

    /// Eq. (9).
    #[inline]
    fn pose(&self, turn: &Turn, triangle: &Triangle, rays: &Rays) -> Pose {
        let signed = turn.inverse_radius.copysign(turn.depth); // eq. (6): the depth of C is positive
        let (cos_phi, sin_phi) = (turn.d * signed, turn.n * signed);
        let unit = 1.0 - 0.5 * turn.defect; // |defect| < 1e-9: the next term is below ε
        let (u, v) = (turn.u * unit, turn.v * unit);
        // e, m, k of the triangle, in the camera frame.
        let [p, q, normal] = [0, 1, 2].map(|i| rays.frame.column(i));
        let e = p * cos_phi + q * sin_phi;
        let across = q * cos_phi - p * sin_phi;
        let m = across * u + normal * v;
        let k = normal * u - across * v;
        let t = &triangle.frame;
        let rotation = Matrix3::from_fn(|i, j| e[i] * t[(j, 0)] + m[i] * t[(j, 1)] + k[i] * t[(j, 2)]);
        let depth_a = (sin_phi * self.g - cos_phi) * triangle.base_length;
        Pose { rotation, translation: rays.frame.column(0) * depth_a - rotation * triangle.origin }
    }
}

/// The turn of C about A–B that belongs to one root.
struct Turn {
    n: f64,
    d: f64,
    depth: f64,
    inverse_radius: f64,
    u: f64,
    v: f64,
    defect: f64,
}
