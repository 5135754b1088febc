//! Classifies pixels as black or white, with a threshold that adapts to the illumination and to the size of the features.
//!
//! Tiles of 8×8 pixels keep their darkest and brightest value; a pyramid of 2×2 tiles follows. A tile uses the finest level whose 3×3
//! neighbourhood has contrast, so that a lamp of two pixels is compared with its surroundings of 24 pixels, and the inside of a disc of 200 with
//! its far rim. Pixels without contrast at any level are `NEITHER`. The cost is one pass over the pixels, whatever they show.

use crate::GrayImage;

/// Class of a pixel that is darker than its surroundings.
pub(super) const DARK: u8 = 0;
/// Class of a pixel that is brighter than its surroundings.
pub(super) const LIGHT: u8 = 1;
/// Class of a pixel without contrast around it.
pub(super) const NEITHER: u8 = 2;

const TILE: usize = 8;
/// A finer level is used when it has this share of the next coarser level's contrast; less is the tail of an edge.
const KEPT_CONTRAST: f32 = 0.25;

/// Darkest and brightest value of each tile of one level.
struct Level {
    columns: usize,
    rows: usize,
    low: Vec<u8>,
    high: Vec<u8>,
}

/// Returns the standard deviation of the noise, grey levels: the median of |I(u−1) − 2 I(u) + I(u+1)| (whose sigma is √6 σ) on every fourth row,
/// but at least 0.29, that of rounding.
pub(super) fn noise_sigma(image: &GrayImage) -> f64 {
    let width = image.width_px as usize;
    let mut counts = [0u32; 1024];
    let mut n = 0;
    for row in image.data.chunks_exact(width.max(1)).step_by(4) {
        for w in row.windows(3).step_by(3) {
            let d = (w[0] as i32 - 2 * w[1] as i32 + w[2] as i32).unsigned_abs();
            counts[(d as usize).min(1023)] += 1;
            n += 1;
        }
    }
    let mut below = 0;
    for (value, count) in counts.iter().enumerate() {
        let next = below + count;
        if n < 2 * next {
            // Within the median's bin the values are assumed to be uniform over ±1/2.
            let within = (0.5 * n as f64 - below as f64) / (*count).max(1) as f64 - 0.5;
            let median = (value as f64 + within).max(0.0);
            return (median / (0.6745 * 6f64.sqrt())).max(0.29);
        }
        below = next;
    }
    0.29
}

/// Classifies each pixel, row by row; `out` is resized to the image.
pub(super) fn classify(image: &GrayImage, min_contrast: f64, out: &mut Vec<u8>) {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    out.clear();
    out.resize(width * height, NEITHER);
    if width == 0 || height == 0 {
        return;
    }
    let levels = pyramid(image);
    let thresholds = thresholds(&levels, min_contrast as f32);
    let columns = levels[0].columns;
    for (v, (row, classes)) in image.data.chunks_exact(width).zip(out.chunks_exact_mut(width)).enumerate() {
        let line = &thresholds[(v / TILE) * columns..][..columns];
        for ((pixels, classes), threshold) in row.chunks(TILE).zip(classes.chunks_mut(TILE)).zip(line) {
            let Some(threshold) = *threshold else { continue };
            for (class, pixel) in classes.iter_mut().zip(pixels) {
                *class = u8::from(threshold < *pixel);
            }
        }
    }
}

fn pyramid(image: &GrayImage) -> Vec<Level> {
    let mut levels = vec![finest(image)];
    while let Some(last) = levels.last().filter(|l| 1 < l.columns || 1 < l.rows) {
        let (columns, rows) = (last.columns.div_ceil(2), last.rows.div_ceil(2));
        let mut next = Level { columns, rows, low: vec![255; columns * rows], high: vec![0; columns * rows] };
        for y in 0..last.rows {
            for x in 0..last.columns {
                let (from, to) = (y * last.columns + x, (y / 2) * columns + x / 2);
                next.low[to] = next.low[to].min(last.low[from]);
                next.high[to] = next.high[to].max(last.high[from]);
            }
        }
        levels.push(next);
    }
    levels
}

fn finest(image: &GrayImage) -> Level {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let mut level = Level { columns, rows, low: vec![255; columns * rows], high: vec![0; columns * rows] };
    let (mut low, mut high) = (vec![255u8; width], vec![0u8; width]);
    for (y, band) in image.data.chunks(width * TILE).enumerate() {
        low.fill(255);
        high.fill(0);
        for row in band.chunks_exact(width) {
            low.iter_mut().zip(row).for_each(|(l, p)| *l = (*l).min(*p));
            high.iter_mut().zip(row).for_each(|(h, p)| *h = (*h).max(*p));
        }
        for x in 0..columns {
            let span = x * TILE..((x + 1) * TILE).min(width);
            level.low[y * columns + x] = low[span.clone()].iter().copied().min().unwrap_or(255);
            level.high[y * columns + x] = high[span].iter().copied().max().unwrap_or(0);
        }
    }
    level
}

/// Returns one threshold per finest tile: a brighter pixel is light.
fn thresholds(levels: &[Level], min_contrast: f32) -> Vec<Option<u8>> {
    // (contrast, threshold) of the level above, inherited where the finer one shows too little.
    let mut above: Vec<(f32, Option<u8>)> = vec![(0.0, None)];
    let mut above_columns = 1;
    for (i, level) in levels.iter().enumerate().rev() {
        let top = i + 1 == levels.len();
        let mut here = Vec::with_capacity(level.low.len());
        for y in 0..level.rows {
            for x in 0..level.columns {
                let parent = if top { above[0] } else { above[(y / 2) * above_columns + x / 2] };
                let (low, high) = level.around(x, y);
                let contrast = high as f32 - low as f32;
                let trusted = min_contrast <= contrast && KEPT_CONTRAST * parent.0 <= contrast;
                let middle = ((low as u16 + high as u16) / 2) as u8;
                here.push(if trusted { (contrast, Some(middle)) } else { parent });
            }
        }
        (above, above_columns) = (here, level.columns);
    }
    above.into_iter().map(|(_, threshold)| threshold).collect()
}

impl Level {
    /// Returns the darkest and the brightest value of the 3×3 tiles around one.
    fn around(&self, x: usize, y: usize) -> (u8, u8) {
        let (mut low, mut high) = (255u8, 0u8);
        for row in y.saturating_sub(1)..(y + 2).min(self.rows) {
            let from = row * self.columns;
            let span = from + x.saturating_sub(1)..from + (x + 2).min(self.columns);
            for i in span {
                low = low.min(self.low[i]);
                high = high.max(self.high[i]);
            }
        }
        (low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_image_says_nothing_and_a_step_says_both() {
        let mut classes = Vec::new();
        let mut image = GrayImage::filled(70, 50, 90);
        classify(&image, 12.0, &mut classes);
        assert!(classes.iter().all(|c| *c == NEITHER));
        for v in 0..50 {
            image.data[v * 70 + 30..(v + 1) * 70].fill(140);
        }
        classify(&image, 12.0, &mut classes);
        for v in 0..50 {
            for u in 0..70 {
                assert_eq!(classes[v * 70 + u], if u < 30 { DARK } else { LIGHT });
            }
        }
    }

    #[test]
    fn noise_is_measured() {
        let mut pcg = crate::render::Pcg::new(3);
        for sigma in [1.0, 3.0, 8.0] {
            let mut image = GrayImage::filled(400, 300, 0);
            image.data.iter_mut().for_each(|p| *p = (128.0 + sigma * pcg.normal()).round() as u8);
            let seen = noise_sigma(&image);
            assert!((seen / sigma - 1.0).abs() < 0.08, "{seen} for {sigma}");
        }
    }
}
