//! The standard normal distribution.

use core::f64::consts::{FRAC_1_SQRT_2, PI};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Where erfc changes from the series of erf (which loses what 1 − erf cancels) to its continued fraction.
const SERIES_UP_TO: f64 = 2.5;
/// Terms of the continued fraction: at z = 2.5 the 60th changes nothing.
const FRACTION_TERMS: usize = 60;

/// The complementary error function.
pub fn erfc(z: f64) -> f64 {
    if z < 0.0 {
        return 2.0 - erfc(-z);
    }
    let bell = (-z * z).exp() * core::f64::consts::FRAC_2_SQRT_PI;
    if SERIES_UP_TO < z {
        let tail = (1..=FRACTION_TERMS).rev().fold(z, |tail, n| z + 0.5 * n as f64 / tail);
        return 0.5 * bell / tail;
    }
    let (mut sum, mut term, mut n) = (0.0, z, 0.0);
    while f64::EPSILON * sum < term {
        sum += term;
        n += 1.0;
        term *= 2.0 * z * z / (2.0 * n + 1.0);
    }
    1.0 - bell * sum
}

/// P(standard normal > z).
pub fn upper_tail(z: f64) -> f64 {
    0.5 * erfc(z * FRAC_1_SQRT_2)
}

/// ln P(standard normal > z); by its asymptote where the probability leaves the range of numbers.
pub fn ln_upper_tail(z: f64) -> f64 {
    if 20.0 < z {
        return -0.5 * z * z - (z * (2.0 * PI).sqrt()).ln();
    }
    let half = 0.5 * erfc(z.abs() * FRAC_1_SQRT_2);
    if z < 0.0 { (-half).ln_1p() } else { half.ln() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both branches of erfc, beside the values of docs/math/check/frames.py; erfc(−z) = 2 − erfc(z).
    #[test]
    fn erfc_matches_the_table() {
        for (z, expected) in [(0.0, 1.0), (0.5, 0.479_500_122_186_953_5), (3.0, 2.209_049_699_858_544e-5)] {
            assert!((erfc(z) - expected).abs() <= 1e-12 * expected, "{z}: {}", erfc(z));
            assert!((erfc(-z) - (2.0 - expected)).abs() < 1e-15, "{z}: {}", erfc(-z));
        }
    }

    /// P(Z > 1.96) = 0.0249979, P(Z > 20) = e^{−203.917…}; the asymptote joins the function.
    #[test]
    fn tails_match_and_join() {
        assert!((upper_tail(1.96) - 0.024_997_895_148_220_435).abs() < 1e-14);
        assert!((upper_tail(-1.96) - 0.975_002_104_851_779_5).abs() < 1e-14);
        assert!((ln_upper_tail(1.96) - 0.024_997_895_148_220_435_f64.ln()).abs() < 1e-12);
        assert!((ln_upper_tail(-1.96) - 0.975_002_104_851_779_5_f64.ln()).abs() < 1e-12);
        // The asymptote errs by 1/z² = 0.25 %.
        assert!((ln_upper_tail(20.0 + 1e-9) - ln_upper_tail(20.0)).abs() < 2.6e-3);
    }
}
