//! Quantiles of the χ² distribution.

use resight_core::frames::chi_square::tail;

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Values by mpmath's regularised gamma function at 50 digits.
    #[test]
    fn quantiles_match_50_digits() {
        for (dof, statistic, expected) in [
            (1, 3.841_458_820_694_124, 0.05),
            (2, 9.210_340_371_976_18, 0.01),
            (3, 16.266_236_196_238_13, 0.001),
            (1, 24.0, 9.633_570_086_430_948e-7),
            (700, 700.0, 0.492_891_767_271_808_2),
            (701, 800.0, 5.440_773_998_736_698e-3),
        ] {
            assert!((quantile(dof, expected) / statistic - 1.0).abs() < 1e-9, "{dof} {expected}");
        }
    }
}
