//! The explanations of a rig's observations besides the input as stated: another lens of one camera, another size of one target.
//!
//! Each is one step from the minimum, with all poses free. docs/math/explanations.md eqs. (1)–(4).

use super::adjust::Adjusted;
use super::layout::Layout;
use super::lens_doubt::{EXPECTED_DEGREES, excess};
use super::lens_score::{LensScore, LensStep};
use super::scale::by_size;
use super::uncertain_lens::stated;
use super::{RigConfig, TargetScale};
use crate::Vector6;
use crate::explanation::{Estimate, Weighed};
use crate::least_squares::rig::{Common, Eliminated};
use crate::locate::suspects::Fault;
use nalgebra::{DMatrix, DVector};

/// What explains the observations of a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum RigExplanation {
    /// Cameras and targets are as stated.
    AsStated,
    /// The lens of a camera is another one.
    Lens {
        /// The camera.
        camera: usize,
    },
    /// A target has another size.
    Size {
        /// The target.
        target: usize,
    },
    /// The files, or the images, of two cameras are exchanged.
    Exchanged {
        /// One camera.
        a: usize,
        /// The other.
        b: usize,
    },
    /// A usual fault of a camera's file, pixels or labels.
    Fault {
        /// The camera; none where all cameras have it.
        camera: Option<usize>,
        /// The fault.
        fault: Fault,
        /// A second one, where only both together explain the observations.
        second: Option<Fault>,
    },
    /// Cameras do not expose together.
    Late {
        /// The camera that is farthest from the reference camera's time.
        camera: usize,
        /// By how much it exposes later, in intervals between views.
        views: f64,
    },
}

/// Odds of an error of any lens, and of any size, before the observations are seen.
const ODDS: f64 = 0.1;
/// Standard deviation of an error where there is one: of a size or focal length, relative, and of a principal point, over the focal length.
const SIGMA: f64 = 0.05;
/// … and of distortion, as the displacement that it causes over the focal length.
const DISTORTION_SIGMA: f64 = 0.01;

/// The minimum, and what it shows of lenses and sizes.
pub(super) struct Shown<'a> {
    pub(super) layout: &'a Layout<'a>,
    pub(super) adjusted: &'a Adjusted,
    pub(super) eliminated: &'a Eliminated,
    pub(super) lenses: &'a [Option<LensScore>],
    pub(super) scales: &'a [TargetScale],
    /// Variance of the noise of which lenses are tested, in units of the stated one.
    pub(super) noise: f64,
    pub(super) config: &'a RigConfig<'a>,
}

impl Shown<'_> {
    /// Returns all explanations, the most probable first.
    pub(super) fn explanations(&self) -> Vec<Weighed<RigExplanation>> {
        let still = vec![Vector6::zeros(); self.layout.problem.cameras.len()];
        let mut all = vec![Weighed::new(RigExplanation::AsStated, 0.0, still)];
        all.extend((0..self.lenses.len()).filter_map(|camera| self.lens(camera)));
        all.extend((0..self.scales.len()).filter_map(|target| self.size(target)));
        Weighed::weigh(&mut all);
        all
    }

    fn lens(&self, camera: usize) -> Option<Weighed<RigExplanation>> {
        let lens = self.lenses[camera].as_ref()?;
        match lens.four(self.noise) {
            Some(four) => self.of_step(camera, lens, &four),
            None => self.of_step(camera, lens, &lens.three(self.noise)?),
        }
    }

    fn of_step<const N: usize>(
        &self,
        camera: usize,
        lens: &LensScore,
        step: &LensStep<N>,
    ) -> Option<Weighed<RigExplanation>> {
        let known = self.config.intrinsics.get(camera).and_then(Option::as_ref);
        let known = known.map_or([0.0; 3], |c| stated(&self.layout.problem.cameras[camera], c, lens.reach()));
        // In the order of the columns; a displacement over its reach is the coefficient of distortion.
        let diagonal = |[focal, centre, distortion]: [f64; 3]| {
            let sigma = [focal, centre, centre, distortion / lens.reach().max(f64::MIN_POSITIVE)];
            DMatrix::from_diagonal(&DVector::from_fn(N, |i, _| sigma[i] * sigma[i]))
        };
        let (excess, degrees_of_freedom) = excess(step)?;
        let by_points = DMatrix::from_fn(N, N, |i, j| step.by_points[(i, j)]);
        let estimate = Estimate {
            value: DVector::from_column_slice(step.x.as_slice()),
            covariance: by_points * excess + diagonal(known),
            degrees_of_freedom,
        };
        let (gain, expected) = estimate.with_prior(&diagonal([SIGMA, SIGMA, DISTORTION_SIGMA]))?;
        let following: Vec<&Common> = lens.following.iter().take(N).collect();
        let log_odds = (ODDS / self.lenses.len() as f64).ln() + gain;
        let motions = self.motions(&following, expected.as_slice());
        Some(Weighed::new(RigExplanation::Lens { camera }, log_odds, motions))
    }

    fn size(&self, target: usize) -> Option<Weighed<RigExplanation>> {
        let TargetScale { ratio, sigma, .. } = self.scales[target];
        let n_views = self.layout.bodies.chunk_by(|a, b| a.0 == b.0).count();
        let one = |variance: f64| DMatrix::from_element(1, 1, variance);
        let estimate = Estimate {
            value: DVector::from_element(1, ratio - 1.0),
            covariance: one(sigma.powi(2) + self.config.scale_sigma.powi(2)),
            degrees_of_freedom: EXPECTED_DEGREES + n_views.saturating_sub(1) as f64,
        };
        let (gain, expected) = estimate.with_prior(&one(SIGMA * SIGMA))?;
        let common = by_size(target, self.layout, self.adjusted).common;
        let following = self.adjusted.equations.following(self.eliminated, &common, false);
        let log_odds = (ODDS / self.scales.len() as f64).ln() + gain;
        let motions = self.motions(&[&following], expected.as_slice());
        Some(Weighed::new(RigExplanation::Size { target }, log_odds, motions))
    }

    /// Returns −H⁻¹Kθ for every camera.
    fn motions(&self, following: &[&Common], parameters: &[f64]) -> Vec<Vector6> {
        let of_block = |block: usize| {
            let terms = following.iter().zip(parameters);
            terms.fold(Vector6::zeros(), |sum, (f, x)| sum - f.shared.fixed_rows::<6>(6 * block) * *x)
        };
        let blocks = self.layout.graph.block_of_camera.iter();
        blocks.map(|block| block.map_or(Vector6::zeros(), of_block)).collect()
    }
}
