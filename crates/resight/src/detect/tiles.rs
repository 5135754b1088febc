//! Searches images that are too large for the tag library tile by tile.
//!
//! The library keeps coordinates in 16 bits and aborts the program where an edge has 32,768 px or more, so that an image is passed to it only
//! once its size is known to fit. It also needs 9 to 23 bytes for each pixel that it searches; tiles limit that, whatever the image's size.

use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::region::{Region, longer_side_px};
use super::sigma;
use crate::GrayImage;
use resight_core::Pixel;

/// Largest reduced image, in pixels, that is searched at once; larger ones are searched in tiles.
const WHOLE_PIXELS: f64 = 8e6;
/// Largest number of pixels of a reduced tile.
const TILE_PIXELS: f64 = 4e6;
/// Longest edge of a reduced image or tile; the library's own limit is 32,767.
const LONGEST_EDGE: f64 = 32_000.0;
/// Overlap of tiles on each side, pixels of the reduced image: a tag of up to this size is completely inside one tile, and larger ones are found
/// at the next reduction.
const OVERLAP: f64 = 64.0;
/// Tags found at the next reduction are used if they have this edge length, pixels: the measurement of their edges then does not include their
/// bits.
const LARGE: f64 = 32.0;

/// The parameters of one search of the library.
#[derive(Debug, Clone, Copy)]
pub(super) struct CameraWatcher {
    /// Factor by which the image is reduced before outlines are searched for; at least 1.
    pub decimate: f32,
    /// The image in which edges are measured.
    pub edges: Edges,
}

/// Finds the tags of an image of any size.
pub(super) fn search(decoder: &mut QuadDecoder, image: &GrayImage, look: CameraWatcher) -> Vec<DecodedTag> {
    let size = [image.width_px, image.height_px];
    let counts = tile_counts(size, look.decimate as f64);
    if counts == [1, 1] {
        return decoder.detect(image, look.decimate, look.edges);
    }
    let overlap_px = (OVERLAP * look.decimate as f64).ceil() as u32;
    let mut part = GrayImage::filled(0, 0, 0);
    let mut all = Vec::new();
    for tile in (0..counts[1]).flat_map(|row| (0..counts[0]).map(move |column| [column, row])) {
        let region = Region::tile(tile, counts, overlap_px, size);
        if region.cut(image, &mut part).is_none() {
            continue;
        }
        let mut found = decoder.detect(&part, look.decimate, look.edges);
        found.iter_mut().flat_map(|tag| &mut tag.corners).for_each(|corner| *corner += region.origin());
        add_new(&mut all, found);
    }
    drop(part);
    // At full size nothing is searched for that half the size did not show (see the callers), so the next reduction is not searched again.
    if 1.0 < look.decimate {
        let wider = CameraWatcher { decimate: 2.0 * look.decimate, ..look };
        let mut large = search(decoder, image, wider);
        large.retain(|tag| LARGE * wider.decimate as f64 <= longer_side_px(&tag.corners));
        add_new(&mut all, large);
    }
    all
}

/// Returns the overlapping parts of an image that are searched at once at full size.
pub(super) fn parts(size_px: [u32; 2]) -> Vec<Region> {
    let counts = tile_counts(size_px, 1.0);
    let tiles = (0..counts[1]).flat_map(|row| (0..counts[0]).map(move |column| [column, row]));
    tiles.map(|tile| Region::tile(tile, counts, OVERLAP as u32, size_px)).collect()
}

/// Returns the number of columns and rows of tiles for an image at this reduction.
fn tile_counts(size_px: [u32; 2], decimate: f64) -> [u32; 2] {
    let reduced = size_px.map(|edge| edge as f64 / decimate);
    if reduced[0] * reduced[1] <= WHOLE_PIXELS && reduced.iter().all(|edge| *edge <= LONGEST_EDGE) {
        return [1, 1];
    }
    let mut counts = [1u32; 2];
    // The loop ends: an edge shrinks towards two overlaps, whose square is far below the largest tile.
    loop {
        let edge =
            |axis: usize| reduced[axis].min(reduced[axis] / counts[axis] as f64 + 2.0 * OVERLAP + 16.0);
        let (width, height) = (edge(0), edge(1));
        if width * height <= TILE_PIXELS && width.max(height) <= LONGEST_EDGE {
            return counts;
        }
        counts[usize::from(width < height)] += 1;
    }
}

/// Adds the tags that are not known yet.
fn add_new(all: &mut Vec<DecodedTag>, found: Vec<DecodedTag>) {
    let centre = |tag: &DecodedTag| tag.corners.iter().sum::<Pixel>() / 4.0;
    let same = |a: &DecodedTag, b: &DecodedTag| {
        let apart_px = (centre(a) - centre(b)).norm();
        (a.family, a.id) == (b.family, b.id) && apart_px < 0.5 * sigma::shortest_edge_px(&a.corners)
    };
    for tag in found {
        if !all.iter().any(|known| same(known, &tag)) {
            all.push(tag);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_of_any_picture_fit_the_library() {
        let edges = [1, 31, 64, 900, 4000, 8000, 32_767, 32_768, 65_535, 1_000_000];
        for size in edges.into_iter().flat_map(|w| edges.map(|h| [w, h])) {
            for decimate in [1.0, 2.0, 4.0] {
                let counts = tile_counts(size, decimate);
                let overlap_px = (OVERLAP * decimate) as u32;
                for tile in [[0, 0], [counts[0] / 2, counts[1] / 2], [counts[0] - 1, counts[1] - 1]] {
                    let region = Region::tile(tile, counts, overlap_px, size);
                    let [width, height] = region.size_px().map(|edge| edge as f64 / decimate);
                    assert!(width.max(height) < 32_768.0, "{size:?} / {decimate}: {width} × {height}");
                    assert!(width * height <= WHOLE_PIXELS, "{size:?} / {decimate}: {width} × {height}");
                }
            }
        }
        assert_eq!(tile_counts([4000, 3000], 2.0), [1, 1]);
    }
}
