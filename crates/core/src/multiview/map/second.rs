//! Targets with a second pose: a square that is seen from one side only has two, and neighbours need not tell which is right. The same holds for
//! a camera by the only other square of a view.

use super::{Adjusted, MapProblem, resized};
use crate::Pose;
use crate::locate::choose::Ambiguity;
use crate::locate::{Config, locate};
use crate::multiview::rig_pose::{RigAmbiguity, RigView, locate_rig};

/// A second pose of a place, in the map's frame, and its residual sum of squares over that of the first.
pub(super) type SecondPose = Option<(Pose, f64)>;

/// Views by which a pose is examined. More views from elsewhere only exclude a second pose.
const VIEWS: usize = 8;

/// Returns the second pose of each place, with the cameras where the adjustment puts them.
pub(super) fn poses(problem: &MapProblem, adjusted: &Adjusted) -> Vec<SecondPose> {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    let of_square = |p: usize, used: &[usize]| -> SecondPose {
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
    let second = |p: usize| {
        let used = adjusted.of_place(p, true);
        of_square(p, &used).or_else(|| of_camera(problem, adjusted, &cam_from_map, p, &used))
    };
    (0..adjusted.places.len()).map(second).collect()
}

/// Returns the second pose of a place that one view shows in which the camera has a second pose by the other targets.
fn of_camera(
    problem: &MapProblem,
    adjusted: &Adjusted,
    cam_from_map: &[Option<Pose>],
    place: usize,
    used: &[usize],
) -> SecondPose {
    let [only] = used else { return None };
    let view = problem.observations[*only].view;
    let present = cam_from_map[view]?;
    let others = adjusted.seen_in(problem, view, Some(place));
    let found = locate(&others, problem.camera, &Config::default()).ok()?;
    let Ambiguity::Ambiguous { ratio, other } = &found.ambiguity else { return None };
    let is_first =
        present.angle_to_rad(&found.cam_from_target) <= present.angle_to_rad(&other.cam_from_target);
    let (other, ratio) =
        if is_first { (other.cam_from_target, *ratio) } else { (found.cam_from_target, 1.0 / ratio) };
    Some((other.inverse() * present * adjusted.rig.targets[place].body_from_target, ratio))
}
