//! Square fiducials: one tag, tags of a map, or every tag of a family.

use super::apriltag::{DecodedTag, QuadDecoder};
use super::families::Family;
use super::{DetectError, sigma};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;

/// A tag seen in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundTag {
    /// Its id.
    pub id: u32,
    /// Corners 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the upright tag, pixels.
    pub corners: [Pixel; 4],
    /// Standard deviation of each corner coordinate, pixels.
    pub sigma_px: f64,
    /// How far its bits lie from the black/white threshold, grey levels.
    pub margin_gray: f64,
}

/// Finds every tag of a family, copies of an id included.
pub struct TagFinder {
    decoder: QuadDecoder,
    min_margin_gray: f64,
    /// How many tags end the search early: all that are wanted.
    wanted: usize,
}

impl TagFinder {
    /// Tags of a family (AprilTag name or OpenCV dictionary), all ids. Fails on an unknown family.
    pub fn new(family: &str) -> Result<Self, DetectError> {
        Self::build(Family::named(family)?, usize::MAX)
    }

    /// Only these ids; others are neither decoded nor confused with them.
    pub fn with_ids(family: &str, ids: &[u32]) -> Result<Self, DetectError> {
        Self::build(Family::named(family)?.only(family, ids)?, ids.len())
    }

    fn build(family: Family, wanted: usize) -> Result<Self, DetectError> {
        let min_margin_gray = family.min_margin_gray();
        let decoder = QuadDecoder::new(&[family]).ok_or(DetectError::OutOfMemory)?;
        Ok(TagFinder { decoder, min_margin_gray, wanted })
    }

    /// The tags in an image, by id, then from the left.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FoundTag> {
        let mut best = Vec::new();
        for &decimate in search_order(image) {
            let tags = self.decoder.detect(image, decimate);
            let tags: Vec<DecodedTag> = tags.into_iter().filter(|t| self.min_margin_gray <= t.margin_gray).collect();
            if best.len() < tags.len() {
                best = tags;
            }
            if self.wanted <= best.len() {
                break;
            }
        }
        let mut found: Vec<FoundTag> = best.iter().map(FoundTag::new).collect();
        found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
        found
    }
}

impl FoundTag {
    fn new(tag: &DecodedTag) -> Self {
        FoundTag { id: tag.id, corners: tag.corners, sigma_px: sigma::tag_px(tag), margin_gray: tag.margin_gray }
    }

    /// Its four corners as detections.
    pub fn detections(&self) -> impl Iterator<Item = Detection> + '_ {
        self.corners.iter().zip(0..).map(|(&pixel, corner)| Detection {
            feature: Feature { id: self.id, corner },
            pixel,
            sigma_px: self.sigma_px,
        })
    }
}

fn search_order(_image: &GrayImage) -> &'static [f32] {
    &[2.0, 1.0]
}

/// Corners of the tags whose id is seen once; the ids seen more often, with how often.
pub(super) fn unique(found: &[FoundTag]) -> (Vec<Detection>, Vec<(u32, usize)>) {
    let mut detections = Vec::with_capacity(4 * found.len());
    let mut copies = Vec::new();
    for same in found.chunk_by(|a, b| a.id == b.id) {
        match same {
            [one] => detections.extend(one.detections()),
            several => copies.push((several[0].id, several.len())),
        }
    }
    (detections, copies)
}
