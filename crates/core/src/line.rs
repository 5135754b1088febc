//! Straight lines: the knowledge about a line in the target, and its observation in an image.
//!
//! An image line is given by two points anywhere along it: only their distances perpendicular to it are measurements. Through the lens they
//! become two bearings, whose plane contains the line in space, whatever the lens does to its image. docs/math/lines.md, section 1.

use crate::{Bearing, Camera, Error, Pixel, Point};
use nalgebra::{Matrix3x2, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A straight line as observed in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageLine {
    /// Two points on it, px: the greater their distance, the more certain its direction.
    pub ends_px: [Pixel; 2],
    /// Unit vectors towards them, camera frame.
    pub bearings: [Bearing; 2],
    /// Derivatives of the bearings with respect to the pixels, rad/px (3×2).
    pub bearing_by_pixel: [Matrix3x2<f64>; 2],
    /// Standard deviation of each end, perpendicular to the line, px.
    pub sigma_px: f64,
}

/// A line of the target and its image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineCorrespondence {
    /// A point on it, target frame, metres; `None` where only the direction is known (the second edge of a road of unknown width).
    pub point_in_target: Option<Point>,
    /// Its direction in the target frame; the opposite direction describes the same line.
    pub direction_in_target: Unit<Vector3<f64>>,
    /// Its observation.
    pub seen: ImageLine,
}

/// Sine of the angle between the ends below which they count as one point.
const MIN_SINE: f64 = 1e-9;

impl ImageLine {
    /// Creates a line from two pixels and their standard deviation perpendicular to the line.
    ///
    /// # Errors
    /// `OutsideField` for an end to which no point projects, `NotPositive` for the sigma, `Coincident` for ends that are the same point.
    pub fn new(camera: &Camera, ends_px: [Pixel; 2], sigma_px: f64) -> Result<Self, Error> {
        if !(0.0 < sigma_px && sigma_px < f64::INFINITY) {
            return Err(Error::NotPositive { index: 0, seen: sigma_px });
        }
        let bearings = [camera.bearing(&ends_px[0])?, camera.bearing(&ends_px[1])?];
        if !(MIN_SINE < bearings[0].cross(&bearings[1]).norm()) {
            return Err(Error::Coincident { first: 0, second: 1, where_: "in the image" });
        }
        let derivative = |i: usize| bearing_by_pixel(camera, &bearings[i], &ends_px[i]);
        let bearing_by_pixel = [derivative(0)?, derivative(1)?];
        Ok(ImageLine { ends_px, bearings, bearing_by_pixel, sigma_px })
    }

    /// Returns the unit normal of the plane through the camera centre and the line.
    pub fn normal(&self) -> Unit<Vector3<f64>> {
        let [a, b] = self.bearings.map(|b| b.into_inner());
        Unit::new_normalize(a.cross(&(b - a)))
    }

    /// Returns the standard deviation of the product of end `i` with a plane normal `m` (of any length), docs/math/lines.md eq. (2).
    pub(crate) fn product_sigma(&self, i: usize, m: &Vector3<f64>) -> f64 {
        self.sigma_px * self.bearing_by_pixel[i].tr_mul(m).norm()
    }

    /// Returns the distances of the two ends from the image of a plane through the camera centre with normal `m`, in standard deviations,
    /// docs/math/lines.md eq. (2).
    pub fn residuals(&self, m: &Vector3<f64>) -> [f64; 2] {
        [0, 1].map(|i| self.plane_residual(i, m).0)
    }

    /// Returns the residual of end `i` and its derivative with respect to `m`, docs/math/lines.md eqs. (2), (6).
    pub(crate) fn plane_residual(&self, i: usize, m: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let (b, j) = (self.bearings[i].into_inner(), &self.bearing_by_pixel[i]);
        let across = j.tr_mul(m);
        let scale = 1.0 / (self.sigma_px * across.norm());
        let product = m.dot(&b);
        (product * scale, (b - j * across * (product / across.norm_squared())) * scale)
    }

    /// Returns the residual between a direction in the camera frame and the image line, in standard deviations, and its derivative with respect
    /// to the direction, docs/math/lines.md eqs. (3)–(4).
    pub(crate) fn direction_residual(&self, v: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let [a, b] = self.bearings.map(|b| b.into_inner());
        let n = a.cross(&(b - a));
        let (by_a, by_b) =
            (self.bearing_by_pixel[0].tr_mul(&b.cross(v)), self.bearing_by_pixel[1].tr_mul(&v.cross(&a)));
        let variance = (by_a.norm_squared() + by_b.norm_squared()) * self.sigma_px * self.sigma_px;
        let (g, scale) = (n.dot(v), variance.sqrt().recip());
        // dvariance/dv = 2 σ² ( [b]ₓᵀ Jₐ Jₐᵀ (b × v) − [a]ₓᵀ J_b J_bᵀ (v × a) ), and [b]ₓᵀ y = y × b.
        let slope = (self.bearing_by_pixel[0] * by_a).cross(&b) + a.cross(&(self.bearing_by_pixel[1] * by_b));
        let slope = slope * (self.sigma_px * self.sigma_px);
        (g * scale, (n - slope * (g / variance)) * scale)
    }
}

/// Returns the inverse of the projection's derivative on the plane perpendicular to the bearing.
fn bearing_by_pixel(camera: &Camera, bearing: &Bearing, pixel: &Pixel) -> Result<Matrix3x2<f64>, Error> {
    let outside = Error::OutsideField {
        u_px: pixel.x,
        v_px: pixel.y,
        model: camera.model_name(),
        limit: "derivative of the projection",
        limit_at: 0.0,
    };
    let (_, derivative) = camera.project_with_jacobian(&bearing.into_inner()).ok_or(outside.clone())?;
    let b = bearing.into_inner();
    let x = b.cross(&least_axis(&b)).normalize();
    let across = Matrix3x2::from_columns(&[x, b.cross(&x)]);
    let inverse = (derivative * across).try_inverse().ok_or(outside)?;
    Ok(across * inverse)
}

/// Returns the coordinate axis farthest from a direction.
fn least_axis(b: &Vector3<f64>) -> Vector3<f64> {
    let least = b.iamin();
    Vector3::from_fn(|i, _| if i == least { 1.0 } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn line() -> ImageLine {
        let camera = Camera::normalized();
        ImageLine::new(&camera, [Pixel::new(-0.3, 0.4), Pixel::new(0.5, 0.1)], 1e-3).expect("a line")
    }

    /// The derivatives of the bearing with respect to the pixel, and of both residuals with respect to direction and plane, agree to six digits.
    #[test]
    fn derivatives_match_central_differences() {
        let (camera, line, h) = (Camera::normalized(), line(), 1e-6);
        for (end, axis) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let moved = |by: f64| {
                let mut pixel = line.ends_px[end];
                pixel[axis] += by;
                camera.bearing(&pixel).expect("a bearing").into_inner()
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((difference - line.bearing_by_pixel[end].column(axis)).norm() < 1e-9);
        }
        let v = Vector3::new(0.8, -0.2, 0.3);
        let (_, derivative) = line.direction_residual(&v);
        let (_, by_plane) = line.plane_residual(1, &v);
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut v = v;
                v[axis] += by;
                Vector2::new(line.direction_residual(&v).0, line.plane_residual(1, &v).0)
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            assert!((difference.x - derivative[axis]).abs() < 1e-6 * derivative.norm(), "{axis}");
            assert!((difference.y - by_plane[axis]).abs() < 1e-6 * by_plane.norm(), "{axis}");
        }
    }

    /// For a pinhole the residual is the pixel distance from the line, to second order in it.
    #[test]
    fn residual_is_the_distance_across_the_line() {
        let line = line();
        let [a, b] = line.ends_px;
        let along = (b - a).normalize();
        let across = crate::Pixel::new(-along.y, along.x);
        let beside = ImageLine::new(&Camera::normalized(), [a + across * 1e-5, b + across * 3e-5], 1e-3)
            .expect("a line");
        let [ra, rb] = beside.residuals(&line.normal());
        assert!((ra.abs() - 1e-2).abs() < 1e-6 && (rb.abs() - 3e-2).abs() < 1e-6, "{ra} {rb}");
    }

    #[test]
    fn lines_that_are_none_are_refused() {
        let camera = Camera::normalized();
        let a = Pixel::new(0.1, 0.2);
        let refused = |ends, sigma| ImageLine::new(&camera, ends, sigma).is_err();
        assert!(
            refused([a, a], 1.0)
                && refused([a, Pixel::zeros()], 0.0)
                && refused([a, Pixel::zeros()], f64::NAN)
        );
        assert!(refused([a, Pixel::new(f64::NAN, 0.0)], 1.0));
    }
}
