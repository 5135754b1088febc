//! Square fiducials: one tag, tags of a map, or every tag of a family.

use super::aprilgrid::GridTagFinder;
use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::families::Family;
use super::joints::{halved, joints};
use super::light;
use super::noise::Quietened;
use super::region::{Region, longer_side_px};
use super::tag_print::{self, LaidTag, Print};
use super::tiles::{self, CameraWatcher};
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
    /// Standard deviation of each coordinate of each corner by the image, pixels.
    pub sigmas_px: [f64; 4],
    /// Standard deviation of each coordinate by what the lens model and a print that is not flat leave, pixels.
    pub lens_sigma_px: f64,
    /// The distance of its bits from the black/white threshold, grey levels.
    pub margin_gray: f64,
    /// The share of the variance there that its print explains; 0 where the print could not be compared.
    pub explained: f64,
}

/// Finds every tag of a family, copies of an id included.
pub struct TagFinder {
    decoder: QuadDecoder,
    family: Family,
    min_margin_gray: f64,
    /// How many tags end the search early: all that are wanted.
    wanted: usize,
    /// Width of what the family has outside the corners, in edges.
    rim_edges: f64,
    /// The part of an image searched last; its memory is used again.
    part: GrayImage,
    /// The same tags inside an AprilGrid, whose squares touch them; built when one is looked for.
    in_grid: Option<GridTagFinder>,
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
        let rim_edges = family.rim_edges();
        // Black and white of a tag that is believed lie at least twice its margin apart. Half of that leaves room for blur, and
        // the noise of an even wall, which cost most of the time, is no longer taken for outlines.
        let mut decoder = QuadDecoder::new(std::slice::from_ref(&family)).ok_or(DetectError::OutOfMemory)?;
        decoder.set_least_contrast(min_margin_gray as u8);
        Ok(TagFinder {
            decoder,
            family,
            min_margin_gray,
            wanted,
            rim_edges,
            part: GrayImage::filled(0, 0, 0),
            in_grid: None,
        })
    }

    /// The tags in an image, by id, then from the left, copies of an id included.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FoundTag> {
        // Half the size shows all copies of a tag; a quarter shows the large ones that are blurred.
        let levels: &[f32] = if self.wanted == 1 { &[FINE, COARSE, FINEST] } else { &[FINE, FINEST] };
        let quiet = Quietened::new(image);
        let tags = if quiet.is_smoothed() {
            self.search_noisy(image, &quiet, levels)
        } else {
            self.search(image, levels)
        };
        let found = self.measured(image, quiet.noise_gray, &tags);
        if found.is_empty() { self.find_in_grid(image) } else { found }
    }

    /// The tags that are part of an AprilGrid, where the image may show one.
    pub(super) fn find_in_grid(&mut self, image: &GrayImage) -> Vec<FoundTag> {
        // Half the size tells in a quarter of the time whether there are joints of squares at all.
        if joints(&halved(image)).len() < LEAST_JOINTS {
            return Vec::new();
        }
        let finder = match self.in_grid.take().or_else(|| GridTagFinder::of(&self.family)) {
            Some(finder) => self.in_grid.insert(finder),
            None => return Vec::new(),
        };
        finder.find(image)
    }

    /// Each tag measured by its print, by id, then from the left.
    fn measured(&self, image: &GrayImage, noise_gray: f64, tags: &[DecodedTag]) -> Vec<FoundTag> {
        let measured = |tag: &DecodedTag| {
            FoundTag::new(tag, self.laid(image, noise_gray, tag.id, &tag.corners, None).as_ref())
        };
        sorted(tags.iter().map(measured).collect())
    }

    /// A tag measured by its print, from the corners that the library found, or those of the image `before`; none where the print does not show.
    pub(super) fn laid(
        &self,
        image: &GrayImage,
        noise_gray: f64,
        id: u32,
        corners: &[Pixel; 4],
        before: Option<&LaidTag>,
    ) -> Option<LaidTag> {
        let index = self.family.ids.iter().position(|known| *known == id)?;
        let print = Print::new(&self.family, self.family.codes[index])?;
        tag_print::lay(image, noise_gray, &print, corners, self.wanted, before)
    }

    /// Found in the smoothed image, measured in the image as it came, where alone the smallest tags show.
    fn search_noisy(&mut self, image: &GrayImage, quiet: &Quietened, levels: &[f32]) -> Vec<DecodedTag> {
        let least = self.min_margin_gray as u8;
        self.decoder.set_least_contrast(quiet.least_contrast(least));
        let reduced: Vec<f32> = levels.iter().copied().filter(|level| FINEST < *level).collect();
        let mut all = self.search(quiet.image(), &reduced);
        self.decoder.set_least_contrast(least);
        for tag in &mut all {
            *tag = self.measure_again(image, tag).unwrap_or(*tag);
        }
        if all.len() < self.wanted {
            self.decoder.set_least_contrast(quiet.least_contrast_unsmoothed(least));
            if all.is_empty() || image.data.len() <= FINEST_PIXELS {
                self.add_at(image, FINEST, &mut all);
            }
            self.decoder.set_least_contrast(least);
        }
        all
    }

    /// The tags that show at these reductions, from coarse to fine, until all that are wanted are found.
    pub(super) fn search(&mut self, image: &GrayImage, levels: &[f32]) -> Vec<DecodedTag> {
        let mut all: Vec<DecodedTag> = Vec::new();
        for &level in levels {
            if level == FINEST && !all.is_empty() && FINEST_PIXELS < image.data.len() {
                break;
            }
            match self.in_other_light(image, level, all.is_empty()) {
                Some(other) => add_new(&mut all, self.find_where_structured(&other, level)),
                None => self.add_at(image, level, &mut all),
            }
            if all.is_empty() && level == FINE {
                // A shadow with hard edges: its logarithm shows what the image does not.
                let log = light::logarithm(image).filter(|_| !self.family.is_weak());
                log.iter().for_each(|log| self.add_at(log, level, &mut all));
            }
            if self.wanted <= all.len() {
                break;
            }
        }
        all
    }

    /// Tags in the part of an image in another light that shows anything.
    fn find_where_structured(&mut self, image: &GrayImage, level: f32) -> Vec<DecodedTag> {
        let region = light::structured(image)
            .and_then(|ends| Region::around(&ends, 16.0, [image.width_px, image.height_px]));
        region.map_or(Vec::new(), |region| self.find_in(image, &region, level))
    }

    /// The image in which small tags are sought where none was found at half the size: those in a shadow or without a white margin show too. Codes that
    /// chance gives are sought in the image as it came, whose contrast tells.
    fn in_other_light(&self, image: &GrayImage, level: f32, is_none: bool) -> Option<GrayImage> {
        if level != FINEST || !is_none || self.family.is_weak() {
            return None;
        }
        light::stretched(image, Quietened::new(image).least_contrast_unsmoothed(self.min_margin_gray as u8))
    }

    /// Tags in a part of an image, corners in the pixels of the whole.
    pub(super) fn find_in(&mut self, image: &GrayImage, region: &Region, level: f32) -> Vec<DecodedTag> {
        let mut part = std::mem::replace(&mut self.part, GrayImage::filled(0, 0, 0));
        let mut found = match region.cut(image, &mut part) {
            Some(()) => self.find_at(&part, level, &[]),
            None => Vec::new(),
        };
        self.part = part;
        found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
        found
    }

    /// The part of an image that a tag with these corners is found in, `reach_px` around where it may be: with its rim, its quiet zone
    /// and the tiles that the threshold looks at.
    pub(super) fn region(&self, corners: &[Pixel], reach_px: f64, size_px: [u32; 2]) -> Option<Region> {
        let margin_px = 16.0 + (self.rim_edges + 0.2) * longer_side_px(corners) + reach_px;
        Region::around(corners, margin_px, size_px)
    }

    /// Adds the tags that show at this reduction and are not there yet.
    pub(super) fn add_at(&mut self, image: &GrayImage, level: f32, all: &mut Vec<DecodedTag>) {
        let found = self.find_at(image, level, all);
        add_new(all, found);
    }

    /// The tags that show at this reduction; of those known already none, or some again.
    fn find_at(&mut self, image: &GrayImage, level: f32, known: &[DecodedTag]) -> Vec<DecodedTag> {
        let clear = self.min_margin_gray;
        let edges = if level < COARSE { Edges::FullSize } else { Edges::Outline };
        let mut tags = tiles::search(&mut self.decoder, image, CameraWatcher { decimate: level, edges });
        tags.retain(|tag| clear <= tag.margin_gray);
        if edges == Edges::FullSize {
            return tags;
        }
        // Edges fitted from as far as this reduction would meet the bits inside: measured again at the finer level, in the part of the
        // image around the tag.
        let new = tags.iter().filter(|tag| !known.iter().any(|known| same_place(known, tag)));
        new.filter_map(|tag| self.measure_again(image, tag)).collect()
    }

    fn measure_again(&mut self, image: &GrayImage, tag: &DecodedTag) -> Option<DecodedTag> {
        let region = self.region(&tag.corners, 0.0, [image.width_px, image.height_px])?;
        let found = self.find_in(image, &region, FINE).into_iter().filter(|found| same_place(found, tag));
        found.max_by(|a, b| a.margin_gray.total_cmp(&b.margin_gray))
    }
}

/// Joints of the squares around a tag of a grid: fewer show none.
const LEAST_JOINTS: usize = 8;

/// By id, then from the left.
pub(super) fn sorted(mut found: Vec<FoundTag>) -> Vec<FoundTag> {
    found.sort_by(by_place_and_id);
    found
}

/// The order of tags: by id, then from the left.
pub(super) fn by_place_and_id(a: &FoundTag, b: &FoundTag) -> std::cmp::Ordering {
    a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x))
}

/// Adds the tags that are not there yet.
pub(super) fn add_new(all: &mut Vec<DecodedTag>, found: Vec<DecodedTag>) {
    for tag in found {
        if !all.iter().any(|known| same_place(known, &tag)) {
            all.push(tag);
        }
    }
}

/// Reductions at which outlines are sought.
pub(super) const COARSE: f32 = 4.0;
pub(super) const FINE: f32 = 2.0;
pub(super) const FINEST: f32 = 1.0;
/// Largest image, pixels, searched at full size although tags were found at half: at full size tags of 12 to 20 px
/// are found too (46 instead of 33 of 47 in photographs of 799 × 533 px), at four times the cost.
const FINEST_PIXELS: usize = 1_000_000;

/// Whether two readings are of one tag: same id, centres closer than half an edge.
pub(super) fn same_place(a: &DecodedTag, b: &DecodedTag) -> bool {
    let centre = |tag: &DecodedTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    a.id == b.id && (centre(a) - centre(b)).norm() < 0.5 * sigma::shortest_edge_px(&a.corners)
}

impl FoundTag {
    /// As its print has it, or the library where that does not show.
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

    /// As the library has it.
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

    /// As the library would have read it.
    pub(super) fn decoded(&self) -> DecodedTag {
        DecodedTag { family: 0, id: self.id, margin_gray: self.margin_gray, corners: self.corners }
    }

    /// Its four corners as detections.
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

/// Ids seen more often than once, with how often.
pub(super) type Copies = Vec<(u32, usize)>;

/// Corners of the tags found, by id, and the ids seen more often than once, with how often. A copied tag of a map is left out, for the others
/// still say where the camera is; where none is left, and of a single tag, copies are an error.
pub(super) fn single_or_unique(
    found: &[FoundTag],
    is_map: bool,
) -> Result<(Vec<Detection>, Copies), DetectError> {
    let (detections, copies) = unique(found);
    match copies.first() {
        Some(&(id, count)) if !is_map || detections.is_empty() => Err(DetectError::Copies { id, count }),
        _ => Ok((detections, copies)),
    }
}

/// Corners of the tags whose id is seen once; the ids seen more often, with how often.
fn unique(found: &[FoundTag]) -> (Vec<Detection>, Copies) {
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
