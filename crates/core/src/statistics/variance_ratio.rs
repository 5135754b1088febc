//! Ratios of variances: the F distribution.

use super::chi_square::tail;

/// Chance that χ² exceeds `statistic` when the covariance it was weighed with is known up to a factor that `noise_degrees` numbers estimated:
/// χ²/k follows F(k, ν) then, docs/math/compare.md eq. (10). k = `degrees_of_freedom` must be even; an infinite ν gives `tail`.
pub(crate) fn tail_with_estimated_noise(
    degrees_of_freedom: usize,
    noise_degrees: f64,
    statistic: f64,
) -> f64 {
    debug_assert!(degrees_of_freedom.is_multiple_of(2));
    if !noise_degrees.is_finite() || degrees_of_freedom == 0 || !(0.0 < statistic) {
        return tail(degrees_of_freedom, statistic);
    }
    if !(0.0 < noise_degrees) {
        return 1.0;
    }
    let half = 0.5 * noise_degrees;
    // Terms Γ(ν/2 + j)/(Γ(ν/2) j!) (q/(ν + q))^j (1 + q/ν)^{-ν/2} by their logarithms: the first may be no number any more while later ones count.
    let by_statistic = -(noise_degrees / statistic).ln_1p();
    let (mut sum, mut logarithm) = (0.0, -half * (statistic / noise_degrees).ln_1p());
    for j in 0..degrees_of_freedom / 2 {
        sum += logarithm.exp();
        logarithm += ((half + j as f64) / (j as f64 + 1.0)).ln() + by_statistic;
    }
    sum.clamp(0.0, 1.0)
}

/// The normal number as unlikely as a ratio of variances of n and m degrees of freedom (Paulson 1942; Wilson and Hilferty 1931).
pub(crate) fn as_normal(ratio: f64, n: f64, m: f64) -> f64 {
    let (a, b) = (2.0 / (9.0 * n), 2.0 / (9.0 * m));
    let root = ratio.cbrt();
    ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the incomplete beta function from docs/math/check/compare.py; many degrees of the noise are no noise.
    #[test]
    fn estimated_noise_has_the_tail_of_f() {
        let table: [(usize, f64, f64, f64); 6] = [
            (6, 3.0, 20.0, 0.1753396648749),
            (6, 3.0, 850.0, 0.00090866108738999),
            (12, 7.5, 60.0, 0.017455211538307),
            (18, 21.0, 45.0, 0.02315656521499),
            (6, 0.5, 10.0, 0.64456566768165),
            (1200, 400.0, 2000.0, 1.2329120143091e-9),
        ];
        for (k, nu, x, expected) in table {
            let found = tail_with_estimated_noise(k, nu, x);
            assert!((found / expected - 1.0).abs() < 1e-11, "{k} {nu} {x}: {found}");
        }
        assert!((tail_with_estimated_noise(18, 1e12, 30.0) / tail(18, 30.0) - 1.0).abs() < 1e-9);
        assert_eq!(tail_with_estimated_noise(18, f64::INFINITY, 30.0), tail(18, 30.0));
        assert_eq!(tail_with_estimated_noise(6, 0.0, 1e9), 1.0);
        assert!(tail_with_estimated_noise(6, 3.0, f64::MAX) < 1e-100);
    }

    /// Quantiles at 1 % of F(4, 43), F(3, 10) and χ²(4)/4, from tables.
    #[test]
    fn an_unlikely_ratio_is_an_unlikely_normal_number() {
        for (ratio, n, m) in [(3.785, 4.0, 43.0), (6.552, 3.0, 10.0), (13.277 / 4.0, 4.0, f64::INFINITY)] {
            assert!((as_normal(ratio, n, m) - 2.326).abs() < 0.03, "{}", as_normal(ratio, n, m));
        }
    }
}
