//! Circles in rows: OpenCV's symmetric and asymmetric grids, with its order and its meaning of the spacing.

use crate::{Error, Point};

/// A grid of circles; origin at the centre of circle 0, id = row · columns + column, as OpenCV's `findCirclesGrid` returns them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CircleGrid {
    /// Rows, along y.
    pub rows: u32,
    /// Circles in each row, along x.
    pub columns: u32,
    /// Distance between rows, metres. In a symmetric grid it is also the distance between circles of a row; in an asymmetric grid these are
    /// twice as far apart.
    pub spacing_m: f64,
    /// Diameter of the circles, metres, for printing; `None` for half the distance between neighbours. A detector measures it.
    pub diameter_m: Option<f64>,
    /// Whether every second row is shifted by `spacing_m` along x.
    pub asymmetric: bool,
}

/// Fewer circles are found among other dots by chance.
const LEAST_CIRCLES: u32 = 9;

impl CircleGrid {
    /// Column and row of a circle's centre in units of the spacing.
    pub fn node(&self, id: u32) -> (i32, i32) {
        let (column, row) = ((id % self.columns) as i32, (id / self.columns) as i32);
        if self.asymmetric { (2 * column + row % 2, row) } else { (column, row) }
    }

    /// Circle at a column and row in units of the spacing.
    pub fn id_at(&self, (x, y): (i32, i32)) -> Option<u32> {
        let row = u32::try_from(y).ok().filter(|row| *row < self.rows)?;
        let column = match self.asymmetric {
            true => Some(x - y % 2).filter(|x| x % 2 == 0)? / 2,
            false => x,
        };
        let column = u32::try_from(column).ok().filter(|column| *column < self.columns)?;
        Some(row * self.columns + column)
    }

    /// Distance between neighbouring circles, metres.
    pub fn pitch_m(&self) -> f64 {
        if self.asymmetric { self.spacing_m * std::f64::consts::SQRT_2 } else { self.spacing_m }
    }

    /// Diameter of the circles as printed, metres.
    pub fn printed_diameter_m(&self) -> f64 {
        self.diameter_m.unwrap_or(0.5 * self.pitch_m())
    }

    /// How many rotations in its plane do not change the grid, none included: 4 of a square symmetric grid, 2 of the other symmetric grids and
    /// of asymmetric ones with an even number of rows, else 1.
    pub fn alike(&self) -> u32 {
        match (self.asymmetric, self.rows == self.columns) {
            (false, true) => 4,
            (false, false) => 2,
            (true, _) if self.rows.is_multiple_of(2) => 2,
            (true, _) => 1,
        }
    }

    pub(super) fn point(&self, id: u32) -> Option<Point> {
        let (x, y) = self.node(Some(id).filter(|id| *id < self.rows * self.columns)?);
        Some(Point::new(f64::from(x) * self.spacing_m, f64::from(y) * self.spacing_m, 0.0))
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let refused = |parameter, seen, needed| Err(Error::InvalidTarget { parameter, seen, needed });
        if self.rows < 3 {
            return refused("rows", self.rows.into(), "a circle grid has at least 3 rows");
        }
        if self.columns < 2 || self.rows.saturating_mul(self.columns) < LEAST_CIRCLES {
            let needed = "a circle grid has at least 2 columns and 9 circles";
            return refused("columns", self.columns.into(), needed);
        }
        let is_positive = |x: f64| 0.0 < x && x.is_finite();
        if !is_positive(self.spacing_m) {
            return refused("spacing_m", self.spacing_m, "it must be positive");
        }
        match self.diameter_m {
            Some(seen) if !is_positive(seen) => refused("diameter_m", seen, "it must be positive"),
            Some(seen) if self.pitch_m() <= seen => {
                let needed = "circles must not touch: it is less than spacing_m, of an asymmetric grid less than 1.41 times that";
                refused("diameter_m", seen, needed)
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OpenCV's board of 4 × 11 circles: point (i, j) is at ((2j + i mod 2) s, i s).
    #[test]
    fn asymmetric_circles_lie_as_in_opencv() {
        let grid = CircleGrid { rows: 11, columns: 4, spacing_m: 0.02, diameter_m: None, asymmetric: true };
        for (id, x, y) in [(0, 0.0, 0.0), (3, 0.12, 0.0), (4, 0.02, 0.02), (7, 0.14, 0.02), (43, 0.12, 0.2)] {
            assert!((grid.point(id).unwrap() - Point::new(x, y, 0.0)).norm() < 1e-12, "{id}");
        }
        assert_eq!(grid.point(44), None);
    }

    #[test]
    fn nodes_and_ids_are_inverse() {
        for asymmetric in [false, true] {
            let grid = CircleGrid { rows: 5, columns: 3, spacing_m: 1.0, diameter_m: None, asymmetric };
            let mut count = 0;
            for (x, y) in (-3..9).flat_map(|x| (-3..9).map(move |y| (x, y))) {
                if let Some(id) = grid.id_at((x, y)) {
                    assert_eq!(grid.node(id), (x, y));
                    count += 1;
                }
            }
            assert_eq!(count, 15);
        }
    }

    #[test]
    fn grids_that_cannot_be_are_refused() {
        let good =
            CircleGrid { rows: 5, columns: 4, spacing_m: 0.02, diameter_m: Some(0.01), asymmetric: true };
        assert!(good.check().is_ok());
        let bad = [
            (CircleGrid { rows: 2, ..good }, "rows"),
            (CircleGrid { columns: 1, ..good }, "columns"),
            (CircleGrid { rows: 4, columns: 2, ..good }, "columns"),
            (CircleGrid { spacing_m: f64::NAN, ..good }, "spacing_m"),
            (CircleGrid { diameter_m: Some(0.029), ..good }, "diameter_m"),
            (CircleGrid { diameter_m: Some(0.0), ..good }, "diameter_m"),
        ];
        for (grid, name) in bad {
            match grid.check() {
                Err(Error::InvalidTarget { parameter, .. }) => assert_eq!(parameter, name),
                other => panic!("{name}: {other:?}"),
            }
        }
    }
}
