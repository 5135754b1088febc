//! Targets that look the same after a rotation in their plane.

use super::{Chessboard, Feature, Target};
use crate::{Point, Pose};
use nalgebra::Matrix3;

impl Chessboard {
    /// How many rotations in its plane the colours of its squares do not show, none included: 2 where rows and columns have an even sum (half a
    /// turn), 4 of a square board of an even number of corners (quarter turns), else 1.
    pub fn alike(&self) -> u32 {
        match (self.rows, self.columns) {
            (rows, columns) if rows == columns && rows.is_multiple_of(2) => 4,
            (rows, columns) if (rows + columns).is_multiple_of(2) => 2,
            _ => 1,
        }
    }
}

impl Target {
    /// The motions of its frame, `target_from_target`, after which it looks the same: a pose `cam_from_target` times one of these fits every
    /// image as well. Empty of all targets but chessboards whose colours do not tell a rotation ([`Chessboard::alike`]).
    ///
    /// ```
    /// use resight_core::{Target, target::Chessboard};
    /// let board = |rows, columns| Target::Chessboard(Chessboard { rows, columns, square_m: 0.025 });
    /// assert_eq!(board(6, 9).symmetries().len(), 0);
    /// assert_eq!(board(5, 7).symmetries().len(), 1); // Half a turn.
    /// assert_eq!(board(6, 6).symmetries().len(), 3); // Quarter turns.
    /// ```
    pub fn symmetries(&self) -> Vec<Pose> {
        let Target::Chessboard(board) = self.design() else { return Vec::new() };
        let corner = |id: u32| self.point(Feature { id, corner: 0 }).map(|p| p.position);
        let (Some(first), Some(last)) = (corner(0), corner(board.rows * board.columns - 1)) else {
            return Vec::new();
        };
        let middle: Point = 0.5 * (first + last);
        let about_middle = |cos: f64, sin: f64| {
            let rotation = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
            Pose::new(rotation, middle - rotation * middle)
        };
        match board.alike() {
            4 => vec![about_middle(-1.0, 0.0), about_middle(0.0, 1.0), about_middle(0.0, -1.0)],
            2 => vec![about_middle(-1.0, 0.0)],
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners go to corners, and black squares to black ones.
    #[test]
    fn symmetries_map_the_pattern_to_itself() {
        for (rows, columns) in [(5, 7), (4, 6), (7, 7), (6, 6), (3, 3)] {
            let board = Chessboard { rows, columns, square_m: 0.02 };
            let target = Target::Chessboard(board);
            let symmetries = target.symmetries();
            assert_eq!(symmetries.len() as u32 + 1, board.alike(), "{rows} × {columns}");
            for symmetry in symmetries {
                for id in 0..rows * columns {
                    let moved = symmetry * target.point(Feature { id, corner: 0 }).unwrap().position / 0.02;
                    assert!((moved - moved.map(f64::round)).norm() < 1e-9, "{rows} × {columns}: {moved}");
                }
                let centre = symmetry * Point::new(0.01, 0.01, 0.0) / 0.02;
                let (column, row) = (centre.x.floor() as i64, centre.y.floor() as i64);
                assert_eq!((column + row).rem_euclid(2), 0, "{rows} × {columns}: square {column}, {row}");
            }
        }
        assert!(
            Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.02 }).symmetries().is_empty()
        );
    }
}
