//! The image around a tag, reduced where the tag is large.

use crate::GrayImage;
use resight_core::Pixel;

/// Means of squares of pixels, on a grid that does not depend on the position of the tag.
pub(super) struct Part {
    /// Edge length of a square, pixels.
    reduce: usize,
    /// First column and row of the grid, and their numbers.
    first: [usize; 2],
    size: [usize; 2],
    gray: Vec<f32>,
    /// Share of the pixels in this part that have one of its two most common grey levels: 1 in a drawing or scan in black and white.
    pub two_levels: f64,
}

/// Variance that smoothing adds along each axis, pixels².
pub(super) const SMOOTHING_PX2: f64 = 1.0;

impl Part {
    /// Returns the part smoothed by 1 4 6 4 1 along rows and columns; the edge is repeated outside. Noise keeps its effect on wider structures.
    pub fn smoothed(&self) -> Self {
        let [width, height] = self.size;
        let pass = |gray: &[f32], n: usize, step: usize| -> Vec<f32> {
            let smooth = |k: usize| {
                let i = k / step % n;
                let at = |j: usize| gray[k + (j.clamp(2, n + 1) - 2) * step - i * step];
                (at(i) + 4.0 * at(i + 1) + 6.0 * at(i + 2) + 4.0 * at(i + 3) + at(i + 4)) / 16.0
            };
            (0..gray.len()).map(smooth).collect()
        };
        let gray = pass(&pass(&self.gray, width, 1), height, width);
        Part { gray, ..*self }
    }

    /// Cuts out the part that contains these positions of the image; `None` where none of it is in the image.
    pub fn cut(image: &GrayImage, places: &[Pixel], reduce: usize) -> Option<Self> {
        let range = |axis: usize, n: u32| {
            let (low, high) = places
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[axis]), b.max(p[axis])));
            let first = (low.max(0.0) / reduce as f64).floor() as usize;
            let end = ((high.max(0.0) / reduce as f64).ceil() as usize + 1).min(n as usize / reduce);
            (low.is_finite() && high.is_finite() && first < end).then(|| (first, end - first))
        };
        let ((u0, width), (v0, height)) = (range(0, image.width_px)?, range(1, image.height_px)?);
        let stride = image.width_px as usize;
        let mean = |k: usize| {
            let (u, v) = ((u0 + k % width) * reduce, (v0 + k / width) * reduce);
            let rows = (v..v + reduce).map(|v| &image.data[v * stride + u..][..reduce]);
            let sum: u32 = rows.flatten().map(|x| *x as u32).sum();
            // The middle grey level is subtracted to keep the sums small.
            sum as f32 / (reduce * reduce) as f32 - 128.0
        };
        let gray = (0..width * height).map(mean).collect();
        let rows = image.data.chunks(stride).skip(v0 * reduce).take(height * reduce);
        let two_levels = share_of_two(rows.flat_map(|row| &row[u0 * reduce..][..width * reduce]));
        Some(Part { reduce, first: [u0, v0], size: [width, height], gray, two_levels })
    }

    /// Converts a position in the image to the grid.
    pub fn reduced(&self, pixel: &Pixel) -> Pixel {
        pixel.map(|x| (x - 0.5 * (self.reduce as f64 - 1.0)) / self.reduce as f64)
    }

    /// Converts a position on the grid to the image.
    pub fn full(&self, pixel: &Pixel) -> Pixel {
        pixel.map(|x| x * self.reduce as f64 + 0.5 * (self.reduce as f64 - 1.0))
    }

    /// Returns the number of pixels of the image along one of the grid.
    pub fn scale(&self) -> f64 {
        self.reduce as f64
    }

    /// Returns the numbers of columns and rows of the grid.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Iterates over one of `every` positions, on diagonals that do not depend on the part, in every `rows`th row, with index and grey level.
    pub fn places(&self, every: usize, rows: usize) -> impl Iterator<Item = (usize, [f64; 2], f64)> + '_ {
        let row = move |(j, grays): (usize, &'_ [f32])| {
            (self.first[1] + j).is_multiple_of(rows).then_some((j, grays.len()))
        };
        self.gray.chunks(self.size[0]).enumerate().filter_map(row).flat_map(move |(j, width)| {
            let v = self.first[1] + j;
            let skipped = (every - (self.first[0] + v) % every) % every;
            (skipped..width).step_by(every).map(move |i| {
                let k = j * width + i;
                (k, [(self.first[0] + i) as f64, v as f64], self.gray[k] as f64)
            })
        })
    }
}

/// Returns the share of the two most common values.
fn share_of_two<'a>(values: impl Iterator<Item = &'a u8>) -> f64 {
    let mut counts = [0u32; 256];
    values.for_each(|value| counts[*value as usize] += 1);
    counts.sort_unstable();
    let all: u32 = counts.iter().sum();
    f64::from(counts[254] + counts[255]) / f64::from(all.max(1))
}
