//! Parts of an image: those searched where a target is expected, and strips of an image searched in turn.

use crate::GrayImage;
use resight_core::Pixel;

/// Parts start and end on multiples of this, pixels: the tag decoder thresholds in 4 × 4 tiles of the image at half size, and finds the same
/// outlines in a part whose tiles are those of the whole image.
const TILE_PX: u32 = 8;

/// A rectangle of pixels, ends excluded, never empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Region {
    first: [u32; 2],
    end: [u32; 2],
}

impl Region {
    /// Returns the part of the image with these points and a margin; `None` where that is outside, or a point is not finite.
    pub fn around(points: &[Pixel], margin_px: f64, size_px: [u32; 2]) -> Option<Self> {
        let span = |axis: usize| {
            let values = points.iter().map(|point| point[axis]);
            let (least, most) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            let (first, end) = (least - margin_px, most + margin_px + 1.0);
            let is_inside = first < end && first < size_px[axis] as f64 && 0.0 < end;
            // The conversion to unsigned numbers clips at the image's edges.
            is_inside.then(|| tiles(first.max(0.0) as u32, end.ceil() as u32, size_px[axis]))
        };
        let is_finite = points.iter().all(|point| point.iter().all(|x| x.is_finite()));
        let ((u0, u1), (v0, v1)) = (span(0).filter(|_| is_finite)?, span(1)?);
        Some(Region { first: [u0, v0], end: [u1, v1] })
    }

    /// Returns all of an image with pixels.
    pub fn whole(size_px: [u32; 2]) -> Self {
        Region { first: [0, 0], end: size_px }
    }

    /// Returns strip `index` of `count`, which tile the image from top to bottom, with `overlap_px` more on both sides.
    pub fn strip(index: u32, count: u32, overlap_px: u32, size_px: [u32; 2]) -> Self {
        let row = |i: u32| (size_px[1] as u64 * i as u64 / count as u64) as u32;
        let (first, end) = (row(index).saturating_sub(overlap_px), row(index + 1).saturating_add(overlap_px));
        let (first, end) = tiles(first, end, size_px[1]);
        Region { first: [0, first], end: [size_px[0], end] }
    }

    /// Returns tile `[column, row]` of `counts` columns and rows, which tile the image, with `overlap_px` more on all sides.
    pub fn tile(tile: [u32; 2], counts: [u32; 2], overlap_px: u32, size_px: [u32; 2]) -> Self {
        let span = |axis: usize| {
            let edge = |i: u32| (size_px[axis] as u64 * i as u64 / counts[axis] as u64) as u32;
            let end = edge(tile[axis] + 1).saturating_add(overlap_px);
            tiles(edge(tile[axis]).saturating_sub(overlap_px), end, size_px[axis])
        };
        let ((u0, u1), (v0, v1)) = (span(0), span(1));
        Region { first: [u0, v0], end: [u1, v1] }
    }

    /// Returns the numbers of columns and rows.
    #[cfg(test)]
    pub fn size_px(&self) -> [u32; 2] {
        [self.end[0] - self.first[0], self.end[1] - self.first[1]]
    }

    /// Returns the first column and row, the offset of detections in this part.
    pub fn origin(&self) -> Pixel {
        Pixel::new(self.first[0] as f64, self.first[1] as f64)
    }

    /// Returns the number of pixels.
    pub fn area_px(&self) -> u64 {
        let edge = |axis: usize| (self.end[axis] - self.first[axis]) as u64;
        edge(0) * edge(1)
    }

    /// Returns whether a position is in this part.
    pub fn contains(&self, pixel: &Pixel) -> bool {
        (0..2).all(|axis| (self.first[axis] as f64..self.end[axis] as f64).contains(&pixel[axis]))
    }

    /// Returns the smallest rectangle that contains both.
    fn with(&self, other: &Region) -> Region {
        let (a, b) = (self, other);
        Region {
            first: [a.first[0].min(b.first[0]), a.first[1].min(b.first[1])],
            end: [a.end[0].max(b.end[0]), a.end[1].max(b.end[1])],
        }
    }

    /// Copies this part of an image, reusing the memory of `part`. `None` where the region was made for a larger image.
    pub fn cut(&self, image: &GrayImage, part: &mut GrayImage) -> Option<()> {
        let width = image.width_px as usize;
        let columns = self.first[0] as usize..self.end[0] as usize;
        part.data.clear();
        for row in self.first[1] as usize..self.end[1] as usize {
            part.data.extend_from_slice(image.data.get(row * width..)?.get(columns.clone())?);
        }
        (part.width_px, part.height_px) = (self.end[0] - self.first[0], self.end[1] - self.first[1]);
        Some(())
    }
}

/// Returns the range from `first` to `end`, widened to whole tiles, in an image of `size` pixels; not empty where `first` is inside.
fn tiles(first: u32, end: u32, size: u32) -> (u32, u32) {
    let start = first.min(size.saturating_sub(1)) / TILE_PX * TILE_PX;
    (start, end.min(size).next_multiple_of(TILE_PX).min(size).max(start + 1))
}

/// Returns the longer side of the smallest upright rectangle around these points, pixels; 0 around none.
pub(super) fn longer_side_px(points: &[Pixel]) -> f64 {
    let side = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        (most - least).max(0.0)
    };
    side(0).max(side(1))
}

/// Joins regions wherever one search of both costs less than two searches.
pub(super) fn joined(mut regions: Vec<Region>) -> Vec<Region> {
    let mut i = 0;
    while i < regions.len() {
        let partner = (i + 1..regions.len())
            .find(|&j| regions[i].with(&regions[j]).area_px() <= regions[i].area_px() + regions[j].area_px());
        match partner {
            Some(j) => {
                regions[i] = regions[i].with(&regions[j]);
                regions.swap_remove(j);
                i = 0; // What it has grown over may be joined now.
            }
            None => i += 1,
        }
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [1280, 961];

    fn around(points: &[(f64, f64)], margin_px: f64) -> Option<Region> {
        let points: Vec<Pixel> = points.iter().map(|(u, v)| Pixel::new(*u, *v)).collect();
        Region::around(&points, margin_px, SIZE)
    }

    #[test]
    fn a_region_holds_its_points_and_ends_on_tiles_or_at_the_edge() {
        let region = around(&[(100.0, 200.0), (130.5, 180.0)], 10.0).unwrap();
        assert_eq!((region.first, region.end), ([88, 168], [144, 216]));
        let corner = around(&[(1279.0, 960.0)], 30.0).unwrap();
        assert_eq!((corner.first, corner.end), ([1248, 928], [1280, 961]));
    }

    #[test]
    fn nothing_outside_the_picture_is_a_region() {
        for points in [&[(-50.0, 10.0)][..], &[(1400.0, 10.0)], &[(f64::NAN, 10.0), (5.0, 5.0)], &[]] {
            assert_eq!(around(points, 20.0), None, "{points:?}");
        }
    }

    #[test]
    fn strips_hold_every_row_and_overlap() {
        let strips: Vec<Region> = (0..8).map(|i| Region::strip(i, 8, 64, SIZE)).collect();
        assert_eq!((strips[0].first[1], strips[7].end[1]), (0, 961));
        for pair in strips.windows(2) {
            assert!(pair[1].first[1] + 128 <= pair[0].end[1], "{pair:?}");
        }
    }

    #[test]
    fn a_part_has_the_pixels_of_its_place() {
        let data = (0..64 * 48u32).map(|k| (k % 251) as u8).collect();
        let image = GrayImage { width_px: 64, height_px: 48, data };
        let region = Region::around(&[Pixel::new(20.0, 30.0)], 5.0, [64, 48]).unwrap();
        let mut part = GrayImage::filled(0, 0, 0);
        region.cut(&image, &mut part).unwrap();
        assert_eq!((region.origin(), part.width_px, part.height_px), (Pixel::new(8.0, 24.0), 24, 16));
        assert_eq!(part.at(3, 2), image.at(11, 26));
        assert_eq!(region.cut(&GrayImage::filled(16, 16, 0), &mut part), None);
    }

    #[test]
    fn regions_are_joined_where_that_saves_pixels() {
        let regions = [(100.0, 100.0), (130.0, 110.0), (900.0, 700.0)];
        let regions: Vec<Region> = regions.iter().filter_map(|at| around(&[*at], 40.0)).collect();
        let joined = joined(regions.clone());
        assert_eq!(joined.len(), 2);
        assert!(regions.iter().all(|a| joined.iter().any(|b| b.with(a) == *b)));
    }
}
