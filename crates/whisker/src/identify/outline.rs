//! The contacts an outline allows: a curve of places and normals, and the distance of a touch from it.
//!
//!   [p(β), β]  tangent contact of a smooth outline: p = c + P P n/|P n|, dp/dβ = ρ t, ρ = det P² / |P n|³      eq. (3), (4)
//!   [cₖ, β]  whisker on corner k, βₖ₋₁ ≤ β ≤ βₖ   ·   [cₖ + u tₖ, βₖ]  whisker along face k, 0 ≤ u ≤ ℓₖ          eq. (5)
//! Numbers: docs/math/whisker_identify.md. Where on the curve is eliminated: e − w wᵀe/w², w = W v, v the curve's tangent, eq. (6).

use super::row::Row;
use arrayvec::ArrayVec;
use nalgebra::{Matrix2, Vector2, Vector3};
use std::f64::consts::{PI, TAU};

/// An outline by the parameters that rows are differentiated by.
#[derive(Debug, Clone)]
pub(super) enum Outline {
    /// Support function n·c + |P n|; parameters c, P₁₁, P₁₂, P₂₂.
    Smooth(Smooth),
    /// Hull of corners, counter-clockwise; parameters their coordinates.
    Corners(Corners),
}

/// An ellipse: P is the symmetric root of its quadratic form.
#[derive(Debug, Clone)]
pub(super) struct Smooth {
    /// c, metres.
    pub centre: Vector2<f64>,
    /// P, metres.
    pub root: Matrix2<f64>,
}

/// A polygon, its faces computed once.
#[derive(Debug, Clone)]
pub(super) struct Corners {
    /// cₖ, metres.
    pub corners: Vec<Vector2<f64>>,
    faces: Vec<Face>,
}

#[derive(Debug, Clone, Copy)]
struct Face {
    along: Vector2<f64>,
    normal: Vector2<f64>,
    length: f64,
    beta: f64,
}

/// Where on the outline the nearest contact is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    /// On a smooth part, β.
    Tangent(f64),
    /// Turning about a corner: which, β.
    Corner(usize, f64),
    /// Along a face: which, u.
    Face(usize, f64),
}

/// The distance of a touch from the outline.
#[derive(Debug, Clone)]
pub(super) struct Distance {
    /// Whitened residual, measured − nearest.
    pub e: Vector3<f64>,
    /// Whitened derivatives of the nearest contact by the parameters it depends on, the way along the curve taken out.
    pub by: ArrayVec<(usize, Vector3<f64>), 5>,
    /// Where.
    pub place: Place,
}

impl Outline {
    /// The nearest contact.
    pub fn distance(&self, row: &Row) -> Distance {
        match self {
            Outline::Smooth(smooth) => smooth.distance(row),
            Outline::Corners(corners) => corners.distance(row),
        }
    }

    /// How many parameters.
    pub fn n_parameters(&self) -> usize {
        match self {
            Outline::Smooth(_) => 5,
            Outline::Corners(corners) => 2 * corners.corners.len(),
        }
    }
}

/// Turns of the whisker about a smooth outline per step of the search; more would leap over the far side.
const LARGEST_TURN: f64 = 0.5;
/// Steps of that search; three or four are taken.
const MOST_TURNS: usize = 8;
/// Smallest second derivative taken, as a share of that along the tangent.
const LEAST_CURVATURE: f64 = 0.2;

impl Smooth {
    fn distance(&self, row: &Row) -> Distance {
        let mut beta = if row.tip { self.normal_through(row) } else { row.beta };
        let (mut e, mut w, mut bend) = self.residual(row, beta);
        for _ in 0..MOST_TURNS {
            // Newton on ½ e²; where that curves downwards, as far inside the outline, a damped step along the tangent.
            let tangent2 = w.norm_squared();
            let curvature = (tangent2 - e.dot(&bend)).max(LEAST_CURVATURE * tangent2).max(f64::MIN_POSITIVE);
            let step = (w.dot(&e) / curvature).clamp(-LARGEST_TURN, LARGEST_TURN);
            beta += step;
            (e, w, bend) = self.residual(row, beta);
            // A thousandth of a standard deviation along the curve: a millionth of the squared distance.
            if step * step * w.norm_squared() < 1e-6 {
                break;
            }
        }
        let n = Vector2::new(beta.cos(), beta.sin());
        let q = self.root * n;
        let unit = q / q.norm();
        // d(P P n/|P n|) by P: dP û + P (I − û ûᵀ) dP n/|P n|, eq. (7).
        let across = self.root * (Matrix2::identity() - unit * unit.transpose()) / q.norm();
        let basis = [
            Matrix2::new(1.0, 0.0, 0.0, 0.0),
            Matrix2::new(0.0, 1.0, 1.0, 0.0),
            Matrix2::new(0.0, 0.0, 0.0, 1.0),
        ];
        let project = along_removed(&w);
        let mut by = ArrayVec::new();
        by.push((0, project(place(row, Vector2::x()))));
        by.push((1, project(place(row, Vector2::y()))));
        for (i, d) in basis.iter().enumerate() {
            by.push((2 + i, project(place(row, d * unit + across * (d * n)))));
        }
        Distance { e: project(e), by, place: Place::Tangent(beta) }
    }

    /// The normal whose contact lies roughly towards a tip contact; an outline is touched on the side it turns to the whisker.
    fn normal_through(&self, row: &Row) -> f64 {
        let square = self.root * self.root;
        let outward = square.try_inverse().unwrap_or_else(Matrix2::identity) * (row.x - self.centre);
        if outward.dot(&row.normal()) <= 0.0 { row.beta } else { outward.y.atan2(outward.x) }
    }

    /// W (y − f(β)), W v and W dv/dβ.
    fn residual(&self, row: &Row, beta: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let n = Vector2::new(beta.cos(), beta.sin());
        let t = Vector2::new(-n.y, n.x);
        let q = self.root * n;
        let h = q.norm();
        let off = row.x - self.centre - self.root * q / h;
        let rho = self.root.determinant().powi(2) / (h * h * h);
        let rho_by_beta = -3.0 * rho * q.dot(&(self.root * t)) / (h * h);
        let tangent = rho * t;
        let bend = rho_by_beta * t - rho * n;
        (
            row.w * Vector3::new(off.x, off.y, row.beta - beta),
            row.w * Vector3::new(tangent.x, tangent.y, 1.0),
            row.w * Vector3::new(bend.x, bend.y, 0.0),
        )
    }
}

impl Corners {
    /// None where the corners are not strictly convex and counter-clockwise.
    pub fn new(corners: Vec<Vector2<f64>>) -> Option<Self> {
        let m = corners.len();
        let mut faces = Vec::with_capacity(m);
        for k in 0..m {
            if m == 1 {
                break;
            }
            let edge = corners[(k + 1) % m] - corners[k];
            let length = edge.norm();
            // Shorter than any noise: two corners that are one.
            if !(1e-7 < length) {
                return None;
            }
            let along = edge / length;
            let normal = Vector2::new(along.y, -along.x);
            faces.push(Face { along, normal, length, beta: normal.y.atan2(normal.x) });
        }
        let convex = |k: usize| 0.0 < faces[k].along.perp(&faces[(k + 1) % m].along);
        if 3 <= m && !((0..m).all(convex) && turns_once(&faces)) {
            return None;
        }
        Some(Corners { corners, faces })
    }

    fn distance(&self, row: &Row) -> Distance {
        let mut best: Option<(f64, Place, Vector3<f64>)> = None;
        let mut offer = |place: Place, e: Vector3<f64>| {
            let squared = e.norm_squared();
            if best.as_ref().is_none_or(|(least, ..)| squared < *least) {
                best = Some((squared, place, e));
            }
        };
        let facing = row.normal();
        for k in 0..self.corners.len() {
            if let Some((beta, e)) = self.at_corner(row, k) {
                offer(Place::Corner(k, beta), e);
            }
            if let Some(face) = self.faces.get(k).filter(|face| !row.tip || 0.0 < face.normal.dot(&facing)) {
                let (u, e) = on_face(row, self.corners[k], face);
                offer(Place::Face(k, u), e);
            }
        }
        // One corner alone takes every touch; of a closed outline some face looks any way.
        let (_, place, e) = best.unwrap_or((0.0, Place::Corner(0, row.beta), Vector3::zeros()));
        Distance { e, by: self.derivatives(row, place), place }
    }

    /// The whisker on corner k, free to turn within its normals: β and the residual.
    fn at_corner(&self, row: &Row, k: usize) -> Option<(f64, Vector3<f64>)> {
        let off = row.x - self.corners[k];
        let mut e = row.w * Vector3::new(off.x, off.y, 0.0);
        if row.tip {
            return self.faces.is_empty().then_some((row.beta, e));
        }
        let turn = -e.z / row.w[(2, 2)];
        let beta = row.beta - turn;
        e.z = 0.0;
        if let Some(face) = self.faces.get(k) {
            let before = self.faces[(k + self.faces.len() - 1) % self.faces.len()].beta;
            if positive_angle(face.beta - before) < positive_angle(beta - before) {
                return None;
            }
        }
        Some((beta, e))
    }

    fn derivatives(&self, row: &Row, at: Place) -> ArrayVec<(usize, Vector3<f64>), 5> {
        let mut by = ArrayVec::new();
        match at {
            Place::Corner(k, _) => {
                let project = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
                by.push((2 * k, project(place(row, Vector2::x()))));
                by.push((2 * k + 1, project(place(row, Vector2::y()))));
            }
            Place::Face(k, u) => {
                let face = &self.faces[k];
                let next = (k + 1) % self.corners.len();
                let share = u / face.length;
                // Only where u is free does sliding along the face cost nothing.
                let free = 0.0 < u && u < face.length;
                let w = if free { place(row, face.along) } else { Vector3::zeros() };
                let project = along_removed(&w);
                let turned = face.normal / face.length;
                for (corner, weight, sign) in [(k, 1.0 - share, 1.0), (next, share, -1.0)] {
                    for (i, unit) in [Vector2::new(1.0, 0.0), Vector2::new(0.0, 1.0)].into_iter().enumerate()
                    {
                        let v = Vector3::new(weight * unit.x, weight * unit.y, sign * turned[i]);
                        by.push((2 * corner + i, project(row.w * v)));
                    }
                }
            }
            Place::Tangent(_) => {}
        }
        by
    }
}

/// The whisker along a face from `corner`: u and the residual.
fn on_face(row: &Row, corner: Vector2<f64>, face: &Face) -> (f64, Vector3<f64>) {
    let off = row.x - corner;
    let e = row.w * Vector3::new(off.x, off.y, nearest_revolution(row.beta - face.beta));
    let w = place(row, face.along);
    let u = (w.dot(&e) / w.norm_squared()).clamp(0.0, face.length);
    (u, e - u * w)
}

/// W of a displacement that does not turn.
fn place(row: &Row, v: Vector2<f64>) -> Vector3<f64> {
    row.w * Vector3::new(v.x, v.y, 0.0)
}

/// Removes the direction of `w`; of a zero vector nothing.
fn along_removed(w: &Vector3<f64>) -> impl Fn(Vector3<f64>) -> Vector3<f64> + use<> {
    let unit = w.try_normalize(1e-300).unwrap_or_else(Vector3::zeros);
    move |v| v - unit * unit.dot(&v)
}

/// The faces of a convex outline turn by one full turn, not two.
fn turns_once(faces: &[Face]) -> bool {
    let m = faces.len();
    let total: f64 = (0..m).map(|k| positive_angle(faces[(k + 1) % m].beta - faces[k].beta)).sum();
    total < 1.5 * TAU
}

/// Into [0, 2π).
pub(super) fn positive_angle(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).floor()
}

/// Into [−π, π).
pub(super) fn nearest_revolution(angle: f64) -> f64 {
    positive_angle(angle + PI) - PI
}
