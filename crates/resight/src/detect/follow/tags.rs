//! One tag, or the tags of a map, from picture to picture.

use super::{Absence, Extent, ROUND_S, Round, SMALL_ROUND_S, TAG_EVERY_S};
use crate::GrayImage;
use crate::detect::DetectError;
use crate::detect::apriltag::DecodedTag;
use crate::detect::region::{Region, joined};
use crate::detect::tags::{COARSE, FINE, FINEST, FoundTag, TagFinder, add_new, single_or_unique};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;

/// Follows tags.
pub(super) struct TagFollower {
    finder: TagFinder,
    /// A copied tag of a map is left out, that of a single one is an error.
    is_map: bool,
    /// As found last, copies included.
    seen: Vec<DecodedTag>,
    absence: Absence,
    /// The picture at a quarter of its size, then strips at half.
    round: Round,
    /// Strips at full size.
    small_round: Round,
}

/// A tag is sought this far around where it is expected, pixels: what a mount vibrates and a hand moves from frame to frame.
const REACH_PX: f64 = 16.0;
/// Strips of a picture.
const STRIPS: u32 = 8;
/// Overlap of strips at half size: tags too small for a quarter of the size, with rim and tiles.
const OVERLAP_PX: u32 = 64;
/// Overlap of strips at full size: tags too small for half of the size.
const SMALL_OVERLAP_PX: u32 = 32;
/// A tag not found near is sought at full size where its part is at most this share of the picture: larger ones show at half size.
const SMALL_SHARE: u64 = 16;
/// Searched in parts, more than this share of a picture costs as much as all of it.
const MOST_OF_IT: f64 = 0.7;

impl TagFollower {
    pub fn new(finder: TagFinder, is_map: bool) -> Self {
        let absence = Absence::new(TAG_EVERY_S);
        let (round, small_round) = (Round::new(STRIPS + 1, ROUND_S), Round::new(STRIPS, SMALL_ROUND_S));
        TagFollower { finder, is_map, seen: Vec::new(), absence, round, small_round }
    }

    pub fn detect(
        &mut self,
        image: &GrayImage,
        elapsed_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<(Vec<Detection>, Extent), DetectError> {
        self.absence.passed(elapsed_s);
        let mut found = self.near(image, expected);
        // Half of what was there has gone: the camera moved, or somebody walked into the view.
        let extent = if self.seen.is_empty() || 2 * found.len() < self.seen.len() {
            self.everywhere(image, elapsed_s, &mut found)
        } else {
            self.besides(image, elapsed_s, &mut found);
            Extent::Near
        };
        if !found.is_empty() {
            self.absence.found();
        }
        self.seen.clone_from(&found);
        let mut found: Vec<FoundTag> = found.iter().map(FoundTag::new).collect();
        found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
        Ok((single_or_unique(&found, self.is_map)?, extent))
    }

    /// Tags where they were last and where they are expected.
    fn near(&mut self, image: &GrayImage, expected: &[(Feature, Pixel)]) -> Vec<DecodedTag> {
        let places = self.places(image, expected);
        let parts = joined(places.iter().map(|(_, region)| *region).collect());
        let mut found = Vec::new();
        let total_px: u64 = parts.iter().map(Region::area_px).sum();
        if MOST_OF_IT * image.data.len() as f64 <= total_px as f64 {
            add_new(&mut found, self.finder.search(image, &[FINE]));
        } else {
            for part in &parts {
                add_new(&mut found, self.finder.find_in(image, part, FINE));
            }
        }
        let is_small = |region: &Region| SMALL_SHARE * region.area_px() <= image.data.len() as u64;
        for (id, region) in places.iter().filter(|(_, region)| is_small(region)) {
            let is_found = |tag: &DecodedTag| tag.id == *id && region.contains(&tag.corners[0]);
            if !found.iter().any(is_found) {
                add_new(&mut found, self.finder.find_in(image, region, FINEST));
            }
        }
        found
    }

    /// Ids and the parts of the picture that they are sought in.
    fn places(&self, image: &GrayImage, expected: &[(Feature, Pixel)]) -> Vec<(u32, Region)> {
        let size_px = [image.width_px, image.height_px];
        let region = |corners: &[Pixel]| self.finder.region(corners, REACH_PX, size_px);
        let mut places: Vec<(u32, Region)> = Vec::new();
        for tag in &self.seen {
            // Where the pose puts it and where it was last need not agree while something moves: both are searched.
            let mut corners: Vec<Pixel> = tag.corners.to_vec();
            let is_alone = self.seen.iter().filter(|other| other.id == tag.id).count() == 1;
            let by_pose = expected.iter().filter(|(feature, _)| is_alone && feature.id == tag.id);
            corners.extend(by_pose.map(|(_, pixel)| *pixel));
            places.extend(region(&corners).map(|region| (tag.id, region)));
        }
        for corners in expected.chunk_by(|a, b| a.0.id == b.0.id) {
            let id = corners[0].0.id;
            let pixels: Vec<Pixel> = corners.iter().map(|(_, pixel)| *pixel).collect();
            let is_new = self.seen.iter().all(|tag| tag.id != id);
            // A tag that the edge cuts is not decoded.
            let is_inside = pixels.iter().all(|pixel| {
                let reaches = |x: f64, size: u32| -REACH_PX <= x && x < size as f64 + REACH_PX;
                reaches(pixel.x, size_px[0]) && reaches(pixel.y, size_px[1])
            });
            if is_new && is_inside {
                places.extend(region(&pixels).map(|region| (id, region)));
            }
        }
        places
    }

    /// What has left its place, or was never seen.
    fn everywhere(&mut self, image: &GrayImage, elapsed_s: f64, found: &mut Vec<DecodedTag>) -> Extent {
        let is_due = self.absence.is_due();
        if is_due {
            add_new(found, self.finder.search(image, self.quick_levels()));
        }
        let strips = self.small_round.take(elapsed_s);
        if found.is_empty() {
            let size_px = [image.width_px, image.height_px];
            for strip in strips {
                let part = Region::strip(strip, STRIPS, SMALL_OVERLAP_PX, size_px);
                add_new(found, self.finder.find_in(image, &part, FINEST));
            }
        }
        if is_due { Extent::Whole } else { Extent::Share }
    }

    /// Copies, tags out of their places and new ones, a share of the picture at a time.
    fn besides(&mut self, image: &GrayImage, elapsed_s: f64, found: &mut Vec<DecodedTag>) {
        let size_px = [image.width_px, image.height_px];
        for part in self.round.take(elapsed_s) {
            let tags = match part.checked_sub(1) {
                None => self.finder.search(image, &[COARSE]),
                Some(strip) => {
                    self.finder.find_in(image, &Region::strip(strip, STRIPS, OVERLAP_PX, size_px), FINE)
                }
            };
            add_new(found, tags);
        }
    }

    /// A large tag shows at a quarter of the size; of many some are small.
    fn quick_levels(&self) -> &'static [f32] {
        if self.finder.wanted() == 1 { &[COARSE, FINE] } else { &[FINE] }
    }
}
