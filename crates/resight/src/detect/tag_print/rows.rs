//! How the grey level of each pixel depends on what is not known of a tag (docs/math/tag_print.md eq. (4)).

use super::ink::{Blur, Print};
use super::part::Part;
use crate::detect::homography::{Homography, PlanePoint};
use nalgebra::{Matrix2, SVector};
use resight_core::Pixel;
use std::ops::Range;

/// Brightness and its two slopes; contrast; times the contrast: eight coordinates of the corners, the blur's variances along u, along both and along v,
/// the spread of the white, six bows.
pub(super) const UNKNOWNS: usize = 22;
pub(super) const GAIN: usize = 3;
pub(super) const CORNERS: Range<usize> = 4..12;
pub(super) const BLUR: Range<usize> = 12..15;
pub(super) const SPREAD: usize = 15;
pub(super) const BOWS: Range<usize> = 16..22;

pub(super) type Row = SVector<f64, UNKNOWNS>;

/// One pixel.
pub(super) struct Line {
    /// Where it is in the part.
    pub index: usize,
    pub row: Row,
    pub gray: f64,
    /// 1 well inside of the print, 0 outside.
    pub weight: f64,
}

impl Line {
    /// Its grey level without a further step of corners and blur.
    pub fn predicted(&self, x: &Row) -> f64 {
        let fixed = |range: Range<usize>| -> f64 { range.map(|i| self.row[i] * x[i]).sum() };
        fixed(0..CORNERS.start) + fixed(SPREAD..UNKNOWNS)
    }
}

/// Step of the derivatives by the corners' coordinates, pixels; a homography bends over edges of tens of pixels.
const DIFFERENCE_PX: f64 = 1e-3;

/// The pixels near lines of the print. None where the corners have no homography.
pub(super) fn lines(
    part: &Part,
    print: &Print,
    at: &[Pixel; 4],
    blur_px2: &Matrix2<f64>,
    every: usize,
) -> Option<Vec<Line>> {
    let plane = print.corners().map(|[x, y]| PlanePoint::new(x, y));
    let map_of = |at: &[Pixel; 4]| Homography::fit(&[0, 1, 2, 3].map(|k: usize| (plane[k], at[k])));
    let map = map_of(at)?;
    let from_image = map.inverse()?;
    // How each place moves with each coordinate of each corner.
    let mut moved = Vec::with_capacity(8);
    for k in 0..8 {
        let mut at = *at;
        at[k / 2][k % 2] += DIFFERENCE_PX;
        moved.push(map.difference(&map_of(&at)?, DIFFERENCE_PX));
    }
    let centre = at.iter().sum::<Pixel>() / 4.0;
    let edge_px = crate::detect::sigma::shortest_edge_px(at).max(1.0);
    let (inset, width) = (print.inset as f64, print.width as f64);
    let cells = width - 2.0 * inset;
    // Outside of what is printed anything may be, and the blur brings it in.
    let rim_px = inset / cells * edge_px;
    let margin_px = (1.5 * (0.5 * blur_px2.trace()).sqrt() + 0.5).min(0.5 * rim_px);
    let mut lines = Vec::new();
    for (index, p, gray) in part.places(every) {
        // Gradients of the plane's coordinates in the image, and the blur across the lines of each.
        let (x, gradients) = from_image.with_gradients(&p);
        if !print.is_known([x.x, x.y]) {
            continue;
        }
        let depth_px = [x.x, x.y]
            .iter()
            .zip(&gradients)
            .map(|(x, g)| x.min(width - x) / g.norm())
            .fold(f64::INFINITY, f64::min);
        let weight = (depth_px - margin_px + 0.5).clamp(0.0, 1.0);
        let variance = |a: usize, b: usize| gradients[a].dot(&(blur_px2 * gradients[b]));
        let sigma = [variance(0, 0).sqrt(), variance(1, 1).sqrt()];
        let correlation = (variance(0, 1) / (sigma[0] * sigma[1])).clamp(-0.9, 0.9);
        if !(0.0 < weight) || !(sigma[0] * sigma[1]).is_normal() {
            continue;
        }
        let Some(ink) = print.at([x.x, x.y], &Blur { sigma, correlation }) else { continue };
        let slope = gradients[0] * ink.slope[0] + gradients[1] * ink.slope[1];
        let mut row = Row::zeros();
        row[0] = 1.0;
        (row[1], row[2]) = ((p.x - centre.x) / edge_px, (p.y - centre.y) / edge_px);
        row[GAIN] = ink.value;
        for i in 0..8 {
            row[CORNERS.start + i] = -slope.dot(&map.moved(&moved[i], &x, &p));
        }
        let bend = |a: usize, b: usize| {
            let [xx, xy, yy] = ink.bend;
            let (g, h) = (&gradients[0], &gradients[1]);
            g[a] * g[b] * xx + (g[a] * h[b] + h[a] * g[b]) * xy + h[a] * h[b] * yy
        };
        row[BLUR.start] = 0.5 * bend(0, 0);
        row[BLUR.start + 1] = bend(0, 1);
        row[BLUR.start + 2] = 0.5 * bend(1, 1);
        row[SPREAD] = slope.norm();
        // Both edges of a pair bow to one side, or to opposite ones; and what is between them is moved along.
        let (s, t) = ((x.x - inset) / cells, (x.y - inset) / cells);
        let bow = |t: f64| 4.0 * t * (1.0 - t) * cells / edge_px;
        row[BOWS.start] = -bow(t) * ink.slope[0];
        row[BOWS.start + 1] = row[BOWS.start] * (2.0 * s - 1.0);
        row[BOWS.start + 2] = -bow(s) * ink.slope[1];
        row[BOWS.start + 3] = row[BOWS.start + 2] * (2.0 * t - 1.0);
        row[BOWS.start + 4] = -bow(s) * ink.slope[0];
        row[BOWS.start + 5] = -bow(t) * ink.slope[1];
        lines.push(Line { index, row, gray, weight });
    }
    (UNKNOWNS < lines.len()).then_some(lines)
}
