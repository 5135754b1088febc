//! Finds saddle points at whole pixels, a tenth of the cost of measuring them: enough to find out whether an image may show black squares that
//! touch at their corners, and where.
//!
//! S. Bennett and J. Lasenby, "ChESS – quick and robust detection of chess-board features", Computer Vision and Image Understanding, 2014: sixteen
//! pixels on a ring of radius 5 alternate between black and white around a saddle point. The response is computed in whole numbers, five times the
//! published one, for many pixels of a row at once.

use super::joints::Joint;
use super::stop;
use crate::GrayImage;
use resight_core::Pixel;

/// Columns and rows of the ring.
const RING: [(isize, isize); 16] = [
    (0, -5),
    (2, -5),
    (3, -3),
    (5, -2),
    (5, 0),
    (5, 2),
    (3, 3),
    (2, 5),
    (0, 5),
    (-2, 5),
    (-3, 3),
    (-5, 2),
    (-5, 0),
    (-5, -2),
    (-3, -3),
    (-2, -5),
];
const RADIUS: usize = 5;
const ROWS: usize = 2 * RADIUS + 1;
/// Least response, five times the published one; it is the limit with which corners are measured.
const LEAST: i16 = 5 * 15;
/// A peak is the largest response within this many pixels to each side.
const PEAK: usize = 2;
/// Standard deviation of a saddle point at whole pixels, refined by the centre of mass of the response.
const SIGMA_PX: f64 = 0.5;
/// Number of pixels of a row that are computed at once; the columns of a block.
const CHUNK: usize = 64;
/// Rows of a block.
const BLOCK_ROWS: usize = 16;
/// Cost relative to that of measuring the corners of as many pixels, from timing both.
#[cfg(test)]
const PASS: usize = 8;

/// Finds the saddle points of an image, the strongest first, where grey levels differ by at least `least_gray`.
pub(super) fn saddles(image: &GrayImage, least_gray: u8) -> Vec<Joint> {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let is_large = 2 * ROWS <= width && 2 * ROWS <= height;
    if !is_large || image.data.len() != width * height || stop::is_stopped() {
        return Vec::new();
    }
    #[cfg(test)]
    super::work::count(image.data.len() / PASS);
    let (inner, n_rows) = (width - 2 * RADIUS, height - 2 * RADIUS);
    let blocks = Blocks::of(image, least_gray);
    let mut responses = vec![0i16; inner * n_rows];
    for v in 0..n_rows {
        for first in (0..inner).step_by(CHUNK).filter(|first| blocks.may_hold(*first, v)) {
            let n = CHUNK.min(inner - first);
            let rows = std::array::from_fn(|k| &image.data[(v + k) * width + first..][..n + 2 * RADIUS]);
            respond(&rows, &mut responses[v * inner + first..][..n]);
        }
    }
    let mut found: Vec<(i16, Joint)> = Vec::new();
    for v in PEAK..n_rows - PEAK {
        for first in (0..inner).step_by(CHUNK).filter(|first| blocks.may_hold(*first, v)) {
            let end = (first + CHUNK).min(inner);
            let row = &responses[v * inner..][first..end];
            if row.iter().fold(0, |most, response| most.max(*response)) <= LEAST {
                continue;
            }
            let inside = first.max(PEAK)..end.min(inner - PEAK);
            found.extend(inside.filter_map(|u| peak(&responses, inner, [u, v])));
        }
    }
    found.sort_by_key(|(response, _)| std::cmp::Reverse(*response));
    found.into_iter().map(|(_, joint)| joint).collect()
}

/// Blocks of an image with contrast in them or beside them: a ring that begins in any other has none.
struct Blocks {
    columns: usize,
    may_hold: Vec<bool>,
}

impl Blocks {
    fn of(image: &GrayImage, least_gray: u8) -> Self {
        let (width, height) = (image.width_px as usize, image.height_px as usize);
        let (columns, rows) = (width.div_ceil(CHUNK), height.div_ceil(BLOCK_ROWS));
        let has_contrast = |column: usize, row: usize| {
            let lines = image.data[row * BLOCK_ROWS * width..].chunks(width).take(BLOCK_ROWS);
            let parts = lines.map(|line| &line[column * CHUNK..width.min((column + 1) * CHUNK)]);
            let (low, high) = parts.fold((u8::MAX, 0u8), |(low, high), part| {
                (part.iter().fold(low, |a, b| a.min(*b)), part.iter().fold(high, |a, b| a.max(*b)))
            });
            least_gray <= high.saturating_sub(low)
        };
        let mut may_hold = vec![false; columns * rows];
        for (column, row) in (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))) {
            if has_contrast(column, row) {
                for k in row.saturating_sub(1)..(row + 2).min(rows) {
                    may_hold[k * columns..][column.saturating_sub(1)..(column + 2).min(columns)].fill(true);
                }
            }
        }
        Blocks { columns, may_hold }
    }

    /// Returns whether rings that begin in a column and row of the image may have contrast.
    fn may_hold(&self, column: usize, row: usize) -> bool {
        self.may_hold[row / BLOCK_ROWS * self.columns + column / CHUNK]
    }
}

/// Computes the responses of a row from the eleven rows around it.
fn respond(rows: &[&[u8]; ROWS], out: &mut [i16]) {
    let n = out.len();
    let at = |(u, v): (isize, isize)| {
        let first = RADIUS.saturating_add_signed(u);
        &rows[RADIUS.saturating_add_signed(v)][first..][..n]
    };
    let ring: [&[u8]; 16] = RING.map(at);
    let cross = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)].map(at);
    for (i, out) in out.iter_mut().enumerate() {
        let s = |k: usize| i16::from(ring[k][i]);
        let quarters = |k: usize| (s(k) + s(k + 8) - s(k + 4) - s(k + 12)).abs();
        let squares = quarters(0) + quarters(1) + quarters(2) + quarters(3);
        let halves = |k: usize| (s(k) - s(k + 8)).abs();
        let edges =
            halves(0) + halves(1) + halves(2) + halves(3) + halves(4) + halves(5) + halves(6) + halves(7);
        let around: i16 = (0..16).map(s).sum();
        let middle: i16 = cross.iter().map(|pixels| i16::from(pixels[i])).sum();
        *out = 5 * (squares - edges) - (5 * around - 16 * middle).abs();
    }
}

/// Returns the saddle point where a response is the largest around it, with another one beside it.
fn peak(responses: &[i16], inner: usize, [u, v]: [usize; 2]) -> Option<(i16, Joint)> {
    let own = responses[v * inner + u];
    if own <= LEAST {
        return None;
    }
    let (mut sum, mut moment, mut n) = (0.0, Pixel::zeros(), 0);
    for (k, j) in (v - PEAK..=v + PEAK).flat_map(|k| (u - PEAK..=u + PEAK).map(move |j| (k, j))) {
        let other = responses[k * inner + j];
        // Of equal ones, the first counts.
        if own < other || own == other && (k, j) < (v, u) {
            return None;
        }
        if 0 < other {
            n += 1;
            sum += f64::from(other);
            moment += f64::from(other) * Pixel::new(j as f64, k as f64);
        }
    }
    let offset = RADIUS as f64;
    let pixel = moment / sum + Pixel::new(offset, offset);
    (1 < n).then_some((own, Joint { pixel, sigma_px: SIGMA_PX }))
}

#[cfg(test)]
mod tests {
    use super::super::joints::joints;
    use super::*;
    use crate::render::Pcg;

    /// Squares, rotated, with noise.
    fn board(square_px: f64, angle: f64, noise: f64) -> GrayImage {
        let mut pcg = Pcg::new(8);
        let gray = |k: usize| {
            let (u, v) = ((k % 240) as f64 - 120.0, (k / 240) as f64 - 100.0);
            let (x, y) = (u * angle.cos() + v * angle.sin(), v * angle.cos() - u * angle.sin());
            // The edges are a pixel wide.
            let soft = |x: f64| {
                (2.0 * square_px / std::f64::consts::PI * (x * std::f64::consts::PI / square_px).sin())
                    .clamp(-0.5, 0.5)
            };
            let is_inside = x.abs() < 3.0 * square_px && y.abs() < 3.0 * square_px;
            let ink = if is_inside { 2.0 * soft(x) * soft(y) } else { 0.5 };
            (128.0 + 160.0 * ink + noise * pcg.normal()).round().clamp(0.0, 255.0) as u8
        };
        GrayImage { width_px: 240, height_px: 200, data: (0..240 * 200).map(gray).collect() }
    }

    /// Each that is measured is found; noise adds some that are rejected where they are measured.
    #[test]
    fn the_saddle_points_that_are_measured_are_found() {
        for (square_px, angle, noise) in [(12.0, 0.3, 0.0), (20.0, 0.7, 3.0), (9.0, 0.1, 2.0)] {
            let image = board(square_px, angle, noise);
            let (fast, measured) = (saddles(&image, 15), joints(&image));
            // Beside the board, joints of noise are measured whose contrast is too small here.
            let is_of_board =
                |joint: &&Joint| (joint.pixel - Pixel::new(120.0, 100.0)).amax() < 4.5 * square_px;
            assert!(25 <= measured.iter().filter(is_of_board).count());
            for joint in measured.iter().filter(is_of_board) {
                let nearest =
                    fast.iter().map(|f| (f.pixel - joint.pixel).norm()).fold(f64::INFINITY, f64::min);
                // The sides of an edge are compared 1.5 px from it and more.
                assert!(nearest < 1.5, "square {square_px}: {nearest} px from {}", joint.pixel);
            }
        }
    }

    #[test]
    fn walls_and_edges_have_none() {
        let edge = GrayImage {
            width_px: 64,
            height_px: 64,
            data: (0..4096).map(|k| if k % 64 < 30 { 0 } else { 255 }).collect(),
        };
        for image in
            [edge, GrayImage::filled(64, 64, 9), GrayImage::filled(8, 900, 9), GrayImage::filled(0, 0, 0)]
        {
            assert_eq!(saddles(&image, 15).len(), 0);
        }
    }
}
