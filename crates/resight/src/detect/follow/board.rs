//! A board from image to image: the part of the image that held it, and the whole image once it is not there.

use super::{Absence, BOARD_EVERY_S, Extent};
use crate::GrayImage;
use crate::detect::region::{Region, longer_side_px};
use crate::detect::{DetectError, Detector};
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use resight_core::{Pixel, Target};

/// Follows a chessboard, a ChArUco board or an AprilGrid.
pub(super) struct BoardFollower {
    detector: Detector,
    /// Width of what the board has around its features, of the larger side of their bounding box.
    rim_share: f64,
    /// Features found last.
    seen: Vec<Pixel>,
    absence: Absence,
    /// The part searched last; its memory is used again.
    part: GrayImage,
}

/// A board is sought this far around where it is expected, pixels.
const REACH_PX: f64 = 24.0;
/// A part of more than this share of the image saves nothing.
const MOST_OF_IT: f64 = 0.8;

impl BoardFollower {
    pub fn new(detector: Detector, target: &Target) -> Self {
        let absence = Absence::new(BOARD_EVERY_S);
        let part = GrayImage::filled(0, 0, 0);
        BoardFollower { detector, rim_share: rim_share(target), seen: Vec::new(), absence, part }
    }

    pub fn detect(
        &mut self,
        image: &GrayImage,
        elapsed_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<(Vec<Detection>, Extent), DetectError> {
        self.absence.passed(elapsed_s);
        let mut found = self.near(image, expected)?;
        let mut extent = Extent::Near;
        if self.seen.is_empty() || 2 * found.len() < self.seen.len() {
            extent = Extent::Share;
            if self.absence.is_due() {
                found = self.detector.detect(image)?;
                extent = Extent::Whole;
            }
        }
        if !found.is_empty() {
            self.absence.found();
        }
        self.seen.clear();
        self.seen.extend(found.iter().map(|detection| detection.pixel));
        Ok((found, extent))
    }

    fn near(
        &mut self,
        image: &GrayImage,
        expected: &[(Feature, Pixel)],
    ) -> Result<Vec<Detection>, DetectError> {
        let Some(region) = self.region(image, expected) else { return Ok(Vec::new()) };
        if region.cut(image, &mut self.part).is_none() {
            return Ok(Vec::new());
        }
        let mut found = self.detector.detect(&self.part)?;
        found.iter_mut().for_each(|detection| detection.pixel += region.origin());
        Ok(found)
    }

    /// Where the board was last and where it is expected; none where that is most of the image, or nothing is known.
    fn region(&self, image: &GrayImage, expected: &[(Feature, Pixel)]) -> Option<Region> {
        let points: Vec<Pixel> =
            self.seen.iter().copied().chain(expected.iter().map(|(_, pixel)| *pixel)).collect();
        let margin_px = REACH_PX + self.rim_share * longer_side_px(&points);
        let region = Region::around(&points, margin_px, [image.width_px, image.height_px])?;
        ((region.area_px() as f64) < MOST_OF_IT * image.data.len() as f64).then_some(region)
    }
}

/// One and a half squares around the inner corners; an AprilGrid's corner squares reach beyond its tags.
fn rim_share(target: &Target) -> f64 {
    let (rim, spans) = match target.design() {
        Target::Chessboard(board) => (1.5, board.rows.min(board.columns).saturating_sub(1)),
        Target::Charuco(board) => (1.5, board.rows.min(board.columns).saturating_sub(2)),
        Target::AprilGrid(grid) => (0.6, grid.rows.min(grid.columns)),
        _ => (1.0, 1),
    };
    rim / spans.max(1) as f64
}
