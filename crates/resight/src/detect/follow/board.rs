//! Follows a board: searches for its corners at their last positions, in the part of the image that contained it, and in the whole image.
//!
//! A board that was complete is first measured at its last position: every corner must be within a pixel or two of it. No other position of the
//! board satisfies this, because its outermost squares have no equal squares beside them. Its ids are decoded again twice a second.
//!
//! The whole image is searched at half its size, in a third of the time or less, and the board is measured at full size where it is found.
//! Boards that are found only at full size (squares of few pixels) are searched for less often, so that a camera without its board costs little
//! more.

use super::{Absence, BOARD_EVERY_S, Extent, SOON_S, TAG_EVERY_S, UNTIMED_S};
use crate::GrayImage;
use crate::detect::homography::Homography;
use crate::detect::joints::halved;
use crate::detect::noise::noise_gray;
use crate::detect::print::Common;
use crate::detect::region::{Region, longer_side_px};
use crate::detect::template::REDRAWN_AGAIN_PX;
use crate::detect::{DetectError, Detector};
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use resight_core::{Pixel, Target};
use std::collections::BTreeSet;

/// Follows a chessboard, a ChArUco board or an AprilGrid.
pub(super) struct BoardFollower {
    detector: Detector,
    /// Width of the board's rim around its features, relative to the larger side of their bounding box.
    rim_share: f64,
    /// The last detection.
    seen: Vec<Detection>,
    /// Time since the ids were decoded, seconds.
    unread_s: f64,
    absence: Absence,
    /// Time since the whole image was searched at full size, seconds.
    full_s: f64,
    /// The part searched last; its memory is reused.
    part: GrayImage,
}

/// A board is searched for this far around its expected position, pixels.
const REACH_PX: f64 = 24.0;
/// Searching a part larger than this share of the image saves no time.
const MOST_OF_IT: f64 = 0.8;
/// Approximate number of corners that determine the motion of a board.
const SCOUTS: usize = 12;
/// Interval in which the ids of a board at rest are decoded, seconds; it cannot be exchanged or rotated unnoticed for longer.
const READ_EVERY_S: f64 = 0.5;
/// Interval in which a board that was just lost is searched for in the whole image at full size, seconds; at half the size, in every image.
const FULL_EVERY_S: f64 = 0.25;

impl BoardFollower {
    pub fn new(detector: Detector, target: &Target) -> Self {
        let absence = Absence::new(TAG_EVERY_S);
        let part = GrayImage::filled(0, 0, 0);
        let full_s = f64::INFINITY;
        BoardFollower {
            detector,
            rim_share: rim_share(target),
            seen: Vec::new(),
            unread_s: f64::INFINITY,
            absence,
            full_s,
            part,
        }
    }

    pub fn detect(
        &mut self,
        image: &GrayImage,
        elapsed_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<(Vec<Detection>, Extent), DetectError> {
        self.absence.passed(elapsed_s);
        self.full_s += elapsed_s;
        self.unread_s += elapsed_s;
        if let Some(found) = self.measured_again(image) {
            self.seen.clone_from(&found);
            return Ok((found, Extent::Near));
        }
        self.unread_s = 0.0;
        let near: Vec<Pixel> =
            self.seen.iter().map(|d| d.pixel).chain(expected.iter().map(|(_, pixel)| *pixel)).collect();
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
        self.seen.clone_from(&found);
        Ok((found, extent))
    }

    /// Measures the board at its last position, in the part of the image that contained it; `None` unless it was and is complete.
    ///
    /// A few corners determine how all have moved: a search that starts near its end takes half of the time.
    fn measured_again(&mut self, image: &GrayImage) -> Option<Vec<Detection>> {
        if READ_EVERY_S - UNTIMED_S < self.unread_s || !self.detector.is_whole_board(&self.seen) {
            return None;
        }
        let places: Vec<Pixel> = self.seen.iter().map(|d| d.pixel).collect();
        let region = self.region(image, &places)?;
        region.cut(image, &mut self.part)?;
        let moved = |d: &Detection, by: Pixel| Detection { pixel: d.pixel + by, ..*d };
        let seen: Vec<Detection> = self.seen.iter().map(|d| moved(d, -region.origin())).collect();
        let every = (seen.len() / SCOUTS).max(1);
        let picked: BTreeSet<Feature> = seen.iter().step_by(every).map(|d| d.feature).collect();
        let common =
            Common { noise_gray: noise_gray(&self.part), blur_px: None, redrawn_px: REDRAWN_AGAIN_PX };
        let (scouts, blur_px) = self.detector.measured_near(&self.part, common, &seen, &picked);
        if scouts.len() < picked.len() {
            return None;
        }
        let before = seen.iter().step_by(every).map(|d| d.pixel);
        let motion = Homography::fit(&before.zip(scouts.iter().map(|d| d.pixel)).collect::<Vec<_>>())?;
        let expected: Vec<Detection> =
            seen.iter().map(|d| Detection { pixel: motion.at(&d.pixel), ..*d }).collect();
        let all = seen.iter().map(|d| d.feature).collect();
        let common = Common { blur_px: Some(blur_px), ..common };
        let (found, _) = self.detector.measured_near(&self.part, common, &expected, &all);
        (found.len() == seen.len()).then(|| found.iter().map(|d| moved(d, region.origin())).collect())
    }

    /// Returns whether much less of the board is visible than was last, or nothing was.
    fn is_lost(&self, found: &[Detection]) -> bool {
        self.seen.is_empty() || self.is_less(found)
    }

    /// Searches the whole image: if the board is found at half the size, or else, when that is due, at full size. Images that arrive rarely are
    /// always searched at full size.
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

    /// Finds the board at full size if it is found at half the size of the whole image.
    fn by_half(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        let reduced = self.detector.detect(&halved(image))?;
        // The centre of a pixel of the reduced image is the common corner of four.
        let enlarged = |detection: &Detection| 2.0 * detection.pixel + Pixel::new(0.5, 0.5);
        let places: Vec<Pixel> = reduced.iter().map(enlarged).collect();
        match self.region(image, &places) {
            Some(region) => self.within(image, region),
            None if places.is_empty() => Ok(Vec::new()),
            None => self.detector.detect(image),
        }
    }

    /// Returns whether much less of the board is visible than was last.
    fn is_less(&self, found: &[Detection]) -> bool {
        2 * found.len() < self.seen.len()
    }

    /// Finds the board in a part of the image.
    fn within(&mut self, image: &GrayImage, region: Region) -> Result<Vec<Detection>, DetectError> {
        if region.cut(image, &mut self.part).is_none() {
            return Ok(Vec::new());
        }
        let mut found = self.detector.detect(&self.part)?;
        found.iter_mut().for_each(|detection| detection.pixel += region.origin());
        Ok(found)
    }

    /// Returns the part of the image around positions of a board; `None` where that is most of the image, or there are no positions.
    fn region(&self, image: &GrayImage, places: &[Pixel]) -> Option<Region> {
        let margin_px = REACH_PX + self.rim_share * longer_side_px(places);
        let region = Region::around(places, margin_px, [image.width_px, image.height_px])?;
        ((region.area_px() as f64) < MOST_OF_IT * image.data.len() as f64).then_some(region)
    }
}

/// Returns one and a half squares around the inner corners; an AprilGrid's corner squares reach beyond its tags.
fn rim_share(target: &Target) -> f64 {
    let (rim, spans) = match target.design() {
        Target::Chessboard(board) => (1.5, board.rows.min(board.columns).saturating_sub(1)),
        Target::Charuco(board) => (1.5, board.rows.min(board.columns).saturating_sub(2)),
        Target::AprilGrid(grid) => (0.6, grid.rows.min(grid.columns)),
        _ => (1.0, 1),
    };
    rim / spans.max(1) as f64
}
