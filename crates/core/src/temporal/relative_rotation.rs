//! How a camera rotated about its own centre, from landmarks of a reference image that were found again: consensus, maximum
//! likelihood, covariance. Derivation: docs/math/turn.md.
//!
//! It holds where the landmarks are far off, or where the camera did not move but only turned: a translation is not seen. What
//! contradicts that (near things, things that move, a camera that moved) is left out where it is little and widens the covariance
//! where it is more.
//!
//! ```text
//!   bᵢ  bearing in the reference   ·   pᵢ  pixel now, Cᵢ its covariance up to a common factor s²   ·   π projection
//!   R   now_from_reference         ·   yᵢ = R bᵢ   ·   eᵢ = pᵢ − π(yᵢ)   ·   Jᵢ = −∂π/∂y [yᵢ]×, so that eᵢ ≈ Jᵢ ω
//!   H = Σ Jᵢᵀ Cᵢ⁻¹ Jᵢ              ·   gᵢ = Jᵢᵀ Cᵢ⁻¹ eᵢ
//! ```

mod fit;
mod agreement;

use crate::{Bearing, Camera, Error, Pixel};
use agreement::agreement;
use fit::{Fit, Prepared};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// A landmark found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmark {
    /// Where it was in the reference, camera frame.
    pub in_reference: Bearing,
    /// Where it is now, px.
    pub pixel: Pixel,
    /// Covariance of that pixel, px², positive definite; a factor common to all is estimated.
    pub covariance_px2: Matrix2<f64>,
    /// Landmarks of one neighbourhood may err alike (one near thing, one tree in the wind).
    pub neighbourhood: u32,
    /// How far a tone curve bent by one standard deviation puts it beside its place, px; the bend is common to all landmarks and is
    /// estimated. Zero where there is none.
    pub bent_px: Vector2<f64>,
    /// Errors common to all landmarks that no residual shows (reading between pixels): column k is how far one standard deviation of
    /// error k puts this one beside its place, px. They widen the covariance. Zero where there are none.
    pub unobserved_px: Matrix2<f64>,
}

/// What counts as agreeing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeRotationConfig {
    /// A landmark farther than this from where a rotation puts it does not agree with that rotation, px.
    pub threshold_px: f64,
    /// Landmarks that must agree, four at least.
    pub least: usize,
    /// Pairs drawn at most.
    pub max_samples: usize,
    /// Seed of the sampling. The same input and seed give the same answer, bit for bit.
    pub seed: u64,
}

impl RelativeRotationConfig {
    /// The defaults for a threshold in px.
    pub fn with_threshold_px(threshold_px: f64) -> Self {
        RelativeRotationConfig { threshold_px, least: 15, max_samples: 500, seed: 0 }
    }
}

/// A rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativeRotation {
    /// Rotation matrix: bearing now = now_from_reference · bearing in the reference.
    pub now_from_reference: Matrix3<f64>,
    /// Covariance of its small left rotation (camera frame now), rad²: docs/math/turn.md eq. (6).
    pub covariance: Matrix3<f64>,
    /// Landmarks that agree, ascending, by number in the input.
    pub used: Vec<usize>,
    /// Landmarks given that lie within the lens' field.
    pub given: usize,
    /// The tone curve's bend, in its standard deviations.
    pub bend: f64,
    /// s²: variances over those stated, as the residuals have it.
    pub noise_factor: f64,
    /// κ²: how much more whole neighbourhoods err than their landmarks' own errors would make them; 1 where they do not.
    pub coherence: f64,
    /// Root mean square of the residuals of those used, px over both coordinates.
    pub rms_px: f64,
}

/// A share of landmarks in agreement below which they contradict each other: no single turn explains what is seen.
const MOSTLY: f64 = 0.5;

impl RelativeRotation {
    /// Rotation vector of old_from_new (where the camera is now in its own old frame), radians about x, y, z, and its covariance.
    pub fn old_from_new(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let r = &self.now_from_reference;
        let vector = Rotation3::from_matrix_unchecked(r.transpose()).scaled_axis();
        (vector, r.transpose() * self.covariance * r)
    }

    /// Whether most of the landmarks given agree with one rotation.
    pub fn is_consistent(&self) -> bool {
        MOSTLY * self.given as f64 <= self.used.len() as f64
    }
}

/// The rotation that the most landmarks agree with, refined over them. `near` is tried first. Landmarks outside the lens' field are left out.
///
/// # Errors
/// `InvalidSetting`, `NotFinite` and `CovarianceNotPositive` for input that cannot be; `TooFewPoints` for fewer landmarks than must
/// agree; `NoConsensus` where fewer agree; `DegenerateView` where those that agree lie too close together.
pub fn relative_rotation(
    landmarks: &[Landmark],
    camera: &Camera,
    near: Option<&Matrix3<f64>>,
    config: &RelativeRotationConfig,
) -> Result<RelativeRotation, Error> {
    let least = check(landmarks, config)?;
    let prepared = Prepared::all(landmarks, camera)?;
    if prepared.len() < least {
        return Err(Error::TooFewPoints { seen: prepared.len(), needed: least });
    }
    let start = agreement(&prepared, near, config)?;
    let found = |best: usize| Error::NoConsensus {
        best,
        n: prepared.len(),
        needed: least,
        what: "landmarks",
        samples: start.samples,
    };
    if start.agreeing < least {
        return Err(found(start.agreeing));
    }
    let fit = Fit::of(&prepared, camera, &start.now_from_reference, config.threshold_px)?;
    if fit.used.len() < least {
        return Err(found(fit.used.len()));
    }
    fit.relative_rotation(&prepared, landmarks)
}

fn check(landmarks: &[Landmark], config: &RelativeRotationConfig) -> Result<usize, Error> {
    let seen = config.threshold_px;
    if !(0.0 < seen && seen.is_finite()) {
        return Err(Error::InvalidSetting { setting: "threshold_px", seen, needed: "it must be positive" });
    }
    let needed = config.least.max(4);
    if landmarks.len() < needed {
        return Err(Error::TooFewPoints { seen: landmarks.len(), needed });
    }
    for (index, landmark) in landmarks.iter().enumerate() {
        let numbers = landmark.in_reference.sum() + landmark.pixel.sum() + landmark.covariance_px2.sum();
        let numbers = numbers + landmark.bent_px.sum() + landmark.unobserved_px.sum();
        if !numbers.is_finite() {
            return Err(Error::NotFinite { what: "a number", index });
        }
    }
    Ok(needed)
}
