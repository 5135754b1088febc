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
        let mut all: Vec<DecodedTag> = Vec::new();
        for level in self.levels() {
            if level == FINEST && !all.is_empty() && FINEST_PIXELS < image.data.len() {
                break;
            }
            for tag in self.find_at(image, level) {
                if !all.iter().any(|known| same_place(known, &tag)) {
                    all.push(tag);
                }
            }
            if self.wanted <= all.len() {
                break;
            }
        }
        let mut found: Vec<FoundTag> = all.iter().map(FoundTag::new).collect();
        found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
        found
    }

    /// From coarse to fine. A large tag shows at a quarter of the size, in a sixteenth of the time; looking there
    /// first costs 5 % when it does not. With many tags some are small, so the coarse look rarely ends the search.
    fn levels(&self) -> impl Iterator<Item = f32> + use<> {
        let levels: &'static [f32] = if self.wanted == 1 { &[COARSE, FINE, FINEST] } else { &[FINE, FINEST] };
        levels.iter().copied()
    }

    fn find_at(&mut self, image: &GrayImage, level: f32) -> Vec<DecodedTag> {
        let clear = self.min_margin_gray;
        let tags: Vec<DecodedTag> =
            self.decoder.detect(image, level).into_iter().filter(|tag| clear <= tag.margin_gray).collect();
        if level < COARSE {
            return tags;
        }
        // The edges are searched over a range that grows with the reduction and then meets the bits inside: measure
        // again at the finer level, in the part of the image around the tag.
        tags.iter().filter_map(|tag| self.measure_again(image, tag)).collect()
    }

    fn measure_again(&mut self, image: &GrayImage, tag: &DecodedTag) -> Option<DecodedTag> {
        let (part, origin) = surroundings(image, tag)?;
        let found = self.decoder.detect(&part, FINE).into_iter().map(|mut found| {
            found.corners.iter_mut().for_each(|corner| *corner += origin);
            found
        });
        found.filter(|found| same_place(found, tag)).max_by(|a, b| a.margin_gray.total_cmp(&b.margin_gray))
    }
}

/// Reductions at which outlines are sought.
const COARSE: f32 = 4.0;
const FINE: f32 = 2.0;
const FINEST: f32 = 1.0;
/// Largest image, pixels, searched at full size although tags were found at half: at full size tags of 12 to 20 px
/// are found too (46 instead of 33 of 47 in photographs of 799 × 533 px), at four times the cost.
const FINEST_PIXELS: usize = 1_000_000;

/// Whether two readings are of one tag: same id, centres closer than half an edge.
fn same_place(a: &DecodedTag, b: &DecodedTag) -> bool {
    let centre = |tag: &DecodedTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    a.id == b.id && (centre(a) - centre(b)).norm() < 0.5 * sigma::shortest_edge_px(&a.corners)
}

/// The part of the image around a tag, with its quiet zone and the tiles the threshold looks at, and where it starts.
fn surroundings(image: &GrayImage, tag: &DecodedTag) -> Option<(GrayImage, Pixel)> {
    let span = |values: [f64; 4], n: u32| {
        let (min, max) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
        let margin = 16.0 + 0.3 * (max - min);
        // An even start keeps the reduced image on the same pixels as that of the whole image.
        let first = ((min - margin).max(0.0) / 2.0).floor() as u32 * 2;
        (first, ((max + margin).max(0.0).ceil() as u32).min(n))
    };
    let (u0, u1) = span(tag.corners.map(|c| c.x), image.width_px);
    let (v0, v1) = span(tag.corners.map(|c| c.y), image.height_px);
    if u1 <= u0 || v1 <= v0 {
        return None;
    }
    let rows = (v0..v1).map(|v| v as usize * image.width_px as usize);
    let data =
        rows.flat_map(|row| image.data[row + u0 as usize..row + u1 as usize].iter().copied()).collect();
    Some((GrayImage { width_px: u1 - u0, height_px: v1 - v0, data }, Pixel::new(u0 as f64, v0 as f64)))
}

impl FoundTag {
    fn new(tag: &DecodedTag) -> Self {
        FoundTag {
            id: tag.id,
            corners: tag.corners,
            sigma_px: sigma::tag_px(tag),
            margin_gray: tag.margin_gray,
        }
    }

    /// Its four corners as detections.
    pub fn detections(&self) -> impl Iterator<Item = Detection> + '_ {
        self.corners.iter().zip(0..).map(|(&pixel, corner)| Detection {
            feature: Feature { id: self.id, corner },
            pixel,
            sigma_px: self.sigma_px,
            covariance_px2: None,
        })
    }
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
