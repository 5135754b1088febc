//! Determines which side of a flat target a camera sees: a print has one front, so a view from behind means a mirrored print or image.

use super::verdict::{Status, Verdict};
use crate::core::correspondence::Detection;
use crate::core::{Correspondence, Pixel, Point, Pose, Target};
use nalgebra::Matrix2;

/// Returns whether the camera is behind the printed front; `None` for targets without a front.
pub fn is_from_behind(target: &Target, cam_from_target: &Pose, points: &[Correspondence]) -> Option<bool> {
    let sign = facing(target)?;
    let middle = points.iter().map(|c| c.x_in_target).sum::<Point>() / points.len().max(1) as f64;
    Some(sign * cam_from_target.rotation.column(2).dot(&(*cam_from_target * middle)) < 0.0)
}

/// Returns 1 where z points into the surface, −1 for Kalibr's grid, whose z points to the viewer; `None` for targets without a front.
fn facing(target: &Target) -> Option<f64> {
    match target.design() {
        Target::Chessboard(_)
        | Target::Charuco(_)
        | Target::CircleGrid(_)
        | Target::Tag(_)
        | Target::LinePlusOne(_) => Some(1.0),
        Target::AprilGrid(_) => Some(-1.0),
        _ => None,
    }
}

/// Returns whether points in an image are mirrored against the printed front, by the affine map that fits them best, which no lens changes.
/// `None` for targets without a front, and for points on one line.
pub fn is_mirrored(target: &Target, detections: &[Detection]) -> Option<bool> {
    let sign = facing(target)?;
    let known = detections.iter().filter_map(|d| Some((target.point(d.feature)?.position.xy(), d.pixel)));
    let pairs: Vec<(Pixel, Pixel)> = known.collect();
    let n = pairs.len().max(1) as f64;
    let (x0, u0) =
        pairs.iter().fold((Pixel::zeros(), Pixel::zeros()), |(x, u), p| (x + p.0 / n, u + p.1 / n));
    let (mut by_plane, mut plane) = (Matrix2::zeros(), Matrix2::zeros());
    for (x, u) in &pairs {
        by_plane += (u - u0) * (x - x0).transpose();
        plane += (x - x0) * (x - x0).transpose();
    }
    let map = by_plane * plane.try_inverse()?;
    let determinant = map.determinant();
    (determinant != 0.0 && determinant.is_finite()).then_some(sign * determinant < 0.0)
}

/// What is wrong with a mirrored view, and the way out.
pub const MIRRORED: &str = "is seen mirrored; the image or the print is mirrored: switch off the mirror mode of the camera, or print the target again \
    without mirroring (only of a board that is printed on both sides is it its back)";

/// Rejects a pose behind the sheet: the mirror image of the true pose fits its pixels equally well.
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
