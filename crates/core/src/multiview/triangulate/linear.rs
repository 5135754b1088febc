//! A start from all rays at once: the point nearest to them, each distance divided by its own, docs/math/triangulate.md eq. (8).

use super::BearingObservation;
use crate::Point;
use nalgebra::{Matrix3, Vector3};

/// Rounds of new weights: the distances settle to a few parts in a hundred in two.
const ROUNDS: usize = 3;

/// None where all rays are parallel.
pub(super) fn nearest_to_rays(bearing_observations: &[BearingObservation]) -> Option<Point> {
    let mut depths = vec![1.0; bearing_observations.len()];
    let mut place = None;
    for _ in 0..ROUNDS {
        let (mut left, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (bearing_observation, depth) in bearing_observations.iter().zip(&depths) {
            let b = bearing_observation.bearing_in_world;
            let across = (Matrix3::identity() - b * b.transpose()) / (depth * depth);
            left += across;
            right += across * bearing_observation.centre_in_world;
        }
        let x: Point = left.cholesky()?.solve(&right);
        place = Some(x).filter(|x| x.sum().is_finite());
        for (bearing_observation, depth) in bearing_observations.iter().zip(&mut depths) {
            *depth = (x - bearing_observation.centre_in_world).norm().max(f64::MIN_POSITIVE);
        }
    }
    place
}
