//! Errors that neighbouring points share in a rig of a single view: docs/math/rig.md section 14.
//!
//! Points that were surveyed one after the other, such as the track of a drone, are displaced together. Where there are many views, their
//! scatter shows errors of that kind; in a single view only the order of the points does.

use super::adjust::Adjusted;
use super::layout::Layout;
use nalgebra::Vector2;

/// An observation with fewer points has no sequence to speak of.
const LEAST_POINTS: usize = 40;
/// Standard normal quantile for one in ten thousand, as in the other tests.
const QUANTILE: f64 = 3.719;
/// Sums end at this share of an observation's points: the products of one lag are few beyond.
const LONGEST: usize = 4;

/// What a single view shows of errors that several residuals share.
pub(super) struct Neighbours {
    /// Factor on the variances of poses for errors that neighbouring points share, eq. (25); 1 where the order of the points shows none.
    pub(super) of_poses: f64,
    /// Factor on the variances of intrinsics: an uncertain point displaces the residuals of all cameras that see it, eq. (26).
    pub(super) of_lenses: f64,
}

impl Neighbours {
    /// Several views show such errors by contradicting each other.
    pub(super) fn new(layout: &Layout, adjusted: &Adjusted) -> Self {
        let is_single = layout.bodies.windows(2).all(|pair| pair[0].0 == pair[1].0);
        if !is_single {
            return Neighbours { of_poses: 1.0, of_lenses: 1.0 };
        }
        let of_poses = variance_factor(adjusted);
        Neighbours { of_poses, of_lenses: of_poses * cameras_of_an_error(layout, adjusted) }
    }
}

/// Returns the number of cameras that see a point, as far as the point's own uncertainty and not the pixel's makes up the variance.
fn cameras_of_an_error(layout: &Layout, adjusted: &Adjusted) -> f64 {
    let (mut whole, mut by_pixels, mut n, mut longest) = (0.0, 0.0, 0, 0);
    for (i, seen) in layout.observations.iter().map(|o| &o.seen).enumerate() {
        for (c, p) in seen.iter().zip(&adjusted.residuals[i].points) {
            let Some((e, squared)) = p else { continue };
            let [uu, _, vv] = c.pixel_covariance();
            whole += squared;
            by_pixels += 2.0 * e.norm_squared() / (uu + vv);
        }
        n += seen.len();
        longest = longest.max(seen.len());
    }
    let share = if whole < by_pixels { 1.0 - whole / by_pixels } else { 0.0 };
    1.0 + share * (n as f64 / longest.max(1) as f64 - 1.0)
}

/// Computes eqs. (24) and (25).
fn variance_factor(adjusted: &Adjusted) -> f64 {
    let sequences: Vec<Vec<Vector2<f64>>> = (0..adjusted.residuals.len())
        .map(|i| whitened(adjusted, i))
        .filter(|r| LEAST_POINTS <= r.len())
        .collect();
    let n: usize = sequences.iter().map(Vec::len).sum();
    let total = products(&sequences, 0).sum::<f64>();
    let at_one = products(&sequences, 1);
    let (sum, squared) = at_one.fold((0.0, 0.0), |s, p| (s.0 + p, s.1 + p * p));
    if n == 0 || sum <= QUANTILE * f64::sqrt(squared) {
        return 1.0;
    }
    let longest = sequences.iter().map(Vec::len).max().unwrap_or(0) / LONGEST;
    let correlation = |lag: usize| products(&sequences, lag).sum::<f64>() / total;
    let pairs = (0..longest).map(|k| correlation(2 * k) + correlation(2 * k + 1));
    2.0 * pairs.take_while(|sum| 0.0 < *sum).sum::<f64>() - 1.0
}

/// Returns the residuals of an observation's points that take part, in their order, in standard deviations.
fn whitened(adjusted: &Adjusted, observation: usize) -> Vec<Vector2<f64>> {
    let points = adjusted.residuals[observation].points.iter().zip(&adjusted.parts.is_used[observation]);
    let used = points.filter(|(_, used)| **used).filter_map(|(p, _)| p.as_ref());
    used.map(|(e, squared)| e.try_normalize(0.0).unwrap_or_default() * squared.sqrt()).collect()
}

fn products(sequences: &[Vec<Vector2<f64>>], lag: usize) -> impl Iterator<Item = f64> {
    sequences.iter().flat_map(move |r| r.iter().zip(r.iter().skip(lag)).map(|(a, b)| a.dot(b)))
}
