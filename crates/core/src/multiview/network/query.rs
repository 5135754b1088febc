//! Queries about positions: lengths, angles, areas, heights, coordinates, each with its gradient. docs/math/survey.md eqs. (16)–(17).

use super::state::{Layout, State};
use crate::Point;
use nalgebra::{DVector, Vector3};

/// A quantity to measure.
#[derive(Debug, Clone, PartialEq)]
pub enum Query {
    /// The distance between two points, m.
    Distance {
        /// First point.
        a: usize,
        /// Second point.
        b: usize,
    },
    /// The length of the line through points in order, m.
    Polyline {
        /// The points, at least two.
        points: Vec<usize>,
    },
    /// The angle at a point, between the directions to two others, rad.
    Angle {
        /// The point of one direction.
        a: usize,
        /// The vertex.
        vertex: usize,
        /// The point of the other direction.
        b: usize,
    },
    /// The area of a flat polygon in space, its corners in order, m².
    Area {
        /// The corners, at least three.
        points: Vec<usize>,
    },
    /// The height above a plane, positive on the side of its normal, m.
    Height {
        /// Which plane.
        plane: usize,
        /// Which point.
        point: usize,
    },
    /// One coordinate of a point, m.
    Coordinate {
        /// Which point.
        point: usize,
        /// 0, 1, 2: x, y, z.
        axis: usize,
    },
}

impl Query {
    /// Returns the points of the query.
    pub fn points(&self) -> Vec<usize> {
        match self {
            Query::Distance { a, b } => vec![*a, *b],
            Query::Polyline { points } | Query::Area { points } => points.clone(),
            Query::Angle { a, vertex, b } => vec![*a, *vertex, *b],
            Query::Height { point, .. } | Query::Coordinate { point, .. } => vec![*point],
        }
    }

    /// Returns the number of points that it needs.
    pub(super) fn least_points(&self) -> usize {
        match self {
            Query::Polyline { .. } => 2,
            Query::Area { .. } => 3,
            _ => 0,
        }
    }

    /// Returns the value, and its gradient by the unknowns.
    pub(super) fn value(&self, state: &State, layout: &Layout) -> (f64, DVector<f64>) {
        let mut gradient = DVector::zeros(layout.n);
        let mut by = |point: usize, slope: Vector3<f64>| {
            for axis in 0..3 {
                if let Some(at) = layout.point[point][axis] {
                    gradient[at] += slope[axis];
                }
            }
        };
        let at = |point: usize| state.points[point];
        let value = match self {
            Query::Distance { a, b } => length(&[*a, *b], &at, &mut by),
            Query::Polyline { points } => length(points, &at, &mut by),
            Query::Angle { a, vertex, b } => angle([*a, *vertex, *b], &at, &mut by),
            Query::Area { points } => area(points, &at, &mut by),
            Query::Coordinate { point, axis } => {
                by(*point, Vector3::ith(*axis, 1.0));
                at(*point)[*axis]
            }
            Query::Height { plane, point } => {
                let found = &state.planes[*plane];
                let x = at(*point);
                by(*point, found.normal);
                if let Some(tilt) = layout.tilt[*plane] {
                    for (k, b) in found.tangents().iter().enumerate() {
                        gradient[tilt + k] = b.dot(&(x - found.pivot));
                    }
                }
                if let Some(height) = layout.height[*plane] {
                    gradient[height] = -1.0;
                }
                found.above_m(&x)
            }
        };
        (value, gradient)
    }
}

/// Returns the unit vector; zero for a zero vector.
fn direction(v: Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or_default()
}

fn length(points: &[usize], at: &impl Fn(usize) -> Point, by: &mut impl FnMut(usize, Vector3<f64>)) -> f64 {
    let piece = |pair: &[usize]| {
        let between = at(pair[1]) - at(pair[0]);
        let u = direction(between);
        by(pair[1], u);
        by(pair[0], -u);
        between.norm()
    };
    points.windows(2).map(piece).sum()
}

/// Returns the angle at `vertex`: moving an end across its arm by δ rotates the arm by δ over its length.
fn angle(
    [a, vertex, b]: [usize; 3],
    at: &impl Fn(usize) -> Point,
    by: &mut impl FnMut(usize, Vector3<f64>),
) -> f64 {
    let (p, q) = (at(a) - at(vertex), at(b) - at(vertex));
    let (u, v) = (direction(p), direction(q));
    let by_a = -direction(v - u * u.dot(&v)) / p.norm().max(f64::MIN_POSITIVE);
    let by_b = -direction(u - v * u.dot(&v)) / q.norm().max(f64::MIN_POSITIVE);
    by(a, by_a);
    by(b, by_b);
    by(vertex, -by_a - by_b);
    u.cross(&v).norm().atan2(u.dot(&v))
}

/// Returns half the length of Σ xᵢ × xᵢ₊₁, with corners relative to the first, so that no digits are lost far from the origin.
fn area(points: &[usize], at: &impl Fn(usize) -> Point, by: &mut impl FnMut(usize, Vector3<f64>)) -> f64 {
    let n = points.len();
    let origin = at(points[0]);
    let x = |i: usize| at(points[i % n]) - origin;
    let twice: Vector3<f64> = (0..n).map(|i| x(i).cross(&x(i + 1))).sum();
    let normal = direction(twice);
    for i in 0..n {
        let across = x(i + 1) - x(i + n - 1);
        by(points[i], across.cross(&normal) * 0.5);
    }
    0.5 * twice.norm()
}
