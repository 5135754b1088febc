//! The part of an image that a board covers.

use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Chessboard;

/// A convex outline, its corners clockwise in the image.
pub(super) struct Outline(Vec<Pixel>);

impl Outline {
    /// Returns the convex hull of a board's inner corners, widened by its outer squares.
    pub fn around(found: &[Detection], board: &Chessboard) -> Self {
        let middle = found.iter().map(|d| d.pixel).sum::<Pixel>() / found.len().max(1) as f64;
        let squares = board.rows.min(board.columns).saturating_sub(1).max(1) as f64;
        let grown = 1.0 + 2.0 / squares;
        let mut points: Vec<Pixel> = found.iter().map(|d| middle + (d.pixel - middle) * grown).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        let mut hull = half(points.iter());
        hull.extend(half(points.iter().rev()));
        Outline(hull)
    }

    /// Returns whether a position is inside.
    pub fn holds(&self, at: &Pixel) -> bool {
        let n = self.0.len();
        2 < n && (0..n).all(|k| 0.0 <= cross(&self.0[k], &self.0[(k + 1) % n], at))
    }
}

/// Returns one chain of the hull, without its last point (A. M. Andrew, Information Processing Letters, 1979).
fn half<'a>(points: impl Iterator<Item = &'a Pixel>) -> Vec<Pixel> {
    let mut chain: Vec<Pixel> = Vec::new();
    for point in points {
        while 2 <= chain.len() && cross(&chain[chain.len() - 2], &chain[chain.len() - 1], point) <= 0.0 {
            chain.pop();
        }
        chain.push(*point);
    }
    chain.pop();
    chain
}

/// Is positive where c is to the right of the line from a to b, in an image whose rows go down.
fn cross(a: &Pixel, b: &Pixel, c: &Pixel) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight_core::target::Feature;

    #[test]
    fn outline_holds_its_board_and_nothing_beside_it() {
        let board = Chessboard { rows: 3, columns: 4, square_m: 1.0 };
        let at = |k: u32| Pixel::new(100.0 + 20.0 * f64::from(k % 4), 50.0 + 20.0 * f64::from(k / 4));
        let found: Vec<Detection> = (0..12)
            .map(|id| Detection {
                feature: Feature { id, corner: 0 },
                pixel: at(id),
                sigma_px: 0.1,
                lens_sigma_px: 0.0,
                covariance_px2: None,
            })
            .collect();
        let outline = Outline::around(&found, &board);
        assert!((0..12).all(|id| outline.holds(&at(id))));
        assert!(outline.holds(&Pixel::new(85.0, 45.0)));
        assert!(!outline.holds(&Pixel::new(220.0, 70.0)) && !outline.holds(&Pixel::new(130.0, 5.0)));
    }
}
