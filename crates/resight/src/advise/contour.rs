//! Lines of equal value through a grid of numbers, by marching squares.

use nalgebra::Vector2;

/// A grid of values, row by row; `None` where there is no value.
pub(super) struct Grid<'a> {
    pub columns: usize,
    pub values: &'a [Option<f64>],
}

impl Grid<'_> {
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    pub fn at(&self, column: usize, row: usize) -> Option<f64> {
        *self.values.get(row * self.columns + column)?
    }

    /// Interpolates between the four neighbours of a position in grid units; `None` where one of them has no value.
    pub fn between(&self, x: f64, y: f64) -> Option<f64> {
        let last = |n: usize| (n.max(2) - 2) as f64;
        let (i, j) = (x.floor().clamp(0.0, last(self.columns)), y.floor().clamp(0.0, last(self.rows())));
        let (s, t) = (x - i, y - j);
        let corner = |di: usize, dj: usize| self.at(i as usize + di, j as usize + dj);
        let (a, b, c, d) = (corner(0, 0)?, corner(1, 0)?, corner(0, 1)?, corner(1, 1)?);
        Some((a * (1.0 - s) + b * s) * (1.0 - t) + (c * (1.0 - s) + d * s) * t)
    }

    /// Returns segments of the line on which the value is `level`, in grid units.
    pub fn contour(&self, level: f64) -> Vec<[Vector2<f64>; 2]> {
        let cells = (1..self.rows()).flat_map(|j| (1..self.columns).map(move |i| (i - 1, j - 1)));
        cells.flat_map(|(i, j)| self.crossings(i, j, level)).collect()
    }

    fn crossings(&self, i: usize, j: usize, level: f64) -> Vec<[Vector2<f64>; 2]> {
        const RING: [(usize, usize); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];
        let corner = |k: usize| {
            let (di, dj) = RING[k % 4];
            let value = self.at(i + di, j + dj)?;
            Some((Vector2::new((i + di) as f64, (j + dj) as f64), value))
        };
        let cut = |k: usize| {
            let ((p, a), (q, b)) = (corner(k)?, corner(k + 1)?);
            let crosses = (a < level) != (b < level);
            crosses.then(|| p + (q - p) * ((level - a) / (b - a)))
        };
        if (0..4).any(|k| corner(k).is_none()) {
            return Vec::new();
        }
        let cuts: Vec<Vector2<f64>> = (0..4).filter_map(cut).collect();
        cuts.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
    }
}

/// Returns about `wanted` round numbers between two positive numbers: 1, 2 and 5 of each decade, or finer ones where these are too few.
pub(super) fn levels(least: f64, greatest: f64, wanted: usize) -> Vec<f64> {
    const LADDERS: [&[f64]; 4] = [
        &[1.0],
        &[1.0, 2.0, 5.0],
        &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
        &[
            1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.8, 2.0, 2.2, 2.5, 2.8, 3.0, 3.2, 3.4, 3.6, 3.8, 4.0, 4.2,
            4.5, 5.0, 6.0, 7.0, 8.0, 9.0,
        ],
    ];
    if !(0.0 < least && least < greatest && greatest.is_finite()) {
        return Vec::new();
    }
    let decades = least.log10().floor() as i32..=greatest.log10().ceil() as i32;
    let on = |ladder: &[f64]| -> Vec<f64> {
        let all = decades.clone().flat_map(|d| ladder.iter().map(move |m| m * 10f64.powi(d)));
        all.filter(|v| least < *v && *v < greatest).collect()
    };
    let enough = LADDERS.iter().map(|ladder| on(ladder)).find(|levels| wanted <= levels.len());
    enough.unwrap_or_else(|| on(LADDERS[3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The contour of a cone is a circle: both ends of every segment lie on it to within the grid's own error.
    #[test]
    fn contour_of_a_cone_is_a_circle() {
        let values: Vec<Option<f64>> =
            (0..41 * 41).map(|k| Some(((k % 41) as f64 - 20.0).hypot((k / 41) as f64 - 20.0))).collect();
        let grid = Grid { columns: 41, values: &values };
        let segments = grid.contour(12.3);
        assert!(60 < segments.len());
        let length: f64 = segments.iter().map(|[a, b]| (b - a).norm()).sum();
        assert!((length / (std::f64::consts::TAU * 12.3) - 1.0).abs() < 0.01, "{length}");
        let radius = |p: &Vector2<f64>| (p - Vector2::new(20.0, 20.0)).norm();
        assert!(segments.iter().flatten().all(|p| (radius(p) - 12.3).abs() < 0.02));
        assert!((grid.between(20.0, 25.5).unwrap() - 5.5).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_drawn_beside_a_missing_value() {
        let values = [Some(0.0), Some(1.0), None, Some(0.0), Some(1.0), Some(2.0)];
        let grid = Grid { columns: 3, values: &values };
        assert_eq!(grid.contour(0.5).len(), 1);
        assert!(grid.contour(1.5).is_empty() && grid.between(1.5, 0.5).is_none());
    }

    #[test]
    fn levels_are_round_and_enough() {
        assert_eq!(levels(0.9, 25.0, 4), [1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(levels(1.05, 1.95, 3).len(), 7);
        assert!(levels(0.0, 1.0, 3).is_empty() && levels(2.0, 1.0, 3).is_empty());
    }
}
