//! Measured distances between cameras: residuals that depend on the cameras alone, docs/math/rig.md eq. (12).

use super::KnownDistance;
use crate::least_squares::rig::{RigEquations, RigGraph, RigPoses};
use crate::{Pose, Vector6};

/// Returns measured less computed distance in standard deviations, and the derivatives of the computed one by both cameras' motions.
fn residual(known: &KnownDistance, cam_from_rig: &[Pose]) -> (f64, [(usize, Vector6); 2]) {
    let (a, b) = (&cam_from_rig[known.a], &cam_from_rig[known.b]);
    let apart = a.origin() - b.origin();
    let distance_m = apart.norm();
    let along = if 0.0 < distance_m { apart / distance_m } else { apart };
    // A left motion [ω; ν] moves the centre by −Rᵀν.
    let by = |pose: &Pose, sign: f64| {
        let v = pose.rotation * along * (sign / known.sigma_m);
        Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
    };
    ((known.distance_m - distance_m) / known.sigma_m, [(known.a, by(a, -1.0)), (known.b, by(b, 1.0))])
}

/// Adds the residuals of all known distances.
pub(super) fn add_distances(
    equations: &mut RigEquations,
    known: &[KnownDistance],
    places: &RigPoses,
    graph: &RigGraph,
) {
    for known in known {
        let (residual, by) = residual(known, &places.cam_from_rig);
        let block = |(camera, d): &(usize, Vector6)| Some((graph.block_of_camera[*camera]?, *d));
        let by: Vec<(usize, Vector6)> = by.iter().filter_map(block).collect();
        equations.add_shared(residual, &by);
    }
}
