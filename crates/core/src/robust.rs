//! Consensus: the pose that the most correspondences agree with, when many may be wrong.
//!
//! sample three → P3P → count, given up early → polish the truncated cost → is it more than chance? → enough samples? →
//! `locate` on those that agree. Derivation: docs/math/robust.md.

mod order;
mod sights;
pub(crate) mod evidence;
mod sampling;
mod search;
mod settle;

use crate::locate::{self, PoseEstimate};
use crate::solve::configuration::check_numbers;
use crate::{Camera, Correspondence, Error};
use search::search;
use settle::settle;

/// What counts as agreeing, and how uncertain to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config<'a> {
    /// A correspondence agrees with a pose that meets its pixel to within this distance, px (the camera's image unit).
    /// Good ones are lost with probability exp(−T²/2σ²): 3.4e-4 at T = 4 σ, 1.1 % at 3 σ.
    pub threshold_px: f64,
    /// Probability with which no larger consensus was missed.
    pub confidence: f64,
    /// Samples after which the search ends whatever the confidence; that reached is reported.
    pub max_samples: usize,
    /// Expected number of poses that as many random correspondences would agree with: above it there is no answer.
    pub max_false_alarms: f64,
    /// Seed of the sampling. The same input and seed give the same answer, bit for bit.
    pub seed: u64,
    /// Label of the group of each correspondence, as long as the input: the points of a group (corners of one tag) agree all
    /// together or not at all.
    pub groups: Option<&'a [u32]>,
    /// How the pose of those that agree is found.
    pub locate: locate::Config<'a>,
}

impl Config<'_> {
    /// The defaults for a threshold in px.
    pub fn with_threshold_px(threshold_px: f64) -> Self {
        Config {
            threshold_px,
            confidence: 0.9999,
            max_samples: 200_000,
            max_false_alarms: 1e-3,
            seed: 0,
            groups: None,
            locate: locate::Config::default(),
        }
    }

    fn check(&self, n_points: usize) -> Result<(), Error> {
        let refused = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
        let is_share = |x: f64| 0.0 < x && x < 1.0;
        if !(0.0 < self.threshold_px && self.threshold_px.is_finite()) {
            return refused("threshold_px", self.threshold_px, "it must be positive");
        }
        if !is_share(self.confidence) {
            return refused("confidence", self.confidence, "it must lie between 0 and 1");
        }
        if !is_share(self.max_false_alarms) {
            return refused("max_false_alarms", self.max_false_alarms, "it must lie between 0 and 1");
        }
        match self.groups {
            _ if !self.locate.groups.is_empty() => {
                let seen = self.locate.groups.len() as f64;
                refused(
                    "locate.groups",
                    seen,
                    "consensus takes each point's error as its own; leave them out",
                )
            }
            Some(groups) if groups.len() != n_points => {
                refused("groups", groups.len() as f64, "one label for each correspondence")
            }
            _ => Ok(()),
        }
    }
}

/// A pose, and the correspondences that agree with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Consensus {
    /// The whole answer of `locate` on those that agree. Its χ² misses the tail beyond the threshold: it is expected to be
    /// `truncation` times the degrees of freedom, and the covariance is already divided by it.
    pub estimate: PoseEstimate,
    /// Rows that agree with `estimate.cam_from_target` to within the threshold, ascending, counted from 0.
    pub inliers: Vec<usize>,
    /// Samples drawn.
    pub n_samples: usize,
    /// Probability with which no larger consensus was missed; below that asked for where `max_samples` ended the search.
    pub confidence: f64,
    /// log₁₀ of the expected number of poses that as many random correspondences would agree with.
    pub log10_false_alarms: f64,
    /// The share of the good points' squared residual left below the threshold, 1 for a wide one and under a robust loss:
    /// docs/math/robust.md eq. (14).
    pub truncation: f64,
}

/// The pose from correspondences of which many are wrong.
///
/// # Errors
/// `NoConsensus` when too few agree to rule out chance, `InvalidSetting` for a setting that cannot be, and those of `locate` on the
/// correspondences that agree, their indices counted in `seen`.
pub fn consensus(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<Consensus, Error> {
    config.check(seen.len())?;
    check_numbers(seen)?;
    if seen.len() < 3 {
        return Err(Error::TooFewPoints { seen: seen.len(), needed: 3 });
    }
    let found = search(seen, camera, config)?;
    settle(found, seen, camera, config)
}
