//! ChArUco boards through `calib-targets`, with OpenCV's corner ids.
//!
//! Two things the library does not do are done here: boards printed inverted (white on black: tried when the plain
//! image shows no board) and OpenCV's pattern of before 4.6. That legacy pattern differs only for an even number of
//! rows, where it starts with a marker in the top-left square; turned by a quarter it is a modern board of swapped
//! rows and columns whose marker table is permuted and turned, so it is detected as that board and renumbered.

use super::chessboard::{corner_config, view};
use super::{DetectError, sigma};
use crate::GrayImage;
use calib_targets::aruco::{Dictionary, resolve_dictionary};
use calib_targets::charuco::{CharucoBoardSpec, CharucoDetector, CharucoParams, MarkerLayout};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{Charuco, Feature};
use std::sync::Mutex;

/// Finds one ChArUco board.
pub(super) struct CharucoFinder {
    detector: CharucoDetector,
    /// The board's own inner corners along x.
    columns: u32,
    /// Inner corners along x of the board as detected, when that is the legacy board turned by a quarter.
    turned: bool,
    rows: u32,
    /// The last board seen was printed white on black: try that first.
    inverted: bool,
}

impl CharucoFinder {
    pub fn new(board: &Charuco) -> Result<Self, DetectError> {
        let unknown = || DetectError::UnknownFamily { name: board.dictionary.clone() };
        let dictionary = resolve_dictionary(&board.dictionary).ok_or_else(unknown)?;
        let turned = board.legacy_pattern && board.rows % 2 == 0;
        let (rows, columns) = if turned { (board.columns, board.rows) } else { (board.rows, board.columns) };
        let dictionary = if turned { turned_dictionary(&dictionary, board)? } else { dictionary };
        let ratio = (board.marker_m / board.square_m) as f32;
        let spec = CharucoBoardSpec::new(rows, columns, 1.0, ratio, dictionary)
            .with_marker_layout(MarkerLayout::OpenCvCharuco);
        let mut params = CharucoParams::for_board(spec);
        params.chess = corner_config();
        let detector =
            CharucoDetector::new(params).map_err(|e| DetectError::Board { reason: e.to_string() })?;
        Ok(CharucoFinder { detector, columns: board.columns - 1, rows: board.rows - 1, turned, inverted: false })
    }

    pub fn detect(&mut self, image: &GrayImage) -> Vec<Detection> {
        let first = self.inverted;
        for inverted in [first, !first] {
            let detections = if inverted { self.find(&negative(image)) } else { self.find(image) };
            if !detections.is_empty() {
                self.inverted = inverted;
                return detections;
            }
        }
        Vec::new()
    }

    fn find(&self, image: &GrayImage) -> Vec<Detection> {
        let Some(found) = view(image).and_then(|view| self.detector.detect(&view).ok()) else {
            return Vec::new();
        };
        let mut detections: Vec<Detection> = found
            .corners
            .iter()
            .map(|c| Detection {
                feature: Feature { id: self.own_id(c.id), corner: 0 },
                pixel: Pixel::new(c.position.x as f64, c.position.y as f64),
                sigma_px: sigma::saddle_px(c.position_covariance.map(|k| k.sigma_max_px() as f64)),
            })
            .collect();
        detections.sort_by_key(|d| d.feature);
        detections
    }

    /// From the id on the detected board to that on the target. A corner (column, row) of the legacy board appears
    /// on the turned one at (rows - 1 - row, column).
    fn own_id(&self, id: u32) -> u32 {
        if !self.turned {
            return id;
        }
        let (turned_column, turned_row) = (id % self.rows, id / self.rows);
        (self.rows - 1 - turned_column) * self.columns + turned_row
    }
}

fn negative(image: &GrayImage) -> GrayImage {
    GrayImage { data: image.data.iter().map(|x| 255 - x).collect(), ..*image }
}

/// Marker tables made for legacy boards; the library takes static tables only, so each is built once and kept.
static TURNED: Mutex<Vec<(&'static str, u32, u32, &'static [u64])>> = Mutex::new(Vec::new());

/// The dictionary under which the legacy board, turned clockwise by a quarter, is a modern board.
fn turned_dictionary(dictionary: &Dictionary, board: &Charuco) -> Result<Dictionary, DetectError> {
    let reason = |reason: String| DetectError::Board { reason };
    let mut tables = TURNED.lock().map_err(|_| reason("the table of legacy boards is locked".into()))?;
    let known = tables.iter().find(|t| (t.0, t.1, t.2) == (dictionary.name(), board.rows, board.columns));
    let codes = match known {
        Some(table) => table.3,
        None => {
            let codes = turned_codes(dictionary, board.rows, board.columns)
                .ok_or_else(|| reason(format!("{} has too few markers for this board", dictionary.name())))?;
            let codes: &'static [u64] = Box::leak(codes.into_boxed_slice());
            tables.push((dictionary.name(), board.rows, board.columns, codes));
            codes
        }
    };
    Dictionary::from_static_codes(dictionary.name(), dictionary.marker_size(), dictionary.max_correction_bits(), codes)
        .map_err(|e| reason(e.to_string()))
}

/// Codes in the order in which a modern board numbers the squares of the turned legacy board.
fn turned_codes(dictionary: &Dictionary, rows: u32, columns: u32) -> Option<Vec<u64>> {
    // Legacy: markers where row and column have the same parity, numbered along the rows.
    let has_marker = |column: u32, row: u32| (column + row) % 2 == 0;
    let id = |column: u32, row: u32| {
        let before = (0..rows * columns).filter(|k| has_marker(k % columns, k / columns));
        before.take_while(|&k| k < row * columns + column).count()
    };
    // Turned square (c, r) = (rows - 1 - row, column).
    let squares = (0..columns).flat_map(|r| (0..rows).map(move |c| (r, rows - 1 - c)));
    squares
        .filter(|&(column, row)| has_marker(column, row))
        .map(|(column, row)| {
            let code = dictionary.codes().get(id(column, row))?;
            Some(quarter_turn(*code, dictionary.marker_size()))
        })
        .collect()
}

/// A marker turned clockwise by a quarter; bits row-major, most significant first.
fn quarter_turn(code: u64, n: usize) -> u64 {
    let bit = |column: usize, row: usize| code >> (n * n - 1 - (row * n + column)) & 1;
    // The turned marker's cell (column, row) shows the old cell (row, n - 1 - column).
    let cells = (0..n * n).map(|k| (k % n, k / n));
    cells.fold(0, |word, (column, row)| word << 1 | bit(row, n - 1 - column))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_quarter_turns_are_none() {
        for (code, n) in [(0xb532u64, 4), (0x1f3a5c9, 5)] {
            let turned = (0..4).fold(code, |c, _| quarter_turn(c, n));
            assert_eq!(turned, code);
            assert_ne!(quarter_turn(code, n), code);
        }
    }

    /// Top-left marker cell of a 2 × 2-bit picture moves to the top right.
    #[test]
    fn quarter_turn_is_clockwise() {
        assert_eq!(quarter_turn(0b1000, 2), 0b0100);
    }
}
