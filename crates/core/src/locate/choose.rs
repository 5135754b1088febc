//! Chooses the pose among refined minima, and decides whether another one explains the pixels as well.

use crate::covariance::is_covariance;
use crate::solve::configuration::Geometry;
use crate::{Error, Matrix6, Pose};
use arrayvec::ArrayVec;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A local minimum of the reprojection error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum {
    /// The pose.
    pub cam_from_target: Pose,
    /// Covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Sum of squared residuals over their variances, those of priors included; of what they cost under a robust loss.
    pub chi2: f64,
    /// Root mean square distance between observed and projected points, px (mean over points, not coordinates).
    pub rms_px: f64,
    /// Logarithm of how much larger, by volume, the covariance of all residuals is here than that of the pixels alone: uncertain points
    /// and intrinsics spread more in the image the nearer the camera is. 0 where both are exact. χ² and this together are minus
    /// twice the log-likelihood, docs/math/refine.md eq. (8a).
    pub log_determinant: f64,
}

impl Minimum {
    /// A pose that is assumed, nothing seen yet.
    #[cfg(feature = "std")]
    pub(crate) fn assumed(cam_from_target: &Pose) -> Self {
        let (covariance, cam_from_target) = (Matrix6::zeros(), *cam_from_target);
        Minimum { cam_from_target, covariance, chi2: 0.0, rms_px: 0.0, log_determinant: 0.0 }
    }

    /// Minus twice its log-likelihood, up to a constant.
    pub(crate) fn cost(&self) -> f64 {
        self.chi2 + self.log_determinant
    }

    /// How far its cost is above another's, where residuals exceed the stated sigmas by `noise_scale` of variance, in units of the
    /// stated χ².
    pub(crate) fn cost_above(&self, best: &Minimum, noise_scale: f64) -> f64 {
        self.chi2 - best.chi2 + noise_scale * (self.log_determinant - best.log_determinant)
    }

    /// Every number in it is one, and its covariance is a covariance.
    pub(crate) fn is_finite(&self) -> bool {
        self.is_finite_with(&self.covariance)
    }

    /// Every number in it is one, and `covariance`, which stands for its own, is a covariance.
    pub(crate) fn is_finite_with(&self, covariance: &Matrix6) -> bool {
        let pose = &self.cam_from_target;
        // A sum is finite only if all its terms are (two infinities of opposite sign make NaN).
        let sum = pose.rotation.sum() + pose.translation.sum() + covariance.sum() + self.chi2 + self.rms_px;
        (sum + self.log_determinant).is_finite() && is_covariance(covariance)
    }
}

/// A minimum with its distance above the lowest one and its probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis {
    /// The minimum. Within the gate its covariance holds all that the answer's own holds; farther above it is that of the
    /// pixels alone.
    pub minimum: Minimum,
    /// χ² above that of the lowest minimum; with uncertain points or intrinsics minus twice the log-likelihood instead (`log_determinant`).
    pub delta_chi2: f64,
    /// Its probability, all minima found being all there are and no pose expected beforehand: docs/math/posterior.md.
    pub probability: f64,
    /// Within the gate: it explains the pixels about as well as the lowest.
    pub is_alternative: bool,
}

/// The minima beside the answer: second solutions within the gate by probability, then the others by χ². Four points in space have no
/// more than these.
pub type Others = [Option<Hypothesis>; 3];

/// Whether another pose explains the pixels as well.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // Boxing the other pose would put a heap into the single-pose path.
pub enum Ambiguity {
    /// No other minimum within the gate. `ratio` = residual sum of squares of the nearest other minimum over this one's;
    /// none when no other minimum exists.
    Unique {
        /// That ratio.
        ratio: Option<f64>,
    },
    /// Two poses fit: χ² of both is less than the gate above the lowest. The answer is the more probable one.
    Ambiguous {
        /// Residual sum of squares of the other over the answer's: below 1 where the more probable pose fits a little worse.
        ratio: f64,
        /// The next probable pose.
        other: Minimum,
    },
}

impl Ambiguity {
    /// Every number in it is one.
    pub(crate) fn is_finite(&self) -> bool {
        match self {
            Ambiguity::Ambiguous { ratio, other } => ratio.is_finite() && other.is_finite(),
            Ambiguity::Unique { ratio } => ratio.is_none_or(f64::is_finite),
        }
    }
}

/// Minima found so far, on the stack.
pub type Minima = ArrayVec<Minimum, 8>;

/// Two minima whose χ² differ by less than this both explain the pixels: 9 is three standard deviations. Measured on random
/// line-plus-one problems, 2–6 m at 0.3 px: 98.8 % stay unique, none of 19,761 wrong; a larger gate buys nothing. No view lets
/// more than 0.135 % through: docs/math/refine.md eq. (16).
pub const AMBIGUITY_GATE_CHI2: f64 = 9.0;
/// Residuals below this are rounding: they take no part in a ratio.
pub(crate) const ROUNDING_PX: f64 = 1e-9;
/// Two refinements that end closer than this many standard deviations of rotation ended in one minimum.
pub(crate) const DUPLICATE_SIGMAS: f64 = 0.1;

/// Adds a minimum unless the list has it already; keeps the list ordered by cost (χ², and the spread of what is uncertain), dropping
/// the worst when full.
pub fn insert(minima: &mut Minima, found: Minimum) {
    if !found.cost().is_finite() || minima.iter().any(|m| are_duplicates(m, &found)) {
        return;
    }
    if minima.is_full() {
        minima.pop();
    }
    let place = minima.iter().position(|m| found.cost() < m.cost()).unwrap_or(minima.len());
    minima.insert(place, found);
}

/// Orders by cost what was inserted by another cost.
pub(crate) fn sort(minima: &mut Minima) {
    minima.sort_unstable_by(|a, b| a.cost().total_cmp(&b.cost()));
}

/// The gate where points or intrinsics are uncertain, four standard deviations: what they spread in the image is known to first order
/// only, and a wrong pose is then wrong by many more of its own standard deviations. Measured on 280,000 random scenes of seven
/// layouts with both uncertain: at 9 fourteen unique answers were the wrong one of two poses, at 16 none.
pub(crate) const UNCERTAIN_GATE_CHI2: f64 = 16.0;

/// The gate where all points are near one line, four standard deviations: the likelihood is then far from normal about each minimum.
/// Measured on 40,000 views of points within 2 cm of a line of 1 m: docs/math/refine.md section 6.
pub(crate) const NARROW_GATE_CHI2: f64 = 16.0;

/// The gate of exact points and intrinsics.
pub(crate) fn gate_of_layout(geometry: Option<&Geometry>) -> f64 {
    if geometry.is_some_and(Geometry::is_narrow) { NARROW_GATE_CHI2 } else { AMBIGUITY_GATE_CHI2 }
}

/// Returns whether a cost this far above the lowest leaves both poses possible. `noise_scale` ≥ 1 is the variance by which the residuals
/// exceed the stated sigmas: the gate, `exact` where neither points nor intrinsics are uncertain, widens with it.
pub(crate) fn is_within_gate(other: &Minimum, best: &Minimum, noise_scale: f64, exact: f64) -> bool {
    let is_exact = best.log_determinant == 0.0 && other.log_determinant == 0.0;
    let gate = if is_exact { exact } else { UNCERTAIN_GATE_CHI2 };
    other.cost_above(best, noise_scale) < gate * noise_scale
}

/// The first minimum and the second solution beside it.
#[derive(Debug, Clone, Copy)]
pub struct Choice<'a> {
    /// The pose: the lowest minimum, or the most probable of those within the gate where they were ordered so.
    pub best: &'a Minimum,
    /// Residual sum of squares of the next minimum over that of the first; none when there is no other.
    pub ratio: Option<f64>,
    /// The next minimum, where it lies within the gate.
    pub alternative: Option<&'a Minimum>,
}

/// Returns the first minimum, and whether the next one is within the gate.
pub(crate) fn choose(
    minima: &Minima,
    n_points: usize,
    noise_scale: f64,
    gate: f64,
) -> Result<Choice<'_>, Error> {
    let best = minima.first().ok_or(Error::NoSolution { n_points })?;
    let other = minima.get(1);
    let alternative = other.filter(|other| is_within_gate(other, best, noise_scale, gate));
    Ok(Choice { best, ratio: other.map(|other| residual_ratio(best, other)), alternative })
}

fn residual_ratio(first: &Minimum, other: &Minimum) -> f64 {
    let squared = |m: &Minimum| m.rms_px.max(ROUNDING_PX).powi(2);
    squared(other) / squared(first)
}

/// How many of the first four minima, in order of χ², lie within the gate.
pub(crate) fn count_alternatives(minima: &Minima, noise_scale: f64, gate: f64) -> usize {
    let Some(lowest) = minima.first() else { return 0 };
    minima.iter().take(4).take_while(|m| is_within_gate(m, lowest, noise_scale, gate)).count()
}

fn are_duplicates(a: &Minimum, b: &Minimum) -> bool {
    are_within(a, b, 1.0)
}

/// Returns whether two rotations are closer than a fraction of their own standard deviation (‖R − R′‖ = √2 θ for small angles), the variances
/// being `noise_scale` times the stated ones.
pub(crate) fn are_within(a: &Minimum, b: &Minimum, noise_scale: f64) -> bool {
    let variance = |m: &Minimum| (0..3).map(|i| m.covariance[(i, i)]).sum::<f64>();
    let angle_squared = 0.5 * (a.cam_from_target.rotation - b.cam_from_target.rotation).norm_squared();
    angle_squared < DUPLICATE_SIGMAS * DUPLICATE_SIGMAS * noise_scale * variance(a).min(variance(b))
}
