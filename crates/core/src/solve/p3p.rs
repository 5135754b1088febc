//! Three points: up to four poses. Own derivation, docs/math/p3p.md; equation numbers refer to it.
//!
//! The triangle is hung on one side, A–B. Two angles remain: φ turns A–B within the plane of its two rays, θ turns C about A–B.
//! Given x = σ h cos θ, φ is rational; x itself is a root of a quartic, of which only roots in [−σh, σh] are poses.
//! Nothing is squared that vanishes with the triangle's height, so a nearly straight triple keeps its digits.
//!
//!   A, B, C  the points, |AB| = 1 after scaling   ·   a, b, c  their bearings   ·   γ angle between a and b, κ = cos γ, σ = sin γ
//!   s, h     C along and across A–B: C = A + s e + h m   ·   (e, m, k), (p, q, n)  frames of the triangle, of the rays
//!   c₁ c₂ c₃ c in the frame (p, q, n), p = a, n ⟂ a, b   ·   u + iv = exp(iθ)   ·   w = 1/σ²   ·   ρ² = N² + w D²

mod trammel;

use super::Candidates;
use crate::polynomial::Factors;
use crate::{Bearing, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A height below this part of the longest side is a straight line: the rotation about it has lost all digits but five.
const MIN_HEIGHT: f64 = 1e-10;
/// Coordinates carry a relative rounding ε; a height below this multiple of it is rounding too.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Two roots closer than this (as cos θ) are one, split by rounding: √ε, with margin.
const MERGE: f64 = 3e-8;
/// Largest h |u² + v² − 1| of a root: a pose off by this misses C by half of it, in units of A–B.
const MAX_MISS: f64 = 1e-9;
/// Largest |u² + v² − 1| whatever the height: its square is rounding.
const MAX_DEFECT: f64 = 2e-8;
/// A defect above this is more than rounding.
const NEEDS_POLISH: f64 = 1e-12;
/// A ρ²/σ² below this leaves N and D fewer than eleven digits to determine φ, none at 0: docs/math/p3p.md, section 4.
const MIN_RHO2: f64 = 1e-11;
/// Imaginary part, as cos θ, up to which a complex pair may be a double root split by rounding; the defect decides.
const BLUR: f64 = 0.01;

/// Every pose that puts the three points onto their rays, in front of the camera; none when the points are on a line.
pub fn p3p(bearings: &[Bearing; 3], points_in_target: &[Point; 3]) -> Candidates {
    let mut poses = Candidates::new();
    let [i, j, k] = widest_pair_first(bearings);
    let rays = Rays::new(&bearings[i], &bearings[j], &bearings[k]);
    let triangle = Triangle::new(&points_in_target[i], &points_in_target[j], &points_in_target[k]);
    if triangle.is_open && rays.are_distinct {
        let any_blunt = push_poses(&mut poses, &triangle, &rays);
        if any_blunt {
            trammel::solve_again(&mut poses, bearings, points_in_target, [i, j, k]);
        }
    }
    poses
}

/// Whether some root does not determine φ, and so was left out.
#[inline]
fn push_poses(poses: &mut Candidates, triangle: &Triangle, rays: &Rays) -> bool {
    let hinge = Hinge::new(triangle, rays);
    let roots = hinge.roots();
    let frames = Frames::new(triangle, rays);
    let mut taken = ArrayVec::<[f64; 2], 4>::new();
    let mut any_blunt = false;
    for x in roots {
        if !(x.abs() < hinge.reach * (1.0 + BLUR)) {
            continue;
        }
        let mut turn = hinge.turn(x);
        any_blunt |= hinge.is_blunt(&turn);
        if NEEDS_POLISH < turn.defect.abs() {
            turn = hinge.turn(hinge.polished(x));
        }
        if !hinge.admits(&turn) {
            continue;
        }
        let angles = hinge.angles(&turn);
        let Angles { u, v, .. } = angles;
        let duplicate = |other: &[f64; 2]| (other[0] - u).abs() + (other[1] - v).abs() < MERGE;
        if !taken.iter().any(duplicate) {
            poses.push(frames.pose(&angles));
            taken.push([u, v]);
        }
    }
    any_blunt
}

/// Cosine and sine of φ and of θ.
#[derive(Clone, Copy)]
struct Angles {
    cos_phi: f64,
    sin_phi: f64,
    u: f64,
    v: f64,
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

/// The triangle in the target, as given: what the quartic needs waits for no square root.
struct Triangle {
    origin: Point,
    ab: Vector3<f64>,
    normal: Vector3<f64>,
    base2: f64,
    normal2: f64,
    s: f64,
    hh: f64,
    is_open: bool,
}

impl Triangle {
    #[inline]
    fn new(a: &Point, b: &Point, c: &Point) -> Self {
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(&ac);
        let (base2, normal2) = (ab.norm_squared(), normal.norm_squared());
        let inverse_base2 = 1.0 / base2;
        let sides2 = base2 + ac.norm_squared();
        let least2 = MIN_HEIGHT * MIN_HEIGHT * sides2 + ROUNDING * ROUNDING * a.norm_squared();
        Triangle {
            origin: *a,
            ab,
            normal,
            base2,
            normal2,
            s: ab.dot(&ac) * inverse_base2,
            hh: normal2 * inverse_base2 * inverse_base2,
            is_open: least2 * base2 < normal2 && sides2 < f64::INFINITY,
        }
    }
}

/// The three rays. `across`, `normal` and the last two of `c` carry a factor σ, so that only w, no root, stands before the quartic.
struct Rays {
    p: Vector3<f64>,
    across: Vector3<f64>,
    normal: Vector3<f64>,
    c: Vector3<f64>,
    kappa: f64,
    sigma2: f64,
    w: f64,
    are_distinct: bool,
}

impl Rays {
    #[inline]
    fn new(a: &Bearing, b: &Bearing, c: &Bearing) -> Self {
        let p = a.into_inner();
        // Differences of bearings are exact to their own size; products of bearings are not.
        let (ab, ac) = (b.into_inner() - p, c.into_inner() - p);
        let p_ab = p.dot(&ab);
        let normal = p.cross(&ab);
        let across = ab - p * p_ab; // normal × p
        let sigma2 = normal.norm_squared();
        let w = 1.0 / sigma2;
        let c = Vector3::new(1.0 + p.dot(&ac), across.dot(&ac), normal.dot(&ac));
        Rays { p, across, normal, c, kappa: 1.0 + p_ab, sigma2, w, are_distinct: w < f64::INFINITY }
    }
}

/// The one-parameter family left when A and B are on their rays.
struct Hinge {
    /// N = n₀ + c₁ x, D = d₀ − c₂ x, K = k₀ + κ x − x², eqs. (5), (6).
    n0: f64,
    d0: f64,
    k0: f64,
    c1: f64,
    c2: f64,
    kappa: f64,
    w: f64,
    /// w c₃².
    cc: f64,
    c3: f64,
    /// σ² h² and σ h: largest |x| of a pose.
    reach2: f64,
    reach: f64,
    inverse_reach: f64,
    inverse_sigma: f64,
    /// n₀² + w d₀².
    r0: f64,
    /// See MIN_RHO2.
    least_rho2: f64,
    hh: f64,
}

impl Hinge {
    #[inline]
    fn new(triangle: &Triangle, rays: &Rays) -> Self {
        let Rays { c, kappa, sigma2, w, .. } = rays;
        let s = triangle.s;
        let reach2 = triangle.hh * sigma2;
        let reach = reach2.sqrt();
        let (n0, d0) = (c.y * (1.0 - s), c.y * kappa - c.x * s * sigma2);
        Hinge {
            n0,
            d0,
            r0: n0 * n0 + d0 * d0 * w,
            k0: s * (1.0 - s) * sigma2,
            c1: c.x,
            c2: c.y,
            kappa: *kappa,
            w: *w,
            cc: c.z * c.z * w,
            c3: c.z,
            reach2,
            reach,
            inverse_reach: 1.0 / reach,
            inverse_sigma: sigma2.sqrt() * w,
            least_rho2: MIN_RHO2 * sigma2,
            hh: triangle.hh,
        }
    }

    /// The quartic in x, eq. (8).
    #[inline]
    fn quartic(&self) -> [f64; 4] {
        let (cc, kappa, k0) = (self.cc, self.kappa, self.k0);
        // ρ² = r₂ x² + 2 r₁ x + r₀.
        let c22 = self.c2 * self.c2 * self.w;
        let r2 = self.c1 * self.c1 + c22;
        let r1 = self.c1 * self.c2 - c22 * kappa;
        // Leading coefficient |c|² = 1.
        [
            cc * (k0 * k0) - self.reach2 * self.r0,
            2.0 * (cc * (kappa * k0) - self.reach2 * r1),
            self.r0 - self.reach2 * r2 + cc * (kappa * kappa - 2.0 * k0),
            2.0 * (r1 - cc * kappa),
        ]
    }

    /// Real roots, NaN where there is none.
    #[inline]
    fn roots(&self) -> [f64; 4] {
        let quartic = self.quartic();
        Factors::of_quartic(&quartic).polished(&quartic).real_roots(BLUR * self.reach)
    }

    /// The angles of a root x, and the deviation of u² + v² from 1, eqs. (5)–(7).
    #[inline]
    fn turn(&self, x: f64) -> Turn {
        let n = self.n0 + self.c1 * x;
        let d = self.d0 - self.c2 * x;
        let k = self.k0 + x * (self.kappa - x);
        let rho2 = n * n + d * d * self.w;
        let inverse_rho2 = 1.0 / rho2;
        let vv = k * k * self.cc * inverse_rho2;
        let defect = (x * x - self.reach2 + vv) * (self.inverse_reach * self.inverse_reach);
        Turn { x, n, d, k, rho2, inverse_rho2, defect }
    }

    /// Newton steps on the defect, for roots that share a factor of the quartic with a near neighbour.
    #[cold]
    #[inline(never)]
    fn polished(&self, x: f64) -> f64 {
        let mut best = self.turn(x);
        for _ in 0..8 {
            let Turn { x, n, d, k, inverse_rho2, defect, .. } = best;
            let vv = k * k * self.cc * inverse_rho2;
            let log_slope = (self.kappa - 2.0 * x) / k - (n * self.c1 - self.w * d * self.c2) * inverse_rho2;
            let slope = 2.0 * (x + vv * log_slope) * (self.inverse_reach * self.inverse_reach);
            let next = self.turn(x - defect / slope);
            if !(next.defect.abs() < best.defect.abs()) {
                break;
            }
            best = next;
        }
        best.x
    }

    /// Whether N and D are too small to determine φ.
    #[inline]
    fn is_blunt(&self, turn: &Turn) -> bool {
        turn.rho2 < self.least_rho2
    }

    /// Whether it reprojects and every depth is positive.
    #[inline]
    fn admits(&self, turn: &Turn) -> bool {
        // A or B would lie behind the camera, eq. (3).
        let in_front = 0.0 < turn.n * turn.k && 0.0 < (turn.n * self.kappa - turn.d) * turn.k;
        let defect = turn.defect.abs();
        in_front
            && (defect < MAX_MISS || defect < MAX_DEFECT && defect * defect * self.hh < MAX_MISS * MAX_MISS)
    }

    /// φ of eq. (6), θ of eq. (7) on the circle.
    #[inline]
    fn angles(&self, turn: &Turn) -> Angles {
        let inverse_rho = turn.rho2.sqrt() * turn.inverse_rho2;
        let signed = inverse_rho.copysign(turn.k); // the depth of C is positive
        let unit = (1.0 - 0.5 * turn.defect) * self.inverse_reach; // |defect| < 3e-8: the next term is of the order of ε
        let y = self.c3 * self.inverse_sigma * turn.k.abs() * inverse_rho;
        Angles {
            cos_phi: turn.d * (signed * self.inverse_sigma),
            sin_phi: turn.n * signed,
            u: turn.x * unit,
            v: y * unit,
        }
    }
}

/// (p, q, n) of the rays in the camera frame, (e, m, k) of the triangle in the target frame.
struct Frames {
    p: Vector3<f64>,
    q: Vector3<f64>,
    n: Vector3<f64>,
    e: Vector3<f64>,
    m: Vector3<f64>,
    k: Vector3<f64>,
    origin: Point,
    base_length: f64,
    kappa: f64,
    inverse_sigma: f64,
}

impl Frames {
    #[inline]
    fn new(triangle: &Triangle, rays: &Rays) -> Self {
        let inverse_sigma = rays.sigma2.sqrt() * rays.w;
        let base_length = triangle.base2.sqrt();
        let inverse_base = 1.0 / base_length;
        let e = triangle.ab * inverse_base;
        // A thin triangle's normal is off by ε/h; m and then k are perpendicular to e whatever the normal.
        let m = triangle.normal.cross(&triangle.ab) * (inverse_base / triangle.normal2.sqrt());
        Frames {
            p: rays.p,
            q: rays.across * inverse_sigma,
            n: rays.normal * inverse_sigma,
            e,
            m,
            k: e.cross(&m),
            origin: triangle.origin,
            base_length,
            kappa: rays.kappa,
            inverse_sigma,
        }
    }

    /// Eq. (9).
    #[inline]
    fn pose(&self, angles: &Angles) -> Pose {
        let Angles { cos_phi, sin_phi, u, v } = *angles;
        // e, m, k of the triangle, in the camera frame.
        let e = self.p * cos_phi + self.q * sin_phi;
        let across = self.q * cos_phi - self.p * sin_phi;
        let m = across * u + self.n * v;
        let k = self.n * u - across * v;
        let rotation = Matrix3::from_fn(|i, j| e[i] * self.e[j] + m[i] * self.m[j] + k[i] * self.k[j]);
        let depth_a = (sin_phi * (self.kappa * self.inverse_sigma) - cos_phi) * self.base_length;
        Pose { rotation, translation: self.p * depth_a - rotation * self.origin }
    }
}

/// The rotation of C about A–B that belongs to one root.
struct Turn {
    x: f64,
    n: f64,
    d: f64,
    k: f64,
    rho2: f64,
    inverse_rho2: f64,
    defect: f64,
}
