//! ChArUco boards, with OpenCV's corner ids.
//!
//! Markers are decoded first, as they are isolated in their squares. Each identifies its square, and every inner corner is fitted to the image
//! where the markers around it predict it (`corners`). So a part of the board is enough, and both of OpenCV's patterns work. Boards printed
//! white on black, and the mirrored print on the back of a double-sided board, are found in the same pass, as three more families; a mirrored
//! board shows the same corners from behind. The grid-first detector of `calib-targets` needs eight connected corners and modern patterns: of a
//! real 4 × 5 board it found 33 % of the corners that this detector finds.

mod corners;

use super::DetectError;
use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::families::{Family, MarkerPattern, marker_pattern};
use super::homography::{Homography, PlanePoint};
use super::joints::CornerWindow;
use super::noise::Quietened;
use super::outlines::{self, Ink};
use super::region::{Region, joined, longer_side_px};
use super::tiles::{self, CameraWatcher};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Charuco;

/// Finds one ChArUco board.
pub(super) struct CharucoFinder {
    board: Charuco,
    window: CornerWindow,
    /// Square (column, row) of each marker id.
    squares: Vec<(u32, u32)>,
    /// Families in the order of [`MIRRORED`].
    decoder: QuadDecoder,
    /// The marker in each square, row by row; `None` in squares without a marker.
    prints: Vec<Option<MarkerPattern>>,
    /// Half of the edge of a marker, in squares.
    half_marker: f64,
    cells_a_square: f64,
    /// Cells along a marker's border.
    border_cells: i32,
    /// Whether the markers found last are printed white on black.
    is_inverted: bool,
}

/// Which of the four families (as printed, white on black, and the mirrored prints of both) are mirrored.
const MIRRORED: [bool; 4] = [false, false, true, true];

/// Largest distance, in squares, of marker corners from where the other markers predict them: lens distortion bends a board by less, a wrong id
/// is off by at least a square.
const CONSISTENT_SQUARES: f64 = 0.4;
/// Least contrast of an outline, grey levels: that of a blurred board printed with a seventh of full contrast.
const LEAST_CONTRAST: u8 = 8;
/// Largest image, in pixels, in which markers are searched for first; the factor 4/3 allows for 4:3 images of whole megapixels.
const FIRST_PIXELS: f64 = 1.4e6;
/// A marker is searched for at its predicted position if a known marker is within this distance, in squares: two squares away.
const GROW_SQUARES: f64 = 3.0;
/// Markers with longer edges than this, in pixels, are found at half the size as well.
const LARGE_MARKER_PX: f64 = 80.0;

impl CharucoFinder {
    pub fn new(board: &Charuco, window: CornerWindow) -> Result<Self, DetectError> {
        let squares = marker_squares(board);
        let ids: Vec<u32> = (0..squares.len() as u32).collect();
        let family = Family::named(&board.dictionary)?.only(&board.dictionary, &ids)?;
        let border_cells = family.border_width;
        let mirrored = family.clone().mirrored();
        let families = [family.clone(), family.inverted(), mirrored.clone(), mirrored.inverted()];
        let decoder = QuadDecoder::new(&families).ok_or(DetectError::OutOfMemory)?;
        let mut prints = vec![None; board.rows as usize * board.columns as usize];
        for (&(column, row), &id) in squares.iter().zip(&ids) {
            prints[(row * board.columns + column) as usize] = Some(marker_pattern(&board.dictionary, id)?);
        }
        let cells = prints.iter().flatten().map(|print| print.width_cells - 2 * print.inset_cells).max();
        let marker = board.marker_m / board.square_m;
        let (half_marker, cells_a_square) = (0.5 * marker, cells.unwrap_or(1) as f64 / marker);
        let board = board.clone();
        Ok(CharucoFinder {
            board,
            window,
            squares,
            decoder,
            prints,
            half_marker,
            cells_a_square,
            border_cells,
            is_inverted: false,
        })
    }

    /// Finds the visible inner corners, sorted by id. Fails where several such boards are in view.
    pub fn detect(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        let quiet = Quietened::new(image);
        let markers = self.markers(image, &quiet)?;
        self.is_inverted = markers.first().is_some_and(|m| m.family % 2 == 1);
        Ok(if markers.is_empty() { Vec::new() } else { self.corners(&markers, image, quiet.noise_gray) })
    }

    /// Finds the markers that agree on the pose of the board. The reduced image is searched first: it shows some markers of most boards in a
    /// quarter of the time, and these predict the others. The smallest markers are visible only in the original image, even if it is noisy.
    fn markers(&mut self, image: &GrayImage, quiet: &Quietened) -> Result<Vec<DecodedTag>, DetectError> {
        let mut decimate = 2.0;
        while FIRST_PIXELS < image.data.len() as f64 / (decimate * decimate) && decimate < 16.0 {
            decimate *= 2.0;
        }
        while 1.0 <= decimate {
            let (searched, contrast) = match 1.0 < decimate {
                true => (quiet.image(), quiet.least_contrast(LEAST_CONTRAST)),
                false => (image, quiet.least_contrast_unsmoothed(LEAST_CONTRAST)),
            };
            self.decoder.set_least_contrast(contrast);
            let seen = match decimate {
                1.0 => self.look_at_outlines(searched, contrast),
                _ => self.look(searched, decimate as f32),
            };
            let copies = self.copies(&seen);
            if 1 < copies {
                return Err(DetectError::BoardCopies { kind: "ChArUco board", count: copies });
            }
            let best = self.agreeing(&seen);
            if !best.is_empty() {
                self.decoder.set_least_contrast(LEAST_CONTRAST);
                return Ok(self.grown(image, best));
            }
            decimate /= 2.0;
        }
        Ok(Vec::new())
    }

    /// Counts the boards that share ids: the largest set of markers that agree, and each further set of [`LEAST_OF_COPY`] or more with an id of
    /// an earlier set in another position. A board with another layout has each id only once.
    fn copies(&self, markers: &[DecodedTag]) -> usize {
        let mut left = markers.to_vec();
        let mut known: Vec<u32> = Vec::new();
        let mut count = 0;
        loop {
            let set = self.largest_set(&left);
            let is_board = LEAST_OF_COPY <= set.len();
            if !is_board || 0 < count && !set.iter().any(|m| known.contains(&m.id)) {
                return count;
            }
            count += 1;
            known.extend(set.iter().map(|m| m.id));
            let is_same = |a: &DecodedTag, b: &DecodedTag| {
                (middle(a) - middle(b)).norm() < 0.5 * super::sigma::shortest_edge_px(&a.corners)
            };
            // The loop ends, as every round removes markers.
            left.retain(|m| !set.iter().any(|other| is_same(other, m)));
        }
    }

    fn look(&mut self, image: &GrayImage, decimate: f32) -> Vec<DecodedTag> {
        let mut seen =
            tiles::search(&mut self.decoder, image, CameraWatcher { decimate, edges: Edges::FullSize });
        seen.iter_mut()
            .filter(|m| MIRRORED[m.family])
            .for_each(|m| m.corners = [1, 0, 3, 2].map(|k: usize| m.corners[k]));
        seen
    }

    /// Decodes the markers that are found only at full size, where the image has outlines with four sides.
    fn look_at_outlines(&mut self, image: &GrayImage, contrast: u8) -> Vec<DecodedTag> {
        let Some(quads) = outlines::of(image, contrast, &[Ink::Dark, Ink::Light], self.border_cells) else {
            return self.look(image, 1.0);
        };
        let size_px = [image.width_px, image.height_px];
        let regions: Vec<Region> =
            quads.iter().filter_map(|quad| Region::around(quad, 16.0, size_px)).collect();
        if outlines::is_texture(&regions, image) {
            return self.look(image, 1.0);
        }
        let mut part = GrayImage::filled(0, 0, 0);
        let mut all = Vec::new();
        for region in joined(regions) {
            if region.cut(image, &mut part).is_none() {
                continue;
            }
            let mut seen = self.look(&part, 1.0);
            seen.iter_mut().flat_map(|m| &mut m.corners).for_each(|corner| *corner += region.origin());
            all.extend(seen);
        }
        all
    }

    /// Adds the markers that are found at full size where the known ones predict them, and repeats this with the new ones.
    fn grown(&mut self, image: &GrayImage, mut markers: Vec<DecodedTag>) -> Vec<DecodedTag> {
        let mut looked = vec![false; self.squares.len()];
        markers.iter().for_each(|m| looked[m.id as usize] = true);
        let mut part = GrayImage::filled(0, 0, 0);
        // The loop ends, as every round searches for markers that were not searched for before.
        loop {
            let missing: Vec<(u32, [Pixel; 4])> = (0..self.squares.len() as u32)
                .filter(|&id| !looked[id as usize])
                .filter_map(|id| Some((id, self.predicted(&markers, id)?)))
                .collect();
            missing.iter().for_each(|(id, _)| looked[*id as usize] = true);
            let around = |(_, corners): &(u32, [Pixel; 4])| {
                let margin_px = 16.0 + 0.4 * longer_side_px(corners);
                Region::around(corners, margin_px, [image.width_px, image.height_px])
            };
            let regions = joined(missing.iter().filter_map(around).collect());
            if regions.is_empty() {
                return markers;
            }
            let edge_px =
                missing.iter().map(|(_, corners)| longer_side_px(corners)).fold(f64::INFINITY, f64::min);
            let decimate = if LARGE_MARKER_PX < edge_px { 2.0 } else { 1.0 };
            let mut all = markers.clone();
            for region in regions {
                if region.cut(image, &mut part).is_none() {
                    continue;
                }
                let mut seen = self.look(&part, decimate);
                seen.iter_mut().flat_map(|m| &mut m.corners).for_each(|corner| *corner += region.origin());
                all.extend(seen);
            }
            let agreeing = self.agreeing(&all);
            if agreeing.len() <= markers.len() {
                return markers;
            }
            markers = agreeing;
            markers.iter().for_each(|m| looked[m.id as usize] = true);
        }
    }

    /// Predicts the corners of a marker from those beside it; `None` where no marker is near.
    fn predicted(&self, markers: &[DecodedTag], id: u32) -> Option<[Pixel; 4]> {
        let centre = self.centre(id);
        let is_near = markers.iter().any(|m| (self.centre(m.id) - centre).norm() <= GROW_SQUARES);
        let map = Homography::fit(&self.pairs_near(markers, &centre)).filter(|_| is_near)?;
        let corners = self.marker_corners(id).map(|x| map.at(&x));
        corners.iter().all(|u| u.iter().all(|x| x.is_finite())).then_some(corners)
    }

    /// Returns the largest set of markers that agree with the prediction of one of them, each id once.
    fn largest_set(&self, markers: &[DecodedTag]) -> Vec<DecodedTag> {
        let set_of = |leader: &DecodedTag| -> Vec<DecodedTag> {
            let Some(map) = Homography::fit(&self.pairs(leader)) else { return Vec::new() };
            let same_print = markers.iter().filter(|m| m.family == leader.family);
            same_print
                .filter(|m| self.deviation_squares(&map, m) <= allowed_squares(self, leader, m))
                .copied()
                .collect()
        };
        let sets = markers.iter().map(set_of);
        let mut best = sets.max_by(|a, b| strength(a).total_cmp(&strength(b))).unwrap_or_default();
        best.sort_by(|a, b| a.id.cmp(&b.id).then(b.margin_gray.total_cmp(&a.margin_gray)));
        best.dedup_by_key(|m| m.id);
        best
    }

    /// Returns the largest set that agrees, if hardly any clear marker contradicts it.
    fn agreeing(&self, markers: &[DecodedTag]) -> Vec<DecodedTag> {
        let best = self.largest_set(markers);
        // The other pattern of a board of odd width puts six of seven markers one column off, all in agreement: so clear markers that contradict
        // count too, not only those that agree.
        let contradicts = |m: &&DecodedTag| {
            let same_print = best.first().is_some_and(|first| first.family == m.family);
            same_print && LONE_MARGIN_GRAY <= m.margin_gray && !best.contains(m)
        };
        if best.len() < 9 * markers.iter().filter(contradicts).count() {
            return Vec::new();
        }
        // A single marker is accepted only with a clear reading, because no other marker confirms its id.
        if best.len() == 1 && best[0].margin_gray < LONE_MARGIN_GRAY { Vec::new() } else { best }
    }

    /// Returns the corners of the markers nearest to a position: on the board, in squares, and in the image.
    fn pairs_near(&self, markers: &[DecodedTag], place: &PlanePoint) -> Vec<(PlanePoint, Pixel)> {
        let apart = |m: &DecodedTag| (self.centre(m.id) - place).norm();
        let mut near: Vec<&DecodedTag> = markers.iter().collect();
        near.sort_by(|a, b| apart(a).total_cmp(&apart(b)).then(a.id.cmp(&b.id)));
        near.into_iter().take(4).flat_map(|m| self.pairs(m)).collect()
    }

    /// Returns the centre of a marker's square, in squares.
    fn centre(&self, id: u32) -> PlanePoint {
        let (column, row) = self.squares[id as usize];
        PlanePoint::new(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Returns the corners of a marker on the board, in squares from the board's top-left corner.
    fn marker_corners(&self, id: u32) -> [PlanePoint; 4] {
        let half = 0.5 * self.board.marker_m / self.board.square_m;
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| self.centre(id) + PlanePoint::new(x, y))
    }

    /// Returns the corners of a marker on the board and in the image.
    fn pairs(&self, marker: &DecodedTag) -> [(PlanePoint, Pixel); 4] {
        let on_board = self.marker_corners(marker.id);
        [0, 1, 2, 3].map(|k| (on_board[k], marker.corners[k]))
    }

    /// Returns the distance between the corners of a marker and those predicted by `map`, in squares of the marker's own image.
    fn deviation_squares(&self, map: &Homography, marker: &DecodedTag) -> f64 {
        let pairs = self.pairs(marker);
        let edge_px = super::sigma::shortest_edge_px(&marker.corners).max(1.0);
        let square_px = edge_px * self.board.square_m / self.board.marker_m;
        pairs.iter().map(|(x, u)| (map.at(x) - u).norm() / square_px).fold(0.0, f64::max)
    }
}

/// Returns the centre of a marker in the image.
fn middle(marker: &DecodedTag) -> Pixel {
    marker.corners.iter().sum::<Pixel>() / 4.0
}

/// Fewer markers that agree are not a second board, but for example a separate sheet with one of its markers.
const LEAST_OF_COPY: usize = 2;

/// Least margin of a single marker, grey levels (30 gave no false id in 72 unconfirmed markers).
const LONE_MARGIN_GRAY: f64 = 30.0;

/// Returns the tolerance: one small marker predicts its neighbours accurately and the far end of the board poorly.
fn allowed_squares(finder: &CharucoFinder, leader: &DecodedTag, other: &DecodedTag) -> f64 {
    let (a, b) = (finder.squares[leader.id as usize], finder.squares[other.id as usize]);
    let apart = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)) as f64;
    CONSISTENT_SQUARES.max(0.15 * apart)
}

/// Ranks sets by their number of markers, then by their clarity.
fn strength(markers: &[DecodedTag]) -> f64 {
    markers.iter().map(|m| 1000.0 + m.margin_gray.min(255.0)).sum()
}

/// Returns the square of each marker: along the rows, the squares that are white. OpenCV's pattern before 4.6 differs for an even number of
/// rows, where the top-left square is white.
fn marker_squares(board: &Charuco) -> Vec<(u32, u32)> {
    let first_white = u32::from(!(board.legacy_pattern && board.rows.is_multiple_of(2)));
    let squares = (0..board.rows).flat_map(|row| (0..board.columns).map(move |column| (column, row)));
    squares.filter(|(column, row)| (column + row) % 2 == first_white).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board(rows: u32, legacy_pattern: bool) -> Charuco {
        let dictionary = "DICT_4X4_50".to_string();
        Charuco { rows, columns: 5, square_m: 0.04, marker_m: 0.03, dictionary, legacy_pattern }
    }

    #[test]
    fn legacy_pattern_differs_for_even_rows_only() {
        assert_eq!(marker_squares(&board(7, true)), marker_squares(&board(7, false)));
        assert_eq!(marker_squares(&board(6, false))[0], (1, 0));
        assert_eq!(marker_squares(&board(6, true))[0], (0, 0));
    }
}
