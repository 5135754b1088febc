//! Kalibr's AprilGrid: tags whose corners touch small black squares.
//!
//! A plain tag detector fails here for two reasons. Where a tag meets a corner square the two black regions merge, so that no closed outline
//! remains. These joints are saddle points; they are found as such (ChESS) and separated by a white dot before the tags are searched for. And
//! Kalibr's border is two cells wide, so that borders of one and two cells are tried. The joints are also the sharpest points of the target:
//! each tag corner is moved to its saddle point.

mod layout;
mod print;

use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::families::Family;
use super::found_tag::{FoundTag, sorted};
use super::homography::{Homography, PlanePoint};
use super::joints::{Joint, joints, nearest};
use super::noise::Quietened;
use super::print::Common;
use super::region::{Region, joined, longer_side_px};
use super::template::REDRAWN_PX;
use super::tiles::{self, CameraWatcher};
use super::{DetectError, sigma};
use crate::GrayImage;
use layout::Layout;
use print::{Corners, GridPrint};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{AprilGrid, Feature};
use std::collections::BTreeSet;

/// Finds one AprilGrid.
pub(super) struct AprilGridFinder {
    grid: AprilGrid,
    decoder: QuadDecoder,
    print: GridPrint,
    /// Border width, in cells, of the tags found last.
    border_cells: usize,
}

impl AprilGridFinder {
    pub fn new(grid: &AprilGrid) -> Result<Self, DetectError> {
        let n_tags = grid.rows * grid.columns;
        let ids: Vec<u32> = (grid.first_id..grid.first_id.saturating_add(n_tags)).collect();
        let family = Family::named(&grid.family)?.only(&grid.family, &ids)?;
        let families = [family.clone(), family.with_double_border()];
        let decoder = QuadDecoder::new(&families).ok_or(DetectError::OutOfMemory)?;
        Ok(AprilGridFinder { grid: grid.clone(), decoder, print: GridPrint::new(grid)?, border_cells: 1 })
    }

    fn ids(&self) -> impl Iterator<Item = u32> + use<> {
        self.grid.first_id..self.grid.first_id + self.grid.rows * self.grid.columns
    }

    /// Predicts the corners of a tag from the tags beside it; `None` where fewer than two are near.
    fn predicted(&self, id: u32, tags: &[DecodedTag]) -> Option<[Pixel; 4]> {
        let apart = |tag: &DecodedTag| (self.corner(tag.id, 0) - self.corner(id, 0)).norm();
        let mut beside: Vec<&DecodedTag> = tags.iter().collect();
        beside.sort_by(|a, b| apart(a).total_cmp(&apart(b)).then(a.id.cmp(&b.id)));
        beside.truncate(4);
        if beside.len() < 2 || COMPLETE_REACH < apart(beside[1]) {
            return None;
        }
        let pairs: Vec<(PlanePoint, Pixel)> = beside
            .iter()
            .flat_map(|tag| (0..4).map(|k| (self.corner(tag.id, k), tag.corners[k as usize])))
            .collect();
        let map = Homography::fit(&pairs)?;
        Some([0, 1, 2, 3].map(|k| map.at(&self.corner(id, k))))
    }

    /// Completes a tag too blurred to decode, if the tags beside it predict it and a joint lies at each of its corners.
    fn complete(&self, id: u32, tags: &[DecodedTag], joints: &[Joint]) -> Option<[Detection; 4]> {
        let predicted = self.predicted(id, tags)?;
        let within_px = 0.06 * sigma::shortest_edge_px(&predicted);
        let mut detections = Vec::with_capacity(4);
        for (pixel, corner) in predicted.iter().zip(0..) {
            let joint = nearest(joints, pixel, within_px)?;
            let feature = Feature { id, corner };
            detections.push(Detection {
                feature,
                pixel: joint.pixel,
                sigma_px: joint.sigma_px,
                lens_sigma_px: sigma::LENS_PX,
                covariance_px2: None,
            });
        }
        detections.try_into().ok()
    }

    fn corner(&self, id: u32, corner: u8) -> PlanePoint {
        self.print.place(id, corner)
    }

    /// Finds the corners; empty where the tags do not have the layout of the grid. Fails where several such grids are in view.
    pub fn detect(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        let joints = joints(image);
        let quiet = Quietened::new(image);
        let decimate = decimate(image);
        let seen = first_look(&mut self.decoder, image, &joints, &quiet, decimate);
        let mut tags = self.laid_out(seen)?;
        if quiet.is_smoothed() || 1.0 < decimate {
            let all = self.with_missing(image, tags, &joints);
            tags = self.laid_out(all)?;
        }
        let undecoded = self.ids().filter(|id| tags.iter().all(|tag| tag.id != *id));
        let completed = undecoded.filter_map(|id| self.complete(id, &tags, &joints)).flatten();
        let mut known = Corners::new();
        known.extend(completed.map(|d| (d.feature, Joint { pixel: d.pixel, sigma_px: d.sigma_px })));
        let mut doubtful = Vec::new();
        for tag in &tags {
            for (feature, joint, is_joint) in corners(tag, &joints) {
                known.insert(feature, joint);
                doubtful.extend((!is_joint).then_some(feature));
            }
        }
        let is_whole = known.len() == 4 * self.ids().count() && doubtful.is_empty();
        if is_vouched(&tags) && !is_whole {
            let border_cells = 1 + tags[0].family;
            self.print.complete(image, quiet.noise_gray, border_cells, &mut known, &doubtful);
        }
        self.border_cells = 1 + tags.first().map_or(0, |tag| tag.family);
        let all = known.keys().copied().collect();
        let common = Common { noise_gray: quiet.noise_gray, blur_px: None, redrawn_px: REDRAWN_PX };
        let (measured, _) = self.print.measured(image, common, self.border_cells, &known, &all, &doubtful);
        Ok(detections(measured))
    }

    /// Keeps the tags that have the layout of the grid.
    fn laid_out(&self, tags: Vec<DecodedTag>) -> Result<Vec<DecodedTag>, DetectError> {
        match layout::of(tags, &self.print) {
            Layout::Grid(tags) => Ok(tags),
            Layout::Otherwise => Ok(Vec::new()),
            Layout::Copies(count) => Err(DetectError::BoardCopies { kind: "AprilGrid", count }),
        }
    }

    /// Returns whether all corners are among the detections.
    pub fn is_whole(&self, seen: &[Detection]) -> bool {
        let all = self.ids().flat_map(|id| (0..4).map(move |corner| Feature { id, corner }));
        seen.iter().map(|d| d.feature).eq(all)
    }

    /// Measures the corners of a whole grid that are picked, by the print around the given positions of all.
    pub fn measured_near(
        &self,
        image: &GrayImage,
        common: Common,
        places: &[Detection],
        picked: &BTreeSet<Feature>,
    ) -> (Vec<Detection>, f64) {
        let joint = |d: &Detection| (d.feature, Joint { pixel: d.pixel, sigma_px: d.sigma_px });
        let known: Corners = places.iter().map(joint).collect();
        let (mut found, blur_px) = self.print.measured(image, common, self.border_cells, &known, picked, &[]);
        found.retain(|feature, _| picked.contains(feature));
        (detections(found), blur_px)
    }

    /// Adds the missing tags that are found, at full resolution, where the known tags predict them.
    fn with_missing(
        &mut self,
        image: &GrayImage,
        tags: Vec<DecodedTag>,
        joints: &[Joint],
    ) -> Vec<DecodedTag> {
        let missing = self.ids().filter(|id| tags.iter().all(|tag| tag.id != *id));
        let around = |corners: [Pixel; 4]| {
            let margin_px = 16.0 + 0.3 * longer_side_px(&corners);
            Region::around(&corners, margin_px, [image.width_px, image.height_px])
        };
        let regions = joined(missing.filter_map(|id| self.predicted(id, &tags).and_then(around)).collect());
        self.decoder.set_least_contrast(LEAST_CONTRAST);
        let mut part = GrayImage::filled(0, 0, 0);
        let mut all = tags;
        for region in regions {
            if region.cut(image, &mut part).is_none() {
                continue;
            }
            let inside = joints.iter().filter(|joint| region.contains(&joint.pixel));
            let inside = inside.map(|joint| Joint { pixel: joint.pixel - region.origin(), ..*joint });
            let cut = cut_joints(&part, &inside.collect::<Vec<_>>(), 1.0);
            let look = CameraWatcher { decimate: 1.0, edges: Edges::FullSize };
            let mut found = tiles::search(&mut self.decoder, &cut, look);
            found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
            all.extend(found);
        }
        one_border(all)
    }
}

fn detections(corners: Corners) -> Vec<Detection> {
    let detection = |(feature, joint): (Feature, Joint)| Detection {
        feature,
        pixel: joint.pixel,
        sigma_px: joint.sigma_px,
        lens_sigma_px: sigma::LENS_PX,
        covariance_px2: None,
    };
    corners.into_iter().map(detection).collect()
}

/// Finds tags that touch small black squares at their corners, of any grid.
pub(super) struct GridTagFinder {
    decoder: QuadDecoder,
}

impl GridTagFinder {
    /// Builds a finder for every id of a family.
    pub fn new(family: &str) -> Result<Self, DetectError> {
        GridTagFinder::of(&Family::named(family)?).ok_or(DetectError::OutOfMemory)
    }

    /// Builds a finder for these ids of a family; `None` for a family without a black border, with which no grid is printed.
    pub fn of(family: &Family) -> Option<Self> {
        let has_black_border = !family.reversed_border && family.total_width == family.border_width + 2;
        let families = [family.clone(), family.clone().with_double_border()];
        Some(GridTagFinder { decoder: QuadDecoder::new(&families).filter(|_| has_black_border)? })
    }

    /// Finds all tags that can be decoded, including copies of an id, sorted by id, then from the left.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FoundTag> {
        let (joints, quiet) = (joints(image), Quietened::new(image));
        let tags = one_border(grid_tags(&mut self.decoder, image, &joints, &quiet));
        let corners = |tag: &DecodedTag| {
            let by_edges = FoundTag::by_edges(tag);
            let at = corners(tag, &joints);
            FoundTag {
                corners: [0, 1, 2, 3].map(|k: usize| at[k].1.pixel),
                sigmas_px: [0, 1, 2, 3].map(|k: usize| at[k].1.sigma_px),
                ..by_edges
            }
        };
        sorted(tags.iter().map(corners).collect())
    }
}

/// Finds tags that touch small black squares at their corners, in the families of a decoder, each read so clearly that no grid is needed to
/// confirm it.
pub(super) fn grid_tags(
    decoder: &mut QuadDecoder,
    image: &GrayImage,
    joints: &[Joint],
    quiet: &Quietened,
) -> Vec<DecodedTag> {
    // A tag of a grid has a joint at each corner.
    if joints.len() < 4 {
        return Vec::new();
    }
    let mut tags = all_tags(decoder, image, joints, quiet, decimate(image));
    let is_at_joints = |tag: &DecodedTag| {
        let reach_px = (0.1 * sigma::shortest_edge_px(&tag.corners)).clamp(1.5, 4.0);
        tag.corners.iter().filter(|corner| nearest(joints, corner, reach_px).is_some()).count()
    };
    tags.retain(|tag| LEAST_MARGIN <= tag.margin_gray && 3 <= is_at_joints(tag));
    tags
}

/// Returns the factor by which an image is reduced before tags are searched for.
fn decimate(image: &GrayImage) -> f32 {
    if image.width_px as u64 * image.height_px as u64 <= FULL_SIZE_PIXELS { 1.0 } else { 2.0 }
}

/// Finds the tags of the whole image, with the border width that yields more of them.
fn first_look(
    decoder: &mut QuadDecoder,
    image: &GrayImage,
    joints: &[Joint],
    quiet: &Quietened,
    decimate: f32,
) -> Vec<DecodedTag> {
    one_border(all_tags(decoder, image, joints, quiet, decimate))
}

/// Finds the tags of the whole image, smoothed where it is noisy.
fn all_tags(
    decoder: &mut QuadDecoder,
    image: &GrayImage,
    joints: &[Joint],
    quiet: &Quietened,
    decimate: f32,
) -> Vec<DecodedTag> {
    decoder.set_least_contrast(quiet.least_contrast(LEAST_CONTRAST));
    let look = CameraWatcher { decimate, edges: Edges::FullSize };
    let tags = tiles::search(decoder, &cut_joints(quiet.image(), joints, decimate), look);
    if !tags.is_empty() || !quiet.is_smoothed() {
        return tags;
    }
    // The smallest tags are visible only in the original image, even if it is noisy.
    decoder.set_least_contrast(quiet.least_contrast_unsmoothed(LEAST_CONTRAST));
    tiles::search(decoder, &cut_joints(image, joints, decimate), look)
}

/// Largest image, in pixels, in which tags are searched for at full size. At half size, a third of the tags of a 1-megapixel fisheye view is
/// lost (22 of 36, against 36 at full size).
const FULL_SIZE_PIXELS: u64 = 4_000_000;

/// Least contrast of an outline, grey levels: that of a blurred grid printed with a seventh of full contrast. A search spent nine tenths of its
/// time on outlines of noise.
const LEAST_CONTRAST: u8 = 8;

/// Least distance of the bits from the threshold, grey levels, for a tag that no grid confirms.
const LEAST_MARGIN: f64 = 30.0;

/// Largest distance, in tag edges, of the second nearest decoded tag from one to complete: two tags away.
const COMPLETE_REACH: f64 = 3.0;

/// Radius of the white dot, pixels of the decimated image.
const CUT_RADIUS_PX: f64 = 1.5;

/// Returns the image with a dot as bright as its surroundings over every saddle point.
fn cut_joints(image: &GrayImage, joints: &[Joint], decimate: f32) -> GrayImage {
    let mut cut = image.clone();
    let radius = CUT_RADIUS_PX * decimate as f64;
    for joint in joints {
        let bright =
            window(image, &joint.pixel, radius + 2.0).map(|(u, v)| image.at(u, v)).max().unwrap_or(255);
        for (u, v) in window(image, &joint.pixel, radius) {
            if (Pixel::new(u as f64, v as f64) - joint.pixel).norm() <= radius {
                cut.data[v as usize * image.width_px as usize + u as usize] = bright;
            }
        }
    }
    cut
}

/// Iterates over the pixels of a square window that lie in the image.
fn window(image: &GrayImage, centre: &Pixel, radius: f64) -> impl Iterator<Item = (u32, u32)> + use<> {
    let range = |c: f64, n: u32| {
        let first = (c - radius).ceil().clamp(0.0, n as f64) as u32;
        first..((c + radius).floor() + 1.0).clamp(first as f64, n as f64) as u32
    };
    let columns = range(centre.x, image.width_px);
    range(centre.y, image.height_px).flat_map(move |v| columns.clone().map(move |u| (u, v)))
}

/// Keeps the tags of the border width that yields more of them.
fn one_border(tags: Vec<DecodedTag>) -> Vec<DecodedTag> {
    let of = |family: usize| tags.iter().filter(|t| t.family == family).count();
    let border = usize::from(of(0) < of(1));
    tags.into_iter().filter(|t| t.family == border).collect()
}

/// A single tag determines all other positions only if it is read this clearly, grey levels; two tags confirm each other.
const LONE_MARGIN_GRAY: f64 = 30.0;

fn is_vouched(tags: &[DecodedTag]) -> bool {
    2 <= tags.len() || tags.iter().any(|tag| LONE_MARGIN_GRAY <= tag.margin_gray)
}

/// Returns the corners of a tag, each at its joint, or at the intersection of the tag's edges where there is none (a corner square is missing or
/// covered), and whether it is a joint.
fn corners(tag: &DecodedTag, joints: &[Joint]) -> [(Feature, Joint, bool); 4] {
    let edge_px = sigma::shortest_edge_px(&tag.corners);
    // The corner square's own opposite corner lies half a corner square (spacing ratio 0.3 of the tag) away.
    let within_px = (0.1 * edge_px).clamp(1.5, 4.0);
    [0, 1, 2, 3].map(|k| {
        let met = Joint { pixel: tag.corners[k], sigma_px: sigma::tag_px(tag) };
        let joint = nearest(joints, &met.pixel, within_px);
        (Feature { id: tag.id, corner: k as u8 }, joint.unwrap_or(met), joint.is_some())
    })
}
