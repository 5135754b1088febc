//! The print inside a tag: black and white cells, from the detectors' own code tables.
//!
//! AprilTag families come from the C library's generator, OpenCV's `DICT_…` from calib-targets; there is no other table of codes here. Both are
//! upright as in the original drawings, which a test verifies by detection; OpenCV draws its `DICT_APRILTAG_…` rotated by half a turn against
//! the AprilTag originals.

use super::RenderError;
use crate::detect::apriltag::{Drawing, drawing};
use calib_targets_aruco::resolve_dictionary;

/// The cells of one tag, white rim included.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cells {
    /// Cells along each side.
    pub per_side: usize,
    /// Cells along the side of the square whose corners are detected, centred: the `size_m` of a tag.
    pub per_size: usize,
    /// Row by row from the top left of the upright tag; true is white.
    pub white: Vec<bool>,
}

impl Cells {
    /// Returns whether a cell is white.
    pub fn is_white(&self, row: usize, column: usize) -> bool {
        self.white.get(row * self.per_side + column).copied().unwrap_or(true)
    }

    /// Returns the same code in a black frame of `bits` cells instead of 1; only for tags whose outermost printed ring is black.
    pub fn with_border(&self, bits: u32) -> Cells {
        let code = self.per_size.saturating_sub(2);
        let first = (self.per_side - code) / 2;
        let rim = bits as usize + 1;
        let inner = |x: usize| (rim..rim + code).contains(&x).then(|| x - rim + first);
        let per_side = code + 2 * rim;
        let cell = |row: usize, column: usize| {
            let outside = row.min(column) == 0 || row.max(column) + 1 == per_side;
            match (inner(row), inner(column)) {
                (Some(r), Some(c)) => self.is_white(r, c),
                _ => outside,
            }
        };
        let white = (0..per_side * per_side).map(|i| cell(i / per_side, i % per_side)).collect();
        Cells { per_side, per_size: code + 2 * bits as usize, white }
    }

    /// Returns whether the ring inside the detected square is completely black, so that `with_border` applies.
    pub fn has_black_frame(&self) -> bool {
        let first = (self.per_side - self.per_size) / 2;
        let last = first + self.per_size - 1;
        let ring = |i: usize| [(first, i), (last, i), (i, first), (i, last)];
        2 < self.per_size
            && self.per_size < self.per_side
            && (first..=last).flat_map(ring).all(|(row, column)| !self.is_white(row, column))
    }
}

/// Returns the cells of a tag: `family` is an AprilTag name (`tag36h11`) or an OpenCV dictionary (`DICT_4X4_50`).
pub fn cells(family: &str, id: u32) -> Result<Cells, RenderError> {
    if let Some(drawing) = drawing(family, id) {
        let Drawing { per_side, per_size, white } = drawing.map_err(|count| unknown_id(family, id, count))?;
        return Ok(Cells { per_side, per_size, white });
    }
    let unknown = || RenderError::UnknownFamily { family: family.to_owned() };
    let dictionary = resolve_dictionary(family).ok_or_else(unknown)?;
    let codes = dictionary.codes();
    let out_of_range = || unknown_id(family, id, codes.len());
    let code = *codes.get(id as usize).ok_or_else(out_of_range)?;
    let n = dictionary.marker_size();
    let per_side = n + 4;
    // calib-targets packs row by row from the lowest bit up, 1 is black.
    let bit = |row: usize, column: usize| (code >> (row * n + column)) & 1 == 0;
    let white = (0..per_side * per_side).map(|i| {
        let (row, column) = (i / per_side, i % per_side);
        let rim = row.min(column) == 0 || row.max(column) + 1 == per_side;
        let inside = |x: usize| (2..n + 2).contains(&x);
        rim || (inside(row) && inside(column) && bit(row - 2, column - 2))
    });
    Ok(Cells { per_side, per_size: n + 2, white: white.collect() })
}

fn unknown_id(family: &str, id: u32, count: usize) -> RenderError {
    RenderError::UnknownId { family: family.to_owned(), id, last: count.saturating_sub(1) as u32 }
}
