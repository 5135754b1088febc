//! Convex objects of the plane: what is identified, what is touched in simulation.

use nalgebra::Vector2;

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

    /// Corners, counter-clockwise; none of a smooth outline.
    pub fn corners_m(&self) -> Vec<Vector2<f64>> {
        match self {
            Shape::Circle { .. } | Shape::Ellipse { .. } => Vec::new(),
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => {
                [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
                    .map(|(i, j)| centre_m + turned(Vector2::new(0.5 * i * a, 0.5 * j * b), *angle_rad))
                    .to_vec()
            }
            Shape::Polygon { corners_m } => corners_m.clone(),
        }
    }
}

fn turned(v: Vector2<f64>, angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}
