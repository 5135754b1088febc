//! Solves for X, Z and the gripper's noise from the views' poses: consensus, variance components, and doubtful effects.

use super::blocks;
use super::consensus::{Consensus, consensus, fit_with_noise};
use super::cost::{Fit, besides};
use super::noise::{self, EFFECTS, Normal, Reml, Variances};
use super::shared::SharedError;
use super::views::{KINDS, Known, located};
use super::{HandEyeConfig, HandEyeView, HandEyeViewResult, motions};
use crate::locate::consistency::noise_scale;
use crate::{Camera, Error, Pose, Vector6};
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
    /// The contribution of each kind of the uncertain noise to the covariance, 12×12.
    pub widenings: [DMatrix<f64>; KINDS],
    /// The factor of all variances where the poses contradict the stated noise, and that of errors which neighbouring views share.
    pub noise_scale: f64,
    pub block_scale: [f64; 2],
    pub rotations_rad: [f64; 3],
}

/// An error that all views share, estimated as one more effect beside X and Z.
#[derive(Debug, Clone)]
pub(super) struct Effect {
    pub error: SharedError,
    /// Its amount, relative to the size or the focal length, and the standard deviation of it.
    pub part: f64,
    pub sigma: f64,
    /// Its effect on X and Z.
    pub shift: SVector<f64, 12>,
    /// The motion of X and Z for a unit of the error.
    pub by_part: SVector<f64, 12>,
    /// ℓ with it.
    pub log_likelihood: f64,
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
    let noise_scale = noise_scale(fit.chi2, fit.degrees_of_freedom);
    let mut settled = Settled {
        known,
        results,
        agreed,
        fit,
        variances,
        widenings: [(); KINDS].map(|()| DMatrix::zeros(12, 12)),
        noise_scale,
        block_scale: [1.0; 2],
        rotations_rad,
    };
    if let Some(found) = settled.reml(config, None) {
        for (widening, found) in settled.widenings.iter_mut().zip(&found.widenings) {
            widening.copy_from(&found.fixed_view::<12, 12>(0, 0));
        }
    }
    settled.block_scale = settled.blocks(config);
    Ok(settled)
}

impl Settled<'_> {
    pub fn used(&self) -> Vec<(usize, usize)> {
        self.agreed.used()
    }

    /// Returns the only camera of all views used.
    pub fn only_camera(&self) -> Option<&Camera> {
        let mut camera: Option<&Camera> = None;
        for (view, _) in self.used() {
            let [only] = self.known[view].seen else { return None };
            if camera.is_some_and(|camera| camera != only.camera) {
                return None;
            }
            camera = Some(only.camera);
        }
        camera
    }

    fn reml(&self, config: &HandEyeConfig, shared: Option<&[Vector6]>) -> Option<Reml> {
        let rows = noise::rows(&self.fit.poses, &self.known, &self.used(), shared);
        let start = self.variances.unwrap_or_default();
        noise::reml(&rows, &besides(&self.fit.poses, &self.known, config), &start)
    }

    /// Returns by which factors the covariances of X and Z of independent views are too small.
    fn blocks(&self, config: &HandEyeConfig) -> [f64; 2] {
        let rows = noise::rows(&self.fit.poses, &self.known, &self.used(), None);
        let besides = besides(&self.fit.poses, &self.known, config);
        let at = noise::evaluate(&rows, &besides, &self.variances.unwrap_or_default());
        let hands: Vec<Pose> =
            self.used().iter().map(|(view, _)| self.known[*view].base_from_gripper()).collect();
        at.map_or([1.0; 2], |at| blocks::factors(&rows, &at, &hands, self.noise_scale))
    }

    /// Returns the factor of the variance of an error that all views share.
    pub fn scale(&self) -> f64 {
        self.noise_scale * self.block_scale[0].max(self.block_scale[1])
    }

    /// Returns the covariance of X and Z of a minimum with the contribution of the uncertain noise, 12×12.
    pub fn with_noise(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        self.widenings.iter().fold(covariance.clone(), |sum, widening| sum + widening)
    }

    /// Widens a covariance of X and Z, 12×12, where the poses contradict the stated noise, and for errors that neighbouring views share.
    pub fn widened(&self, covariance: DMatrix<f64>) -> DMatrix<f64> {
        let root = |i: usize| (self.noise_scale * self.block_scale[i / 6]).sqrt();
        DMatrix::from_fn(12, 12, |i, j| covariance[(i, j)] * root(i) * root(j))
    }

    /// Returns ℓ without any shared error.
    pub fn log_likelihood(&self, config: &HandEyeConfig) -> Option<f64> {
        Some(self.reml(config, None)?.log_likelihood)
    }

    /// Estimates an error that all views share as one more effect, together with the noise, eq. (25). `None` where the views do not determine it.
    pub fn effect(&self, error: SharedError, config: &HandEyeConfig) -> Option<Effect> {
        if matches!(error, SharedError::Lens(_)) {
            self.only_camera()?;
        }
        let motion = |(view, candidate): &(usize, usize)| error.motion(&self.known[*view], *candidate);
        let motions: Vec<Vector6> = self.used().iter().map(motion).collect::<Option<_>>()?;
        let found = self.reml(config, Some(&motions))?;
        let last = EFFECTS - 1;
        let whole = found.phi + found.widenings.iter().sum::<Normal>();
        let variance = whole[(last, last)];
        let by_part = whole.fixed_view::<12, 1>(0, last) / variance;
        (0.0 < variance && variance < 1e6).then(|| Effect {
            error,
            part: found.effects[last],
            sigma: variance.sqrt(),
            shift: found.effects.fixed_rows::<12>(0).into_owned(),
            by_part,
            log_likelihood: found.log_likelihood,
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
