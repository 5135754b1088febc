//! Finds square fiducials: one tag, the tags of a map, or every tag of a family.

use super::aprilgrid::GridTagFinder;
use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::chessboard::squares::{Square, black_squares};
use super::families::Family;
use super::found_tag::sorted;
use super::joints::halved;
use super::light;
use super::noise::{Quietened, noise_gray, spread_of_tiles};
use super::outlines::{self, Ink};
use super::region::{Region, joined, longer_side_px};
use super::saddles::saddles;
use super::tag_print::{self, LaidTag, Print};
use super::tiles::{self, CameraWatcher};
use super::{DetectError, sigma};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use std::cell::OnceCell;

pub use super::found_tag::FoundTag;

/// Finds every tag of a family, copies of an id included.
pub struct TagFinder {
    decoder: QuadDecoder,
    family: Family,
    min_margin_gray: f64,
    /// Number of tags that end the search early: all that are wanted.
    wanted: usize,
    /// Width of the family's print outside the corners, in edges.
    rim_edges: f64,
    /// The part of an image searched last; its memory is reused.
    part: GrayImage,
    /// Finds the same tags in an AprilGrid, whose squares touch them; built when needed.
    in_grid: Option<GridTagFinder>,
}

/// An image, and what several searches need to know of it.
pub(super) struct Ground<'a> {
    image: &'a GrayImage,
    /// Difference of grey levels that noise rarely reaches.
    least_gray: u8,
    is_structured: OnceCell<bool>,
    half: OnceCell<GrayImage>,
}

impl Ground<'_> {
    /// Returns whether anything in the image is as large as a readable tag.
    fn has_structure(&self) -> bool {
        *self.is_structured.get_or_init(|| light::has_structure(self.image, self.least_gray))
    }

    /// Returns the image at half its size.
    fn half(&self) -> &GrayImage {
        self.half.get_or_init(|| halved(self.image))
    }
}

impl TagFinder {
    /// Builds a finder for the tags of a family (AprilTag name or OpenCV dictionary), with all ids. Fails on an unknown family.
    pub fn new(family: &str) -> Result<Self, DetectError> {
        Self::build(Family::named(family)?, usize::MAX)
    }

    /// Builds a finder for these ids only; others are neither decoded nor confused with them.
    pub fn with_ids(family: &str, ids: &[u32]) -> Result<Self, DetectError> {
        Self::build(Family::named(family)?.only(family, ids)?, ids.len())
    }

    fn build(family: Family, wanted: usize) -> Result<Self, DetectError> {
        let min_margin_gray = family.min_margin_gray();
        let rim_edges = family.rim_edges();
        // Black and white of an accepted tag differ by at least twice its margin. Half of that leaves room for blur, and the noise of an even
        // wall, which took most of the time, gives no outlines any more.
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

    /// Finds the tags in an image, sorted by id, then from the left, copies of an id included.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FoundTag> {
        // At half the size all copies of a tag are found; at a quarter, the large ones that are blurred.
        let levels: &[f32] = if self.wanted == 1 { &[FINE, COARSE, FINEST] } else { &[FINE, FINEST] };
        let quiet = Quietened::new(image);
        let ground = self.ground_of(image, quiet.noise_gray);
        let tags = if quiet.is_smoothed() {
            self.search_noisy(&ground, &quiet, levels)
        } else {
            self.search_ground(&ground, levels)
        };
        let mut found = self.measured(image, quiet.noise_gray, &tags);
        if found.is_empty() || self.wanted == 1 {
            // The same tag in a grid beside it is a copy too.
            found.extend(self.find_in_grid(&ground, &tags));
        }
        sorted(found)
    }

    /// Returns an image with what several searches need to know of it.
    pub(super) fn ground<'a>(&self, image: &'a GrayImage) -> Ground<'a> {
        self.ground_of(image, noise_gray(image))
    }

    fn ground_of<'a>(&self, image: &'a GrayImage, noise_gray: f64) -> Ground<'a> {
        let least_gray = spread_of_tiles(noise_gray, self.min_margin_gray as u8);
        Ground { image, least_gray, is_structured: OnceCell::new(), half: OnceCell::new() }
    }

    /// Finds the tags that are part of an AprilGrid, where the image may show one, beside those that are known.
    pub(super) fn find_in_grid(&mut self, ground: &Ground, known: &[DecodedTag]) -> Vec<FoundTag> {
        if !ground.has_structure() {
            return Vec::new();
        }
        let image = ground.image;
        // Whether there are black squares with joints at their corners, and where, is found out at half the size and at whole pixels, which takes
        // a thirtieth of the time.
        let half = ground.half();
        let joints = saddles(half, LEAST_JOINT_GRAY);
        if joints.len() < LEAST_JOINTS {
            return Vec::new();
        }
        let size_px = [image.width_px, image.height_px];
        let around = |square: Square| {
            let corners = square.map(|k| 2.0 * joints[k].pixel + Pixel::new(0.5, 0.5));
            Region::around(&corners, 16.0 + AROUND_SQUARE * longer_side_px(&corners), size_px)
        };
        // The bits of a tag touch at their corners as well.
        let is_of_known = |square: &Square| {
            let middle = square.iter().map(|k| 2.0 * joints[*k].pixel).sum::<Pixel>() / 4.0;
            known.iter().any(|tag| {
                let centre = tag.corners.iter().sum::<Pixel>() / 4.0;
                (middle - centre).norm() < ABOUT_KNOWN * longer_side_px(&tag.corners)
            })
        };
        let mut squares = black_squares(&joints, half, noise_gray(half));
        squares.retain(|square| !is_of_known(square));
        let regions: Vec<Region> = squares.into_iter().filter_map(around).collect();
        if regions.is_empty() {
            return Vec::new();
        }
        let finder = match self.in_grid.take().or_else(|| GridTagFinder::of(&self.family)) {
            Some(finder) => self.in_grid.insert(finder),
            None => return Vec::new(),
        };
        let is_texture = outlines::is_texture(&regions, image);
        let regions = if is_texture { vec![Region::whole(size_px)] } else { joined(regions) };
        let mut part = GrayImage::filled(0, 0, 0);
        let mut all: Vec<FoundTag> = Vec::new();
        for region in regions {
            let found = region.cut(image, &mut part).map(|()| finder.find(&part)).unwrap_or_default();
            for mut tag in found {
                tag.corners.iter_mut().for_each(|corner| *corner += region.origin());
                let is_new = |other: &DecodedTag| !same_place(other, &tag.decoded());
                if known.iter().all(is_new) && all.iter().all(|other| is_new(&other.decoded())) {
                    all.push(tag);
                }
            }
        }
        all
    }

    /// Measures each tag by its print; sorted by id, then from the left.
    fn measured(&self, image: &GrayImage, noise_gray: f64, tags: &[DecodedTag]) -> Vec<FoundTag> {
        let measured = |tag: &DecodedTag| {
            FoundTag::new(tag, self.laid(image, noise_gray, tag.id, &tag.corners, None).as_ref())
        };
        sorted(tags.iter().map(measured).collect())
    }

    /// Measures a tag by its print, starting from the library's corners, or those in the image `before`; `None` where the print is not visible.
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

    /// Searches the smoothed image, but measures in the original one, in which alone the smallest tags are visible.
    fn search_noisy(&mut self, ground: &Ground, quiet: &Quietened, levels: &[f32]) -> Vec<DecodedTag> {
        let image = ground.image;
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
            if all.is_empty() {
                self.at_outlines(ground, true, &mut all);
            } else if image.data.len() <= FINEST_PIXELS {
                self.add_at(image, FINEST, &mut all);
            }
            self.decoder.set_least_contrast(least);
        }
        all
    }

    /// Returns the tags found at these reductions, from coarse to fine, until all that are wanted are found.
    pub(super) fn search(&mut self, image: &GrayImage, levels: &[f32]) -> Vec<DecodedTag> {
        self.search_ground(&self.ground(image), levels)
    }

    fn search_ground(&mut self, ground: &Ground, levels: &[f32]) -> Vec<DecodedTag> {
        let image = ground.image;
        let mut all: Vec<DecodedTag> = Vec::new();
        for &level in levels {
            if level == FINEST && !all.is_empty() && FINEST_PIXELS < image.data.len() {
                break;
            }
            if level == FINEST && all.is_empty() {
                self.at_outlines(ground, false, &mut all);
            } else {
                self.add_at(image, level, &mut all);
            }
            if all.is_empty() && level == FINE {
                self.in_shadow(ground, &mut all);
            }
            if self.wanted <= all.len() {
                break;
            }
        }
        all
    }

    /// Adds the tags that are found only at full size, in a soft shadow or without a white margin: they are decoded where the image, stretched
    /// to black and white, has outlines with four sides. Codes that arise by chance, and noise, are checked in the original image by their
    /// contrast.
    fn at_outlines(&mut self, ground: &Ground, is_noisy: bool, all: &mut Vec<DecodedTag>) {
        if !ground.has_structure() {
            return;
        }
        let (image, least) = (ground.image, ground.least_gray);
        let mut tile = GrayImage::filled(0, 0, 0);
        for part in tiles::parts([image.width_px, image.height_px]) {
            if part.cut(image, &mut tile).is_none() {
                continue;
            }
            let Some(stretched) = light::stretched(&tile, least) else {
                self.add_at(image, FINEST, all);
                return;
            };
            let outlines = outlines::quads(&stretched, self.ink(), self.family.border_width);
            let is_read_as_it_came = is_noisy || self.family.is_weak();
            let searched = if is_read_as_it_came { &tile } else { &stretched };
            let mut found = self.find_around(searched, &outlines, FINEST);
            found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += part.origin());
            add_new(all, found);
        }
    }

    /// Adds the tags under a shadow with hard edges, which are visible in the logarithm of the image. Outlines are searched for at half the
    /// size.
    fn in_shadow(&mut self, ground: &Ground, all: &mut Vec<DecodedTag>) {
        if self.family.is_weak() || !ground.has_structure() {
            return;
        }
        let (image, half) = (ground.image, ground.half());
        let least = self.ground(half).least_gray;
        let Some(log) = light::logarithm(half) else { return };
        let Some(stretched) = light::stretched(&log, least.saturating_mul(2)) else { return };
        let enlarged = |quad: outlines::Quad| quad.map(|p| 2.0 * p + Pixel::new(0.5, 0.5));
        let outlines: Vec<outlines::Quad> = outlines::quads(&stretched, self.ink(), self.family.border_width)
            .into_iter()
            .map(enlarged)
            .collect();
        for region in self.regions_around(image, &outlines) {
            let mut part = GrayImage::filled(0, 0, 0);
            let log = region.cut(image, &mut part).and_then(|()| light::logarithm(&part));
            let mut found = log.map(|log| self.find_at(&log, FINE, &[])).unwrap_or_default();
            found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
            add_new(all, found);
        }
    }

    /// Returns the colour of the border inside the corners.
    fn ink(&self) -> Ink {
        if self.family.reversed_border { Ink::Light } else { Ink::Dark }
    }

    /// Finds tags in the parts of an image around outlines.
    fn find_around(&mut self, image: &GrayImage, outlines: &[outlines::Quad], level: f32) -> Vec<DecodedTag> {
        let regions = self.regions_around(image, outlines);
        regions.iter().flat_map(|region| self.find_in(image, region, level)).collect()
    }

    /// Returns the parts of an image around outlines, or the whole image where they cover about as much.
    fn regions_around(&self, image: &GrayImage, outlines: &[outlines::Quad]) -> Vec<Region> {
        let size_px = [image.width_px, image.height_px];
        let regions: Vec<Region> =
            outlines.iter().filter_map(|quad| self.region(quad, 0.0, size_px)).collect();
        if outlines::is_texture(&regions, image) { vec![Region::whole(size_px)] } else { joined(regions) }
    }

    /// Finds tags in a part of an image; the corners are in the pixels of the whole image.
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

    /// Finds tags that show at full size only, in a shadow or without a white margin.
    pub(super) fn find_small_in(&mut self, image: &GrayImage, region: &Region) -> Vec<DecodedTag> {
        let (mut part, mut found) = (GrayImage::filled(0, 0, 0), Vec::new());
        if region.cut(image, &mut part).is_some() {
            self.at_outlines(&self.ground(&part), false, &mut found);
        }
        found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
        found
    }

    /// Returns the part of the image to search for a tag with these corners, `reach_px` around them: with its rim, its quiet zone and the tiles
    /// that the threshold uses.
    pub(super) fn region(&self, corners: &[Pixel], reach_px: f64, size_px: [u32; 2]) -> Option<Region> {
        let margin_px = 16.0 + (self.rim_edges + 0.2) * longer_side_px(corners) + reach_px;
        Region::around(corners, margin_px, size_px)
    }

    /// Adds the tags that are found at this reduction and are not known yet.
    pub(super) fn add_at(&mut self, image: &GrayImage, level: f32, all: &mut Vec<DecodedTag>) {
        let found = self.find_at(image, level, all);
        add_new(all, found);
    }

    /// Returns the tags found at this reduction; known ones may be included or missing.
    fn find_at(&mut self, image: &GrayImage, level: f32, known: &[DecodedTag]) -> Vec<DecodedTag> {
        let clear = self.min_margin_gray;
        let edges = if level < COARSE { Edges::FullSize } else { Edges::Outline };
        let mut tags = tiles::search(&mut self.decoder, image, CameraWatcher { decimate: level, edges });
        tags.retain(|tag| clear <= tag.margin_gray);
        if edges == Edges::FullSize {
            return tags;
        }
        // At this reduction, the pixels to which an edge is fitted would include the bits: the tag is measured again at the finer level, in the
        // part of the image around it.
        let new = tags.iter().filter(|tag| !known.iter().any(|known| same_place(known, tag)));
        new.filter_map(|tag| self.measure_again(image, tag)).collect()
    }

    fn measure_again(&mut self, image: &GrayImage, tag: &DecodedTag) -> Option<DecodedTag> {
        let region = self.region(&tag.corners, 0.0, [image.width_px, image.height_px])?;
        let found = self.find_in(image, &region, FINE).into_iter().filter(|found| same_place(found, tag));
        found.max_by(|a, b| a.margin_gray.total_cmp(&b.margin_gray))
    }
}

/// Black squares within this distance of a tag's centre, in longer sides of it, belong to the tag.
const ABOUT_KNOWN: f64 = 0.75;
/// Least contrast around a joint of a grid; an accepted tag has twice as much.
const LEAST_JOINT_GRAY: u8 = 15;
/// Least number of joints around a tag of a grid.
const LEAST_JOINTS: usize = 8;
/// A tag of a grid is searched for this far around its square, in longer sides of it: with the joints at its corners.
const AROUND_SQUARE: f64 = 0.5;

/// Adds the tags that are not known yet.
pub(super) fn add_new(all: &mut Vec<DecodedTag>, found: Vec<DecodedTag>) {
    for tag in found {
        if !all.iter().any(|known| same_place(known, &tag)) {
            all.push(tag);
        }
    }
}

/// Reductions at which outlines are searched for.
pub(super) const COARSE: f32 = 4.0;
pub(super) const FINE: f32 = 2.0;
pub(super) const FINEST: f32 = 1.0;
/// Largest image, in pixels, that is searched at full size although tags were found at half: at full size tags of 12 to 20 px are found too (46
/// instead of 33 of 47 in photographs of 799 × 533 px), at four times the cost.
const FINEST_PIXELS: usize = 1_000_000;

/// Returns whether two readings are of one tag: same id, centres closer than half an edge.
pub(super) fn same_place(a: &DecodedTag, b: &DecodedTag) -> bool {
    let centre = |tag: &DecodedTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    a.id == b.id && (centre(a) - centre(b)).norm() < 0.5 * sigma::shortest_edge_px(&a.corners)
}

/// Ids found more than once, with their numbers.
pub(super) type Copies = Vec<(u32, usize)>;

/// Returns the corners of the tags found, by id, and the ids found more than once, with their numbers. A copied tag of a map is left out,
/// because the others still determine the pose; where none is left, and for a single tag, copies are an error.
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

/// Returns the corners of the tags whose id is found once, and the ids found more often, with their numbers.
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
