//! The bend of the likelihood along the focal length: as f grows the distance grows with it, and the tilt changes, on a curve and not on a
//! straight line, docs/math/focal.md eqs. (26)–(28).

use super::cost::{Descent, FocalProblem, JointCovariance, UNKNOWNS};
use nalgebra::SVector;

/// Where the unknowns of the lens begin.
pub(super) const LOG_FOCAL: usize = 6;
/// The likelihood is probed so many standard deviations to either side.
const PROBE: f64 = 2.0;
/// A smaller rise of χ² at the probes is taken as this: a flatter ridge is a tenfold variance, and no answer.
const LEAST_RISE: f64 = 0.4;

type JointVector = SVector<f64, UNKNOWNS>;

/// The covariance of a minimum, noise and bend included.
pub(super) fn whole(
    problem: &FocalProblem,
    descent: &Descent,
    covariance: &JointCovariance,
    noise_scale: f64,
) -> JointCovariance {
    let scaled = covariance * noise_scale;
    let variance = scaled[(LOG_FOCAL, LOG_FOCAL)];
    let direction: JointVector = scaled.column(LOG_FOCAL) / variance.sqrt();
    let sides = [PROBE, -PROBE].map(|side| problem.along_ridge(descent, side * variance.sqrt()));
    let rises = sides.iter().map(|side| side.as_ref().map_or(0.0, |(_, chi2)| chi2 - descent.chi2));
    let rise = rises.fold(f64::INFINITY, f64::min) / noise_scale;
    let rise = rise.clamp(LEAST_RISE, PROBE * PROBE);
    let mut whole = scaled + direction * direction.transpose() * (PROBE * PROBE / rise - 1.0);
    if let [Some((up, _)), Some((down, _))] = sides {
        let bend = (up + down) / (2.0 * PROBE * PROBE);
        whole += bend * bend.transpose() * 3.0;
    }
    whole
}
