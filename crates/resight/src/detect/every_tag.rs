//! Every tag of an image, of one family or of any family.

use super::aprilgrid::GridTagFinder;
use super::families::APRILTAG_FAMILIES;
use super::tags::{FoundTag, TagFinder};
use super::{DetectError, sigma};
use crate::GrayImage;
use resight_core::Pixel;

/// OpenCV's dictionaries that are sought beside the AprilTag families. Each begins with the ids of its smaller ones, so that these are
/// found too. Of 4 × 4 bits only fifty: of a thousand, one square in fifteen would bear one by chance.
const DICTIONARIES: [&str; 5] =
    ["DICT_4X4_50", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL"];
/// Families that Kalibr's grids are printed with.
const OF_GRIDS: [&str; 3] = ["tag36h11", "tag25h9", "tag16h5"];

/// The tags of one family in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct FamilyTags {
    /// The family.
    pub family: String,
    /// Its tags, by id, then from the left, copies of an id included.
    pub tags: Vec<FoundTag>,
}

/// Finds every tag; built once per thread.
pub struct EveryTagFinder {
    free: Vec<(String, TagFinder)>,
    /// Tags that touch the small squares of an AprilGrid, sought where no tag stands free.
    in_grids: Vec<(String, GridTagFinder)>,
}

impl EveryTagFinder {
    /// All tags of a family (AprilTag name or OpenCV dictionary), or of any family where `family` is `any`.
    ///
    /// # Errors
    /// `UnknownFamily`.
    pub fn new(family: &str) -> Result<Self, DetectError> {
        if family == "any" {
            return Self::of(APRILTAG_FAMILIES.iter().chain(&DICTIONARIES).copied());
        }
        Self::of([family])
    }

    fn of<'a>(families: impl IntoIterator<Item = &'a str>) -> Result<Self, DetectError> {
        let mut finder = EveryTagFinder { free: Vec::new(), in_grids: Vec::new() };
        for family in families {
            finder.free.push((family.to_owned(), TagFinder::new(family)?));
            if OF_GRIDS.contains(&family) {
                finder.in_grids.push((family.to_owned(), GridTagFinder::new(family)?));
            }
        }
        Ok(finder)
    }

    /// The families that an image shows, the one with most tags first. A square that two families read is that of the one that shows
    /// more tags.
    pub fn find(&mut self, image: &GrayImage) -> Vec<FamilyTags> {
        let of = |family: &str, tags: Vec<FoundTag>| FamilyTags { family: family.to_owned(), tags };
        let mut found: Vec<FamilyTags> =
            self.free.iter_mut().map(|(family, finder)| of(family, finder.find(image))).collect();
        found.extend(self.in_grids.iter_mut().map(|(family, finder)| of(family, finder.find(image))));
        // The sort is stable: among equals the family named first.
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
        for family in &mut kept {
            family.tags.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
        }
        kept
    }
}

/// Whether two readings are of one square: centres closer than half an edge.
fn is_same(a: &FoundTag, b: &FoundTag) -> bool {
    let centre = |tag: &FoundTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    (centre(a) - centre(b)).norm() < 0.5 * sigma::shortest_edge_px(&a.corners)
}
