//! Real roots of the low-degree polynomials behind the closed forms.
//!
//! A quartic is split into two real quadratics. Each quadratic is polished as a whole (Bairstow), so that a nearly
//! double root inside one of them costs no digits of the factor; only then is it solved. Both are worked side by side.
//! Derivation and the choice of the split: docs/math/p3p.md, section 3.

pub mod bernstein;
pub mod arc;
pub mod eigen;

use nalgebra::Vector2;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Two real monic quadratics x² + `linear` x + `constant`, one in each row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factors {
    /// Coefficients of x.
    pub linear: Vector2<f64>,
    /// Constant terms.
    pub constant: Vector2<f64>,
}

impl Factors {
    /// Splits x⁴ + a₃x³ + a₂x² + a₁x + a₀, given as `[a0, a1, a2, a3]`; good to 1e-7 or so, see [`Factors::polished`].
    ///
    /// Real roots are paired in order of size (the two smallest, the two largest), complex ones with their conjugates.
    #[inline]
    pub fn of_quartic(a: &[f64; 4]) -> Self {
        let (b, c, d, e) = (0.25 * a[3], a[2] * (1.0 / 6.0), 0.25 * a[1], a[0]);
        let bb = b * b;
        let h = c - bb;
        let i = e - 4.0 * (b * d) + 3.0 * (c * c);
        let j = e * h + c * (2.0 * (b * d) - c * c) - d * d;
        let g = d - b * (3.0 * c - 2.0 * bb);
        let tau = resolvent_root(i * (1.0 / 3.0), -j, 2.0 * h);
        let alpha2 = (2.0 * (tau - 2.0 * h)).max(0.0);
        let alpha = alpha2.sqrt();
        let mean = tau + h;
        // α² is off by ε times the scale of the resolvent, which h alone is not: it vanishes for (x² − a²)(x² + a²).
        let half_gap = if 1e-20 * (h * h + i.abs()) < alpha2 * alpha2 {
            2.0 * g * (1.0 / alpha2) * alpha // side by side with the square root; 2g/α would wait for it
        } else {
            (mean * mean - (i - 3.0 * h * h)).max(0.0).sqrt().copysign(g)
        };
        // (z² + αz + mean − half_gap)(z² − αz + mean + half_gap), moved back to x = z − b.
        let shift = bb + mean;
        let skew = alpha * b - half_gap;
        Factors {
            linear: Vector2::new(2.0 * b + alpha, 2.0 * b - alpha),
            constant: Vector2::new(shift + skew, shift - skew),
        }
    }

    /// One Newton step on each factor of the quartic (Bairstow): quadratic convergence even where the factor's own two
    /// roots coincide.
    #[inline]
    pub fn polished(&self, a: &[f64; 4]) -> Self {
        let [a0, a1, a2, a3] = a.map(Vector2::repeat);
        let (p, q) = (self.linear, self.constant);
        // Quotient x² + b x + c, remainder r1 x + r0.
        let b = a3 - p;
        let c = a2 - q - p.component_mul(&b);
        let r1 = a1 - p.component_mul(&c) - q.component_mul(&b);
        let r0 = a0 - q.component_mul(&c);
        // The remainder of the quotient by the factor, k x + l, gives the derivative.
        let (k, l) = (b - p, c - q);
        let determinant = l.component_mul(&l) - k.component_mul(&(p.component_mul(&l) - q.component_mul(&k)));
        // Zero when the factors share a root: then they stay as they are.
        let inverse = determinant.map(|d| if d == 0.0 { 0.0 } else { 1.0 / d });
        // (k x + l)(δp x + δq) ≡ r1 x + r0 modulo the factor.
        let step_p = r1.component_mul(&l) - r0.component_mul(&k);
        let step_q = r0.component_mul(&(l - p.component_mul(&k))) + r1.component_mul(&q.component_mul(&k));
        Factors { linear: p + step_p.component_mul(&inverse), constant: q + step_q.component_mul(&inverse) }
    }

    /// The real roots without cancellation, NaN where there is none. A complex pair whose imaginary part is below
    /// `blur` gives its real part once: rounding turns a double root into such a pair as often as into two real ones.
    #[inline]
    pub fn real_roots(&self, blur: f64) -> [f64; 4] {
        let half = self.linear * -0.5;
        let discriminant = half.component_mul(&half) - self.constant;
        let nan_below = |least: f64| move |x: f64, d: f64| if d < least { f64::NAN } else { x };
        let centre = half.zip_map(&discriminant, nan_below(-blur * blur));
        let product = self.constant.zip_map(&discriminant, nan_below(f64::MIN_POSITIVE));
        let far = centre + discriminant.zip_map(&half, |d, h| d.max(0.0).sqrt().copysign(h));
        let near = product.component_div(&far);
        [far.x, near.x, far.y, near.y]
    }
}

/// The root of the resolvent t³ − 3 p t − 2 q that splits a quartic best: the largest, unless it nearly coincides with the
/// second; then the smallest, the one that is still well separated, if it is above `least` and so gives real factors.
#[inline]
fn resolvent_root(p: f64, q: f64, least: f64) -> f64 {
    let discriminant = q * q - p * p * p;
    if 0.0 < discriminant {
        let cube = q.abs() + discriminant.sqrt();
        let w = inverse_cube_root(cube);
        return (w * (cube * w + p)).copysign(q);
    }
    let root = p.max(0.0).sqrt();
    let cosine = q * root * (1.0 / (p * p).max(f64::MIN_POSITIVE));
    let excess = (1.0 + cosine).clamp(0.0, 2.0);
    // Near −1 the smallest root is cos(π − …) = −1 + e/9 + (4/3)(e/9)², with e = 1 + cosine.
    let smallest = 2.0 * root * (-1.0 + excess * (1.0 / 9.0) + excess * excess * (4.0 / 243.0));
    if excess < 1e-3 && least < smallest {
        return smallest;
    }
    2.0 * root * cosine_of_two_thirds((0.5 * excess).sqrt())
}

/// cos(⅔ arccos s) on [0, 1] to 5e-10: Chebyshev fit, which the polishing of the factors makes good.
#[inline]
fn cosine_of_two_thirds(s: f64) -> f64 {
    let pair = |a: f64, b: f64| a + b * s;
    let s2 = s * s;
    let s4 = s2 * s2;
    let low = pair(0.500_000_000_475_432_8, 0.577_350_170_559_073_9)
        + s2 * pair(-0.111_107_702_920_325_29, 0.053_412_057_474_713_84);
    let middle = pair(-0.032_595_931_606_471_73, 0.021_509_111_524_157_958)
        + s2 * pair(-0.013_436_705_983_048_611, 0.006_784_710_241_862_33);
    let high = pair(-0.002_280_393_712_086_849_5, 0.000_364_684_299_528_016_04);
    low + s4 * (middle + s4 * high)
}

/// x^(−1/3) of a positive number to 3e-14: a third of the exponent's bits gives 3 %, a Chebyshev fit of (1 − r)^(−1/3) 1e-7,
/// a Newton step the rest.
#[inline]
fn inverse_cube_root(x: f64) -> f64 {
    let residue = |y: f64| 1.0 - x * (y * y * y);
    let y = f64::from_bits(0x553E_E90F_F972_4746 - x.to_bits() / 3);
    let r = residue(y); // |r| < 0.103
    let low = 1.0 + 0.333_328_981_592_051_3 * r;
    let high = 0.222_218_352_726_258_26 + 0.174_492_824_305_045_84 * r;
    let y = y * (low + r * r * (high + r * r * 0.145_502_927_897_445_62));
    y + y * (1.0 / 3.0) * residue(y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrayvec::ArrayVec;

    /// Real roots of the quartic `[a0, a1, a2, a3]` (monic), each once per multiplicity, unordered.
    fn quartic_real_roots(a: &[f64; 4]) -> ArrayVec<f64, 4> {
        let factors = Factors::of_quartic(a).polished(a).polished(a);
        factors.real_roots(0.0).into_iter().filter(|root| !root.is_nan()).collect()
    }

    /// Monic quartic with the given roots.
    fn quartic(roots: [f64; 4]) -> [f64; 4] {
        let mut a = [1.0, 0.0, 0.0, 0.0, 0.0];
        for (degree, root) in roots.into_iter().enumerate() {
            for i in (0..=degree).rev() {
                a[i + 1] -= root * a[i];
            }
        }
        [a[4], a[3], a[2], a[1]]
    }

    #[test]
    fn roots_of_a_product_are_its_factors_roots() {
        let cases = [
            ([-3.0, -1.0, 0.5, 2.0], 1e-13),
            ([1.0, 2.0, 3.0, 4.0], 1e-12),
            ([-2e-6, 1e-6, 3.0, 5.0], 1e-13), // two scales, as for a nearly straight triple
            ([-1.0, 0.7, 0.7 + 1e-4, 3.0], 1e-9), // the middle pair close: the other pairing
            ([-1.0, -1.0 + 1e-4, 0.7, 3.0], 1e-9),
            ([-2.0, -1.0, 1.0, 2.0], 1e-13), // biquadratic
        ];
        for (expected, tolerance) in cases {
            let mut found = quartic_real_roots(&quartic(expected));
            found.sort_unstable_by(f64::total_cmp);
            assert_eq!(found.len(), 4, "{expected:?}");
            for (x, y) in found.iter().zip(expected) {
                assert!((x - y).abs() < tolerance, "{found:?} {expected:?}");
            }
        }
    }

    #[test]
    fn a_polynomial_without_real_roots_gives_none() {
        assert!(quartic_real_roots(&[4.0, 0.0, 5.0, 0.0]).is_empty()); // (x² + 1)(x² + 4)
        assert!(quartic_real_roots(&[10.0, -10.0, 7.0, -2.0]).is_empty()); // ((x − 1)² + 1)(x² + 5)
    }

    #[test]
    fn cosine_of_two_thirds_is_what_it_says() {
        for i in 0..=1000 {
            let s = f64::from(i) / 1000.0;
            assert!((cosine_of_two_thirds(s) - (s.acos() * 2.0 / 3.0).cos()).abs() < 1e-9);
        }
    }

    #[test]
    fn inverse_cube_root_is_what_it_says() {
        for i in -3000..3000 {
            let y = 10f64.powf(f64::from(i) / 30.0);
            assert!((inverse_cube_root(y * y * y) * y - 1.0).abs() < 1e-13, "{y}");
        }
    }
}
