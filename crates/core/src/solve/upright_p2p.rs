//! Two points and the vertical: up to two poses. Own derivation, docs/math/upright_p2p.md; equation numbers refer to it.
//!
//! The chord between the points is known in height and in length; it lies in the plane of the two rays. A height, a length and a
//! plane leave two chords. No half angles, no frame rotated upright first.
//!
//!   w, u  the vertical in the camera and in the target: w = R u   ·   a, b  bearings of the points A, B
//!   D = B − A = u h + d, d ⟂ u, |d| = ρ   ·   C = R D = w h + c, c ⟂ w: the chord in the camera frame
//!   g = a × b, q = g·w, p = |g × w|   ·   m = g × w / p, the horizontal in the plane of the rays; f = w × m
//!   c = k f + s m

use super::Candidates;
use crate::{Bearing, Error, Point, Pose};
use nalgebra::{Matrix3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Sine between two bearings below which they are one: the chord's plane is rounding.
const MIN_SINE: f64 = 1e-10;
/// Sine between the plane of the rays and the horizon below which height says nothing about the place.
const MIN_TILT: f64 = 1e-9;
/// Horizontal part of the chord (of its length) below which no rotation about the vertical is seen.
const MIN_LEVEL: f64 = 1e-9;
/// Coordinates carry a relative rounding ε; a chord shorter than this multiple of it is rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// A chord that is too steep for its rays by less than this part, as noise makes one near a double root, is laid flat along f.
const MAX_EXCESS: f64 = 0.1;
/// Two roots whose chords are closer than this (of ρ) are one, split by rounding: √ε, with margin.
const MERGE: f64 = 3e-8;

/// Every pose that puts the two points onto their rays, in front of the camera, and the vertical onto the vertical.
///
/// `up_in_target` and `up_in_cam` are one direction (up or down, but the same) in both frames. On exact data one of the poses is the
/// true one. Near a double root noise leaves no such pose; then the nearest turn is returned, which reprojects up to that noise.
///
/// # Errors
/// `Coincident` for points or bearings that are one; `DegenerateView` for points above each other (no rotation about the vertical is
/// seen) and for rays in the horizon (the distance is open); `NoSolution` where every root lies behind the camera, or there is none.
#[inline]
pub fn upright_p2p(
    bearings: &[Bearing; 2],
    points_in_target: &[Point; 2],
    up_in_target: &Unit<Vector3<f64>>,
    up_in_cam: &Unit<Vector3<f64>>,
) -> Result<Candidates, Error> {
    let chord = Chord::new(points_in_target, up_in_target)?;
    let rays = Rays::new(bearings, up_in_cam)?;
    let k = -rays.q * chord.h * rays.inverse_p; // eq. (3)
    let (k, s) = across(k, chord.rho).ok_or(NO_SOLUTION)?;
    let mut poses = Candidates::new();
    for s in [s, -s] {
        let level = rays.f * k + rays.m * s;
        if let Some(depth) = rays.depth(&(rays.w * chord.h + level)) {
            let pose = chord.cam_from_target(&rays, &level, depth);
            // Coordinates of 1e154 and more overflow; the rotation enters every component of the translation.
            if pose.translation.sum().is_finite() {
                poses.push(pose);
            }
        }
        if s <= MERGE * chord.rho {
            break; // A double root is one pose.
        }
    }
    if poses.is_empty() { Err(NO_SOLUTION) } else { Ok(poses) }
}

const NO_SOLUTION: Error = Error::NoSolution { n_points: 2 };

/// The chord's horizontal parts (k, s): s = √(ρ² − k²), eq. (4). None when k exceeds ρ by more than noise explains, or is NaN.
#[inline]
fn across(k: f64, rho: f64) -> Option<(f64, f64)> {
    if k.abs() <= rho {
        return Some((k, ((rho - k) * (rho + k)).sqrt()));
    }
    (k.abs() < rho * (1.0 + MAX_EXCESS)).then(|| (rho.copysign(k), 0.0))
}

/// The two points in the target, and the vertical there.
struct Chord {
    origin: Point,
    u: Vector3<f64>,
    h: f64,
    d: Vector3<f64>,
    rho: f64,
}

impl Chord {
    #[inline]
    fn new([a, b]: &[Point; 2], up: &Unit<Vector3<f64>>) -> Result<Self, Error> {
        let (u, chord) = (up.into_inner(), b - a);
        let h = u.dot(&chord);
        let d = chord - u * h;
        let (squared, rho_squared) = (chord.norm_squared(), d.norm_squared());
        let rounding = ROUNDING * a.amax().max(b.amax());
        if !(rounding * rounding < squared && squared < f64::INFINITY) {
            return Err(Error::Coincident { first: 0, second: 1, where_: "in the target" });
        }
        if !((MIN_LEVEL * MIN_LEVEL * squared).max(rounding * rounding) < rho_squared) {
            return Err(one_above_the_other((rho_squared / squared).sqrt()));
        }
        Ok(Chord { origin: *a, u, h, d, rho: rho_squared.sqrt() })
    }

    /// The rotation that lays d along `level` and u along w, eq. (6), and the place of the first point at `depth`.
    #[inline]
    fn cam_from_target(&self, rays: &Rays, level: &Vector3<f64>, depth: f64) -> Pose {
        let (w, scale) = (&rays.w, 1.0 / (self.rho * self.rho));
        let (c, wc, d, ud) = (level * scale, w.cross(level) * scale, &self.d, self.u.cross(&self.d));
        let rotation = Matrix3::from_fn(|i, j| w[i] * self.u[j] + c[i] * d[j] + wc[i] * ud[j]);
        Pose { rotation, translation: rays.a * depth - rotation * self.origin }
    }
}

/// The two rays, and the vertical as the camera sees it.
struct Rays {
    a: Vector3<f64>,
    b: Vector3<f64>,
    w: Vector3<f64>,
    g: Vector3<f64>,
    q: f64,
    inverse_p: f64,
    inverse_gg: f64,
    m: Vector3<f64>,
    f: Vector3<f64>,
}

impl Rays {
    #[inline]
    fn new([a, b]: &[Bearing; 2], up: &Unit<Vector3<f64>>) -> Result<Self, Error> {
        let (a, b, w) = (a.into_inner(), b.into_inner(), up.into_inner());
        // A difference of bearings is exact to its own size; a product of bearings is not.
        let g = a.cross(&(b - a));
        let gg = g.norm_squared();
        if !(MIN_SINE * MIN_SINE < gg) {
            return Err(Error::Coincident { first: 0, second: 1, where_: "in the image" });
        }
        let level = g.cross(&w);
        let pp = level.norm_squared();
        if !(MIN_TILT * MIN_TILT * gg < pp) {
            return Err(rays_in_the_horizon((pp / gg).sqrt()));
        }
        let inverse_p = 1.0 / pp.sqrt();
        let m = level * inverse_p;
        Ok(Rays { a, b, w, g, q: g.dot(&w), inverse_p, inverse_gg: 1.0 / gg, m, f: w.cross(&m) })
    }

    /// Distance of A from the camera for the chord `c`, eq. (5); none where A or B lies behind.
    #[inline]
    fn depth(&self, c: &Vector3<f64>) -> Option<f64> {
        let across = c.cross(&self.g);
        let (depth_a, depth_b) = (across.dot(&self.b) * self.inverse_gg, across.dot(&self.a));
        (0.0 < depth_a && 0.0 < depth_b).then_some(depth_a)
    }
}

#[cold]
fn one_above_the_other(metric: f64) -> Error {
    let reason =
        "one point is above the other, so no rotation about the vertical is seen; use points side by side";
    Error::DegenerateView { reason, metric, needed: MIN_LEVEL }
}

#[cold]
fn rays_in_the_horizon(metric: f64) -> Error {
    let reason = "both points are level with the camera, which leaves their distance open; use a point above or below it";
    Error::DegenerateView { reason, metric, needed: MIN_TILT }
}
