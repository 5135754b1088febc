//! ChArUco boards, with OpenCV's corner ids.
//!
//! Markers are decoded first (they stand free in their squares), each names its square, and the inner corners are
//! looked up among the saddle points near where the markers around them say they are. So a part of the board is
//! enough, and both of OpenCV's patterns work. Boards printed white on black, and the mirrored print on the back of a
//! double-sided board, are found in the same pass as three more families; the mirrored one shows the same corners
//! from behind. The grid-first detector of `calib-targets` needs eight connected corners and modern patterns: it found
//! 33 % of the corners of a real 4 × 5 board that this finds.

use super::DetectError;
use super::apriltag::{DecodedTag, Edges, QuadDecoder};
use super::families::Family;
use super::homography::{Homography, PlanePoint};
use super::joints::{CornerWindow, Joint, joints, nearest};
use super::tiles::{self, Look};
use crate::GrayImage;
use resight_core::correspondence::Detection;
use resight_core::target::{Charuco, Feature};

/// Finds one ChArUco board.
pub(super) struct CharucoFinder {
    board: Charuco,
    window: CornerWindow,
    /// Square (column, row) of each marker id.
    squares: Vec<(u32, u32)>,
    /// Families in the order of [`MIRRORED`].
    decoder: QuadDecoder,
}

/// Which of the four families (as printed, white on black, and the mirrored prints of both) are mirrored.
const MIRRORED: [bool; 4] = [false, false, true, true];

/// Marker corners may lie this far, in squares, from where the other markers of the board put them: lens distortion
/// bends a board by less, a wrong id is off by at least a square.
const CONSISTENT_SQUARES: f64 = 0.4;
/// A corner is looked for this far, in squares, from its prediction. The nearest saddle points that are not corners
/// lie in the markers, at least a margin and a border cell away (0.2 squares on common boards).
const SEARCH_SQUARES: f64 = 0.1;
/// Half window of the refinement, in squares: just clear of the markers, whose margin is an eighth of a square on
/// common boards. On 48 frames of four webcams the board's corners then fit a plane to 0.10–0.13 px; an 11 px window
/// that takes the markers in leaves 0.16–0.45 px.
const WINDOW_SQUARES: f64 = 0.12;

impl CharucoFinder {
    pub fn new(board: &Charuco, window: CornerWindow) -> Result<Self, DetectError> {
        let squares = marker_squares(board);
        let ids: Vec<u32> = (0..squares.len() as u32).collect();
        let family = Family::named(&board.dictionary)?.only(&board.dictionary, &ids)?;
        let mirrored = family.clone().mirrored();
        let prints = [family.clone(), family.inverted(), mirrored.clone(), mirrored.inverted()];
        let decoder = QuadDecoder::new(&prints).ok_or(DetectError::OutOfMemory)?;
        Ok(CharucoFinder { board: board.clone(), window, squares, decoder })
    }

    pub fn detect(&mut self, image: &GrayImage) -> Vec<Detection> {
        let markers = self.markers(image);
        if markers.is_empty() { Vec::new() } else { self.corners(&markers, &joints(image), image) }
    }

    /// Markers that agree on where the board is. Half size first: it shows most boards in a quarter of the time.
    fn markers(&mut self, image: &GrayImage) -> Vec<DecodedTag> {
        let mut best = Vec::new();
        for decimate in [2.0, 1.0] {
            let mut seen = tiles::search(&mut self.decoder, image, Look { decimate, edges: Edges::FullSize });
            seen.iter_mut()
                .filter(|m| MIRRORED[m.family])
                .for_each(|m| m.corners = [1, 0, 3, 2].map(|k: usize| m.corners[k]));
            let agreeing = self.agreeing(&seen);
            if best.len() < agreeing.len() {
                best = agreeing;
            }
            if self.squares.len() <= best.len() {
                break;
            }
        }
        best
    }

    /// The largest set of markers that one marker of it puts in their places.
    fn agreeing(&self, markers: &[DecodedTag]) -> Vec<DecodedTag> {
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
        // The other pattern of a board of odd width puts six of seven markers one column off, all in agreement: clear
        // markers that contradict count, not only those that agree.
        let contradicts = |m: &&DecodedTag| {
            let same_print = best.first().is_some_and(|first| first.family == m.family);
            same_print && LONE_MARGIN_GRAY <= m.margin_gray && !best.contains(m)
        };
        if best.len() < 9 * markers.iter().filter(contradicts).count() {
            return Vec::new();
        }
        // One marker alone is believed only with a clear reading: nothing else vouches for its id.
        if best.len() == 1 && best[0].margin_gray < LONE_MARGIN_GRAY { Vec::new() } else { best }
    }

    fn corners(&self, markers: &[DecodedTag], joints: &[Joint], image: &GrayImage) -> Vec<Detection> {
        let (rows, columns) = (self.board.rows - 1, self.board.columns - 1);
        (0..rows * columns)
            .filter_map(|id| {
                let place = PlanePoint::new((id % columns + 1) as f64, (id / columns + 1) as f64);
                let map = Homography::fit(&self.pairs_near(markers, &place))?;
                let predicted = map.at(&place);
                let beside = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)];
                let half_px =
                    beside.map(|(x, y)| (map.at(&(place + PlanePoint::new(x, y))) - predicted).norm());
                let square_px = 2.0 * half_px.into_iter().fold(f64::INFINITY, f64::min);
                let inside = 0.0 <= predicted.x && predicted.x < image.width_px as f64;
                let joint =
                    nearest(joints, &predicted, (SEARCH_SQUARES * square_px).max(2.0)).filter(|_| inside)?;
                let joint = joint.refined(image, WINDOW_SQUARES * square_px, self.window);
                let feature = Feature { id, corner: 0 };
                Some(Detection {
                    feature,
                    pixel: joint.pixel,
                    sigma_px: joint.sigma_px,
                    covariance_px2: None,
                })
            })
            .collect()
    }

    /// Corners of the markers nearest to a place, board (squares) and image.
    fn pairs_near(
        &self,
        markers: &[DecodedTag],
        place: &PlanePoint,
    ) -> Vec<(PlanePoint, resight_core::Pixel)> {
        let centre = |m: &DecodedTag| {
            let (column, row) = self.squares[m.id as usize];
            PlanePoint::new(column as f64 + 0.5, row as f64 + 0.5)
        };
        let mut near: Vec<&DecodedTag> = markers.iter().collect();
        near.sort_by(|a, b| {
            (centre(a) - place).norm().total_cmp(&(centre(b) - place).norm()).then(a.id.cmp(&b.id))
        });
        near.into_iter().take(4).flat_map(|m| self.pairs(m)).collect()
    }

    /// A marker's corners on the board, in squares from its top-left corner, and in the image.
    fn pairs(&self, marker: &DecodedTag) -> [(PlanePoint, resight_core::Pixel); 4] {
        let (column, row) = self.squares[marker.id as usize];
        let size = self.board.marker_m / self.board.square_m;
        let first = PlanePoint::new(column as f64, row as f64).add_scalar(0.5 * (1.0 - size));
        let corner = [(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)];
        [0, 1, 2, 3].map(|k| (first + PlanePoint::new(corner[k].0, corner[k].1), marker.corners[k]))
    }

    /// How far a marker's corners lie from where `map` puts them, in squares of its own image.
    fn deviation_squares(&self, map: &Homography, marker: &DecodedTag) -> f64 {
        let pairs = self.pairs(marker);
        let edge_px = super::sigma::shortest_edge_px(&marker.corners).max(1.0);
        let square_px = edge_px * self.board.square_m / self.board.marker_m;
        pairs.iter().map(|(x, u)| (map.at(x) - u).norm() / square_px).fold(0.0, f64::max)
    }
}

/// Reading a lone marker needs, grey levels (30 gave no false id in 72 markers, without anything to vouch).
const LONE_MARGIN_GRAY: f64 = 30.0;

/// One small marker predicts its neighbours well and the far end of the board poorly.
fn allowed_squares(finder: &CharucoFinder, leader: &DecodedTag, other: &DecodedTag) -> f64 {
    let (a, b) = (finder.squares[leader.id as usize], finder.squares[other.id as usize]);
    let apart = a.0.abs_diff(b.0).max(a.1.abs_diff(b.1)) as f64;
    CONSISTENT_SQUARES.max(0.15 * apart)
}

/// More markers first, then clearer ones.
fn strength(markers: &[DecodedTag]) -> f64 {
    markers.iter().map(|m| 1000.0 + m.margin_gray.min(255.0)).sum()
}

/// Square of each marker: along the rows, the squares that are white. OpenCV's pattern before 4.6 differs for an
/// even number of rows, where the top-left square is white.
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
