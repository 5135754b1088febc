//! Relative pose of two views of a camera with known intrinsics: rotation and direction of translation, with their covariance.
//!
//! five pairs → essential matrices → consensus of all pairs → which of the four poses → refinement (3 + 2 numbers) → covariance, or what is not
//! determined. Derivation: docs/math/two_view.md.
//!
//! ```text
//!   λ₂ b = λ₁ R a + t    a, b bearings of a point in the first and second view   ·   R, t  second_from_first, |t| = 1
//! ```

mod epipolar;
mod five_point;
mod fit;
mod agreement;

use crate::{Bearing, Error, Pose};
use agreement::{Agreement, agreement};
pub(crate) use epipolar::axes_across;
use epipolar::{RelativePose, squared_residual};
use fit::Fit;
use nalgebra::{Matrix3, Matrix3x2, Matrix5, Vector3};

/// A point seen in both views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BearingPair {
    /// In the first camera frame.
    pub first: Bearing,
    /// In the second camera frame.
    pub second: Bearing,
    /// Standard deviation of `first` about each of two axes across it, radians.
    pub sigma_first_rad: f64,
    /// … of `second`.
    pub sigma_second_rad: f64,
}

/// What counts as agreeing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoViewConfig {
    /// A pair agrees whose residual is less than this, in its own stated standard deviations.
    pub threshold_sigmas: f64,
    /// Pairs that must agree, eight at least.
    pub least: usize,
    /// Samples drawn at most.
    pub max_samples: usize,
    /// Seed of the sampling. The same input and seed give the same answer, bit for bit.
    pub seed: u64,
}

impl Default for TwoViewConfig {
    fn default() -> Self {
        TwoViewConfig { threshold_sigmas: 8.0, least: 20, max_samples: 500, seed: 0 }
    }
}

/// A relative pose.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoView {
    /// x_second = second_from_first · x_first, the translation at unit length.
    pub second_from_first: Pose,
    /// Covariance of (ω, δ): rotation ← Exp(ω) rotation, rad, second camera frame; translation ← translation + `across` δ, rad.
    /// docs/math/two_view.md eq. (12).
    pub covariance: Matrix5<f64>,
    /// The two axes across the translation, second camera frame.
    pub across: Matrix3x2<f64>,
    /// Pairs that agree, ascending, by number in the input.
    pub used: Vec<usize>,
    /// s²: variances over those stated, as the residuals show them.
    pub noise_factor: f64,
    /// A different pose that explains the pairs nearly as well, as every view of a single plane has one; `None` where no other was found.
    pub second_solution: Option<SecondSolution>,
}

/// How much worse a different pose explains the pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondSolution {
    /// Its truncated χ² less that of the best pose, in units of s².
    pub difference: f64,
    /// Standard deviation of that difference by chance, if both poses were right: from the pairs that agree with both.
    pub sigma: f64,
}

/// Difference of χ² below which a second solution is possible: chance exceeds it once in 20,000 times where both poses have equal residuals …
const AMBIGUOUS: f64 = 20.0;
/// … and in standard deviations, where they have different ones.
const AMBIGUOUS_SIGMAS: f64 = 4.0;

/// Standard deviations of a parallax that is more than noise.
const SIGNIFICANT: f64 = 3.0;

impl TwoView {
    /// Returns whether a second pose explains the pairs as well, as where all points lie in one plane.
    pub fn is_ambiguous(&self) -> bool {
        self.second_solution
            .is_some_and(|second| second.difference < AMBIGUOUS.max(AMBIGUOUS_SIGMAS * second.sigma))
    }

    /// Returns both depths of a pair's point in units of the baseline; `None` where the rays are parallel.
    pub fn depths(&self, pair: &BearingPair) -> Option<[f64; 2]> {
        let (y, b) = (self.second_from_first.rotation * pair.first.into_inner(), pair.second.into_inner());
        let square = y.cross(&b).norm_squared();
        let depths = self.relative().scaled_depths(pair).map(|scaled| scaled / square);
        (0.0 < square && (depths[0] + depths[1]).is_finite()).then_some(depths)
    }

    /// Returns the share of the pairs that agree whose rays differ, after the rotation, by more than three standard deviations: what is not far away
    /// moves through the view. Of a camera that stands still before a few moving things it is small.
    pub fn parallax_share(&self, pairs: &[BearingPair]) -> f64 {
        let moves = |i: &&usize| {
            let pair = &pairs[**i];
            let (y, b) =
                (self.second_from_first.rotation * pair.first.into_inner(), pair.second.into_inner());
            let sigma = pair.sigma_first_rad.hypot(pair.sigma_second_rad) * self.noise_factor.sqrt();
            SIGNIFICANT * sigma < y.cross(&b).norm()
        };
        self.used.iter().filter(moves).count() as f64 / self.used.len().max(1) as f64
    }

    fn relative(&self) -> RelativePose {
        RelativePose { r: self.second_from_first.rotation, t: self.second_from_first.translation }
    }
}

/// The relative pose that the most pairs agree with, refined over them. `near`, of which the rotation and the direction of translation are used, is
/// tried first.
///
/// # Errors
/// `InvalidSetting`, `NotFinite` and `NotPositive` for input that cannot be; `TooFewPoints` for fewer pairs than must agree; `NoConsensus` where
/// fewer agree, or no more than by chance; `DegenerateView` where the pairs show no parallax (the camera only rotated, or stood still), or lie too
/// close together.
pub fn two_view(
    pairs: &[BearingPair],
    near: Option<&Pose>,
    config: &TwoViewConfig,
) -> Result<TwoView, Error> {
    let least = check(pairs, config)?;
    let near = near.and_then(|pose| {
        let t = pose.translation.try_normalize(f64::MIN_POSITIVE)?;
        Some(RelativePose { r: pose.rotation, t }.essential())
    });
    let found = agreement(pairs, near, least, config)?;
    let fit = Fit::of(pairs, &found.best, config)?;
    let refused = |best: usize| Error::NoConsensus {
        best,
        n: pairs.len(),
        needed: found.needed,
        what: "pairs",
        samples: found.samples,
    };
    if fit.used.len() < found.needed {
        return Err(refused(fit.used.len()));
    }
    let second_solution = second_solution(pairs, &found, &fit, config);
    finished(pairs, fit, second_solution)
}

/// The relative pose nearest to `start`, without a search for another: for pairs of which a pose is known, as those seen through a slightly different
/// lens.
///
/// # Errors
/// As of [`two_view`].
pub fn refine_two_view(
    pairs: &[BearingPair],
    start: &Pose,
    config: &TwoViewConfig,
) -> Result<TwoView, Error> {
    let needed = check(pairs, config)?;
    let t = start
        .translation
        .try_normalize(f64::MIN_POSITIVE)
        .ok_or(Error::NotFinite { what: "a translation", index: 0 })?;
    let fit = Fit::of(pairs, &RelativePose { r: start.rotation, t }, config)?;
    if fit.used.len() < needed {
        return Err(Error::TooFewPoints { seen: fit.used.len(), needed });
    }
    finished(pairs, fit, None)
}

fn finished(
    pairs: &[BearingPair],
    fit: Fit,
    second_solution: Option<SecondSolution>,
) -> Result<TwoView, Error> {
    let noise_factor = fit.noise_factor();
    let covariance = fit.covariance(pairs)?;
    let across = axes_across(&fit.at.t);
    let second_from_first = Pose::new(fit.at.r, fit.at.t);
    Ok(TwoView { second_from_first, covariance, across, used: fit.used, noise_factor, second_solution })
}

/// The best of the other poses found.
fn second_solution(
    pairs: &[BearingPair],
    found: &Agreement,
    fit: &Fit,
    config: &TwoViewConfig,
) -> Option<SecondSolution> {
    let (limit, best) = (config.threshold_sigmas.powi(2), fit.at.essential());
    let starts = [found.other, exchanged(pairs, fit)].into_iter().flatten();
    let others = starts.filter_map(|start| Fit::of(pairs, &start, config).ok()).filter(|other| {
        agreement::DIFFERENT < other.at.t.cross(&fit.at.t).norm()
            || agreement::DIFFERENT < (other.at.r - fit.at.r).norm()
    });
    let compared = |other: Fit| {
        let (other, s2) = (other.at.essential(), fit.noise_factor());
        let (mut difference, mut square) = (0.0, 0.0);
        for pair in pairs {
            let [a, b] = [best, other].map(|e| squared_residual(&e, pair).min(limit) / s2);
            difference += b - a;
            square += if a.max(b) < fit::GATE.powi(2) { (b - a).powi(2) } else { 0.0 };
        }
        SecondSolution { difference, sigma: square.sqrt() }
    };
    others.map(compared).min_by(|a, b| a.difference.total_cmp(&b.difference))
}

/// A start near the second pose of a plane: its normal, by least squares of the inverse depths, takes the place of the translation.
fn exchanged(pairs: &[BearingPair], fit: &Fit) -> Option<RelativePose> {
    let (mut information, mut sum) = (Matrix3::zeros(), Vector3::zeros());
    for pair in fit.used.iter().map(|i| &pairs[*i]) {
        let (y, b) = (fit.at.r * pair.first.into_inner(), pair.second.into_inner());
        let [scaled, _] = fit.at.scaled_depths(pair);
        // Inverse depth is c²/scaled; weighted by its own precision, |t × b|.
        let (c2, weight) = (y.cross(&b).norm_squared(), fit.at.t.cross(&b).norm_squared());
        if scaled.abs() <= f64::MIN_POSITIVE {
            continue;
        }
        information += y * y.transpose() * weight;
        sum += y * (weight * c2 / scaled);
    }
    let normal = information.try_inverse()? * sum;
    // From behind the plane it moves towards it: −n of n · x = h.
    let t = normal.try_normalize(f64::MIN_POSITIVE)?;
    let poses = [t, -t].map(|t| RelativePose { r: fit.at.r, t });
    let behind = |at: &RelativePose| fit.used.iter().filter(|i| fit::is_behind(&pairs[**i], at)).count();
    poses.into_iter().min_by_key(behind)
}

fn truncated(pairs: &[BearingPair], e: &Matrix3<f64>, limit: f64) -> f64 {
    pairs.iter().map(|pair| squared_residual(e, pair).min(limit)).sum()
}

fn check(pairs: &[BearingPair], config: &TwoViewConfig) -> Result<usize, Error> {
    let seen = config.threshold_sigmas;
    if !(0.0 < seen && seen.is_finite()) {
        return Err(Error::InvalidSetting {
            setting: "threshold_sigmas",
            seen,
            needed: "it must be positive",
        });
    }
    for (index, pair) in pairs.iter().enumerate() {
        let sum: Vector3<f64> = pair.first.into_inner() + pair.second.into_inner();
        if !sum.sum().is_finite() {
            return Err(Error::NotFinite { what: "a bearing", index });
        }
        for seen in [pair.sigma_first_rad, pair.sigma_second_rad] {
            if !(0.0 < seen && seen.is_finite()) {
                return Err(Error::NotPositive { index, seen });
            }
        }
    }
    let needed = config.least.max(8);
    if pairs.len() < needed {
        return Err(Error::TooFewPoints { seen: pairs.len(), needed });
    }
    Ok(needed)
}
