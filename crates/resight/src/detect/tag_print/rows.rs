//! The derivatives of each pixel's grey level by the unknowns of a tag (docs/math/tag_print.md eq. (4)).

use super::ink::{Blur, Print};
use super::part::Part;
use crate::detect::homography::{Homography, PlanePoint};
use nalgebra::{Matrix2, SMatrix, SVector};
use resight_core::Pixel;
use std::ops::Range;

/// Brightness and its two slopes; contrast; multiplied by the contrast: eight entries of the homography, the blur's covariance (uu, uv, vv), the
/// spread of the white, six bows.
pub(super) const UNKNOWNS: usize = 22;
pub(super) const GAIN: usize = 3;
pub(super) const MAP: Range<usize> = 4..12;
pub(super) const BLUR: Range<usize> = 12..15;
pub(super) const SPREAD: usize = 15;
pub(super) const BOWS: Range<usize> = 16..22;
/// The grey level follows the derivatives, and a zero pads the row: sums of products of whole rows hold both sides of the normal equations.
pub(super) const GRAY: usize = 22;
pub(super) const WIDTH: usize = 24;

pub(super) type Row = SVector<f64, UNKNOWNS>;
/// Derivative of the eight coordinates of the corners with respect to the entries of the homography.
pub(super) type CornersByMap = SMatrix<f64, 8, 8>;

/// One pixel.
pub(super) struct Line {
    /// Its position in the part.
    pub index: usize,
    pub row: [f64; WIDTH],
    /// 1 well inside the print, 0 outside.
    pub weight: f64,
}

impl Line {
    pub fn gray(&self) -> f64 {
        self.row[GRAY]
    }

    /// Returns its grey level without a further step of corners and blur.
    pub fn predicted(&self, x: &Row) -> f64 {
        let fixed = |range: Range<usize>| -> f64 { range.map(|i| self.row[i] * x[i]).sum() };
        fixed(0..MAP.start) + fixed(SPREAD..UNKNOWNS)
    }

    /// Returns its grey level less that of the whole fit.
    pub fn residual(&self, x: &Row) -> f64 {
        self.row[..UNKNOWNS].iter().zip(x).fold(self.row[GRAY], |left, (row, x)| left - row * x)
    }
}

/// The print, placed by four corners and a blur.
pub(super) struct Placed<'a> {
    print: &'a Print,
    blur_px2: Matrix2<f64>,
    /// Map from pixels relative to the centre to the square −1 to 1 whose corners are detected.
    from_image: Homography,
    /// The variance of the blur along each axis of the square, in cells, times z²: polynomials of the position along that axis.
    variances: [[f64; 3]; 2],
    centre: Pixel,
    /// One over the shortest edge, 1/pixel.
    per_edge: f64,
    margin_px: f64,
}

impl<'a> Placed<'a> {
    /// Places the print; `None` where the corners have no homography.
    pub fn new(print: &'a Print, at: &[Pixel; 4], blur_px2: &Matrix2<f64>) -> Option<Self> {
        let centre = at.iter().sum::<Pixel>() / 4.0;
        let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let pair = |k: usize| (PlanePoint::from(square[k]), at[k] - centre);
        let from_image = Homography::fit(&[0, 1, 2, 3].map(pair))?.inverse()?;
        let edge_px = crate::detect::sigma::shortest_edge_px(at).max(1.0);
        let (inset, width) = (print.inset as f64, print.width as f64);
        // Outside the print anything may be in the image, and the blur mixes it in.
        let rim_px = inset / (width - 2.0 * inset) * edge_px;
        let margin_px = (1.5 * (0.5 * blur_px2.trace()).sqrt() + 0.5).min(0.5 * rim_px);
        let variances = [0, 1].map(|axis| {
            from_image.scatter(axis, blur_px2).map(|coefficient| (0.5 * width - inset).powi(2) * coefficient)
        });
        Some(Placed {
            print,
            blur_px2: *blur_px2,
            from_image,
            variances,
            centre,
            per_edge: edge_px.recip(),
            margin_px,
        })
    }

    /// Returns the derivative of the corners with respect to the entries of the homography from the square to the image.
    pub fn corners_by_map(&self, at: &[Pixel; 4]) -> CornersByMap {
        let mut moves = CornersByMap::zeros();
        for (k, corner) in at.iter().enumerate() {
            let p = corner - self.centre;
            let [x, y, z] = self.from_image.homogeneous([p.x, p.y]);
            for (axis, direction) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                let by = self.by_map([x, y, z], direction, [p.x, p.y]);
                (0..8).for_each(|i| moves[(2 * k + axis, i)] = by[i]);
            }
        }
        moves
    }

    /// Returns the motion of the image `p` of a point, along a direction, with each entry but the last of the homography. With w, the third of
    /// the point's homogeneous coordinates (x, y, w), it is w (e_a − p e_3) times (x/w, y/w, 1). The third row is in edges.
    fn by_map(&self, [x, y, w]: [f64; 3], [du, dv]: [f64; 2], p: [f64; 2]) -> [f64; 8] {
        let d = -(du * p[0] + dv * p[1]) * self.per_edge;
        [du * x, du * y, du * w, dv * x, dv * y, dv * w, d * x, d * y]
    }

    /// Collects the pixels near lines of the print, into memory that is reused. `None` where there are too few.
    pub fn lines(&self, part: &Part, every: usize, rows: usize, lines: &mut Vec<Line>) -> Option<()> {
        lines.clear();
        for (index, at, gray) in part.places(every, rows) {
            lines.extend(self.line(index, [at[0] - self.centre.x, at[1] - self.centre.y], gray));
        }
        (UNKNOWNS < lines.len()).then_some(())
    }

    #[inline]
    fn line(&self, index: usize, p: [f64; 2], gray: f64) -> Option<Line> {
        let (inset, width) = (self.print.inset as f64, self.print.width as f64);
        let half = 0.5 * width - inset;
        let homogeneous = self.from_image.homogeneous(p);
        let per_z = 1.0 / homogeneous[2];
        let square = [homogeneous[0] * per_z, homogeneous[1] * per_z];
        let x = square.map(|x| 0.5 * width + half * x);
        // Most pixels of a large tag are not near a line.
        let variances = [0, 1].map(|axis| {
            let [a, b, c] = self.variances[axis];
            (a + square[axis] * (b + square[axis] * c)) * (per_z * per_z)
        });
        if !self.print.is_known(x) || !self.print.is_near_line(x, variances) {
            return None;
        }
        // The gradients of the plane's coordinates in the image, in cells.
        let [g, h] = self.from_image.gradients(square, per_z).map(|g| g.map(|x| half * x));
        let weight = self.inside(x, [g, h]);
        let b = &self.blur_px2;
        let variance = |g: [f64; 2], h: [f64; 2]| {
            g[0] * (b[(0, 0)] * h[0] + b[(0, 1)] * h[1]) + g[1] * (b[(0, 1)] * h[0] + b[(1, 1)] * h[1])
        };
        let sigma = variances.map(f64::sqrt);
        let area = sigma[0] * sigma[1];
        if !(0.0 < weight) || !area.is_normal() {
            return None;
        }
        let correlation = (variance(g, h) / area).clamp(-0.9, 0.9);
        let ink = self.print.at(x, &Blur { sigma, correlation })?;
        let slope = [0, 1].map(|a: usize| g[a] * ink.slope[0] + h[a] * ink.slope[1]);
        let mut row = [0.0; WIDTH];
        row[0] = 1.0;
        (row[1], row[2]) = (p[0] * self.per_edge, p[1] * self.per_edge);
        row[GAIN] = ink.value;
        row[MAP].copy_from_slice(&self.by_map(homogeneous, slope.map(|x| -x), p));
        let bend = |a: usize, b: usize| {
            let [xx, xy, yy] = ink.bend;
            g[a] * g[b] * xx + (g[a] * h[b] + h[a] * g[b]) * xy + h[a] * h[b] * yy
        };
        row[BLUR.start] = 0.5 * bend(0, 0);
        row[BLUR.start + 1] = bend(0, 1);
        row[BLUR.start + 2] = 0.5 * bend(1, 1);
        row[SPREAD] = (slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
        // Both edges of a pair bow to one side, or to opposite ones; the print between them is moved accordingly.
        let bow = square.map(|s| (1.0 - s * s) * 2.0 * half * self.per_edge);
        row[BOWS.start] = -bow[1] * ink.slope[0];
        row[BOWS.start + 1] = row[BOWS.start] * square[0];
        row[BOWS.start + 2] = -bow[0] * ink.slope[1];
        row[BOWS.start + 3] = row[BOWS.start + 2] * square[1];
        row[BOWS.start + 4] = -bow[0] * ink.slope[0];
        row[BOWS.start + 5] = -bow[1] * ink.slope[1];
        row[GRAY] = gray;
        Some(Line { index, row, weight })
    }

    /// Returns 1 well inside the print, and 0 nearer to its end than the margin.
    fn inside(&self, x: [f64; 2], gradients: [[f64; 2]; 2]) -> f64 {
        let width = self.print.width as f64;
        let mut weight = 1.0f64;
        for (x, g) in x.iter().zip(gradients) {
            let (depth, norm2) = (x.min(width - x), g[0] * g[0] + g[1] * g[1]);
            // Most positions are well inside, and need no root.
            if depth * depth < (self.margin_px + 0.5).powi(2) * norm2 {
                weight = weight.min((depth / norm2.sqrt() - self.margin_px + 0.5).max(0.0));
            }
        }
        weight
    }
}
