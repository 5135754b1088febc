//! The uncertainty of a print's shift (docs/math/corner_sigma.md).
//!
//! There are two contributions. The effect of white noise follows from the slopes of the print: the Cramér–Rao bound. The other follows from the
//! residual: pixels of one edge that are off together (a foreign edge, a wrong print, ink that spreads) move the corner as noise does, so that
//! each pixel's pull on the corner is summed over small squares, and the squares of these sums are added (W. K. Newey and K. D. West,
//! Econometrica 1987, in two dimensions). Squares opposite to each other across the corner count as one: the residuals of a wrong blur pull
//! there in opposite directions and move no corner, while those of a wrong edge along its whole length pull in one.
//! A blur that differs from the assumed one, or is not round, and a print that is slightly rotated or sheared are fitted here too, with
//! seven more unknowns: otherwise they would be counted as errors, although they hardly move a corner.

use super::Laid;
use nalgebra::{SMatrix, SVector, Vector2};
use resight_core::Pixel;

/// Variance of rounding to whole grey levels.
const ROUNDING_GRAY2: f64 = 1.0 / 12.0;

/// Edge length of the squares over which pulls are summed: in standard deviations of the blur, with its limits in pixels.
const REACH_BLURS: f64 = 3.0;
const REACH_PX: (usize, usize) = (3, 7);

/// Brightness, contrast; multiplied by the contrast: shift, half of the blur's excess covariance, departure of the local affine map.
const UNKNOWNS: usize = 11;
/// Prior standard deviations of blur and map, so that prints that do not determine them are handled: pixels², and dimensionless.
const PRIORS: [(std::ops::Range<usize>, f64); 2] = [(4..7, 1.0), (7..11, 0.1)];
type Row = SVector<f64, UNKNOWNS>;

/// Variances of the shift, averaged over both axes, and the remaining shift.
pub(super) struct Scatter {
    pub by_noise_px2: f64,
    pub by_residual_px2: f64,
    pub step: Pixel,
}

/// Computes docs/math/corner_sigma.md eqs. (1)–(5); `None` where the print has no structure. `gain_gray` is the current estimate of the
/// contrast.
pub(super) fn of(laid: &Laid, gain_gray: f64) -> Option<Scatter> {
    let half = laid.window.half_px;
    let width = 2 * half + 1;
    let rows = rows(laid);
    let noise_gray2 = laid.window.noise_gray.powi(2).max(ROUNDING_GRAY2);
    let (x, inverse) = solved(&rows, noise_gray2 / (gain_gray * gain_gray))?;
    let shift_rows = inverse.fixed_rows::<2>(2) / x[1];
    let by_noise_px2 = 0.5 * noise_gray2 * (inverse[(2, 2)] + inverse[(3, 3)]) / (x[1] * x[1]);
    let reach = reach_px(laid.window.blur_px, &x);
    // Every square that contains a pixel: those that begin up to `reach` − 1 before it.
    let side = width + reach - 1;
    let mut squares = vec![Vector2::<f64>::zeros(); side * side];
    for (k, (row, gray)) in rows.iter().enumerate() {
        let pull = shift_rows * row * (gray - row.dot(&x));
        let (u, v) = (k % width, k / width);
        for line in v..v + reach {
            squares[line * side + u..][..reach].iter_mut().for_each(|sum| *sum += pull);
        }
    }
    let squares_px2 = 0.5 * paired(&squares, side, opposite(laid, reach)) / (reach * reach) as f64;
    let by_residual_px2 = unbiased(reach as f64 / width as f64) * squares_px2;
    Some(Scatter { by_noise_px2, by_residual_px2, step: Pixel::new(x[2], x[3]) / x[1] })
}

/// Returns the sums of column and row of a square and of the opposite one across the corner.
fn opposite(laid: &Laid, reach: usize) -> [i64; 2] {
    let at = laid.corner + laid.shift;
    [at.x, at.y].map(|x| (2.0 * (laid.window.half_px as f64 + x)).round() as i64 + reach as i64 - 1)
}

/// Returns half of the sum, over all squares, of the squared sum of each square and its opposite; the window is padded with zeros.
fn paired(squares: &[Vector2<f64>], side: usize, opposite: [i64; 2]) -> f64 {
    let index = |sum: i64, k: usize| usize::try_from(sum - k as i64).ok().filter(|k| *k < side);
    let mut total = 0.0;
    for (line, row) in squares.chunks(side).enumerate() {
        let across = index(opposite[1], line).map(|line| &squares[line * side..][..side]);
        for (column, sum) in row.iter().enumerate() {
            let other = across.zip(index(opposite[0], column)).map_or_else(Vector2::zeros, |(row, k)| row[k]);
            total += (sum + other).norm_squared();
        }
    }
    0.5 * total
}

/// Corrects for the part of the noise that the unknowns absorb, which is larger for sums over squares than for single pixels: the value for
/// white noise is divided out, with `share` the edge of a square over that of the window (eq. (6), accurate to 15 %).
fn unbiased(share: f64) -> f64 {
    1.0 + 1.5 * share + 1.4 * share * share
}

/// Returns the unknowns and the inverse of their normal equations; `noise_share2` is the variance of the noise over the squared contrast.
fn solved(rows: &[(Row, f64)], noise_share2: f64) -> Option<(Row, SMatrix<f64, UNKNOWNS, UNKNOWNS>)> {
    let (mut normal, mut right) = (SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros(), Row::zeros());
    for (row, gray) in rows {
        for i in 0..UNKNOWNS {
            right[i] += row[i] * gray;
            for j in 0..=i {
                normal[(i, j)] += row[i] * row[j];
            }
        }
    }
    for (unknowns, sigma) in PRIORS {
        unknowns.for_each(|i| normal[(i, i)] += noise_share2 / (sigma * sigma));
    }
    let factor = normal.cholesky()?;
    Some((factor.solve(&right), factor.inverse()))
}

/// Returns the edge of the squares, pixels: as wide as a blurred edge.
fn reach_px(blur_px: f64, x: &Row) -> usize {
    let more = (2.0 * x[4].max(x[6]) / x[1]).max(0.0);
    let blur_px = (blur_px * blur_px + more).sqrt();
    ((REACH_BLURS * blur_px).round() as usize).clamp(REACH_PX.0, REACH_PX.1)
}

/// Returns (1, T, −∂T/∂u, −∂T/∂v, ∂²T/∂u², ∂²T/∂u∂v, ∂²T/∂v², slopes by positions) and the grey level of each pixel.
fn rows(laid: &Laid) -> Vec<(Row, f64)> {
    let Laid { image, picture, middle, shift, corner, window } = laid;
    let (half, side) = (window.half_px as f64, 2 * window.half_px + 1);
    let (u0, v0) = (middle.x as usize - window.half_px, middle.y as usize - window.half_px);
    let moved = picture.moved(*shift, window.half_px);
    let row = |k: usize| {
        let (column, line) = (k % side, k / side);
        let (u, v) = (column as f64 - half - shift.x, line as f64 - half - shift.y);
        let ((value, du, dv), [uu, uv, vv]) = (moved.at(column, line), moved.bends(column, line));
        // Relative to the corner, about which the map's departure rotates.
        let (x, y) = (u - corner.x, v - corner.y);
        let gray = image.data[(v0 + line) * image.width_px as usize + u0 + column] as f64 - 128.0;
        (Row::from([1.0, value, -du, -dv, uu, uv, vv, du * x, du * y, dv * x, dv * y]), gray)
    };
    (0..side * side).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The residuals of a wrong blur move no corner; an error that moves both arms of an edge counts twice.
    #[test]
    fn squares_count_with_those_across_the_corner() {
        let side = 5;
        let sum = |k: usize| Vector2::new(k as f64 - 12.0, (k as f64 - 12.0).powi(3));
        let opposed: Vec<Vector2<f64>> = (0..side * side).map(sum).collect();
        assert_eq!(paired(&opposed, side, [4, 4]), 0.0);
        let alike = vec![Vector2::new(1.0, -2.0); side * side];
        assert_eq!(paired(&alike, side, [4, 4]), 2.0 * 5.0 * 25.0);
        // If the corner is not in the middle, some squares have no opposite.
        assert_eq!(paired(&alike, side, [2, 4]), 0.5 * 5.0 * (4.0 * 15.0 + 10.0));
        assert_eq!(paired(&alike, side, [i64::MIN / 2, 4]), 0.5 * 5.0 * 25.0);
    }
}
