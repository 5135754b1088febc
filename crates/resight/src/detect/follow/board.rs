//! A board from image to image: the part of the image that held it, and the whole image once it is not there.
//!
//! The whole image is looked through at half its size, a third of the time or less, and the board measured at full size where that shows it. What
//! shows at full size only (squares of few pixels) is looked for more seldom, so that a camera without its board costs little more than one with it.

use super::{Absence, BOARD_EVERY_S, Extent, SOON_S, TAG_EVERY_S, UNTIMED_S};
use crate::GrayImage;
use crate::detect::joints::halved;
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
    /// Since the whole image was looked through at full size, seconds.
    full_s: f64,
    /// The part searched last; its memory is used again.
    part: GrayImage,
}

/// A board is sought this far around where it is expected, pixels.
const REACH_PX: f64 = 24.0;
/// A part of more than this share of the image saves nothing.
const MOST_OF_IT: f64 = 0.8;
/// A board lost just now is looked for in the whole image at full size once in this time, seconds, at half the size in every image.
const FULL_EVERY_S: f64 = 0.25;

impl BoardFollower {
    pub fn new(detector: Detector, target: &Target) -> Self {
        let absence = Absence::new(TAG_EVERY_S);
        let part = GrayImage::filled(0, 0, 0);
        let full_s = f64::INFINITY;
        BoardFollower { detector, rim_share: rim_share(target), seen: Vec::new(), absence, full_s, part }
    }

    pub fn detect(
        &mut self,
        image: &GrayImage,
        elapsed_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<(Vec<Detection>, Extent), DetectError> {
        self.absence.passed(elapsed_s);
        self.full_s += elapsed_s;
        let near: Vec<Pixel> =
            self.seen.iter().copied().chain(expected.iter().map(|(_, pixel)| *pixel)).collect();
        let mut found = match self.region(image, &near) {
            Some(region) => self.within(image, region)?,
            None => Vec::new(),
        };
        let mut extent = Extent::Near;
        if self.is_lost(&found) {
            extent = Extent::Share;
            if self.absence.is_due() {
                found = self.elsewhere(image, found, elapsed_s)?;
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

    /// Whether this is much less of the board than was seen last, or nothing was.
    fn is_lost(&self, found: &[Detection]) -> bool {
        self.seen.is_empty() || self.is_less(found)
    }

    /// What the whole image shows: where half its size shows the board, else, when that is due, at full size. Images that come seldom are always
    /// searched at full size.
    fn elsewhere(
        &mut self,
        image: &GrayImage,
        found: Vec<Detection>,
        elapsed_s: f64,
    ) -> Result<Vec<Detection>, DetectError> {
        if elapsed_s < FULL_EVERY_S - UNTIMED_S {
            let there = self.by_half(image)?;
            if !there.is_empty() && !self.is_less(&there) {
                return Ok(there);
            }
            let every_s = if self.absence.gone_s <= SOON_S { FULL_EVERY_S } else { BOARD_EVERY_S };
            if self.full_s < every_s - UNTIMED_S {
                return Ok(if found.len() < there.len() { there } else { found });
            }
        }
        self.full_s = 0.0;
        self.detector.detect(image)
    }

    /// The board at full size, where half the size of the whole image shows it.
    fn by_half(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        let reduced = self.detector.detect(&halved(image))?;
        // The middle of a pixel of the reduced image is the corner of four.
        let enlarged = |detection: &Detection| 2.0 * detection.pixel + Pixel::new(0.5, 0.5);
        let places: Vec<Pixel> = reduced.iter().map(enlarged).collect();
        match self.region(image, &places) {
            Some(region) => self.within(image, region),
            None if places.is_empty() => Ok(Vec::new()),
            None => self.detector.detect(image),
        }
    }

    /// Whether this is much less of the board than was seen last.
    fn is_less(&self, found: &[Detection]) -> bool {
        2 * found.len() < self.seen.len()
    }

    /// The board in a part of the image.
    fn within(&mut self, image: &GrayImage, region: Region) -> Result<Vec<Detection>, DetectError> {
        if region.cut(image, &mut self.part).is_none() {
            return Ok(Vec::new());
        }
        let mut found = self.detector.detect(&self.part)?;
        found.iter_mut().for_each(|detection| detection.pixel += region.origin());
        Ok(found)
    }

    /// The part of the image around places of a board; none where that is most of the image, or there is no place.
    fn region(&self, image: &GrayImage, places: &[Pixel]) -> Option<Region> {
        let margin_px = REACH_PX + self.rim_share * longer_side_px(places);
        let region = Region::around(places, margin_px, [image.width_px, image.height_px])?;
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
