//! The upper tail of the χ² distribution, docs/math/frames.md eqs. (12)–(13).

/// Where erfc changes from the series of erf (which loses what 1 − erf cancels) to its continued fraction.
const SERIES_UP_TO: f64 = 2.5;
/// From here on e^{-y} nears the least positive number.
const LOGARITHMS_FROM: f64 = 600.0;
/// Terms of the continued fraction: at z = 2.5 the 60th changes nothing.
const FRACTION_TERMS: usize = 60;

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

/// Chance that χ² exceeds `statistic` when the covariance it was weighed with is known up to a factor that `noise_degrees` numbers estimated:
/// χ²/k follows F(k, ν) then, docs/math/compare.md eq. (10). k = `degrees_of_freedom` must be even; an infinite ν gives `tail`.
pub fn tail_with_estimated_noise(degrees_of_freedom: usize, noise_degrees: f64, statistic: f64) -> f64 {
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

/// The complementary error function for z ≥ 0.
pub fn erfc(z: f64) -> f64 {
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
}
