//! The paper of Wang (2004)'s camera: closed-form correction from measured to ideal coordinates, negated perspective.
//!
//! Paper: F.-Y. Wang, A Simple and Analytical Procedure for Calibrating Extrinsic Camera Parameters, IEEE Trans. Robotics
//! and Automation, 2004, eq. (1) and Table I.
//!   c = (x, y) measured   Δ = c − (x_p, y_p)   r = |Δ|   W = (X, Y, Z) in the camera frame, Z > 0 visible
//!   d_x = Δx (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2Δx²) + 2 p2 Δx Δy
//!   d_y = Δy (1 + k1 r² + k2 r⁴ + k3 r⁶) + p2 (r² + 2Δy²) + a1 Δx + a2 Δy
//!   d(c) = −f/Z (X, Y)
//! As printed: d_y has no 2 p1 Δx Δy (Brown's decentring has one). All of it in the unit of f, which may be mm, px or 1.
//! Inside, lengths are divided by f: t = Δ/f. Valid field: the disc of t where d is safely one-to-one, docs/math/camera.md section 8.

use super::field::{
    GREATEST_SLOPE, INSIDE, ON_EDGE, RADIUS_CAP, RESIDUAL_PX, distance_is_usable, first_zero,
    invert_monotone, invert_plane, outside, solve,
};
use super::{IntrinsicsJacobian, Parameters, check_finite};
use crate::{Bearing, Error, Pixel, Point};
use nalgebra::{Matrix2, Matrix2x3, Unit, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The field ends where the correction reduces a length in some direction below this share: its inverse multiplies rounding by 1/0.05 there.
const LEAST_SLOPE: f64 = 0.05;

/// Table I of the paper. Lengths in one unit L, that of the image coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotogrammetricParameters {
    /// Focal length, L.
    pub f: f64,
    /// Principal point, L.
    pub xp: f64,
    /// Principal point, L.
    pub yp: f64,
    /// Radial distortion k1, k2, k3: L⁻², L⁻⁴, L⁻⁶.
    pub k: [f64; 3],
    /// Decentring distortion p1, p2: L⁻¹.
    pub p: [f64; 2],
    /// Affinity a1, a2: dimensionless.
    pub a: [f64; 2],
}

/// The model with its valid field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Photogrammetric {
    parameters: PhotogrammetricParameters,
    /// k and p for lengths in units of f.
    k: [f64; 3],
    p: [f64; 2],
    radius_max: f64,
}

impl Photogrammetric {
    /// The name in files and messages.
    pub const NAME: &'static str = "photogrammetric";

    /// # Errors
    /// `InvalidCamera` for a value that is not finite, f ≤ 0, or an affinity that mirrors the image.
    pub fn new(parameters: PhotogrammetricParameters) -> Result<Self, Error> {
        for (name, value) in named(&parameters) {
            check_finite(name, value)?;
        }
        let PhotogrammetricParameters { f, k, p, a, .. } = parameters;
        if f <= 0.0 {
            return Err(Error::InvalidCamera {
                parameter: "f",
                seen: f,
                needed: "a focal length is positive",
            });
        }
        let f2 = f * f;
        let mut model = Photogrammetric {
            parameters,
            k: [k[0] * f2, k[1] * f2 * f2, k[2] * f2 * f2 * f2],
            p: p.map(|p| p * f),
            radius_max: 0.0,
        };
        model.radius_max = model.one_to_one_radius();
        if !(0.0 < model.radius_max) {
            let needed =
                "the affinity a1, a2 must leave the image the right way round: (1 + a2/2)² > (a1² + a2²)/4";
            return Err(Error::InvalidCamera { parameter: "a", seen: a[1], needed });
        }
        Ok(model)
    }

    /// Returns Table I as given.
    pub fn table(&self) -> PhotogrammetricParameters {
        self.parameters
    }

    /// Returns the distance from the principal point up to which the correction is one-to-one, in the unit of f.
    pub fn radius_max(&self) -> f64 {
        self.radius_max * self.parameters.f
    }

    /// Returns the radius at which the derivative's symmetric part falls to `LEAST_SLOPE`, camera.md eq. (17).
    fn one_to_one_radius(&self) -> f64 {
        let [k1, k2, k3] = self.k;
        let [p1, p2] = self.p;
        let [a1, a2] = self.parameters.a;
        let floor = 1.0 + 0.5 * (a2 - a1.hypot(a2)) - LEAST_SLOPE;
        // Largest Frobenius norm of the decentring term's symmetric part on the unit circle, eq. (18).
        let (xx, yy, xy) = (36.0 * p1 * p1 + 8.0 * p2 * p2, 2.0 * p1 * p1 + 40.0 * p2 * p2, 16.0 * p1 * p2);
        let decentring = (0.5 * (xx + yy) + (0.5 * (xx - yy)).hypot(xy)).sqrt();
        let side = [floor, -decentring, k1, 0.0, k2, 0.0, k3];
        let fold = [floor, -decentring, 3.0 * k1, 0.0, 5.0 * k2, 0.0, 7.0 * k3];
        let mut stretch = fold.map(|c| -c);
        stretch[0] = GREATEST_SLOPE;
        let radius = first_zero(&stretch, first_zero(&side, first_zero(&fold, RADIUS_CAP)));
        let radial = |r: f64| {
            let t = r * r;
            let (g, slope) = (1.0 + t * (k1 + t * (k2 + t * k3)), fold[2] + t * (fold[4] + t * fold[6]));
            (r * g, 1.0 + t * slope)
        };
        if radial(radius).0 <= RADIUS_CAP { radius } else { invert_monotone(radial, RADIUS_CAP, radius) }
    }

    /// Returns d/f at t, with its derivative.
    #[inline]
    fn correct(&self, t: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [k1, k2, k3] = self.k;
        let [p1, p2] = self.p;
        let [a1, a2] = self.parameters.a;
        let (x, y) = (t.x, t.y);
        let r2 = x * x + y * y;
        let g = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let dg = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let value = Vector2::new(
            x * g + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y,
            y * g + p2 * (r2 + 2.0 * y * y) + a1 * x + a2 * y,
        );
        let slope = Matrix2::new(
            g + x * x * dg + 6.0 * p1 * x + 2.0 * p2 * y,
            x * y * dg + 2.0 * p1 * y + 2.0 * p2 * x,
            x * y * dg + 2.0 * p2 * x + a1,
            g + y * y * dg + 6.0 * p2 * y + a2,
        );
        (value, slope)
    }

    /// Returns t with d(t)/f = −(X, Y)/Z.
    fn measured(&self, x: &Point) -> Option<Vector2<f64>> {
        let target = Vector2::new(-x.x / x.z, -x.y / x.z);
        let visible = 0.0 < x.z && distance_is_usable(x.z * x.z) && target.norm_squared() < 1e4;
        if !visible {
            return None;
        }
        let rounding = 16.0 * f64::EPSILON * target.norm();
        let tolerance = rounding.max(RESIDUAL_PX * LEAST_SLOPE / self.parameters.f.max(1.0));
        invert_plane(|t| self.correct(t), &target, target, self.radius_max, tolerance)
    }

    /// Returns the measured coordinates of t.
    fn coordinates(&self, t: &Vector2<f64>) -> Pixel {
        let PhotogrammetricParameters { f, xp, yp, .. } = self.parameters;
        Vector2::new(xp + f * t.x, yp + f * t.y)
    }

    /// See `Camera::project`; in the unit of f.
    pub fn project(&self, x_in_cam: &Point) -> Option<Pixel> {
        Some(self.coordinates(&self.measured(x_in_cam)?))
    }

    /// See `Camera::project_with_jacobian`; in the unit of f.
    pub fn project_with_jacobian(&self, x_in_cam: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let t = self.measured(x_in_cam)?;
        let (value, slope) = self.correct(&t);
        let iz = 1.0 / x_in_cam.z;
        // ∂(−X/Z, −Y/Z)/∂W = −(1/Z) [I | d/f]
        let across = slope.try_inverse()? * (-iz * self.parameters.f);
        let along = across * value;
        let jacobian = Matrix2x3::new(across.m11, across.m12, along.x, across.m21, across.m22, along.y);
        Some((self.coordinates(&t), jacobian))
    }

    /// See `Camera::bearing`; closed form.
    pub fn bearing(&self, pixel: &Pixel) -> Result<Bearing, Error> {
        let PhotogrammetricParameters { f, xp, yp, .. } = self.parameters;
        let t = Vector2::new((pixel.x - xp) / f, (pixel.y - yp) / f);
        let radius = t.norm();
        if !(radius <= self.radius_max * ON_EDGE) {
            return Err(outside(
                pixel,
                Self::NAME,
                "distance from the principal point up to",
                self.radius_max(),
            ));
        }
        let on_edge = radius > self.radius_max * INSIDE;
        let t = if on_edge { t * (self.radius_max * INSIDE / radius) } else { t };
        let (value, _) = self.correct(&t);
        Ok(Unit::new_normalize(Vector3::new(-value.x, -value.y, 1.0)))
    }

    /// Order: f, xp, yp, k1, k2, k3, p1, p2, a1, a2.
    pub fn intrinsics_jacobian(&self, x: &Point) -> Option<IntrinsicsJacobian> {
        let t = self.measured(x)?;
        let (ideal, slope) = self.correct(&t);
        let f = self.parameters.f;
        // d(c) = f·ideal is fixed by the point, so ∂c/∂ζ = slope⁻¹ (∂(f ideal)/∂ζ − ∂d/∂ζ), camera.md eq. (19).
        let delta = t * f;
        let r2 = delta.norm_squared();
        let (x, y) = (delta.x, delta.y);
        let change = |by: Vector2<f64>| solve(&slope, &by);
        let mut columns = IntrinsicsJacobian::new();
        columns.push(change(ideal)?);
        columns.push(Vector2::new(1.0, 0.0));
        columns.push(Vector2::new(0.0, 1.0));
        for by in [
            delta * r2,
            delta * (r2 * r2),
            delta * (r2 * r2 * r2),
            Vector2::new(r2 + 2.0 * x * x, 0.0),
            Vector2::new(2.0 * x * y, r2 + 2.0 * y * y),
            Vector2::new(0.0, x),
            Vector2::new(0.0, y),
        ] {
            columns.push(change(-by)?);
        }
        Some(columns)
    }

    /// Names and values, in the order of `intrinsics_jacobian`.
    pub fn parameters(&self) -> Parameters {
        named(&self.parameters).into_iter().collect()
    }

    /// Returns the same model with other values, in the order of `parameters`.
    pub(super) fn rebuilt(&self, values: &[f64]) -> Result<Self, Error> {
        Self::new(PhotogrammetricParameters {
            f: values[0],
            xp: values[1],
            yp: values[2],
            k: [values[3], values[4], values[5]],
            p: [values[6], values[7]],
            a: [values[8], values[9]],
        })
    }

    /// Returns the same lens for image lengths `s` times as long, with pixel centres at whole numbers.
    pub(super) fn scaled(&self, s: f64) -> Result<Self, Error> {
        let PhotogrammetricParameters { f, xp, yp, k, p, a } = self.parameters;
        let s2 = s * s;
        Self::new(PhotogrammetricParameters {
            f: f * s,
            xp: (xp + 0.5) * s - 0.5,
            yp: (yp + 0.5) * s - 0.5,
            k: [k[0] / s2, k[1] / (s2 * s2), k[2] / (s2 * s2 * s2)],
            p: p.map(|p| p / s),
            a,
        })
    }
}

fn named(t: &PhotogrammetricParameters) -> [(&'static str, f64); 10] {
    let PhotogrammetricParameters { f, xp, yp, k: [k1, k2, k3], p: [p1, p2], a: [a1, a2] } = *t;
    [
        ("f", f),
        ("xp", xp),
        ("yp", yp),
        ("k1", k1),
        ("k2", k2),
        ("k3", k3),
        ("p1", p1),
        ("p2", p2),
        ("a1", a1),
        ("a2", a2),
    ]
}
