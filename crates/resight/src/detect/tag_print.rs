//! A tag measured by all that is printed on it (docs/math/corner_sigma.md section 4).
//!
//! The library fits a line to each edge of a tag. Where the image is blurred, or the tag small, the bits inside reach into these lines; but the bits are
//! known once the tag is read. The whole print, seen through the homography of four corners and a Gaussian blur, is laid on the image: four corners,
//! brightness, contrast and blur minimise the sum of squares. What does not look like the print at all (a finger over a corner) is left out.

use super::families::MarkerPattern;
use super::homography::{Homography, PlanePoint};
use super::region::longer_side_px;
use super::template::scatter::unbiased;
use super::template::{Picture, Window};
use crate::GrayImage;
use nalgebra::{SMatrix, SVector};
use resight_core::Pixel;

/// Where a tag's corners are.
#[derive(Debug, Clone, Copy)]
pub(super) struct LaidTag {
    pub corners: [Pixel; 4],
    /// Standard deviation of each coordinate of the corners, root mean square, pixels.
    pub sigma_px: f64,
}

/// Longest edge of a tag that is compared at full size, pixels; larger ones are reduced.
const LONGEST_PX: f64 = 110.0;
/// Of tags with longer edges the outline is compared alone, pixels: each edge then rests on pixels enough, and the bits cost time.
const OUTLINE_PX: f64 = 40.0;
/// Steps; each about squares the error.
const ROUNDS: usize = 4;
/// Corners that move less need no further step, pixels of the reduced image.
const SETTLED_PX: f64 = 0.01;
/// Blur to begin with, and the least and the most, pixels of the reduced image.
const FIRST_BLUR_PX: f64 = 0.8;
const BLUR_PX: (f64, f64) = (0.3, 4.0);
/// A pixel this far from the print, in contrasts from black to white (or standard deviations of the noise), shows something else.
const FOREIGN: f64 = 0.35;
const FOREIGN_SIGMAS: f64 = 4.5;
/// Least share of the pixels that shows the print, and of their variance that it explains.
const SHOWN: f64 = 0.6;
const EXPLAINED: f64 = 0.8;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 8.0;
/// The corners lie further than this from where the library has them, in edges: another's.
const REACH_EDGES: f64 = 0.1;

/// Brightness, contrast, eight coordinates of the corners, half of the blur's excess variance, bows of the edges.
const UNKNOWNS: usize = 17;
const CORNERS: std::ops::Range<usize> = 2..10;
/// What the blur is known to beforehand in each step, pixels² of half its variance.
const BLUR_PRIOR_PX2: f64 = 2.0;
/// What a lens bends an edge by in its middle, pixels at an edge of 50 px; grows with its square.
const BOW_PRIOR_PX: f64 = 0.1;
type Row = SVector<f64, UNKNOWNS>;
type Normal = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Corners of the upright tag's outer square on its plane.
const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

/// Lays a print on the image, corners as the library found them. None where the print does not show there, or part of it leaves the image.
pub(super) fn lay(
    image: &GrayImage,
    noise_gray: f64,
    print: &MarkerPattern,
    corners: &[Pixel; 4],
) -> Option<LaidTag> {
    let reduce = (longer_side_px(corners) / LONGEST_PX).ceil().clamp(1.0, 1e4) as usize;
    let cells = (print.width_cells - 2 * print.inset_cells) as f64;
    let part = Part::cut(image, corners, reduce, 1.0 + 2.0 * print.inset_cells as f64 / cells)?;
    let noise_gray = (noise_gray.powi(2) + 1.0 / 12.0).sqrt() / reduce as f64;
    let start = corners.map(|corner| part.reduced(&corner));
    let edge_px = super::sigma::shortest_edge_px(&start);
    let (mut at, mut blur_px) = (start, FIRST_BLUR_PX);
    let mut gain = None;
    for round in 0..ROUNDS {
        let comparison = Comparison::new(&part, print, &at, blur_px, noise_gray)?;
        let solved = comparison.solve(gain)?;
        for (k, corner) in at.iter_mut().enumerate() {
            *corner += Pixel::new(solved.x[2 + 2 * k], solved.x[3 + 2 * k]) / solved.x[1];
        }
        let moved_px = solved.x.fixed_rows::<8>(2).amax() / solved.x[1].abs();
        let off_edges = (0..4).map(|k| (at[k] - start[k]).norm() / edge_px).fold(0.0, f64::max);
        if !(off_edges <= REACH_EDGES) || !(0.5 * CONTRAST_GRAY < solved.x[1]) {
            return None;
        }
        if round + 1 == ROUNDS || (0 < round && moved_px < SETTLED_PX) {
            return comparison.conclude(&solved, &part, at);
        }
        let more = (solved.x[10] + solved.x[12]) / solved.x[1];
        blur_px = (blur_px * blur_px + more).max(BLUR_PX.0 * BLUR_PX.0).sqrt().min(BLUR_PX.1);
        gain = Some((solved.x[0], solved.x[1]));
    }
    None
}

/// The image around a tag, reduced.
struct Part {
    half: usize,
    reduce: f64,
    /// Centre of the middle pixel in the image.
    middle: Pixel,
    gray: Vec<f32>,
}

impl Part {
    /// The means of `reduce`² pixels in a square that holds the tag `grown` times; none where it leaves the image.
    fn cut(image: &GrayImage, corners: &[Pixel; 4], reduce: usize, grown: f64) -> Option<Self> {
        let centre = corners.iter().sum::<Pixel>() / 4.0;
        let reach_px = corners.iter().map(|corner| (corner - centre).amax()).fold(0.0, f64::max) * grown;
        let half = (reach_px / reduce as f64).ceil();
        if !(half <= 2.0 * LONGEST_PX) {
            return None;
        }
        let half = half as usize;
        let side = 2 * half + 1;
        let extent = (side * reduce) as f64;
        let first = centre.map(|c| (c - 0.5 * (extent - 1.0)).round());
        let inside = |c: f64, n: u32| 0.0 <= c && c + extent <= n as f64;
        if !inside(first.x, image.width_px) || !inside(first.y, image.height_px) {
            return None;
        }
        let (u0, v0, stride) = (first.x as usize, first.y as usize, image.width_px as usize);
        let mean = |k: usize| {
            let (u, v) = (u0 + k % side * reduce, v0 + k / side * reduce);
            let rows = (v..v + reduce).map(|v| &image.data[v * stride + u..][..reduce]);
            let sum: u32 = rows.flatten().map(|x| *x as u32).sum();
            sum as f32 / (reduce * reduce) as f32 - 128.0
        };
        let middle = first.map(|c| c + 0.5 * (extent - 1.0));
        Some(Part { half, reduce: reduce as f64, middle, gray: (0..side * side).map(mean).collect() })
    }

    fn reduced(&self, pixel: &Pixel) -> Pixel {
        (pixel - self.middle) / self.reduce + Pixel::new(self.half as f64, self.half as f64)
    }

    fn full(&self, pixel: &Pixel) -> Pixel {
        (pixel - Pixel::new(self.half as f64, self.half as f64)) * self.reduce + self.middle
    }
}

/// The rows of the pixels that show where the tag is.
struct Comparison {
    side: usize,
    /// Shortest edge of the tag, pixels.
    edge_px: f64,
    blur_px: f64,
    noise_gray: f64,
    /// Pixel, row of the normal equations, grey level.
    rows: Vec<(usize, Row, f64)>,
}

struct Solved {
    x: Row,
    inverse: Normal,
    is_shown: Vec<bool>,
}

impl Comparison {
    fn new(
        part: &Part,
        print: &MarkerPattern,
        at: &[Pixel; 4],
        blur_px: f64,
        noise_gray: f64,
    ) -> Option<Self> {
        let square = SQUARE.map(|(x, y)| PlanePoint::new(x, y));
        let map_of = |at: &[Pixel; 4]| Homography::fit(&[0, 1, 2, 3].map(|k: usize| (square[k], at[k])));
        let map = map_of(at)?;
        let from_image = map.inverse()?;
        // How each place moves with each coordinate of each corner.
        let mut moved = Vec::with_capacity(8);
        for k in 0..8 {
            let mut at = *at;
            at[k / 2][k % 2] += DIFFERENCE_PX;
            moved.push(map_of(&at)?);
        }
        let side = 2 * part.half + 1;
        let middle = Pixel::new(part.half as f64, part.half as f64);
        let window = Window { half_px: part.half, blur_px, noise_gray };
        let picture =
            Picture::draw(&|x: PlanePoint| ink(print, x), &from_image, middle, Pixel::zeros(), &window);
        let cells = (print.width_cells - 2 * print.inset_cells) as f64;
        let rim = print.inset_cells as f64 / cells;
        // Outside of what is printed anything may be, and the blur brings it in.
        let edge_px = super::sigma::shortest_edge_px(at).max(1.0);
        let rim = rim - ((1.5 * blur_px + 0.5) / edge_px).min(0.5 * rim);
        let is_print = |x: &PlanePoint| -rim <= x.x && x.x <= 1.0 + rim && -rim <= x.y && x.y <= 1.0 + rim;
        let band = if edge_px < OUTLINE_PX { 1.0 } else { (3.0 * blur_px + 1.5) / edge_px };
        let is_compared = |x: &PlanePoint| {
            let off = |x: f64| x.abs().min((x - 1.0).abs());
            is_print(x) && off(x.x).min(off(x.y)) <= band
        };
        let row = |k: usize| {
            let p = Pixel::new((k % side) as f64, (k / side) as f64);
            let x = from_image.at(&p);
            if !is_compared(&x) {
                return None;
            }
            let (value, du, dv) = picture.at(p.x - middle.x, p.y - middle.y);
            let mut row = Row::zeros();
            (row[0], row[1]) = (1.0, value);
            if FLAT < du.abs() + dv.abs() {
                for i in 0..8 {
                    let shift = (moved[i].at(&x) - p) / DIFFERENCE_PX;
                    row[2 + i] = -(du * shift.x + dv * shift.y);
                }
                let [uu, uv, vv] = picture.bends(p.x - middle.x, p.y - middle.y);
                (row[10], row[11], row[12]) = (uu, uv, vv);
                // Both edges of a pair bow to one side, or to opposite ones.
                let along = |step: PlanePoint| {
                    let shift = (map.at(&(x + step * DIFFERENCE)) - p) / (DIFFERENCE * edge_px);
                    -(du * shift.x + dv * shift.y)
                };
                let bow = |t: f64| 4.0 * t * (1.0 - t);
                row[13] = bow(x.y) * along(PlanePoint::x());
                row[14] = row[13] * (2.0 * x.x - 1.0);
                row[15] = bow(x.x) * along(PlanePoint::y());
                row[16] = row[15] * (2.0 * x.y - 1.0);
            }
            Some((k, row, part.gray[k] as f64))
        };
        let rows: Vec<_> = (0..side * side).filter_map(row).collect();
        Some(Comparison { side, edge_px, blur_px, noise_gray, rows })
    }

    /// The unknowns from the pixels that show the print; all of them at first. `gain` is brightness and contrast found before.
    fn solve(&self, gain: Option<(f64, f64)>) -> Option<Solved> {
        let cut = |g: f64| (2.0 * FOREIGN * g.abs()).max(FOREIGN_SIGMAS * self.noise_gray);
        let is_shown: Vec<bool> = match gain {
            Some((a, g)) => {
                self.rows.iter().map(|(_, row, gray)| (gray - a - g * row[1]).abs() <= cut(g)).collect()
            }
            None => vec![true; self.rows.len()],
        };
        let (mut normal, mut right) = (Normal::zeros(), Row::zeros());
        let shown = || self.rows.iter().zip(&is_shown).filter(|(_, shown)| **shown).map(|(row, _)| row);
        for (_, row, gray) in shown() {
            let last = if row[2] == 0.0 && row[10] == 0.0 { 2 } else { UNKNOWNS };
            for i in 0..last {
                right[i] += row[i] * gray;
                for j in 0..=i {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
        let g2 = gain.map_or(64.0, |(_, g)| g).powi(2);
        let noise_share2 = self.noise_gray.powi(2) / g2;
        (10..13).for_each(|i| normal[(i, i)] += noise_share2 / BLUR_PRIOR_PX2.powi(2) + 1e-9);
        let bow_px = BOW_PRIOR_PX * (self.edge_px / 50.0).powi(2);
        (13..17).for_each(|i| normal[(i, i)] += noise_share2 / (bow_px * bow_px) + 1e-9);
        let factor = normal.cholesky()?;
        let (x, inverse) = (factor.solve(&right), factor.inverse());
        x.iter().all(|x| x.is_finite()).then_some(Solved { x, inverse, is_shown })
    }

    fn conclude(&self, solved: &Solved, part: &Part, at: [Pixel; 4]) -> Option<LaidTag> {
        let Solved { x, inverse, is_shown } = solved;
        let shown = || self.rows.iter().zip(is_shown).filter(|(_, shown)| **shown).map(|(row, _)| row);
        let n = shown().count() as f64;
        let mean = shown().map(|(_, _, gray)| gray).sum::<f64>() / n;
        let noise_gray2 = self.noise_gray * self.noise_gray;
        let (mut total, mut left) = (0.0, 0.0);
        let reach = (3.0 * self.blur_px).round().clamp(3.0, 7.0) as usize;
        let side = self.side + reach - 1;
        let mut squares = vec![SVector::<f64, 8>::zeros(); side * side];
        let rows = inverse.fixed_rows::<8>(CORNERS.start) / x[1];
        for (k, row, gray) in shown() {
            let residual = gray - row.dot(x);
            total += (gray - mean).powi(2);
            left += residual * residual;
            let pull = rows * row * residual;
            let (u, v) = (k % self.side, k / self.side);
            for line in v..v + reach {
                squares[line * side + u..][..reach].iter_mut().for_each(|sum| *sum += pull);
            }
        }
        let explained = 1.0 - (left - n * noise_gray2).max(0.0) / (total - n * noise_gray2).max(1e-9);
        if !(EXPLAINED <= explained) || n < SHOWN * self.rows.len() as f64 {
            return None;
        }
        let by_noise_px2 = noise_gray2 * CORNERS.map(|i| inverse[(i, i)]).sum::<f64>() / (8.0 * x[1] * x[1]);
        let squares_px2 =
            squares.iter().map(|sum| sum.norm_squared()).sum::<f64>() / (8 * reach * reach) as f64;
        // Two of the unknowns belong to each edge.
        let share = reach as f64 / self.edge_px;
        let by_residual_px2 = unbiased(share) * squares_px2;
        let variance_px2 = by_residual_px2.max(super::print::LEAST_EXCESS * by_noise_px2);
        let sigma_px = (part.reduce.powi(2) * variance_px2 + super::print::METHOD_PX.powi(2)).sqrt();
        let corners = at.map(|corner| part.full(&corner));
        sigma_px.is_finite().then_some(LaidTag { corners, sigma_px })
    }
}

/// Step of the derivatives by the corners' coordinates, pixels; a homography bends over edges of tens of pixels.
const DIFFERENCE_PX: f64 = 1e-3;
/// The same on the plane, in edges.
const DIFFERENCE: f64 = 1e-5;
/// Where the print is this flat nothing moves it.
const FLAT: f64 = 1e-3;

/// −1 where black and 1 where white, on a plane in edges of the tag; white outside of the print.
fn ink(print: &MarkerPattern, x: PlanePoint) -> f32 {
    let cells = (print.width_cells - 2 * print.inset_cells) as f64;
    let cell = |x: f64| (x * cells + print.inset_cells as f64).floor();
    let (u, v) = (cell(x.x), cell(x.y));
    let inside = |c: f64| 0.0 <= c && c < print.width_cells as f64;
    let is_white = !inside(u) || !inside(v) || print.white[v as usize * print.width_cells + u as usize];
    if is_white { 1.0 } else { -1.0 }
}
