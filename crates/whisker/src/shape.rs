//! Convex objects of the plane: what is identified, what is touched in simulation.

use crate::Error;
use nalgebra::Vector2;
use std::f64::consts::{PI, TAU};

/// A convex object in the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A disc.
    Circle {
        /// Its centre, world, metres.
        centre_m: Vector2<f64>,
        /// Its radius, metres.
        radius_m: f64,
    },
    /// An ellipse.
    Ellipse {
        /// Its centre, world, metres.
        centre_m: Vector2<f64>,
        /// Semi-axes, metres, the larger first.
        semi_axes_m: [f64; 2],
        /// Direction of the first semi-axis, radians.
        angle_rad: f64,
    },
    /// A rectangle; a square where both sides are equal.
    Rectangle {
        /// Its centre, world, metres.
        centre_m: Vector2<f64>,
        /// Sides, metres: along `angle_rad`, then across.
        sides_m: [f64; 2],
        /// Direction of the first side, radians.
        angle_rad: f64,
    },
    /// A convex polygon.
    Polygon {
        /// Corners, counter-clockwise, world, metres.
        corners_m: Vec<Vector2<f64>>,
    },
}

impl Shape {
    /// A square.
    pub fn square(centre_m: Vector2<f64>, side_m: f64, angle_rad: f64) -> Self {
        Shape::Rectangle { centre_m, sides_m: [side_m, side_m], angle_rad }
    }

    /// Support function: the largest n·x over the object for a unit vector n, metres.
    pub fn support_m(&self, normal: Vector2<f64>) -> f64 {
        match self {
            Shape::Circle { centre_m, radius_m } => normal.dot(centre_m) + radius_m,
            Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad } => {
                let n = turned(normal, -angle_rad);
                normal.dot(centre_m) + (a * n.x).hypot(b * n.y)
            }
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => {
                let n = turned(normal, -angle_rad);
                normal.dot(centre_m) + 0.5 * (a * n.x.abs() + b * n.y.abs())
            }
            Shape::Polygon { corners_m } => {
                corners_m.iter().map(|corner| normal.dot(corner)).fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// Corners, counter-clockwise, those of a rectangle from its lower left in its own axes; none of a smooth outline.
    /// Face i leads from corner i to the next.
    pub fn corners_m(&self) -> Vec<Vector2<f64>> {
        match self {
            Shape::Circle { .. } | Shape::Ellipse { .. } => Vec::new(),
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => {
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(i, j)| centre_m + turned(Vector2::new(0.5 * i * a, 0.5 * j * b), *angle_rad))
                    .to_vec()
            }
            Shape::Polygon { corners_m } => corners_m.clone(),
        }
    }

    /// Refuses what is no convex object: a length that is not positive, a number that is none, corners that do not turn left.
    pub fn check(&self) -> Result<(), Error> {
        let place = match self {
            Shape::Circle { centre_m, .. } => [centre_m.x, centre_m.y, 0.0],
            Shape::Ellipse { centre_m, angle_rad, .. } | Shape::Rectangle { centre_m, angle_rad, .. } => {
                [centre_m.x, centre_m.y, *angle_rad]
            }
            Shape::Polygon { corners_m } => return check_corners(corners_m),
        };
        if !place.iter().all(|v| v.is_finite()) {
            return Err(Error::NotFinite { what: "the object's centre or angle" });
        }
        match self {
            Shape::Circle { radius_m, .. } => positive("the circle's radius", *radius_m),
            Shape::Ellipse { semi_axes_m, .. } => {
                semi_axes_m.iter().try_for_each(|&a| positive("a semi-axis of the ellipse", a))
            }
            Shape::Rectangle { sides_m, .. } => {
                sides_m.iter().try_for_each(|&a| positive("a side of the rectangle", a))
            }
            Shape::Polygon { .. } => Ok(()),
        }
    }

    /// The point of a smooth outline whose outward normal has the direction `angle_rad`, metres, and the radius of curvature
    /// there, metres: moving the normal by dν moves the point by ρ dν (−sin ν, cos ν). None of a polygon.
    pub fn smooth_point_m(&self, angle_rad: f64) -> Option<(Vector2<f64>, f64)> {
        let (sin, cos) = angle_rad.sin_cos();
        match self {
            Shape::Circle { centre_m, radius_m } => {
                Some((centre_m + Vector2::new(cos, sin) * *radius_m, *radius_m))
            }
            Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad } => {
                let n = turned(Vector2::new(cos, sin), -angle_rad);
                let h = (a * n.x).hypot(b * n.y);
                let point = Vector2::new(a * a * n.x / h, b * b * n.y / h);
                Some((centre_m + turned(point, *angle_rad), (a * b / h).powi(2) / h))
            }
            Shape::Rectangle { .. } | Shape::Polygon { .. } => None,
        }
    }

    /// Direction of the outward normal of the outline next to a point near it, radians; exact on the outline.
    pub fn normal_near_rad(&self, x_in_world: Vector2<f64>) -> f64 {
        let from_centre = x_in_world - self.centre_m();
        match self {
            Shape::Circle { .. } => from_centre.y.atan2(from_centre.x),
            Shape::Ellipse { semi_axes_m: [a, b], angle_rad, .. } => {
                let x = turned(from_centre, -angle_rad);
                angle_rad + (x.y / (b * b)).atan2(x.x / (a * a))
            }
            Shape::Rectangle { .. } | Shape::Polygon { .. } => {
                let corners = self.corners_m();
                let off = |i: usize, normal: f64| {
                    let (sin, cos) = normal.sin_cos();
                    cos * (x_in_world.x - corners[i].x) + sin * (x_in_world.y - corners[i].y)
                };
                let faces = self.face_normals_rad().into_iter().enumerate();
                faces.max_by(|a, b| off(a.0, a.1).total_cmp(&off(b.0, b.1))).map_or(0.0, |(_, normal)| normal)
            }
        }
    }

    /// Directions of the outward normals of a polygon's faces, face i from corner i to the next, radians; none of a smooth
    /// outline. The normals at corner i lie between those of face i − 1 and face i.
    pub fn face_normals_rad(&self) -> Vec<f64> {
        let corners = self.corners_m();
        edges(&corners).map(|edge| (-edge.x).atan2(edge.y)).collect()
    }

    /// A number that is negative inside the outline, 0 on it and positive outside; the distance for a circle, no more than the
    /// distance for a polygon, metres; for an ellipse the distance to first order.
    pub fn outside_m(&self, x_in_world: Vector2<f64>) -> f64 {
        match self {
            Shape::Circle { centre_m, radius_m } => (x_in_world - centre_m).norm() - radius_m,
            Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad } => {
                let x = turned(x_in_world - centre_m, -angle_rad);
                let scaled = Vector2::new(x.x / a, x.y / b);
                let steepness = (scaled.x / a).hypot(scaled.y / b);
                let radius = scaled.norm();
                if steepness == 0.0 { -a.min(*b) } else { (radius - 1.0) * radius / steepness }
            }
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => {
                let x = turned(x_in_world - centre_m, -angle_rad);
                (x.x.abs() - 0.5 * a).max(x.y.abs() - 0.5 * b)
            }
            Shape::Polygon { corners_m } => corners_m
                .iter()
                .zip(edges(corners_m))
                .map(|(corner, edge)| outward(edge).dot(&(x_in_world - corner)))
                .fold(f64::NEG_INFINITY, f64::max),
        }
    }

    /// Whether the segment from `from` to `to` enters the inside by more than `depth_m`.
    pub fn is_cut_by(&self, from: Vector2<f64>, to: Vector2<f64>, depth_m: f64) -> bool {
        match self {
            Shape::Circle { centre_m, radius_m } => {
                distance_to_segment(from - centre_m, to - centre_m) < radius_m - depth_m
            }
            Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad } => {
                let scaled = |x: Vector2<f64>| {
                    let x = turned(x - centre_m, -angle_rad);
                    Vector2::new(x.x / (a - depth_m), x.y / (b - depth_m))
                };
                distance_to_segment(scaled(from), scaled(to)) < 1.0
            }
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => {
                let [p, q] = [from, to].map(|x| turned(x - centre_m, -angle_rad));
                let half = [0.5 * a - depth_m, 0.5 * b - depth_m];
                let sides =
                    [(p.x, q.x, half[0]), (-p.x, -q.x, half[0]), (p.y, q.y, half[1]), (-p.y, -q.y, half[1])];
                clip(sides.into_iter().map(|(p, q, limit)| (p - limit, q - limit)))
            }
            Shape::Polygon { corners_m } => {
                clip(corners_m.iter().zip(edges(corners_m)).map(|(corner, edge)| {
                    let n = outward(edge);
                    (n.dot(&(from - corner)) + depth_m, n.dot(&(to - corner)) + depth_m)
                }))
            }
        }
    }

    /// A point inside: the centre, or the mean of the corners.
    pub fn centre_m(&self) -> Vector2<f64> {
        match self {
            Shape::Circle { centre_m, .. }
            | Shape::Ellipse { centre_m, .. }
            | Shape::Rectangle { centre_m, .. } => *centre_m,
            Shape::Polygon { corners_m } => corners_m.iter().sum::<Vector2<f64>>() / corners_m.len() as f64,
        }
    }

    /// The least distance between two parallel supporting lines, metres.
    pub fn width_m(&self) -> f64 {
        match self {
            Shape::Circle { radius_m, .. } => 2.0 * radius_m,
            Shape::Ellipse { semi_axes_m: [a, b], .. } => 2.0 * a.min(*b),
            Shape::Rectangle { sides_m: [a, b], .. } => a.min(*b),
            // The narrowest strip lies along a face.
            Shape::Polygon { corners_m } => edges(corners_m)
                .map(|edge| self.support_m(outward(edge)) + self.support_m(-outward(edge)))
                .fold(f64::INFINITY, f64::min),
        }
    }

    /// Length of the outline, metres.
    pub fn perimeter_m(&self) -> f64 {
        match self {
            Shape::Circle { radius_m, .. } => TAU * radius_m,
            // The mean radius of curvature over the normals: spectrally accurate, as the outline is periodic and smooth.
            Shape::Ellipse { .. } => {
                let radius = |i: usize| self.smooth_point_m(TAU * i as f64 / 512.0).map_or(0.0, |(_, r)| r);
                (0..512).map(radius).sum::<f64>() * TAU / 512.0
            }
            Shape::Rectangle { .. } | Shape::Polygon { .. } => {
                edges(&self.corners_m()).map(|edge| edge.norm()).sum()
            }
        }
    }

    /// The outline as a closed counter-clockwise line of points for drawing, metres: the corners, or `count` points of a smooth
    /// outline; the first is not repeated.
    pub fn outline_m(&self, count: usize) -> Vec<Vector2<f64>> {
        let smooth: Vec<_> = (0..count)
            .filter_map(|i| self.smooth_point_m(TAU * i as f64 / count as f64).map(|(point, _)| point))
            .collect();
        if smooth.is_empty() { self.corners_m() } else { smooth }
    }
}

/// From each corner to the next.
fn edges(corners: &[Vector2<f64>]) -> impl Iterator<Item = Vector2<f64>> + '_ {
    (0..corners.len()).map(|i| corners[(i + 1) % corners.len()] - corners[i])
}

/// Unit normal to the right of an edge: outward where the corners run counter-clockwise.
fn outward(edge: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(edge.y, -edge.x) / edge.norm()
}

/// Distance of the segment from the origin.
fn distance_to_segment(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    let along = to - from;
    let length2 = along.norm_squared();
    let share = if length2 == 0.0 { 0.0 } else { (-from.dot(&along) / length2).clamp(0.0, 1.0) };
    (from + along * share).norm()
}

/// Whether a segment has a part where every linear function, given at both ends, is negative.
fn clip(functions: impl Iterator<Item = (f64, f64)>) -> bool {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, end) in functions {
        if 0.0 <= start && 0.0 <= end {
            return false;
        }
        if 0.0 <= start {
            enter = enter.max(start / (start - end));
        } else if 0.0 <= end {
            leave = leave.min(start / (start - end));
        }
    }
    enter < leave
}

/// Every corner turns left, and all together by one rotation.
fn check_corners(corners: &[Vector2<f64>]) -> Result<(), Error> {
    if !corners.iter().all(|c| c.x.is_finite() && c.y.is_finite()) {
        return Err(Error::NotFinite { what: "a corner of the polygon" });
    }
    if corners.len() < 3 {
        let way_out = "name the corners of a convex polygon counter-clockwise";
        return Err(Error::TooFew { what: "corners", seen: corners.len(), needed: 3, way_out });
    }
    let edges: Vec<_> = edges(corners).collect();
    let mut total = 0.0;
    for (i, edge) in edges.iter().enumerate() {
        let before = edges[(i + edges.len() - 1) % edges.len()];
        let rotation_rad = before.perp(edge).atan2(before.dot(edge));
        // Below 1e-9 rad a corner is none, and its two faces one.
        if !(1e-9 < rotation_rad) {
            return Err(Error::NotConvex { corner: i, rotation_rad });
        }
        total += rotation_rad;
    }
    if PI < (total - TAU).abs() { Err(Error::NotConvex { corner: 0, rotation_rad: total }) } else { Ok(()) }
}

fn positive(what: &'static str, seen: f64) -> Result<(), Error> {
    if seen.is_finite() && 0.0 < seen { Ok(()) } else { Err(Error::NotPositive { what, seen }) }
}

fn turned(v: Vector2<f64>, angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}
