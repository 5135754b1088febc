//! Real roots of the low-degree polynomials behind the closed forms.
//!
//! A quartic is split into two real quadratics. Each quadratic is polished as a whole (Bairstow), so that a nearly
//! double root inside one of them costs no digits of the factor; only then is it solved.
//! Derivation and the choice of the split: docs/math/p3p.md, section 3.

pub mod eigen;

use arrayvec::ArrayVec;

/// A monic quadratic x² + `linear` x + `constant`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quadratic {
    /// Coefficient of x.
    pub linear: f64,
    /// Constant term.
    pub constant: f64,
}

impl Quadratic {
    /// Its real roots without cancellation, NaN where there is none. A complex pair whose imaginary part is below
    /// `blur` gives its real part once: rounding turns a double root into such a pair as often as into two real ones.
    #[inline]
    pub fn real_roots(&self, blur: f64) -> [f64; 2] {
        let half = -0.5 * self.linear;
        let discriminant = half * half - self.constant;
        if discriminant <= 0.0 {
            return [if discriminant < -blur * blur { f64::NAN } else { half }, f64::NAN];
        }
        let far = half + discriminant.sqrt().copysign(half);
        [far, self.constant / far]
    }
}

/// The root of the resolvent x³ + b x² + c x + d that splits a quartic best: the largest, unless it nearly coincides
/// with the second; then the smallest, the one that is still well separated.
#[inline]
fn resolvent_root(b: f64, c: f64, d: f64) -> f64 {
    let shift = b / 3.0;
    let p = shift * shift - c / 3.0; // x = t − shift: t³ − 3 p t − 2 q = 0
    let q = 0.5 * (shift * c - d) - shift * shift * shift;
    let ppp = p * p * p;
    let discriminant = q * q - ppp;
    if 0.0 < discriminant {
        let u = cube_root(q.abs() + discriminant.sqrt());
        return (u + p / u).copysign(q) - shift;
    }
    let root = p.max(f64::MIN_POSITIVE).sqrt();
    let cosine = q / (p * root).max(f64::MIN_POSITIVE);
    let excess = (1.0 + cosine).clamp(0.0, 2.0);
    // Near −1 the smallest root is cos(π − …) = −1 + e/9 + (4/3)(e/9)², with e = 1 + cosine.
    let smallest = 2.0 * root * (-1.0 + excess / 9.0 + excess * excess * (4.0 / 243.0)) - shift;
    if excess < 1e-3 && 0.0 < smallest {
        return smallest;
    }
    2.0 * root * cosine_of_two_thirds((0.5 * excess).sqrt()) - shift
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

/// Cube root of a positive number to 1e-13: a third of the exponent's bits, then two of Halley's steps.
#[inline]
fn cube_root(x: f64) -> f64 {
    let mut y = f64::from_bits(x.to_bits() / 3 + 0x2A9F_7893_782D_A1CE);
    for _ in 0..2 {
        let yyy = y * y * y;
        y *= (yyy + 2.0 * x) / (2.0 * yyy + x);
    }
    y
}

/// Splits x⁴ + a₃x³ + a₂x² + a₁x + a₀, given as `[a0, a1, a2, a3]`, into two real monic quadratics.
///
/// Real roots are paired in order of size (the two smallest, the two largest), complex ones with their conjugates.
#[inline]
pub fn quartic_factors(a: &[f64; 4]) -> [Quadratic; 2] {
    let [a0, a1, a2, a3] = *a;
    let e = 0.25 * a3; // x = z − e: z⁴ + p z² + q z + r
    let ee = e * e;
    let p = a2 - 6.0 * ee;
    let q = a1 - 2.0 * e * (a2 - 4.0 * ee);
    let r = a0 - e * (a1 - e * (a2 - 3.0 * ee));
    let m = resolvent_root(2.0 * p, p * p - 4.0 * r, -q * q).max(0.0);
    let alpha = m.sqrt();
    let mean = 0.5 * (p + m);
    let half_gap =
        if 1e-10 * p.abs() < m { 0.5 * q / alpha } else { (mean * mean - r).max(0.0).sqrt().copysign(q) };
    // (z² + αz + mean − half_gap)(z² − αz + mean + half_gap), moved back to x = z − e.
    let back = |alpha: f64, beta: f64| Quadratic { linear: 2.0 * e + alpha, constant: ee + alpha * e + beta };
    [back(alpha, mean - half_gap), back(-alpha, mean + half_gap)]
}

/// One Newton step on a quadratic factor of the quartic (Bairstow): quadratic convergence even where the factor's own
/// two roots coincide.
#[inline]
pub fn polished_factor(a: &[f64; 4], factor: Quadratic) -> Quadratic {
    let Quadratic { linear: p, constant: q } = factor;
    let [a0, a1, a2, a3] = *a;
    // Quotient x² + b x + c, remainder r1 x + r0.
    let b = a3 - p;
    let c = a2 - q - p * b;
    let r1 = a1 - p * c - q * b;
    let r0 = a0 - q * c;
    // The remainder of the quotient by the factor, k x + l, gives the derivative.
    let k = b - p;
    let l = c - q;
    let determinant = l * l - k * (p * l - q * k);
    if determinant == 0.0 {
        return factor;
    }
    let inverse = 1.0 / determinant;
    // (k x + l)(δp x + δq) ≡ r1 x + r0 modulo the factor.
    let step_p = (r1 * l - r0 * k) * inverse;
    let step_q = (r0 * (l - p * k) + r1 * q * k) * inverse;
    Quadratic { linear: p + step_p, constant: q + step_q }
}

/// Real roots of the quartic `[a0, a1, a2, a3]` (monic), each once per multiplicity, unordered.
pub fn quartic_real_roots(a: &[f64; 4]) -> ArrayVec<f64, 4> {
    let mut roots = ArrayVec::new();
    for factor in quartic_factors(a) {
        let factor = polished_factor(a, polished_factor(a, factor));
        roots.extend(factor.real_roots(0.0).into_iter().filter(|root| !root.is_nan()));
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn cube_root_undoes_the_cube() {
        for exponent in -100..100 {
            let y = 1.37 * 10f64.powi(exponent);
            assert!((cube_root(y * y * y) / y - 1.0).abs() < 1e-12, "{exponent}");
        }
    }
}
