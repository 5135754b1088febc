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
    /// How many rotations in its plane an image does not show, none included: of chessboards and circle grids 1, 2 or 4, of all others 1.
    pub fn alike(&self) -> u32 {
        match self.design() {
            Target::Chessboard(board) => board.alike(),
            Target::CircleGrid(grid) => grid.alike(),
            _ => 1,
        }
    }

    /// The motions of its frame, `target_from_target`, after which it looks the same: a pose `cam_from_target` times one of these fits every
    /// image as well. Empty of all targets but chessboards and circle grids that do not show a rotation ([`Target::alike`]).
    ///
    /// ```
    /// use resight_core::{Target, target::Chessboard};
    /// let board = |rows, columns| Target::Chessboard(Chessboard { rows, columns, square_m: 0.025 });
    /// assert_eq!(board(6, 9).symmetries().len(), 0);
    /// assert_eq!(board(5, 7).symmetries().len(), 1); // Half a turn.
    /// assert_eq!(board(6, 6).symmetries().len(), 3); // Quarter turns.
    /// ```
    pub fn symmetries(&self) -> Vec<Pose> {
        let Some(middle) = self.middle_of_box() else { return Vec::new() };
        let about_middle = |cos: f64, sin: f64| {
            let rotation = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
            Pose::new(rotation, middle - rotation * middle)
        };
        match self.alike() {
            4 => vec![about_middle(-1.0, 0.0), about_middle(0.0, 1.0), about_middle(0.0, -1.0)],
            2 => vec![about_middle(-1.0, 0.0)],
            _ => Vec::new(),
        }
    }

    /// The middle of the smallest box around its points; `None` for targets with one orientation.
    fn middle_of_box(&self) -> Option<Point> {
        let place = |id: u32| self.point(Feature { id, corner: 0 }).map(|p| p.position);
        let count = match self.design() {
            Target::Chessboard(board) => board.rows * board.columns,
            Target::CircleGrid(grid) => grid.rows * grid.columns,
            _ => return None,
        };
        let first = place(0)?;
        let (low, high) =
            (0..count).filter_map(place).fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
        Some(0.5 * (low + high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::CircleGrid;

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

    /// Of all rotations by quarter turns about the middle of the grid's box, exactly its symmetries move every circle to a circle.
    #[test]
    fn circles_go_to_circles_under_their_symmetries_only() {
        for (rows, columns, asymmetric, alike) in [
            (11, 4, true, 1),
            (10, 4, true, 2),
            (6, 3, true, 2),
            (6, 9, false, 2),
            (7, 7, false, 4),
            (5, 2, true, 1),
        ] {
            let grid = CircleGrid { rows, columns, spacing_m: 1.0, diameter_m: None, asymmetric };
            let target = Target::CircleGrid(grid);
            let middle = target.middle_of_box().unwrap();
            let is_kept = |(cos, sin): &(f64, f64)| {
                let rotation = Matrix3::new(*cos, -sin, 0.0, *sin, *cos, 0.0, 0.0, 0.0, 1.0);
                (0..rows * columns).all(|id| {
                    let p = target.point(Feature { id, corner: 0 }).unwrap().position;
                    let moved = rotation * (p - middle) + middle;
                    let node = moved.map(f64::round);
                    (node - moved).norm() < 1e-9 && grid.id_at((node.x as i32, node.y as i32)).is_some()
                })
            };
            let kept =
                [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].iter().filter(|r| is_kept(r)).count();
            assert_eq!((kept as u32, target.alike()), (alike, alike), "{rows} × {columns}, {asymmetric}");
            assert_eq!(target.symmetries().len() as u32 + 1, alike);
        }
    }
}
