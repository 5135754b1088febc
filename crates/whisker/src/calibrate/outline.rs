//! The outline of the object in a fit: the distance of a line or a point from it, and its derivatives by the object's free parameters.
//!
//! For a convex object with support function h: the line with outward normal n supports it where n·x = h(n), and a point lies on the
//! outline where its signed distance max_n (n·x − h(n)) vanishes. docs/math/whisker_calibrate.md eqs. (9)–(10).

use super::Object;
use crate::Shape;
use nalgebra::Vector2;
use std::f64::consts::FRAC_PI_2;

/// The object in a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    start: Shape,
    freedom: Freedom,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Freedom {
    Held,
    Pose,
    PoseAndSize,
}

/// How far apart the central differences of h by a parameter stand, in metres or radians: h is smooth on the scale of the object,
/// 10⁻² m; truncation (10⁻⁶/10⁻²)² and rounding 10⁻¹⁶/10⁻⁶ are both far below the 10⁻³ that a Jacobian must hold.
const STEP: f64 = 1e-6;

impl Outline {
    /// Returns the outline of `object`; `None` for an object that is completely unknown.
    pub fn of(object: &Object) -> Option<Self> {
        let (start, freedom) = match object {
            Object::Unknown | Object::Unclassified => return None,
            Object::Known(shape) => (shape, Freedom::Held),
            Object::KnownSize(shape) => (shape, Freedom::Pose),
            Object::KnownClass(shape) => (shape, Freedom::PoseAndSize),
        };
        Some(Outline { start: start.clone(), freedom })
    }

    /// The number of free parameters: shift x, shift y, turn (not of a circle), then sizes.
    pub fn count(&self) -> usize {
        match self.freedom {
            Freedom::Held => 0,
            Freedom::Pose => self.pose_count(),
            Freedom::PoseAndSize => self.pose_count() + self.size_count(),
        }
    }

    /// Returns whether it has no corner.
    pub fn is_smooth(&self) -> bool {
        self.start.corners_m().is_empty()
    }

    fn pose_count(&self) -> usize {
        if matches!(self.start, Shape::Circle { .. }) { 2 } else { 3 }
    }

    fn size_count(&self) -> usize {
        if matches!(self.start, Shape::Ellipse { .. } | Shape::Rectangle { .. }) { 2 } else { 1 }
    }

    /// The shape at `moved`: metres and radians from the start; the size of a polygon is ln of its scale times 0.01 m.
    pub fn shape(&self, moved: &[f64]) -> Shape {
        let at = |i: usize| moved.get(i).copied().unwrap_or(0.0);
        let shift = Vector2::new(at(0), at(1));
        let size = self.pose_count();
        match &self.start {
            Shape::Circle { centre_m, radius_m } => {
                Shape::Circle { centre_m: centre_m + shift, radius_m: radius_m + at(size) }
            }
            Shape::Ellipse { centre_m, semi_axes_m: [a, b], angle_rad } => Shape::Ellipse {
                centre_m: centre_m + shift,
                semi_axes_m: [a + at(size), b + at(size + 1)],
                angle_rad: angle_rad + at(2),
            },
            Shape::Rectangle { centre_m, sides_m: [a, b], angle_rad } => Shape::Rectangle {
                centre_m: centre_m + shift,
                sides_m: [a + at(size), b + at(size + 1)],
                angle_rad: angle_rad + at(2),
            },
            Shape::Polygon { corners_m } => {
                let centre = corners_m.iter().sum::<Vector2<f64>>() / corners_m.len() as f64;
                let (sin, cos) = at(2).sin_cos();
                let scale = (at(size) / 0.01).exp();
                let place = |corner: &Vector2<f64>| {
                    let d = (corner - centre) * scale;
                    centre + shift + Vector2::new(cos * d.x - sin * d.y, sin * d.x + cos * d.y)
                };
                Shape::Polygon { corners_m: corners_m.iter().map(place).collect() }
            }
        }
    }

    /// ∂h/∂(free parameters) in the direction `angle_rad`.
    pub fn support_by_parameters(&self, moved: &[f64], angle_rad: f64) -> Vec<f64> {
        self.by_parameters(moved, |shape| shape.support_m(unit(angle_rad)))
    }

    /// ∂h′/∂(free parameters) in the direction `angle_rad`; h′ is how far along its tangent the outline has that normal.
    pub fn slope_by_parameters(&self, moved: &[f64], angle_rad: f64) -> Vec<f64> {
        self.by_parameters(moved, |shape| {
            unit(angle_rad + FRAC_PI_2).dot(&supporting_point(shape, angle_rad).0)
        })
    }

    /// ∂(n·x − h(n))/∂(free parameters), n the normal of face `face`, which turns with the object.
    pub fn face_by_parameters(&self, moved: &[f64], face: usize, x: Vector2<f64>) -> Vec<f64> {
        self.by_parameters(moved, |shape| {
            let normal = unit(face_normal(shape, face));
            normal.dot(&x) - shape.support_m(normal)
        })
    }

    fn by_parameters(&self, moved: &[f64], value: impl Fn(&Shape) -> f64) -> Vec<f64> {
        (0..self.count())
            .map(|i| {
                let ends = [STEP, -STEP].map(|off| {
                    let mut there = moved.to_vec();
                    there[i] += off;
                    value(&self.shape(&there))
                });
                (ends[0] - ends[1]) / (2.0 * STEP)
            })
            .collect()
    }
}

/// Returns the point of the outline with the outward normal of direction `angle_rad`, and the radius of curvature there, metres: for a polygon
/// the corner that is farthest out, with radius zero.
pub fn supporting_point(shape: &Shape, angle_rad: f64) -> (Vector2<f64>, f64) {
    let out = |corner: &Vector2<f64>| unit(angle_rad).dot(corner);
    let corner =
        || shape.corners_m().into_iter().max_by(|a, b| out(a).total_cmp(&out(b))).unwrap_or_default();
    shape.smooth_point_m(angle_rad).unwrap_or_else(|| (corner(), 0.0))
}

/// The direction of the normal of face `face`, radians.
pub fn face_normal(shape: &Shape, face: usize) -> f64 {
    shape.face_normals_rad().get(face).copied().unwrap_or(0.0)
}

/// The face whose normal is within [`FACE_MARGIN_RAD`] of the direction `angle_rad`: which of its points is touched is not said
/// by the normal.
pub fn face_near(shape: &Shape, angle_rad: f64) -> Option<usize> {
    shape.face_normals_rad().iter().position(|normal| (normal - angle_rad).cos() > FACE_MARGIN_RAD.cos())
}

/// Three σ of half a degree, what a new rig's clamp may be rotated by; the noise of a contact's direction is smaller.
const FACE_MARGIN_RAD: f64 = 0.026;

/// Whether `x` is too near a corner for the distance from the outline to be a smooth function of it: within 1.5 mm, some 5 σ of a
/// contact at the tip.
pub fn is_near_corner(shape: &Shape, x: Vector2<f64>) -> bool {
    shape.corners_m().iter().any(|corner| (corner - x).norm() < CORNER_MARGIN_M)
}

const CORNER_MARGIN_M: f64 = 1.5e-3;

/// Signed distance of `x` from the outline, positive outside, metres, and the direction of the normal it is measured along.
pub fn signed_distance(shape: &Shape, x: Vector2<f64>) -> (f64, f64) {
    let gap = |angle: f64| unit(angle).dot(&x) - shape.support_m(unit(angle));
    // The gap has one highest maximum but may have several lower ones: the best of 72 directions lies on its hill for every
    // object that turns its outline by less than 5° within the distance looked at; the golden section then climbs it.
    let step = std::f64::consts::TAU / 72.0;
    let best = (0..72).map(|i| i as f64 * step).max_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap_or(0.0);
    let angle = highest(gap, best - step, best + step);
    (gap(angle), angle)
}

/// The maximum of a function with one hill between `low` and `high`, to 10⁻⁸ of the interval, by the golden section.
fn highest(value: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let mut inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let mut values = inner.map(&value);
    for _ in 0..38 {
        if values[1] < values[0] {
            high = inner[1];
            inner = [high - GOLDEN * (high - low), inner[0]];
            values = [value(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + GOLDEN * (high - low)];
            values = [values[1], value(inner[1])];
        }
    }
    0.5 * (low + high)
}

/// The unit vector in direction `angle_rad`.
pub fn unit(angle_rad: f64) -> Vector2<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Vector2::new(cos, sin)
}
