//! Three points whose quartic root does not tell φ. Own derivation, docs/math/p3p.md, section 4; equation numbers refer to it.
//!
//! Where the foot of C on the plane of the rays a, b lies on the circle through the camera, A and B, N = D = 0: as in a trammel, whatever
//! turn φ keeps A and B on their rays keeps the foot on its own, and the quartic has a double root for two poses, which differ in φ.
//! The height of C over the plane tells them apart, eq. (13). φ is started from it, then both angles are corrected together.
//!
//!   g, s, h, c  as in section 1, nothing scaled by σ   ·   t₁, t₂  axes across c, t₁ in the plane of a, b

use super::{Angles, BLUR, Frames, Hinge, MERGE, Rays, Triangle};
use crate::solve::Candidates;
use crate::{Bearing, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Newton steps: a double pose gains one bit of its 27 with each.
const STEPS: usize = 40;
/// Largest turn in one step.
const MAX_ROTATION_RAD: f64 = 0.3;
/// Two close φ are also started from this far outside: near their middle a step may go to either.
const OUTSIDE_RAD: f64 = 0.05;
/// Largest angle between C and its ray: a double pose reaches 1e-15, nothing else ends in between.
const MAX_MISS: f64 = 1e-11;
/// Steps that stop at a double pose stop this far apart: two steps of a few √ε.
const MERGE_DOUBLE: f64 = 30.0 * MERGE;

/// All poses, points i and j being the base, when N and D do not tell φ at some root.
#[cold]
#[inline(never)]
pub(super) fn solve_again(
    poses: &mut Candidates,
    bearings: &[Bearing; 3],
    points: &[Point; 3],
    [i, j, k]: [usize; 3],
) {
    let triangle = Triangle::new(&points[i], &points[j], &points[k]);
    let rays = Rays::new(&bearings[i], &bearings[j], &bearings[k]);
    let hinge = Hinge::new(&triangle, &rays);
    let trammel = Trammel::new(&triangle, &rays);
    let mut found = ArrayVec::<Angles, 4>::new();
    let mut keep = |angles: Angles, within: f64| {
        if !found.is_full() && !found.iter().any(|other| angles.is_duplicate_of(other, within)) {
            found.push(angles);
        }
    };
    for x in hinge.roots().into_iter().filter(|x| x.abs() < hinge.reach * (1.0 + BLUR)) {
        let turn = hinge.turn(x);
        if hinge.is_blunt(&turn) {
            let theta = trammel.theta(x * hinge.inverse_sigma);
            let [low, high] = trammel.both_phi(theta);
            let Angles { cos_phi, sin_phi, .. } = hinge.angles(&turn);
            let corrected = [low, high, sin_phi.atan2(cos_phi), low - OUTSIDE_RAD, high + OUTSIDE_RAD]
                .map(|phi| trammel.corrected(phi, theta));
            corrected.into_iter().flatten().for_each(|angles| keep(angles, MERGE_DOUBLE));
        } else {
            let turn = hinge.turn(hinge.polished(x));
            if hinge.admits(&turn) {
                keep(hinge.angles(&turn), MERGE);
            }
        }
    }
    let frames = Frames::new(&triangle, &rays);
    poses.clear();
    poses.extend(found.iter().map(|angles| frames.pose(angles)));
}

impl Angles {
    /// Duplicates share φ too: two φ for one θ are two poses.
    fn is_duplicate_of(&self, other: &Angles, within: f64) -> bool {
        let near = |x: f64, y: f64| (x - y).abs() < within;
        near(self.u, other.u)
            && near(self.v, other.v)
            && near(self.cos_phi, other.cos_phi)
            && near(self.sin_phi, other.sin_phi)
    }
}

struct Trammel {
    g: f64,
    s: f64,
    h: f64,
    c: Vector3<f64>,
    t1: Vector3<f64>,
    t2: Vector3<f64>,
}

impl Trammel {
    fn new(triangle: &Triangle, rays: &Rays) -> Self {
        let sigma = rays.sigma2.sqrt();
        let c = Vector3::new(rays.c.x, rays.c.y / sigma, rays.c.z / sigma);
        let t1 = Vector3::new(-c.y, c.x, 0.0).normalize();
        Trammel { g: rays.kappa / sigma, s: triangle.s, h: triangle.hh.sqrt(), c, t1, t2: c.cross(&t1) }
    }

    /// θ of a root, on the side of the plane on which c is.
    fn theta(&self, x: f64) -> f64 {
        let u = (x / self.h).clamp(-1.0, 1.0);
        (1.0 - u * u).sqrt().copysign(self.c.z).atan2(u)
    }

    /// The two φ that lift C to its ray, eq. (13); where C does not reach it, twice the highest.
    fn both_phi(&self, theta: f64) -> [f64; 2] {
        let (v, u) = theta.sin_cos();
        let (c, x) = (&self.c, self.h * u);
        let along_sin = c.x * (self.g - x) + c.y * self.s;
        let along_cos = c.x * (self.s - 1.0) + c.y * x;
        let foot = self.h * v / c.z * (c.x * c.x + c.y * c.y);
        let half = (foot / along_sin.hypot(along_cos)).clamp(-1.0, 1.0).acos();
        let middle = along_sin.atan2(along_cos);
        [middle - half, middle + half]
    }

    /// C' and its derivatives by φ and θ, eqs. (1), (2), in the frame (p, q, n).
    fn third_point(&self, phi: f64, theta: f64) -> [Vector3<f64>; 3] {
        let ((sin_phi, cos_phi), (v, u)) = (phi.sin_cos(), theta.sin_cos());
        let e = Vector3::new(cos_phi, sin_phi, 0.0);
        let across = Vector3::new(-sin_phi, cos_phi, 0.0);
        let lambda = self.g * sin_phi - cos_phi;
        let slide = Vector3::new(self.g * cos_phi + sin_phi, 0.0, 0.0);
        let place = Vector3::new(lambda, 0.0, 0.0) + e * self.s + (across * u + Vector3::z() * v) * self.h;
        let by_phi = slide + across * self.s - e * (self.h * u);
        let by_theta = (Vector3::z() * u - across * v) * self.h;
        [place, by_phi, by_theta]
    }

    /// How far C' is off its ray.
    fn miss(&self, place: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.t1.dot(place), self.t2.dot(place))
    }

    /// Newton steps on both angles; None when they do not end at a pose in front of the camera.
    fn corrected(&self, mut phi: f64, mut theta: f64) -> Option<Angles> {
        let mut best = (f64::INFINITY, phi, theta);
        for _ in 0..STEPS {
            let [place, by_phi, by_theta] = self.third_point(phi, theta);
            let miss = self.miss(&place);
            if miss.norm() < best.0 {
                best = (miss.norm(), phi, theta);
            } else if best.0 < 2.0 * f64::EPSILON * place.norm() {
                break; // a double pose split by rounding has no root to settle on: the next step may go anywhere
            }
            let slopes = Matrix2::from_columns(&[self.miss(&by_phi), self.miss(&by_theta)]);
            let Some(step): Option<Vector2<f64>> = slopes.try_inverse().map(|inverse| inverse * miss) else {
                break;
            };
            let shorten = (MAX_ROTATION_RAD / step.amax()).min(1.0);
            phi -= shorten * step.x;
            theta -= shorten * step.y;
            if step.amax() < 4.0 * f64::EPSILON {
                break;
            }
        }
        let (miss, phi, theta) = best;
        let depth_c = self.c.dot(&self.third_point(phi, theta)[0]);
        let ((sin_phi, cos_phi), (v, u)) = (phi.sin_cos(), theta.sin_cos());
        let in_front = 0.0 < sin_phi && cos_phi < self.g * sin_phi; // eq. (3)
        (in_front && miss < MAX_MISS * depth_c).then_some(Angles { cos_phi, sin_phi, u, v })
    }
}
