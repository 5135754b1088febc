//! Two views: the least change of both pixels that makes the rays meet. Derivation: docs/math/triangulate.md eqs. (2)–(7).
//!
//! All planes through the baseline are n(φ) = cos φ n₀ + sin φ n₁. In each view the plane is a line; the least change of the pixel onto
//! it costs p²/q with p linear and q quadratic in (cos φ, sin φ). The sum over both views has its extrema at the roots of a
//! polynomial of degree 6, all of which are found.
//!
//! ```text
//!   y  coordinates about the ray: direction b + y₁ e₁ + y₂ e₂, pixel u + M y (exact for pinholes)
//!   Σ' = M⁻¹ Σ M⁻ᵀ   ·   l = (n·e₁, n·e₂)   ·   p = n·b   ·   q = lᵀ Σ' l
//! ```

use super::{BearingObservation, matrix_of};
use crate::Point;
use crate::polynomial::bernstein::{Coefficients, roots_in_unit_interval};
use nalgebra::{Matrix2, Vector2, Vector3};

/// The rays of both views as they meet.
pub(super) struct Corrected {
    pub(super) x_in_world: Point,
    pub(super) bearings_in_world: [Vector3<f64>; 2],
    /// Distance of the point along either ray, negative behind.
    pub(super) depths_m: [f64; 2],
}

/// A view in the pencil of planes: p and q of one view on an arc of φ, in x = s/t.
struct Wing {
    /// p₀, p₁.
    p: [f64; 2],
    /// q₀, q₁, q₂.
    q: [f64; 3],
}

/// Coordinates about a ray.
struct Chart {
    ray: Vector3<f64>,
    axes: [Vector3<f64>; 2],
    covariance: Matrix2<f64>,
}

/// Rays closer to the image plane than this are charted across themselves.
const OBLIQUE: f64 = 0.2;
/// Sine of the angle between rays and baseline below which no plane can be reported.
const ON_BASELINE: f64 = 1e-12;
/// Arcs of φ: a quarter of the half circle each, so that the polynomial runs evenly.
const ARCS: usize = 4;

/// Two unit vectors across a direction and each other.
pub(super) fn tangents(direction: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let first = direction.cross(&Vector3::ith(direction.iamin(), 1.0)).normalize();
    (first, direction.cross(&first).normalize())
}

/// None where the centres coincide, both rays lie along the baseline, or the corrected rays are parallel.
pub(super) fn correct(first: &BearingObservation, second: &BearingObservation) -> Option<Corrected> {
    let baseline = second.centre_in_world - first.centre_in_world;
    let along = baseline.try_normalize(0.0)?;
    let charts = [Chart::of(first)?, Chart::of(second)?];
    // n₀ is the plane nearest to both rays: the optimum lies near φ = 0 and far from the ends of the half circle.
    let mean = first.bearing_in_world + second.bearing_in_world;
    let across = mean - along * mean.dot(&along);
    let widest = if across.norm() < ON_BASELINE { first.bearing_in_world } else { mean };
    let n0 = along.cross(&widest).try_normalize(ON_BASELINE)?;
    let n1 = along.cross(&n0);
    let mut best: Option<(f64, Vector3<f64>)> = None;
    for arc in 0..ARCS {
        let end = |k: usize| {
            let angle = core::f64::consts::PI * (k as f64 / ARCS as f64 - 0.5);
            n0 * angle.cos() + n1 * angle.sin()
        };
        let (start, end) = (end(arc), end(arc + 1));
        let wings = [charts[0].wing(&start, &end), charts[1].wing(&start, &end)];
        let places = roots_in_unit_interval(&extrema(&wings));
        for s in places.into_iter().chain([0.0]) {
            let normal = (start * (1.0 - s) + end * s).normalize();
            let cost = charts[0].cost(&normal) + charts[1].cost(&normal);
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, normal));
            }
        }
    }
    let (_, normal) = best?;
    meet(first, second, [charts[0].corrected(&normal), charts[1].corrected(&normal)])
}

/// Scaled Bernstein coefficients of p₁(…)q₂² + p₂(…)q₁², degree 6, times (s + t)²: docs/math/triangulate.md eq. (6).
fn extrema(wings: &[Wing; 2]) -> Coefficients {
    let mut sum = [0.0; 9];
    for (own, other) in [(&wings[0], &wings[1]), (&wings[1], &wings[0])] {
        let ([p0, p1], [q0, q1, q2]) = (own.p, own.q);
        let slope = [2.0 * p1 * q0 - p0 * q1, p1 * q1 - 2.0 * p0 * q2];
        let low = [p0 * slope[0], p0 * slope[1] + p1 * slope[0], p1 * slope[1]];
        let [a, b, c] = other.q;
        let square = [a * a, 2.0 * a * b, b * b + 2.0 * a * c, 2.0 * b * c, c * c];
        for (i, x) in low.iter().enumerate() {
            for (j, y) in square.iter().enumerate() {
                for (k, z) in [1.0, 2.0, 1.0].iter().enumerate() {
                    sum[i + j + k] += x * y * z;
                }
            }
        }
    }
    // The roots depend on no common factor; the threshold of rounding is relative.
    sum
}

/// The point on two rays that lie in one plane with the baseline.
fn meet(
    first: &BearingObservation,
    second: &BearingObservation,
    directions: [Vector3<f64>; 2],
) -> Option<Corrected> {
    let [a, b] = directions;
    let between = second.centre_in_world - first.centre_in_world;
    let normal = a.cross(&b);
    let n2 = normal.norm_squared();
    let depths_m = [between.cross(&b).dot(&normal) / n2, between.cross(&a).dot(&normal) / n2];
    let x_in_world =
        0.5 * (first.centre_in_world + a * depths_m[0] + second.centre_in_world + b * depths_m[1]);
    x_in_world.sum().is_finite().then_some(Corrected { x_in_world, bearings_in_world: directions, depths_m })
}

impl Chart {
    fn of(bearing_observation: &BearingObservation) -> Option<Self> {
        let rotation = bearing_observation.view.cam_from_world.rotation;
        let bearing = bearing_observation.bearing.into_inner();
        let (e1, e2) = if OBLIQUE < bearing.z { (Vector3::x(), Vector3::y()) } else { tangents(&bearing) };
        let (_, by_point) = bearing_observation.view.camera.project_with_jacobian(&bearing)?;
        let metric = Matrix2::from_columns(&[by_point * e1, by_point * e2]).try_inverse()?;
        Some(Chart {
            ray: bearing_observation.bearing_in_world,
            axes: [rotation.tr_mul(&e1), rotation.tr_mul(&e2)],
            covariance: metric * matrix_of(&bearing_observation.view.covariance_px2) * metric.transpose(),
        })
    }

    fn line(&self, normal: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(normal.dot(&self.axes[0]), normal.dot(&self.axes[1]))
    }

    fn wing(&self, start: &Vector3<f64>, end: &Vector3<f64>) -> Wing {
        let (a, b) = (self.line(start), self.line(end));
        let (va, vb) = (self.covariance * a, self.covariance * b);
        Wing { p: [start.dot(&self.ray), end.dot(&self.ray)], q: [a.dot(&va), 2.0 * a.dot(&vb), b.dot(&vb)] }
    }

    /// p²/q: squared change of the pixel over its variance.
    fn cost(&self, normal: &Vector3<f64>) -> f64 {
        let (p, l) = (normal.dot(&self.ray), self.line(normal));
        p * p / l.dot(&(self.covariance * l)).max(f64::MIN_POSITIVE)
    }

    /// The nearest direction in the plane, eq. (3).
    fn corrected(&self, normal: &Vector3<f64>) -> Vector3<f64> {
        let (p, l) = (normal.dot(&self.ray), self.line(normal));
        let vl = self.covariance * l;
        let y = vl * (-p / l.dot(&vl).max(f64::MIN_POSITIVE));
        (self.ray + self.axes[0] * y.x + self.axes[1] * y.y).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Pinhole;
    use crate::correspondence::PixelCovariance;
    use crate::multiview::triangulate::PointView;
    use crate::{Camera, CameraMatrix, Pixel, Pose, Vector6};

    /// Before any refinement: the plane found costs no more than the best of 20,000, for slips of up to 200 px and stretched noise.
    /// Neighbouring planes differ by 1.6e-4 rad, so that the best of them may cost 10⁻³ more than the minimum, never less.
    #[test]
    fn the_polynomial_finds_the_cheapest_plane() {
        let matrix = CameraMatrix { fx_px: 700.0, fy_px: 650.0, cx_px: 320.0, cy_px: 240.0 };
        let camera = Camera { lens: Pinhole { matrix }.into(), size: None };
        let poses = [
            Pose::exp(&Vector6::new(0.1, -0.2, 0.05, 0.3, 0.1, 0.0)),
            Pose::exp(&Vector6::new(-0.2, 0.5, 0.3, -1.4, 0.2, 0.4)),
        ];
        for i in 0..60 {
            let slip =
                |k: usize| Pixel::new(((i * 37 + k * 11) % 401) as f64, ((i * 53 + k * 29) % 401) as f64);
            let view = |k: usize| PointView {
                camera: &camera,
                cam_from_world: poses[k],
                covariance: None,
                intrinsics_covariance: None,
                pixel: Pixel::new(120.0, 40.0) + slip(k),
                covariance_px2: PixelCovariance { uu_px2: 1.0 + k as f64, uv_px2: 0.4, vv_px2: 0.5 },
            };
            let views = [view(0), view(1)];
            let bearing_observations =
                [BearingObservation::new(&views[0]).unwrap(), BearingObservation::new(&views[1]).unwrap()];
            let found = correct(&bearing_observations[0], &bearing_observations[1]).unwrap();
            let charts =
                [Chart::of(&bearing_observations[0]).unwrap(), Chart::of(&bearing_observations[1]).unwrap()];
            let cost = |n: &Vector3<f64>| charts[0].cost(n) + charts[1].cost(n);
            let baseline = bearing_observations[1].centre_in_world - bearing_observations[0].centre_in_world;
            let (a, b) = tangents(&baseline.normalize());
            let plane = |k: usize| {
                let (sin, cos) = (k as f64 * core::f64::consts::PI / 20_000.0).sin_cos();
                a * cos + b * sin
            };
            let least = (0..20_000).map(|k| cost(&plane(k))).fold(f64::INFINITY, f64::min);
            let own = cost(&baseline.cross(&found.bearings_in_world[0]).normalize());
            assert!(own <= least * (1.0 + 1e-9) + 1e-9, "{i}: {own} {least}");
            // Both corrected rays lie in one plane with the baseline.
            let [d, e] = found.bearings_in_world;
            assert!(baseline.dot(&d.cross(&e)).abs() < 1e-9, "{i}");
        }
    }
}
