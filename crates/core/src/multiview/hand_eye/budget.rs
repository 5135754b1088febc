//! The error budgets of both poses: docs/math/budget.md section 4.

use super::HandEyeConfig;
use super::cost::{Fit, Level, SOURCES, parts};
use super::settle::Settled;
use super::shared::SharedError;
use super::verdict::Verdict;
use super::views::centre;
use crate::budget::{Budget, ErrorSource};
use crate::pose::symmetric;
use nalgebra::DMatrix;

/// Returns the budgets of X and Z; `level` is that of the minimum. Empty where they cannot be computed.
pub(super) fn budgets(
    settled: &Settled,
    best: &Fit,
    verdict: &Verdict,
    config: &HandEyeConfig,
    level: Level,
) -> [Budget; 2] {
    let Some(of_fit) = parts(best, &settled.known, &settled.used(), config, level) else {
        return [Budget::default(), Budget::default()];
    };
    let centre = centre(&settled.known);
    let budget = |at: usize| {
        let block = |matrix: &DMatrix<f64>| {
            let (_, undone) = centre.undone(&best.poses, matrix);
            symmetric(&undone.fixed_view::<6, 6>(at, at).into_owned())
        };
        let mut budget = Budget::default();
        of_fit.iter().for_each(|(source, part)| budget.add(*source, &block(part)));
        // The parts are those of the minimum, its covariance has the weights of the round before.
        let mut budget = budget.adding_up_to(&block(&best.covariance))?;
        for (source, widening) in SOURCES.into_iter().zip(&settled.widenings) {
            budget.add(source, &block(widening));
        }
        for (probability, effect) in verdict.shared() {
            let source = match effect.error {
                SharedError::Size => ErrorSource::Target,
                SharedError::Lens(_) => ErrorSource::Lens,
            };
            budget.add(source, &block(&Verdict::added(probability, effect)));
        }
        let sum = budget.covariance() * settled.noise_scale;
        budget.add(ErrorSource::Residuals, &(sum * (1.0 - 1.0 / settled.noise_scale)));
        budget.add(ErrorSource::SharedInBlock, &(sum * (settled.block_scale[at / 6] - 1.0)));
        Some(budget)
    };
    [0, 6].map(|at| budget(at).unwrap_or_default())
}
