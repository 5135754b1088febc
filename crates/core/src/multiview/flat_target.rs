//! The shape of a flat target that is stretched or bent: docs/math/intrinsics.md section 2.

use crate::{Correspondence, Point};

/// The deformation of a flat target: x → (x, y (1 + stretch), bend_x (1 − ξ²) + bend_y (1 − η²)), ξ and η the coordinates over the
/// target's half width and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) centre: Point,
    pub(super) half_m: [f64; 2],
    /// stretch, bend_x (m), bend_y (m).
    pub(super) values: [f64; 3],
    /// Standard deviation of the stretch from the rulers on the print; `None` where they were not measured.
    pub(super) stretch_sigma: Option<f64>,
    /// Whether the bends are estimated too; otherwise they are zero.
    pub(super) is_bent: bool,
}

impl Shape {
    /// Creates the shape of points in one plane z = constant; `None` where they are not, or are on a line.
    pub(super) fn of<'a>(points: impl Iterator<Item = &'a Correspondence> + Clone) -> Option<Self> {
        let fold = |best: fn(f64, f64) -> f64| {
            points.clone().map(|c| c.x_in_target).reduce(|a, b| a.zip_map(&b, best))
        };
        let (low, high) = (fold(f64::min)?, fold(f64::max)?);
        let (centre, half) = (0.5 * (low + high), 0.5 * (high - low));
        let is_flat = half.z <= 1e-9 * half.x && 0.1 * half.x < half.y && 0.1 * half.y < half.x;
        is_flat.then_some(Shape {
            centre,
            half_m: [half.x, half.y],
            values: [0.0; 3],
            stretch_sigma: None,
            is_bent: true,
        })
    }

    /// Returns the number of values that are estimated.
    pub(super) fn n(&self) -> usize {
        if self.is_bent { 3 } else { 1 }
    }

    fn unit(&self, x: &Point) -> [f64; 2] {
        [(x.x - self.centre.x) / self.half_m[0], (x.y - self.centre.y) / self.half_m[1]]
    }

    /// Returns the position of a point of the target.
    pub(super) fn at(&self, x: &Point) -> Point {
        let ([u, v], [stretch, bend_x, bend_y]) = (self.unit(x), self.values);
        x + Point::new(0.0, stretch * v * self.half_m[1], bend_x * (1.0 - u * u) + bend_y * (1.0 - v * v))
    }

    /// Returns its derivatives with respect to the three values.
    pub(super) fn derivatives(&self, x: &Point) -> [Point; 3] {
        let [u, v] = self.unit(x);
        let along_z = |z: f64| Point::new(0.0, 0.0, z);
        [Point::new(0.0, v * self.half_m[1], 0.0), along_z(1.0 - u * u), along_z(1.0 - v * v)]
    }
}
