//! Finds every tag of an image, of one family or of any family, for users who do not know which tags are in view.
//!
//! One search over the image finds the outlines of tags, and all families are decoded in them. Only the families found there are then searched
//! for one by one, with everything that measures their corners. So an image without a tag costs two or three searches, not one for every family.

use super::aprilgrid::{GridTagFinder, grid_tags};
use super::apriltag::{Edges, QuadDecoder};
use super::families::{APRILTAG_FAMILIES, Family};
use super::found_tag::{FoundTag, by_place_and_id};
use super::joints::joints;
use super::light;
use super::noise::Quietened;
use super::tags::{FINE, FINEST, TagFinder};
use super::tiles::{self, CameraWatcher};
use super::{DetectError, sigma, stop};
use crate::GrayImage;
use resight_core::Pixel;
use std::collections::BTreeSet;

/// OpenCV's dictionaries that are searched for beside the AprilTag families. Each begins with the ids of its smaller ones, which are therefore
/// found too. Of 4 × 4 bits only fifty codes are used: with a thousand, one square in fifteen would bear one by chance.
const DICTIONARIES: [&str; 5] =
    ["DICT_4X4_50", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"];
/// Families used in Kalibr's grids, in both conventions.
const OF_GRIDS: [&str; 6] =
    ["tag36h11", "tag25h9", "tag16h5", "DICT_APRILTAG_36h11", "DICT_APRILTAG_25h9", "DICT_APRILTAG_16h5"];

/// The tags of one family in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyTags {
    /// The family.
    pub family: String,
    /// Its tags, sorted by id, then from the left, copies of an id included.
    pub tags: Vec<FoundTag>,
}

/// Finds every tag; built once per thread.
pub struct EveryTagFinder {
    families: Vec<Sought>,
    /// Decodes all families in every outline: isolated tags,
    free: QuadDecoder,
    /// and tags that touch the small squares of an AprilGrid; `None` where no family of a grid is wanted.
    in_grids: Option<QuadDecoder>,
    /// The index in `families` of each family that `in_grids` decodes.
    of_grids: Vec<usize>,
}

/// A family, and the finder that measures its tags once one was found.
struct Sought {
    name: String,
    least_margin_gray: f64,
    /// Whether one square in some hundreds bears one of its codes by chance, so that its print has to be verified.
    is_weak: bool,
    free: Option<TagFinder>,
    in_grids: Option<GridTagFinder>,
}

/// Share of the variance that the print has to explain in such a family: of another print it explains half.
const EXPLAINED_OF_WEAK: f64 = 0.85;

/// Least number of tags in a grid of such a family: among a dozen tags of another family, chance occasionally gives one code.
const LEAST_OF_WEAK_GRID: usize = 3;

impl EveryTagFinder {
    /// Builds a finder for all tags of a family (AprilTag name or OpenCV dictionary), or of any family where `family` is `any`.
    ///
    /// # Errors
    /// `UnknownFamily`.
    pub fn new(family: &str) -> Result<Self, DetectError> {
        if family == "any" {
            return Self::of(APRILTAG_FAMILIES.iter().chain(&DICTIONARIES).copied());
        }
        Self::of([family])
    }

    fn of<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<Self, DetectError> {
        let (mut families, mut free, mut in_grids, mut of_grids) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for name in names {
            let family = Family::named(name)?;
            if OF_GRIDS.contains(&name) {
                of_grids.push(families.len());
                in_grids.extend([family.clone(), family.clone().with_double_border()]);
            }
            families.push(Sought {
                name: name.to_owned(),
                least_margin_gray: family.min_margin_gray(),
                is_weak: family.is_weak(),
                free: None,
                in_grids: None,
            });
            free.push(family);
        }
        let decoder = |families: &[Family]| QuadDecoder::new(families).ok_or(DetectError::OutOfMemory);
        let in_grids = if of_grids.is_empty() { None } else { Some(decoder(&in_grids)?) };
        Ok(EveryTagFinder { families, free: decoder(&free)?, in_grids, of_grids })
    }

    /// Finds the families in an image, the one with most tags first. A square decoded in two families is assigned to the family with more tags.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FamilyTags> {
        if super::is_blank(image) || stop::is_stopped() {
            return Vec::new();
        }
        let quiet = Quietened::new(image);
        let (free, in_grids) = (self.shown(&quiet), self.shown_in_grids(image, &quiet));
        let mut found = self.measured(image, free);
        found.extend(in_grids.into_iter().filter_map(|index| self.families[index].find(image, false)));
        if found.iter().all(|family| family.tags.is_empty()) {
            // Tags that are found only at full size, or with another illumination.
            let free = self.shown_finest(image, &quiet);
            found = self.measured(image, free);
        }
        // The sort is stable: of equals, the family that is listed first stays first.
        found.sort_by_key(|family| std::cmp::Reverse(family.tags.len()));
        let mut kept: Vec<FamilyTags> = Vec::new();
        for mut family in found {
            family.tags.retain(|tag| kept.iter().all(|other| other.tags.iter().all(|o| !is_same(tag, o))));
            match kept.iter_mut().find(|other| other.family == family.family) {
                Some(own) => own.tags.extend(family.tags),
                None if family.tags.is_empty() => {}
                None => kept.push(family),
            }
        }
        kept.iter_mut().for_each(|family| family.tags.sort_by(by_place_and_id));
        kept.sort_by_key(|family| std::cmp::Reverse(family.tags.len()));
        kept
    }

    fn measured(&mut self, image: &GrayImage, free: BTreeSet<usize>) -> Vec<FamilyTags> {
        free.into_iter().filter_map(|index| self.families[index].find(image, true)).collect()
    }

    /// Returns the families with an isolated tag at half the size.
    fn shown(&mut self, quiet: &Quietened) -> BTreeSet<usize> {
        self.free.set_least_contrast(quiet.least_contrast(self.least_margin_gray()));
        self.shown_at(quiet.image(), FINE)
    }

    /// Returns the families with an isolated tag at full size; for families without chance codes, also in a shadow or without a white margin.
    fn shown_finest(&mut self, image: &GrayImage, quiet: &Quietened) -> BTreeSet<usize> {
        let least = quiet.least_contrast_unsmoothed(self.least_margin_gray());
        self.free.set_least_contrast(least);
        let mut all = self.shown_at(image, FINEST);
        for (other, level) in [(light::logarithm(image), FINE), (light::stretched(image, least), FINEST)] {
            let shown = other.map(|other| self.shown_at(&other, level)).unwrap_or_default();
            all.extend(shown.into_iter().filter(|index| !self.families[*index].is_weak));
        }
        all
    }

    fn least_margin_gray(&self) -> u8 {
        self.families.iter().map(|family| family.least_margin_gray).fold(f64::INFINITY, f64::min) as u8
    }

    fn shown_at(&mut self, image: &GrayImage, decimate: f32) -> BTreeSet<usize> {
        let look = CameraWatcher { decimate, edges: Edges::FullSize };
        let tags = tiles::search(&mut self.free, image, look);
        let clear = tags.iter().filter(|tag| self.families[tag.family].least_margin_gray <= tag.margin_gray);
        clear.map(|tag| tag.family).collect()
    }

    /// Returns the families with a tag that touches the squares of a grid.
    fn shown_in_grids(&mut self, image: &GrayImage, quiet: &Quietened) -> BTreeSet<usize> {
        let Some(decoder) = &mut self.in_grids else { return BTreeSet::new() };
        let tags = grid_tags(decoder, image, &joints(image), quiet);
        tags.iter().map(|tag| self.of_grids[tag.family / 2]).collect()
    }
}

impl Sought {
    /// Finds the tags of the family, isolated or in a grid; `None` where the finder cannot be built, which was possible before.
    fn find(&mut self, image: &GrayImage, is_free: bool) -> Option<FamilyTags> {
        let mut tags = if is_free {
            let finder = match &mut self.free {
                Some(finder) => finder,
                none => none.insert(TagFinder::new(&self.name).ok()?),
            };
            finder.find(image)
        } else {
            let finder = match &mut self.in_grids {
                Some(finder) => finder,
                none => none.insert(GridTagFinder::new(&self.name).ok()?),
            };
            finder.find(image)
        };
        // A tag of a grid has another print around it, and needs a clear reading; where chance gives that too, it needs the tags beside it.
        tags.retain(|tag| !is_free || !self.is_weak || EXPLAINED_OF_WEAK <= tag.explained);
        if !is_free && self.is_weak && tags.len() < LEAST_OF_WEAK_GRID {
            tags.clear();
        }
        Some(FamilyTags { family: self.name.clone(), tags })
    }
}

/// Returns whether two readings are of one square: their centres are closer than half an edge.
fn is_same(a: &FoundTag, b: &FoundTag) -> bool {
    let centre = |tag: &FoundTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    (centre(a) - centre(b)).norm() < 0.5 * sigma::shortest_edge_px(&a.corners)
}
