//! The upper tail of the χ² distribution, docs/math/frames.md eqs. (12)–(13), and its quantiles.

use super::normal::erfc;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// From here on e^{-y} nears the least positive number.
const LOGARITHMS_FROM: f64 = 600.0;
/// Chance that χ² with `degrees_of_freedom` exceeds `statistic`; 1 without degrees of freedom.
pub fn tail(degrees_of_freedom: usize, statistic: f64) -> f64 {
    if degrees_of_freedom == 0 || !(0.0 < statistic) {
        return 1.0;
    }
    let y = 0.5 * statistic;
    if LOGARITHMS_FROM < y {
        return tail_by_logarithms(degrees_of_freedom, y);
    }
    let is_odd = degrees_of_freedom % 2 == 1;
    // The terms y^a e^{-y}/Γ(a + 1), a = 0, 1, … or ½, 3/2, …
    let (mut sum, mut a, mut term) = match is_odd {
        true => (erfc(y.sqrt()), 0.5, (-y).exp() * y.sqrt() * core::f64::consts::FRAC_2_SQRT_PI),
        false => (0.0, 0.0, (-y).exp()),
    };
    for _ in 0..degrees_of_freedom / 2 {
        sum += term;
        a += 1.0;
        term *= y / a;
    }
    sum.clamp(0.0, 1.0)
}

/// The same sum where e^{-y} leaves the range of numbers although the terms that count do not: each term by its logarithm. What is
/// lost are erfc √y and the digits that y takes of its logarithm's sixteen.
fn tail_by_logarithms(degrees_of_freedom: usize, y: f64) -> f64 {
    let (mut a, mut logarithm) = match degrees_of_freedom % 2 {
        1 => (0.5, 0.5 * y.ln() - y + core::f64::consts::FRAC_2_SQRT_PI.ln()),
        _ => (0.0, -y),
    };
    let mut sum = 0.0;
    for _ in 0..degrees_of_freedom / 2 {
        sum += logarithm.exp();
        a += 1.0;
        logarithm += (y / a).ln();
    }
    sum.clamp(0.0, 1.0)
}

/// The statistic that χ² with `degrees_of_freedom` exceeds with `probability`, to 10⁻¹² of it, by bisection.
pub fn quantile(degrees_of_freedom: usize, probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0 + 4.0 * degrees_of_freedom as f64);
    for _ in 0..64 {
        if !(probability < tail(degrees_of_freedom, high)) {
            break;
        }
        high *= 2.0;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if probability < tail(degrees_of_freedom, middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The statistic that χ² exceeds as rarely as a standard normal number exceeds `normal`: Wilson and Hilferty (1931), within 5 % from
/// two degrees of freedom on where that is once in ten thousand, docs/math/refine.md eq. (17). Fast, and for any real number of degrees.
pub(crate) fn quick_quantile(degrees_of_freedom: f64, normal: f64) -> f64 {
    let k = 2.0 / (9.0 * degrees_of_freedom);
    degrees_of_freedom * (1.0 - k + normal * k.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values at 13 digits from docs/math/check/frames.py.
    #[test]
    fn tail_matches_the_table() {
        let table: [(usize, f64, f64); 14] = [
            (1, 0.001, 0.97477287937),
            (1, 3.841, 0.05001368376396),
            (1, 13.0, 0.0003114909767674),
            (1, 60.0, 9.485737571074e-15),
            (2, 0.5, 0.7788007830714),
            (2, 18.421, 9.998403847161e-5),
            (3, 1.0, 0.8012519569012),
            (3, 12.4, 0.006131306320578),
            (3, 14.0, 0.002905152774267),
            (4, 9.488, 0.04999440557799),
            (7, 30.0, 9.495972508134e-5),
            (9, 2.0, 0.9914676066288),
            (14, 40.0, 0.0002551224958563),
            (18, 100.0, 2.214995672998e-13),
        ];
        for (k, x, expected) in table {
            assert!((tail(k, x) / expected - 1.0).abs() < 1e-11, "{k} {x}: {}", tail(k, x));
        }
    }

    /// Many degrees of freedom, where e^{-y} is no number any more: docs/math/check/compare.py.
    #[test]
    fn many_degrees_of_freedom() {
        let table: [(usize, f64, f64); 5] = [
            (1194, 1300.0, 0.0169343242542367),
            (1195, 1300.0, 0.0178004519015729),
            (6000, 6200.0, 0.0350000136990462),
            (1000, 1201.0, 1.12228399787059e-05),
            (999, 1199.0, 1.21546968339325e-05),
        ];
        for (k, x, expected) in table {
            assert!((tail(k, x) / expected - 1.0).abs() < 1e-10, "{k} {x}: {}", tail(k, x));
        }
        let (below, above) = (tail(1100, 1200.0 - 1e-9), tail(1100, 1200.0 + 1e-9));
        assert!((below / above - 1.0).abs() < 1e-9, "{below} {above}");
        assert!(tail(6, 1e5) == 0.0 && (tail(5000, 1e3) - 1.0).abs() < 1e-12);
    }
    /// Values by mpmath's regularised gamma function at 50 digits.
    #[test]
    fn quantiles_match_50_digits() {
        for (degrees_of_freedom, statistic, expected) in [
            (1, 3.841_458_820_694_124, 0.05),
            (2, 9.210_340_371_976_18, 0.01),
            (3, 16.266_236_196_238_13, 0.001),
            (1, 24.0, 9.633_570_086_430_948e-7),
            (700, 700.0, 0.492_891_767_271_808_2),
            (701, 800.0, 5.440_773_998_736_698e-3),
        ] {
            assert!(
                (quantile(degrees_of_freedom, expected) / statistic - 1.0).abs() < 1e-9,
                "{degrees_of_freedom} {expected}"
            );
        }
    }

    /// One in ten thousand and one in a hundred (standard normal 3.719 and 2.326), beside the exact ones.
    #[test]
    fn quick_quantiles_are_near() {
        for degrees_of_freedom in [2, 3, 6, 10, 100, 1000] {
            for (normal, probability) in [(3.719_016_485_455_709, 1e-4), (2.326_347_874_040_841, 1e-2)] {
                let ratio = quick_quantile(degrees_of_freedom as f64, normal)
                    / quantile(degrees_of_freedom, probability);
                assert!((ratio - 1.0).abs() < 0.05, "{degrees_of_freedom} {probability}: {ratio}");
            }
        }
    }
}
