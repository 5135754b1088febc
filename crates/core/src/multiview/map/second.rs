//! Targets with a second pose: a square that is seen from one side only has two, and neighbours need not tell which is right.

use super::{Adjusted, MapProblem, resized};
use crate::Pose;
use crate::multiview::rig_pose::{RigAmbiguity, RigView, locate_rig};

/// A second pose of a place, in the map's frame, and its residual sum of squares over that of the first.
pub(super) type SecondPose = Option<(Pose, f64)>;

/// Views by which a pose is examined. More views from elsewhere only exclude a second pose.
const VIEWS: usize = 8;

/// Returns the second pose of each place, with the cameras where the adjustment puts them.
pub(super) fn poses(problem: &MapProblem, adjusted: &Adjusted) -> Vec<SecondPose> {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    let second = |p: usize| -> SecondPose {
        let used = adjusted.of_place(p, true);
        let size = adjusted.sizes[adjusted.places[p].target];
        let chosen = used.iter().step_by(used.len().div_ceil(VIEWS).max(1));
        let seen: Vec<_> = chosen
            .filter_map(|i| {
                let observation = &problem.observations[*i];
                Some((cam_from_map[observation.view]?, resized(&observation.seen, size)))
            })
            .collect();
        let views: Vec<RigView> = seen
            .iter()
            .map(|(cam_from_rig, seen)| RigView {
                camera: problem.camera,
                cam_from_rig: *cam_from_rig,
                cam_from_rig_covariance: None,
                intrinsics_covariance: None,
                seen,
            })
            .collect();
        let found = locate_rig(&views).ok()?;
        let RigAmbiguity::Ambiguous { ratio, other } = found.ambiguity else { return None };
        let own = adjusted.rig.targets[p].body_from_target;
        let is_first = own.angle_to_rad(&found.rig_from_target) <= own.angle_to_rad(&other.rig_from_target);
        Some(if is_first { (other.rig_from_target, ratio) } else { (found.rig_from_target, 1.0 / ratio) })
    };
    (0..adjusted.places.len()).map(second).collect()
}
