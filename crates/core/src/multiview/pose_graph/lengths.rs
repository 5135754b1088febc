//! Lengths of pairs that disagree along the lines between their cameras, as pairs do that were calibrated with targets of different size. Which size
//! is right nobody knows, so that all positions are as uncertain as the lengths. Derivation: docs/math/pose_graph.md eqs. (14)–(16).
//!
//! ```text
//!   a  residual translation along the line between the cameras  ·  c  that across it  ·  α, γ  their stated variances  ·  ρ  redundancy of the pair
//! ```

use super::noise::Noise;
use super::snooping::as_normal;
use super::{PairResult, PoseGraph};
use crate::Pose;
use nalgebra::DVector;

/// Standard normal quantile of 1 %: the chance that equal lengths seem to differ.
const BEYOND_CHANCE: f64 = 2.326;

/// Sums over pairs: squares over their variances and how many were expected, along and across, and the squared lengths over the variances along.
#[derive(Default)]
struct Sums {
    along: f64,
    across: f64,
    expected: f64,
    lengths: f64,
}

/// Returns what the lengths contribute to the motion of every camera, one standard deviation: eq. (16). None where they agree.
pub(super) fn shared(
    graph: &PoseGraph,
    poses: &[Pose],
    (pairs, noise): (&[PairResult], &Noise),
) -> Option<DVector<f64>> {
    let mut sums = Sums::default();
    for (i, result) in pairs.iter().enumerate().filter(|(_, result)| result.is_used) {
        let (pair, whole) = (&graph.pairs[i], noise.covariance(i));
        let line = (poses[pair.b] * poses[pair.a].inverse()).translation;
        let Some(direction) = line.try_normalize(0.0) else { continue };
        let variance = whole.fixed_view::<3, 3>(3, 3);
        let along = direction.dot(&(variance * direction));
        let shift = result.residual.fixed_rows::<3>(3);
        let a = direction.dot(&shift);
        let share = result.redundancy / 6.0;
        sums.along += a * a / along;
        sums.across += 2.0 * (shift.norm_squared() - a * a) / (variance.trace() - along);
        sums.expected += share;
        sums.lengths += line.norm_squared() * share / along;
    }
    let noise = sums.across / (2.0 * sums.expected);
    let ratio = sums.along / sums.expected / noise.max(f64::MIN_POSITIVE);
    if !(1.0 < sums.expected && BEYOND_CHANCE < as_normal(ratio, [sums.expected, 2.0 * sums.expected])) {
        return None;
    }
    let tau = ((sums.along - noise * sums.expected) / sums.lengths).sqrt();
    let motion = |pose: &Pose| {
        let t = pose.translation * tau;
        [0.0, 0.0, 0.0, t.x, t.y, t.z]
    };
    Some(DVector::from_iterator(6 * poses.len(), poses.iter().flat_map(motion)))
}
