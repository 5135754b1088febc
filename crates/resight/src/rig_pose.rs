//! Solves for the pose of a known rig, from points that any of its cameras observe: the job of `resight rig-pose`.

mod read;
mod solve;

pub use read::{RigPoint, RigPointsView, TableRemarks, read_rig_points};
pub use solve::RigPoseRequest;

use crate::answer::rig_pose::RigPoseAnswer;
use crate::core::{Camera, Matrix6, Pose};
use crate::error::Error;
use crate::formats::{self, NamedCamera};
use crate::report::verdict::Verdict;
use crate::rig::places::placed;
use std::path::Path;

/// A camera of a known rig.
#[derive(Debug, Clone)]
pub struct KnownCamera {
    /// Name and lens, with the uncertainty of its intrinsics.
    pub named: NamedCamera,
    /// x_in_cam = cam_from_rig · x_in_rig.
    pub cam_from_rig: Pose,
    /// Covariance of its small left motion, camera frame; `None` when exact or not stated.
    pub covariance: Option<Matrix6>,
}

impl KnownCamera {
    fn camera(&self) -> &Camera {
        &self.named.camera
    }
}

/// Reads the cameras of a rig file, with their poses in a common frame.
///
/// # Errors
/// What is wrong with the file; a file with intrinsics only, or one whose poses do not connect its cameras.
pub fn read_known_rig(path: impl AsRef<Path>) -> Result<Vec<KnownCamera>, Error> {
    let path = path.as_ref();
    let cameras = formats::read_cameras(path)?.cameras;
    let places = match cameras.as_slice() {
        [_] if cameras[0].placement.is_none() => None,
        several => {
            Some(placed(several).map_err(|reason| Error::request(format!("{} {reason}", path.display())))?)
        }
    };
    let known = |(i, named): (usize, NamedCamera)| {
        let place = places.as_ref().map(|all| &all[i]);
        let covariance = place.and_then(|p| p.covariance).filter(|c| *c != Matrix6::zeros());
        KnownCamera { named, cam_from_rig: place.map_or_else(Pose::identity, |p| p.cam_from_rig), covariance }
    };
    Ok(cameras.into_iter().enumerate().map(known).collect())
}

/// Solves for the pose of a rig in each view, in file order.
///
/// ```no_run
/// # fn main() -> Result<(), resight::Error> {
/// use resight::rig_pose::{RigPoseRequest, read_known_rig, read_rig_points, rig_poses};
/// let rig = read_known_rig("rig.toml")?;
/// let views = read_rig_points("points.csv", &rig)?;
/// for answer in rig_poses(&rig, &views, &RigPoseRequest::default()) {
///     println!("{} {}: {}", answer.view, answer.status.name(), answer.message);
/// }
/// # Ok(())
/// # }
/// ```
pub fn rig_poses(
    rig: &[KnownCamera],
    views: &[RigPointsView],
    request: &RigPoseRequest,
) -> Vec<RigPoseAnswer> {
    let table = TableRemarks::of(views);
    let solved = |view| {
        let mut answer = solve::solved(rig, view, request);
        let verdict = Verdict { status: answer.status, message: std::mem::take(&mut answer.message) };
        Verdict { status: answer.status, message: answer.message } = verdict.with_sizes(&table.sizes);
        RigPoseAnswer { remarks: table.all().chain(&answer.remarks).cloned().collect(), ..answer }
    };
    views.iter().map(solved).collect()
}
