//! All real roots of a polynomial of degree 8 in an interval, none lost: Bernstein coefficients, halved until Descartes' rule
//! leaves one root or none.
//!
//! p(s) = Σ bₖ C(8, k) sᵏ (1 − s)⁸⁻ᵏ on [0, 1]. The number of sign changes in b is at least the number of roots in (0, 1) and of the
//! same parity: none means none, one means one. Halving by averages (de Casteljau) does not amplify rounding.
//! Derivation: docs/math/gp3p.md, section 4.

use arrayvec::ArrayVec;

/// Coefficients of a polynomial of degree 8.
pub type Coefficients = [f64; 9];

/// C(8, k).
const BINOMIAL: Coefficients = [1.0, 8.0, 28.0, 56.0, 70.0, 56.0, 28.0, 8.0, 1.0];
const INVERSE_BINOMIAL: Coefficients =
    [1.0, 1.0 / 8.0, 1.0 / 28.0, 1.0 / 56.0, 1.0 / 70.0, 1.0 / 56.0, 1.0 / 28.0, 1.0 / 8.0, 1.0];
/// Values below this part of the largest coefficient may be rounding of the products they come from.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// A pair of roots closer than the square root of the rounding may have become complex.
const BLUR: f64 = 1e-6;
/// Roots closer than this are given as one: 2⁻³² of the interval.
const LEAST_WIDTH: f64 = 2.4e-10;
/// Halvings that stay in waiting: one for each level, and the first.
const LEVELS: usize = 36;
/// Newton's error after a step of this size is below 1e-9 of the interval where the root is well separated.
const LAST_STEP: f64 = 1e-5;
/// Bisection alone reaches 2⁻⁵⁰.
const MAX_STEPS: usize = 50;

/// Places at which roots lie; a cluster closer than rounding allows to tell gives its place once or more. Room for eight
/// roots and those repeats.
pub type Places = ArrayVec<f64, 24>;

/// A part of the interval and the polynomial's Bernstein coefficients on it.
struct Piece {
    b: Coefficients,
    start: f64,
    width: f64,
}

/// The roots in [0, 1] of Σ cₖ sᵏ (1 − s)⁸⁻ᵏ, with c the *scaled* coefficients C(8, k) bₖ.
///
/// Places are good to 1e-9 of the interval for well separated roots, and to 1e-5 for double ones: the caller polishes them
/// on the equations
/// that the polynomial came from.
pub fn roots_in_unit_interval(scaled: &Coefficients) -> Places {
    let mut places = Places::new();
    let mut waiting = ArrayVec::<Piece, LEVELS>::new();
    let b: Coefficients = core::array::from_fn(|k| scaled[k] * INVERSE_BINOMIAL[k]);
    let noise = ROUNDING * b.iter().fold(0.0, |most, x| f64::max(most, x.abs()));
    if !noise.is_finite() {
        return places;
    }
    waiting.push(Piece { b, start: 0.0, width: 1.0 });
    while let Some(piece) = waiting.pop() {
        match piece.sign_changes() {
            0 | 1 => piece.push_places(noise, &mut places),
            _ if piece.width < LEAST_WIDTH => piece.push_place(0.5, &mut places),
            _ => {
                let [left, right] = piece.halves();
                waiting.push(right);
                waiting.push(left);
            }
        }
    }
    places
}

impl Piece {
    /// Zero counts as positive, so that a root at a common end belongs to exactly one of two neighbours.
    #[inline]
    fn sign_changes(&self) -> u32 {
        let signs = (0..9).fold(0u32, |bits, k| bits | (u32::from(self.b[k] < 0.0) << k));
        ((signs ^ (signs >> 1)) & 0xFF).count_ones()
    }

    #[inline]
    fn push_place(&self, s: f64, places: &mut Places) {
        if !places.is_full() {
            places.push(self.start + self.width * s);
        }
    }

    /// The root of a piece with one sign change, and where it may touch zero besides: a double root that rounding has lifted off, at a
    /// cut or inside.
    #[inline]
    fn push_places(&self, noise: f64, places: &mut Places) {
        let near_zero = |x: f64| x.abs() < noise;
        if self.sign_changes() == 1 {
            self.push_place(self.single_root(), places);
        } else if self.width < BLUR && self.b.iter().any(|x| near_zero(*x)) {
            self.push_place(0.5, places);
        }
        // Every cut is the end of one piece.
        if near_zero(self.b[8]) {
            self.push_place(1.0, places);
        }
    }

    /// Both halves by de Casteljau's averages.
    #[inline]
    fn halves(&self) -> [Piece; 2] {
        let (mut b, mut left) = (self.b, [0.0; 9]);
        left[0] = b[0];
        for level in 1..9 {
            for k in 0..9 - level {
                b[k] = 0.5 * (b[k] + b[k + 1]);
            }
            left[level] = b[0];
        }
        let width = 0.5 * self.width;
        [Piece { b: left, start: self.start, width }, Piece { b, start: self.start + width, width }]
    }

    /// The one root of a piece with one sign change: Newton's steps within a bracket, in x = s/(1 − s) for the first half of the
    /// piece and in its inverse for the second, so that x stays in [0, 1].
    #[inline]
    fn single_root(&self) -> f64 {
        let mut c: Coefficients = core::array::from_fn(|k| self.b[k] * BINOMIAL[k]);
        let at_middle: f64 = c.iter().sum();
        let in_second_half = (at_middle < 0.0) == (self.b[0] < 0.0);
        if in_second_half {
            c.reverse();
        }
        let guess = self.crossing_of_the_polygon();
        let guess = if in_second_half { 1.0 - guess } else { guess };
        let x = bracketed_root(&c, (guess / (1.0 - guess)).min(1.0));
        if in_second_half { 1.0 / (1.0 + x) } else { x / (1.0 + x) }
    }

    /// Where the polygon through the points (k/8, bₖ) crosses zero: the first guess.
    #[inline]
    fn crossing_of_the_polygon(&self) -> f64 {
        let negative = self.b[0] < 0.0;
        let k = (1..8).find(|k| (self.b[*k] < 0.0) != negative).unwrap_or(8);
        let (before, after) = (self.b[k - 1], self.b[k]);
        ((k - 1) as f64 + before / (before - after)) * 0.125
    }
}

/// The root in [0, 1] of Σ cₖ xᵏ, known to change its sign there.
#[inline]
fn bracketed_root(c: &Coefficients, guess: f64) -> f64 {
    let negative_at_zero = c[0] < 0.0;
    let (mut low, mut high, mut x) = (0.0, 1.0, guess);
    for _ in 0..MAX_STEPS {
        let (mut value, mut slope) = (c[8], 0.0);
        for k in (0..8).rev() {
            slope = slope * x + value;
            value = value * x + c[k];
        }
        if (value < 0.0) == negative_at_zero {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let next = if low <= newton && newton <= high { newton } else { 0.5 * (low + high) };
        let step = (next - x).abs();
        x = next;
        if step < LAST_STEP {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scaled coefficients of Π (s − rᵢ): in s and t = 1 − s each factor is (1 − r) s − r t.
    fn product(roots: [f64; 8]) -> Coefficients {
        let mut c = [0.0; 9];
        c[0] = 1.0;
        for (degree, root) in roots.into_iter().enumerate() {
            for k in (0..=degree + 1).rev() {
                let from_below = if k == 0 { 0.0 } else { c[k - 1] * (1.0 - root) };
                let here = if k == degree + 1 { 0.0 } else { c[k] * -root };
                c[k] = from_below + here;
            }
        }
        c
    }

    /// Simple roots inside are all found; those outside, however near, are not.
    #[test]
    fn roots_of_a_product_are_those_of_its_factors_inside() {
        let cases: [([f64; 8], f64); 5] = [
            ([0.05, 0.2, 0.3, 0.45, 0.5, 0.7, 0.85, 0.95], 1e-8),
            ([-2.0, -0.1, 0.3, 0.300_01, 0.5, 0.9, 1.01, 4.0], 1e-8),
            // Beside its neighbour Newton's step only halves the distance, and the last is below 1e-5.
            ([-2.0, -1e-9, 1e-9, 1.0 - 1e-9, 1.0 + 1e-9, 2.0, 3.0, 4.0], 1e-5),
            // On the cut rounding may leave it outside the bracket of Newton, which then bisects down to a step of 1e-5.
            ([0.5, -1.0, -2.0, -3.0, -4.0, 2.0, 3.0, 4.0], 1e-5),
            ([-1.0, -2.0, -3.0, -4.0, 2.0, 3.0, 4.0, 5.0], 0.0),
        ];
        for (roots, tolerance) in cases {
            let found = roots_in_unit_interval(&product(roots));
            let near = |x: f64, root: f64| (x - root).abs() < tolerance;
            let inside = || roots.into_iter().filter(|r| (0.0..1.0).contains(r));
            assert!(inside().all(|r| found.iter().any(|x| near(*x, r))), "{roots:?}: {found:?}");
            assert!(found.iter().all(|x| inside().any(|r| near(*x, r))), "{roots:?}: {found:?}");
        }
    }

    /// A double root gives its place at least once and nothing far from it, wherever it lies: also where halving cuts. To
    /// 1e-5, the last
    /// step of Newton, which only halves the distance there.
    #[test]
    fn a_double_root_is_not_lost() {
        for i in 1..64 {
            let root = f64::from(i) / 64.0 + if i % 3 == 0 { 1e-3 } else { 0.0 };
            let found = roots_in_unit_interval(&product([root, root, -1.0, -2.0, -3.0, 2.0, 3.0, 4.0]));
            assert!(!found.is_empty(), "{root}");
            assert!(found.iter().all(|x| (x - root).abs() < 1e-5), "{root}: {found:?}");
        }
    }

    #[test]
    fn no_number_gives_no_root() {
        assert!(roots_in_unit_interval(&[f64::NAN; 9]).is_empty());
        assert!(roots_in_unit_interval(&[f64::INFINITY; 9]).is_empty());
    }
}
