//! Distortion of the normalised plane as OpenCV writes it: rational radial, tangential, thin prism.
//!
//!   r² = x² + y²    g = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
//!   x' = x g + 2 p1 x y + p2 (r² + 2x²) + s1 r² + s2 r⁴
//!   y' = y g + p1 (r² + 2y²) + 2 p2 x y + s3 r² + s4 r⁴
//!
//! Valid field: the disc on which the symmetric part of the derivative is positive definite, hence the map is one-to-one
//! (docs/math/camera.md section 2). Used by Brown–Conrady and, with k1, k2, p1, p2, by omni.

use super::field::{GREATEST_SLOPE, INSIDE, ON_EDGE, RADIUS_CAP, first_zero, invert_monotone, invert_plane};
use nalgebra::{Matrix2, Vector2};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The field ends before a pole of g, where the derivative exceeds `GREATEST_SLOPE`. A denominator may nearly vanish together with its numerator
/// and leave a harmless map; below this value only rounding remains of it.
const LEAST_DENOMINATOR: f64 = 1e-6;
/// Rounding of numerator and denominator, in units of their terms.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Coefficients and the field in which they are valid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlaneDistortion {
    numerator: [f64; 3],
    denominator: [f64; 3],
    p: [f64; 2],
    s: [f64; 4],
    is_radial: bool,
    is_polynomial: bool,
    has_prism: bool,
    radius_max: f64,
    r2_max: f64,
    /// Largest radius to which a point of the field is mapped.
    image_radius_max: f64,
}

impl PlaneDistortion {
    /// Creates a distortion; `c` is in OpenCV's order, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4, of any length; the rest is zero. The field is also
    /// limited by `radius_cap`.
    pub fn new(c: &[f64], radius_cap: f64) -> Self {
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        let mut plane = PlaneDistortion {
            numerator: [at(0), at(1), at(4)],
            denominator: [at(5), at(6), at(7)],
            p: [at(2), at(3)],
            s: [at(8), at(9), at(10), at(11)],
            is_radial: c.iter().enumerate().all(|(i, &v)| (i < 2 || (4..8).contains(&i)) || v == 0.0),
            has_prism: [8, 9, 10, 11].map(at) != [0.0; 4],
            is_polynomial: [5, 6, 7].map(at) == [0.0; 3],
            radius_max: 0.0,
            r2_max: 0.0,
            image_radius_max: 0.0,
        };
        let mut radius = plane.one_to_one_radius(radius_cap.min(RADIUS_CAP));
        if !(plane.radial(radius).0 <= RADIUS_CAP) {
            radius = invert_monotone(|r| plane.radial(r), RADIUS_CAP, radius) * INSIDE;
        }
        let [s1, s2, s3, s4] = plane.s;
        let r2 = radius * radius;
        let asymmetric = 3.0 * plane.p[0].hypot(plane.p[1]) + s1.hypot(s3) + s2.hypot(s4) * r2;
        plane.radius_max = radius;
        plane.r2_max = r2;
        plane.image_radius_max = (plane.radial(radius).0 + asymmetric * r2) * ON_EDGE;
        plane
    }

    /// Returns the radius of the disc on which the derivative's symmetric part is positive definite, camera.md eq. (6).
    fn one_to_one_radius(&self, cap: f64) -> f64 {
        let n = [1.0, self.numerator[0], self.numerator[1], self.numerator[2]];
        let d = [1.0, self.denominator[0], self.denominator[1], self.denominator[2]];
        let [s1, s2, s3, s4] = self.s;
        let b1 = 6.0 * self.p[0].hypot(self.p[1]) + 2.0 * s1.hypot(s3);
        let b3 = 4.0 * s2.hypot(s4);
        // Index = power of r; n and d are polynomials in s = r², d/ds brings the factor 2j below.
        let mut fold = [0.0; 16];
        let mut side = [0.0; 16];
        let mut pole = [0.0; 16];
        let mut stretch = [0.0; 16];
        for i in 0..4 {
            pole[2 * i] = d[i];
            side[2 * i] += n[i];
            side[2 * i + 1] -= b1 * d[i];
            side[2 * i + 3] -= b3 * d[i];
            for j in 0..4 {
                // n d + 2 s (n' d − n d')
                let slope = n[i] * d[j] * (1.0 + 2.0 * (i as f64 - j as f64));
                fold[2 * (i + j)] += slope;
                stretch[2 * (i + j)] += GREATEST_SLOPE * d[i] * d[j] - slope;
                fold[2 * (i + j) + 1] -= b1 * d[i] * d[j];
                fold[2 * (i + j) + 3] -= b3 * d[i] * d[j];
            }
        }
        pole[0] -= LEAST_DENOMINATOR;
        let cap = first_zero(&pole, cap);
        [fold, side, stretch].iter().fold(cap, |cap, condition| first_zero(condition, cap))
    }

    /// Returns the radius of the valid field on the undistorted plane.
    pub fn radius_max(&self) -> f64 {
        self.radius_max
    }

    /// Returns the square of `radius_max`.
    #[inline]
    pub fn r2_max(&self) -> f64 {
        self.r2_max
    }

    /// Returns g and dg/d(r²).
    #[inline]
    fn gain(&self, r2: f64) -> (f64, f64) {
        let [k1, k2, k3] = self.numerator;
        let [k4, k5, k6] = self.denominator;
        let n = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let dn = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        if self.is_polynomial {
            return (n, dn);
        }
        let d = 1.0 / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
        let dd = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
        let g = n * d;
        (g, (dn - g * dd) * d)
    }

    /// Returns the rounding error of the distorted radius at r: large where the denominator nearly cancels.
    fn rounding(&self, r: f64) -> f64 {
        if self.is_polynomial {
            return 0.0;
        }
        let s = r * r;
        let [k4, k5, k6] = self.denominator;
        let terms = 1.0 + s * (k4.abs() + s * (k5.abs() + s * k6.abs()));
        let denominator = 1.0 + s * (k4 + s * (k5 + s * k6));
        ROUNDING * terms * r / denominator.abs()
    }

    /// Returns r g and its derivative with respect to r.
    fn radial(&self, r: f64) -> (f64, f64) {
        let r2 = r * r;
        let (g, dg) = self.gain(r2);
        (r * g, g + 2.0 * r2 * dg)
    }

    /// Returns the distorted point.
    #[inline]
    pub fn apply(&self, q: &Vector2<f64>) -> Vector2<f64> {
        let r2 = q.norm_squared();
        let (g, _) = self.gain(r2);
        if self.is_radial { q * g } else { q * g + self.asymmetric(q, r2) }
    }

    /// Returns the distorted point and its derivative.
    #[inline]
    pub fn apply_with_jacobian(&self, q: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (x, y) = (q.x, q.y);
        let r2 = x * x + y * y;
        let (g, dg) = self.gain(r2);
        let cross = 2.0 * x * y * dg;
        let radial = Matrix2::new(g + 2.0 * x * x * dg, cross, cross, g + 2.0 * y * y * dg);
        if self.is_radial {
            return (q * g, radial);
        }
        let [p1, p2] = self.p;
        let mixed = 2.0 * (p1 * x + p2 * y);
        let mut slope =
            radial + Matrix2::new(2.0 * p1 * y + 6.0 * p2 * x, mixed, mixed, 6.0 * p1 * y + 2.0 * p2 * x);
        if self.has_prism {
            let [s1, s2, s3, s4] = self.s;
            let (prism_x, prism_y) = (2.0 * s1 + 4.0 * s2 * r2, 2.0 * s3 + 4.0 * s4 * r2);
            slope += Matrix2::new(prism_x * x, prism_x * y, prism_y * x, prism_y * y);
        }
        (q * g + self.asymmetric(q, r2), slope)
    }

    #[inline]
    fn asymmetric(&self, q: &Vector2<f64>, r2: f64) -> Vector2<f64> {
        let (x, y) = (q.x, q.y);
        let [p1, p2] = self.p;
        let cross = 2.0 * x * y;
        let tangential =
            Vector2::new(p1 * cross + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + p2 * cross);
        if !self.has_prism {
            return tangential;
        }
        let [s1, s2, s3, s4] = self.s;
        tangential + Vector2::new(s1 + s2 * r2, s3 + s4 * r2) * r2
    }

    /// Returns the point of the field that is distorted to `target`, within `tolerance`; `None` when there is none.
    pub fn invert(&self, target: &Vector2<f64>, tolerance: f64) -> Option<Vector2<f64>> {
        let distorted = target.norm();
        if distorted == 0.0 {
            return Some(Vector2::zeros());
        }
        if !(distorted <= self.image_radius_max) {
            return None;
        }
        let radius = self.radius_max * INSIDE;
        if self.is_radial {
            let r = invert_monotone(|r| self.radial(r), distorted, radius);
            let tolerance = tolerance.max(self.rounding(r));
            return ((self.radial(r).0 - distorted).abs() <= tolerance).then(|| target * (r / distorted));
        }
        let tolerance = tolerance.max(self.rounding(distorted.min(radius)));
        let from = |start| invert_plane(|q| self.apply_with_jacobian(q), target, start, radius, tolerance);
        // A rough start is enough almost everywhere; near a fold the radial solution is used.
        let (gain, _) = self.gain(distorted.min(radius).powi(2));
        from(target / gain).or_else(|| {
            let r = invert_monotone(|r| self.radial(r), distorted, radius);
            from(target * (r / distorted))
        })
    }

    /// Returns the derivatives of the distorted point with respect to the coefficients, in OpenCV's order.
    #[inline]
    pub fn coefficient_derivatives(&self, q: &Vector2<f64>) -> [Vector2<f64>; 12] {
        let r2 = q.norm_squared();
        let (r4, r6) = (r2 * r2, r2 * r2 * r2);
        let [k4, k5, k6] = self.denominator;
        let per_d = 1.0 / (1.0 + k4 * r2 + k5 * r4 + k6 * r6);
        let (g, _) = self.gain(r2);
        let (upper, lower) = (q * per_d, q * (-g * per_d));
        [
            upper * r2,
            upper * r4,
            Vector2::new(2.0 * q.x * q.y, r2 + 2.0 * q.y * q.y),
            Vector2::new(r2 + 2.0 * q.x * q.x, 2.0 * q.x * q.y),
            upper * r6,
            lower * r2,
            lower * r4,
            lower * r6,
            Vector2::new(r2, 0.0),
            Vector2::new(r4, 0.0),
            Vector2::new(0.0, r2),
            Vector2::new(0.0, r4),
        ]
    }
}
