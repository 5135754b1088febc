//! A tag found in an image: its corners and their accuracy.

use super::apriltag::DecodedTag;
use super::sigma;
use super::tag_print::LaidTag;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;

/// A tag found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundTag {
    /// Its id.
    pub id: u32,
    /// Corners 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the upright tag, pixels.
    pub corners: [Pixel; 4],
    /// Standard deviation of each coordinate of each corner, from the image, pixels.
    pub sigmas_px: [f64; 4],
    /// Standard deviation of each coordinate for errors of the lens model and for paper that is not flat, pixels.
    pub lens_sigma_px: f64,
    /// The distance of its bits from the black/white threshold, grey levels.
    pub margin_gray: f64,
    /// The share of the image's variance that its print explains; 0 where the print could not be compared.
    pub explained: f64,
}

impl FoundTag {
    /// Builds a tag with the corners measured by its print, or those of the library where the print is not visible.
    pub(super) fn new(tag: &DecodedTag, laid: Option<&LaidTag>) -> Self {
        let by_edges = FoundTag::by_edges(tag);
        laid.map_or(by_edges, |laid| FoundTag {
            corners: laid.corners,
            sigmas_px: laid.sigmas_px,
            lens_sigma_px: sigma::tag_lens_px(&laid.corners),
            explained: laid.explained_of_all,
            ..by_edges
        })
    }

    /// Builds a tag with the corners of the library.
    pub(super) fn by_edges(tag: &DecodedTag) -> Self {
        FoundTag {
            id: tag.id,
            corners: tag.corners,
            sigmas_px: [sigma::tag_px(tag); 4],
            lens_sigma_px: sigma::LENS_PX,
            margin_gray: tag.margin_gray,
            explained: 0.0,
        }
    }

    /// Converts to the form in which the library returns a tag.
    pub(super) fn decoded(&self) -> DecodedTag {
        DecodedTag { family: 0, id: self.id, margin_gray: self.margin_gray, corners: self.corners }
    }

    /// Returns its four corners as detections.
    pub fn detections(&self) -> impl Iterator<Item = Detection> + '_ {
        let corners = self.corners.iter().zip(self.sigmas_px).zip(0..);
        corners.map(|((&pixel, sigma_px), corner)| Detection {
            feature: Feature { id: self.id, corner },
            pixel,
            sigma_px,
            lens_sigma_px: self.lens_sigma_px,
            covariance_px2: None,
        })
    }
}

/// Sorts tags by id, then from the left.
pub(super) fn sorted(mut found: Vec<FoundTag>) -> Vec<FoundTag> {
    found.sort_by(by_place_and_id);
    found
}

/// Compares two tags: by id, then from the left.
pub(super) fn by_place_and_id(a: &FoundTag, b: &FoundTag) -> std::cmp::Ordering {
    a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x))
}
