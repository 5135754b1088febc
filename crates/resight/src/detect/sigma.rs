//! The accuracy of a detected corner: the standard deviations on which every covariance is based.

use super::apriltag::DecodedTag;
use resight_core::Pixel;

/// Error of a corner's position that a lens model leaves, standard deviation of each coordinate in pixels. It must be included, or every good
/// view would be called inconsistent. No single number fits all lenses (docs/math/corner_sigma.md section 5): recordings with published
/// intrinsics need 0.12 and 0.13 (chessboard, two webcams), 0.16 (EuRoC), 0.06 (TUM-VI fisheye), 0.21 and at most 0.05 (four ChArUco webcams).
/// The value makes the total as large as the corners' sigmas before they were predicted, so that verdicts do not change.
pub const LENS_PX: f64 = 0.16;

/// Sigma of a corner where the library gives none: its refinement did not converge, and the corner remained at the centre of mass of the
/// response, 0.09 px from the truth on rendered boards.
const UNREFINED_PX: f64 = 0.10;

/// Sigma of a corner refined in a window that may contain other edges.
pub(super) const WINDOW_PX: f64 = 0.05;

/// Sigma of a saddle point whose print is not visible: the edge of a shadow or of an object in front of the board lies across it. In rendered images
/// such corners are 0.6 to 3 px off.
pub(super) const UNEXPLAINED_PX: f64 = 1.0;

/// Returns the sigma of a saddle point from the library's own estimate (image noise through the fit, plus its systematic part).
pub(super) fn saddle_px(library_px: Option<f64>) -> f64 {
    library_px.filter(|s| s.is_finite() && 0.0 < *s).unwrap_or(UNREFINED_PX)
}

/// A tag corner is the intersection of two fitted edges; the number of points on each grows with its length. Against the reference corners of 46
/// photographed tags ours differ by 0.31 px per coordinate at edges of 12 to 21 px and by 0.19 px at 40 to 44 px; divided between both
/// detectors, this is 0.22 px and 0.13 px.
const TAG_AT_ONE_PX: f64 = 0.8;
/// Decision margin of a well lit tag, grey levels; below it the noise is larger relative to the contrast.
const CLEAR_MARGIN_GRAY: f64 = 50.0;

/// Returns the sigma of a tag corner, the intersection of two fitted edges.
pub(super) fn tag_px(tag: &DecodedTag) -> f64 {
    tag_corner_px(&tag.corners, Some(tag.margin_gray))
}

/// Returns the sigma of a tag corner from corners and decision margin (grey levels) alone; without a margin, a well lit tag is assumed.
pub fn tag_corner_px(corners: &[Pixel; 4], margin_gray: Option<f64>) -> f64 {
    let margin_gray = margin_gray.unwrap_or(CLEAR_MARGIN_GRAY);
    let dim = (CLEAR_MARGIN_GRAY / margin_gray.max(1.0)).max(1.0);
    dim * TAG_AT_ONE_PX / shortest_edge_px(corners).max(1.0).sqrt()
}

/// Returns the error of a tag's corner from lens and paper, for corners whose accuracy the image itself determines. The total is as large as the
/// corners' sigma was before it was predicted, so that verdicts do not change.
pub(super) fn tag_lens_px(corners: &[Pixel; 4]) -> f64 {
    LENS_PX.hypot(tag_corner_px(corners, None))
}

/// Returns the length of a quadrilateral's shortest edge, pixels.
pub(super) fn shortest_edge_px(corners: &[Pixel; 4]) -> f64 {
    (0..4).map(|k| (corners[(k + 1) % 4] - corners[k]).norm()).fold(f64::INFINITY, f64::min)
}
