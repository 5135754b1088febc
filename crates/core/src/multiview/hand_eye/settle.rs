//! Solves for X, Z and the gripper's noise from the views' poses: consensus, variance components, and doubtful effects.

use super::consensus::{Consensus, consensus, fit_with_noise};
use super::cost::{Fit, besides};
use super::noise::{self, EFFECTS, Reml, Variances};
use super::views::{Known, located};
use super::{HandEyeConfig, HandEyeView, HandEyeViewResult, motions};
use crate::Error;
use nalgebra::{DMatrix, SVector};

/// Least travel that measures a size, in standard deviations of the gripper's position.
const MIN_TRAVEL: f64 = 3.0;

/// The answer based on poses.
pub(super) struct Settled<'a> {
    pub known: Vec<Known<'a>>,
    pub results: Vec<HandEyeViewResult>,
    pub agreed: Consensus,
    pub fit: Fit,
    /// The estimated noise of the gripper; `None` where every view states its own.
    pub variances: Option<Variances>,
    /// The contribution of the uncertain noise to the covariance, 12×12.
    pub widening: DMatrix<f64>,
    pub rotations_rad: [f64; 3],
}

/// A target larger than stated, as an effect beside X and Z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Larger {
    /// The relative error of its size, and the standard deviation of it.
    pub part: f64,
    pub sigma: f64,
    /// Its effect on X and Z.
    pub shift: SVector<f64, 12>,
}

/// Finds the consensus and the noise.
pub(super) fn settled<'a>(
    views: &'a [HandEyeView<'a>],
    config: &HandEyeConfig,
) -> Result<Settled<'a>, Error> {
    let (mut known, results) = located(views, config)?;
    if known.len() < 3 {
        return Err(Error::TooFewMotions { seen: known.len(), needed: 3 });
    }
    motions::check(&known, config)?;
    let agreed = consensus(&mut known, config)?;
    let used = agreed.used();
    if used.len() < 3 {
        return Err(Error::TooFewMotions { seen: used.len(), needed: 3 });
    }
    let (fit, variances) = fit_with_noise(&agreed.poses, &mut known, &used, config)?;
    // A wrong gripper pose can look like a rotation about another axis, so the test is repeated without the rejected views.
    let kept: Vec<Known> = used.iter().map(|(view, _)| known[*view].clone()).collect();
    let rotations_rad = motions::check(&kept, config)?;
    let mut settled =
        Settled { known, results, agreed, fit, variances, widening: DMatrix::zeros(12, 12), rotations_rad };
    if let Some(found) = settled.reml(config, false) {
        settled.widening.copy_from(&found.widening.fixed_view::<12, 12>(0, 0));
    }
    Ok(settled)
}

impl Settled<'_> {
    pub fn used(&self) -> Vec<(usize, usize)> {
        self.agreed.used()
    }

    fn reml(&self, config: &HandEyeConfig, with_size: bool) -> Option<Reml> {
        let rows = noise::rows(&self.fit.poses, &self.known, &self.used(), with_size);
        let start = self.variances.unwrap_or_default();
        noise::reml(&rows, &besides(&self.fit.poses, &self.known, config), &start)
    }

    /// Estimates the target's size as one more effect, together with the noise, eq. (25).
    pub fn larger(&self, config: &HandEyeConfig) -> Option<Larger> {
        let found = self.reml(config, true)?;
        let last = EFFECTS - 1;
        let variance = found.phi[(last, last)] + found.widening[(last, last)];
        let shift = found.effects.fixed_rows::<12>(0).into_owned();
        (0.0 < variance && variance < 1e6).then_some(Larger {
            part: found.effects[last],
            sigma: variance.sqrt(),
            shift,
        })
    }

    /// Returns the standard deviations of the gripper's orientation (rad) and position (m), per axis, over the views used; noise about the base
    /// is in both.
    pub fn sigmas(&self) -> Option<[f64; 2]> {
        let [turn, base, position] = self.variances?;
        let used = self.used();
        let lever2 = |(view, _): &(usize, usize)| self.known[*view].base_lever2();
        let lever2 = used.iter().map(lever2).sum::<f64>() / used.len().max(1) as f64;
        Some([(turn + base).sqrt(), (position + base * lever2).sqrt()])
    }

    /// Returns whether the gripper's travel stands out of its noise: one that only rotates about its own origin says nothing about the target's size.
    pub fn measures_size(&self) -> bool {
        let used = self.used();
        let travel2: f64 =
            used.iter().map(|(view, _)| self.known[*view].gripper_in_base().norm_squared()).sum();
        let travel_m = (travel2 / used.len().max(1) as f64).sqrt();
        self.sigmas().is_none_or(|[_, sigma_m]| MIN_TRAVEL * sigma_m <= travel_m)
    }

    /// Returns the gripper's root mean square distance from its mean position, or the target's distance, whichever is larger, m.
    pub fn reach_m(&self) -> f64 {
        let used = self.used();
        let mean =
            |f: &dyn Fn(&(usize, usize)) -> f64| used.iter().map(f).sum::<f64>() / used.len().max(1) as f64;
        let travel = mean(&|(view, _)| self.known[*view].gripper_in_base().norm_squared());
        let distance = mean(&|(view, candidate)| {
            self.known[*view].candidates[*candidate].cam_from_target.translation.norm_squared()
        });
        f64::max(travel, distance).sqrt()
    }
}
