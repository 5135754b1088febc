//! Which side of a flat target a camera sees: a print has one face, so a view from behind is a mirrored print or a mirrored image.

use super::verdict::{Status, Verdict};
use crate::core::{Correspondence, Point, Pose, Target};

/// Whether the camera stands behind the printed face; none of targets that have no face.
pub fn is_from_behind(target: &Target, cam_from_target: &Pose, points: &[Correspondence]) -> Option<bool> {
    // z runs into the surface, but for Kalibr's grid, whose z points to the viewer.
    let sign = match target.design() {
        Target::Chessboard(_) | Target::Charuco(_) | Target::Tag(_) | Target::LinePlusOne(_) => 1.0,
        Target::AprilGrid(_) => -1.0,
        _ => return None,
    };
    let middle = points.iter().map(|c| c.x_in_target).sum::<Point>() / points.len().max(1) as f64;
    Some(sign * cam_from_target.rotation.column(2).dot(&(*cam_from_target * middle)) < 0.0)
}

/// A pose behind the sheet is not to be relied on: the mirror image of the true one fits its pixels exactly as well.
pub fn judged(
    verdict: Verdict,
    target: &Target,
    cam_from_target: &Pose,
    points: &[Correspondence],
) -> Verdict {
    match is_from_behind(target, cam_from_target, points) {
        Some(true) if verdict.status.has_pose() => Verdict {
            status: Status::Inconsistent,
            message: format!(
                "the {} is seen mirrored, so this pose puts the camera behind its printed face; the image or the print is mirrored: switch off the \
                 mirror mode of the camera, or print the target again without mirroring (only of a board that is printed on both sides is it the pose)",
                target.design().kind()
            ),
        },
        _ => verdict,
    }
}
