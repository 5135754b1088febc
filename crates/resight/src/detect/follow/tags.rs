//! Follows one tag, or the tags of a map, from image to image.
//!
//! A decoded tag is first measured at its last position, without being decoded: its whole print must be as visible as before. Each tag is
//! decoded again twice a second, in turn, so that no frame waits for all of them.

use super::{Absence, Extent, ROUND_S, Round, SMALL_ROUND_S, TAG_EVERY_S};
use crate::GrayImage;
use crate::detect::DetectError;
use crate::detect::apriltag::DecodedTag;
use crate::detect::found_tag::sorted;
use crate::detect::noise::noise_gray;
use crate::detect::region::{Region, joined, longer_side_px};
use crate::detect::tag_print::LaidTag;
use crate::detect::tags::{COARSE, FINE, FINEST, FoundTag, TagFinder, add_new, same_place, single_or_unique};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;

/// Follows tags.
pub(super) struct TagFollower {
    finder: TagFinder,
    /// Whether the target is a map: a copied tag of a map is left out, a copy of a single tag is an error.
    is_map: bool,
    /// The tags found last, copies included.
    seen: Vec<Seen>,
    /// Selects the tags to decode again by the last digits of their ids.
    reading: Round,
    absence: Absence,
    /// The image at a quarter of its size, then strips at half.
    round: Round,
    /// Strips at full size.
    small_round: Round,
}

/// A tag that was found.
struct Seen {
    /// The tag as it was decoded, with its current corners.
    tag: DecodedTag,
    /// The tag as measured by its print; `None` where that is not visible.
    laid: Option<LaidTag>,
    /// The visible share of the print when it was decoded.
    shown: f64,
    /// Its motion since the previous image; zero where it was not found.
    moved: Pixel,
}

impl Seen {
    fn new(tag: &DecodedTag, laid: Option<LaidTag>) -> Self {
        Seen { tag: *tag, laid, shown: laid.map_or(0.0, |laid| laid.shown), moved: Pixel::zeros() }
    }

    /// Returns the tag in the next image; `None` if less of it is visible.
    fn again(&self, laid: LaidTag) -> Option<Self> {
        let tag = DecodedTag { corners: laid.corners, ..self.tag };
        let moved = (0..4).map(|k| tag.corners[k] - self.tag.corners[k]).sum::<Pixel>() / 4.0;
        (SHOWN_AGAIN * self.shown <= laid.shown).then_some(Seen { tag, laid: Some(laid), moved, ..*self })
    }
}

/// The possible positions of a tag. The pose's prediction and the last position may differ during a motion: both are searched.
struct Place {
    id: u32,
    /// Length of its longer side, pixels.
    side_px: f64,
    last: Option<Region>,
    by_pose: Option<Region>,
}

impl Place {
    fn regions(&self) -> impl Iterator<Item = Region> + use<> {
        self.last.into_iter().chain(self.by_pose)
    }

    fn holds(&self, tag: &DecodedTag) -> bool {
        tag.id == self.id && self.regions().any(|region| region.contains(&tag.corners[0]))
    }
}

/// Interval in which a tag at rest is decoded, seconds; it cannot be exchanged or rotated unnoticed for longer,
const READ_EVERY_S: f64 = 0.5;
/// divided among this many tags.
const READ_IN_TURN: u32 = 16;
/// Least share of the print that must still be visible: another tag's bits, or its own shifted by a cell, hide more.
const SHOWN_AGAIN: f64 = 0.9;
/// A tag that moved farther than this between two images, pixels, is expected to move on; one on a vibrating support is not.
const MOVING_PX: f64 = 1.0;
/// A tag is searched for this far around its expected position, pixels: vibrations and hand motion from frame to frame.
const REACH_PX: f64 = 16.0;
/// Number of strips of an image.
const STRIPS: u32 = 8;
/// Overlap of strips at half size: tags too small for a quarter of the size, with rim and tiles.
const OVERLAP_PX: u32 = 64;
/// Overlap of strips at full size: tags too small for half of the size.
const SMALL_OVERLAP_PX: u32 = 32;
/// A tag not found nearby is searched for at full size if its longer side is at most this, pixels: larger ones are found at half size;
const SMALL_PX: f64 = 64.0;
/// and if the part to search is at most this share of the image.
const SMALL_SHARE: u64 = 16;
/// Searching parts larger than this share of the image costs as much as searching all of it.
const MOST_OF_IT: f64 = 0.7;

impl TagFollower {
    pub fn new(finder: TagFinder, is_map: bool) -> Self {
        let absence = Absence::new(TAG_EVERY_S);
        let (round, small_round) = (Round::new(STRIPS + 1, ROUND_S), Round::new(STRIPS, SMALL_ROUND_S));
        let reading = Round::new(READ_IN_TURN, READ_EVERY_S);
        TagFollower { finder, is_map, seen: Vec::new(), reading, absence, round, small_round }
    }

    pub fn detect(
        &mut self,
        image: &GrayImage,
        elapsed_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<(Vec<Detection>, Extent), DetectError> {
        self.absence.passed(elapsed_s);
        let noise_gray = noise_gray(image);
        let mut seen = self.measured_again(image, noise_gray, elapsed_s);
        let mut found = seen.iter().map(|seen| seen.tag).collect();
        self.near(image, expected, &mut found);
        // If half of the tags have disappeared, the camera moved, or a person walked into the view.
        let extent = if self.seen.is_empty() || 2 * found.len() < self.seen.len() {
            self.everywhere(image, elapsed_s, &mut found)
        } else {
            self.besides(image, elapsed_s, &mut found);
            Extent::Near
        };
        if !found.is_empty() {
            self.absence.found();
        }
        for tag in &found[seen.len()..] {
            seen.push(Seen::new(tag, self.finder.laid(image, noise_gray, tag.id, &tag.corners, None)));
        }
        self.seen = seen;
        let found = self.seen.iter().map(|seen| FoundTag::new(&seen.tag, seen.laid.as_ref())).collect();
        Ok((single_or_unique(&sorted(found), self.is_map)?.0, extent))
    }

    /// Measures the tags that are at their last positions, except those that are to be decoded. The first is searched for at its last position,
    /// or at the predicted one if it is moving; the others are assumed to move equally.
    fn measured_again(&mut self, image: &GrayImage, noise_gray: f64, elapsed_s: f64) -> Vec<Seen> {
        let due: Vec<u32> = self.reading.take(elapsed_s).collect();
        let mut again: Vec<Seen> = Vec::new();
        for seen in self.seen.iter().filter(|seen| !due.contains(&(seen.tag.id % READ_IN_TURN))) {
            let Some(before) = &seen.laid else { continue };
            let motion = match again.last() {
                Some(other) => other.moved,
                None if MOVING_PX < seen.moved.norm() => seen.moved,
                None => Pixel::zeros(),
            };
            let corners = seen.tag.corners.map(|corner| corner + motion);
            let laid = self.finder.laid(image, noise_gray, seen.tag.id, &corners, Some(before));
            match laid.and_then(|laid| seen.again(laid)) {
                Some(now) => again.push(now),
                // The camera moved: the others are not at their last positions either.
                None if again.is_empty() => break,
                None => {}
            }
        }
        again
    }

    /// Adds the tags that are near their last and their expected positions.
    fn near(&mut self, image: &GrayImage, expected: &[(Feature, Pixel)], found: &mut Vec<DecodedTag>) {
        let places = self.places(image, expected, found);
        let parts = joined(places.iter().flat_map(Place::regions).collect());
        let total_px: u64 = parts.iter().map(Region::area_px).sum();
        if MOST_OF_IT * image.data.len() as f64 <= total_px as f64 {
            add_new(found, self.finder.search(image, &[FINE]));
        } else {
            for part in &parts {
                add_new(found, self.finder.find_in(image, part, FINE));
            }
        }
        let is_small = |region: &Region| SMALL_SHARE * region.area_px() <= image.data.len() as u64;
        for place in places.iter().filter(|place| place.side_px <= SMALL_PX) {
            if !found.iter().any(|tag| place.holds(tag)) {
                for region in joined(place.regions().collect()).iter().filter(|region| is_small(region)) {
                    add_new(found, self.finder.find_in(image, region, FINEST));
                }
            }
        }
    }

    /// Returns the parts of the image to search for each tag that is not found yet.
    fn places(&self, image: &GrayImage, expected: &[(Feature, Pixel)], found: &[DecodedTag]) -> Vec<Place> {
        let size_px = [image.width_px, image.height_px];
        let region = |corners: &[Pixel]| self.finder.region(corners, REACH_PX, size_px);
        let place = |tag: &DecodedTag| Place {
            id: tag.id,
            side_px: longer_side_px(&tag.corners),
            last: region(&tag.corners),
            by_pose: None,
        };
        let is_new = |tag: &&DecodedTag| !found.iter().any(|found| same_place(found, tag));
        let mut places: Vec<Place> =
            self.seen.iter().map(|seen| &seen.tag).filter(is_new).map(place).collect();
        for corners in expected.chunk_by(|a, b| a.0.id == b.0.id) {
            let id = corners[0].0.id;
            if found.iter().any(|tag| tag.id == id) {
                continue;
            }
            let pixels: Vec<Pixel> = corners.iter().map(|(_, pixel)| *pixel).collect();
            let mut seen = places.iter_mut().filter(|place| place.id == id);
            match (seen.next(), seen.next()) {
                (Some(alone), None) => alone.by_pose = region(&pixels),
                // A tag cut by the edge of the image is not decoded.
                (None, _) if is_inside(&pixels, size_px) => {
                    let side_px = longer_side_px(&pixels);
                    places.push(Place { id, side_px, last: None, by_pose: region(&pixels) });
                }
                _ => {}
            }
        }
        places
    }

    /// Searches for tags that have left their positions, or were never seen.
    fn everywhere(&mut self, image: &GrayImage, elapsed_s: f64, found: &mut Vec<DecodedTag>) -> Extent {
        let is_due = self.absence.is_due();
        if is_due {
            // All copies are included, so that the first image reports the same copies as later ones.
            add_new(found, self.finder.search(image, &[FINE]));
            if found.is_empty() {
                add_new(
                    found,
                    self.finder
                        .find_in_grid(&self.finder.ground(image), &[])
                        .iter()
                        .map(FoundTag::decoded)
                        .collect(),
                );
            }
        }
        let strips = self.small_round.take(elapsed_s);
        if found.is_empty() {
            let size_px = [image.width_px, image.height_px];
            for strip in strips {
                let part = Region::strip(strip, STRIPS, SMALL_OVERLAP_PX, size_px);
                add_new(found, self.finder.find_small_in(image, &part));
            }
        }
        if is_due { Extent::Whole } else { Extent::Share }
    }

    /// Searches for copies, displaced tags and new ones, in a share of the image at a time.
    fn besides(&mut self, image: &GrayImage, elapsed_s: f64, found: &mut Vec<DecodedTag>) {
        let size_px = [image.width_px, image.height_px];
        for part in self.round.take(elapsed_s) {
            match part.checked_sub(1) {
                None => self.finder.add_at(image, COARSE, found),
                Some(strip) => {
                    let part = Region::strip(strip, STRIPS, OVERLAP_PX, size_px);
                    add_new(found, self.finder.find_in(image, &part, FINE));
                }
            }
        }
    }
}

/// Returns whether all of these positions are inside an image or close to its edges.
fn is_inside(pixels: &[Pixel], size_px: [u32; 2]) -> bool {
    let reaches = |x: f64, size: u32| -REACH_PX <= x && x < size as f64 + REACH_PX;
    pixels.iter().all(|pixel| reaches(pixel.x, size_px[0]) && reaches(pixel.y, size_px[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE_PX: [u32; 2] = [1280, 960];

    /// A square of 90 px.
    fn corners(left_px: f64, top_px: f64) -> [Pixel; 4] {
        [[0.0, 0.0], [90.0, 0.0], [90.0, 90.0], [0.0, 90.0]]
            .map(|[u, v]: [f64; 2]| Pixel::new(left_px + u, top_px + v))
    }

    /// Returns the area searched, in pixels, for a tag last seen at one position and expected at another.
    fn searched_px(last: [Pixel; 4], by_pose: [Pixel; 4]) -> u64 {
        let mut follower = TagFollower::new(TagFinder::with_ids("tag36h11", &[3]).unwrap(), false);
        let tag = DecodedTag { family: 0, id: 3, margin_gray: 80.0, corners: last };
        follower.seen = vec![Seen::new(&tag, None)];
        let image = GrayImage::filled(SIZE_PX[0], SIZE_PX[1], 128);
        let expected = by_pose.map(|pixel| (Feature { id: 3, corner: 0 }, pixel));
        let places = follower.places(&image, &expected, &[]);
        joined(places.iter().flat_map(Place::regions).collect()).iter().map(Region::area_px).sum()
    }

    /// The filter follows a sudden motion one frame late; the area between the two positions is not searched.
    #[test]
    fn a_tag_is_sought_where_it_was_and_where_it_is_expected_and_not_between() {
        let here = searched_px(corners(300.0, 500.0), corners(300.0, 500.0));
        assert_eq!(searched_px(corners(300.0, 500.0), corners(900.0, 100.0)), 2 * here);
        assert!(searched_px(corners(300.0, 500.0), corners(330.0, 500.0)) < here * 3 / 2);
    }
}
