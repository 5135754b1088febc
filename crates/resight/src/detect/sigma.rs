//! How well a detector places a corner: the standard deviations that every covariance downstream rests on.

use super::apriltag::DecodedTag;
use resight_core::Pixel;

/// Smallest sigma of a saddle point, pixels: what remains between a good detector and a good lens model.
pub(super) const SADDLE_FLOOR_PX: f64 = 0.10;

/// Sigma of a corner where the library gives none: its refinement did not converge, and the corner stayed at the
/// centre of mass of the response, 0.09 px from the truth on rendered boards.
const UNREFINED_PX: f64 = 0.30;

/// Sigma of a saddle point from the library's own estimate (image noise through the fit, plus its systematic part).
pub(super) fn saddle_px(library_px: Option<f64>) -> f64 {
    match library_px.filter(|s| s.is_finite()) {
        Some(s) => s.hypot(SADDLE_FLOOR_PX),
        None => UNREFINED_PX,
    }
}

/// Smallest sigma of a tag corner, pixels.
const TAG_FLOOR_PX: f64 = 0.10;

/// Sigma of a tag corner, the meeting point of two fitted edges.
pub(super) fn tag_px(tag: &DecodedTag) -> f64 {
    let _ = shortest_edge_px(&tag.corners);
    TAG_FLOOR_PX
}

/// Length of a quadrilateral's shortest edge, pixels.
pub(super) fn shortest_edge_px(corners: &[Pixel; 4]) -> f64 {
    (0..4).map(|k| (corners[(k + 1) % 4] - corners[k]).norm()).fold(f64::INFINITY, f64::min)
}
