//! By which factor a covariance of independent views is too small where blocks of neighbouring views share errors: docs/math/hand_eye.md eq. (33).

/// Odds of such errors before the views are seen.
pub(super) const ODDS: f64 = 0.1;
/// Less probable errors add nothing.
pub(super) const LEAST_PROBABILITY: f64 = 0.1;
/// The largest factor by which they may enlarge the covariance.
pub(super) const MOST: f64 = 10.0;
/// Into so many blocks views are divided, each of at least four.
const COUNTS: [usize; 7] = [2, 3, 4, 6, 8, 12, 16];
const LEAST_VIEWS: usize = 4;
/// Steps of the integral over the factor.
const STEPS: usize = 60;

/// Returns into how many blocks views in sequence are divided.
pub(super) fn numbers_of_blocks(n_views: usize) -> impl Iterator<Item = usize> {
    COUNTS.into_iter().filter(move |count| count * LEAST_VIEWS <= n_views)
}

/// Returns the mean of the factor over divisions into blocks, each with χ² and degrees of freedom of its blocks' disagreement; 1 where shared errors
/// are improbable.
pub(super) fn mean_factor(divisions: &[(f64, f64)]) -> f64 {
    let odds = ODDS / divisions.len().max(1) as f64;
    let known =
        divisions.iter().filter_map(|(chi2, degrees_of_freedom)| inflated(*chi2, *degrees_of_freedom));
    let (sum, weight) = known.fold((1.0, 1.0), |(sum, weight), (evidence, mean)| {
        (sum + odds * evidence * mean, weight + odds * evidence)
    });
    match sum / weight {
        _ if weight < 1.0 / (1.0 - LEAST_PROBABILITY) => 1.0,
        factor if factor.is_finite() => factor,
        _ => MOST,
    }
}

/// Returns the evidence of a factor of variances between 1 and `MOST` against none, and its mean, eq. (33).
pub(super) fn inflated(chi2: f64, degrees_of_freedom: f64) -> Option<(f64, f64)> {
    let step = MOST.ln() / STEPS as f64;
    let (mut evidence, mut sum) = (0.0, 0.0);
    for i in 0..STEPS {
        let factor = ((i as f64 + 0.5) * step).exp();
        let gain = 0.5 * chi2 * (1.0 - factor.recip()) - 0.5 * degrees_of_freedom * factor.ln();
        evidence += gain.exp() / STEPS as f64;
        sum += factor * gain.exp() / STEPS as f64;
    }
    (0.0 < evidence).then_some((evidence, sum / evidence))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the quadrature in docs/math/check/hand_eye.py.
    #[test]
    fn a_factor_has_the_evidence_and_the_mean_of_its_integral() {
        let (evidence, mean) = inflated(40.0, 12.0).expect("a factor");
        assert!((evidence / 388.498851939 - 1.0).abs() < 1e-4 && (mean / 3.853423850866 - 1.0).abs() < 1e-4);
    }
}
