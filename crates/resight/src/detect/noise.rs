//! Estimates the noise of an image, and returns an image with less noise in which outlines are searched for.

use crate::GrayImage;

/// Number of columns and rows between the positions where the noise is measured.
const EVERY: usize = 4;
/// The smallest number of samples.
const MIN_PLACES: usize = 64;
/// Smallest share of an image with samples: an image of pure black and white has samples only at the edges of letters.
const MIN_SHARE: f64 = 0.002;
/// Largest response of the mask below, 8·255 in either direction.
const LARGEST: usize = 2040;

/// Returns the standard deviation of the noise of each pixel, grey levels; 0 for an image that is too small.
///
/// J. Immerkær, "Fast noise variance estimation", Computer Vision and Image Understanding, 1996: the mask
/// `1 −2 1, −2 4 −2, 1 −2 1` does not respond to brightness, slopes or straight edges along the axes, and to noise of standard deviation σ
/// with 6 σ. The median of its absolute value, instead of the mean, excludes the texture and the corners of up to half of the image.
pub(super) fn noise_gray(image: &GrayImage) -> f64 {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    if width < 3 || height < 3 || image.data.len() != width * height {
        return 0.0;
    }
    let mut counts = [0u32; LARGEST + 1];
    let (mut places, mut all) = (0, 0);
    for v in (0..height - 2).step_by(EVERY) {
        let [a, b, c] = [0, 1, 2].map(|i| &image.data[(v + i) * width..(v + i + 1) * width]);
        for u in (0..width - 2).step_by(EVERY) {
            let row = |r: &[u8]| r[u] as i32 - 2 * r[u + 1] as i32 + r[u + 2] as i32;
            let answer = (row(a) - 2 * row(b) + row(c)).unsigned_abs() as usize;
            // Overexposed and black parts have no visible noise, and the pixels between them are an edge.
            let is_clipped = |r: &[u8]| r[u..u + 3].iter().any(|gray| matches!(gray, 0 | 255));
            all += 1;
            if ![a, b, c].into_iter().any(is_clipped) {
                counts[answer.min(LARGEST)] += 1;
                places += 1;
            }
        }
    }
    let says_nothing = places < MIN_PLACES || (places as f64) < MIN_SHARE * all as f64;
    if says_nothing { 0.0 } else { median(&counts, places) / (6.0 * NORMAL_QUARTILE) }
}

/// Half of the values of a standard normal distribution lie within this of zero.
const NORMAL_QUARTILE: f64 = 0.6745;

/// Returns the median of counted whole numbers, interpolated within its count.
fn median(counts: &[u32], n: usize) -> f64 {
    let middle = 0.5 * n as f64;
    let mut below = 0.0;
    for (value, &count) in counts.iter().enumerate() {
        let count = count as f64;
        if middle <= below + count {
            // All values that are rounded to zero are between 0 and a half.
            let (first, width) = if value == 0 { (0.0, 0.5) } else { (value as f64 - 0.5, 1.0) };
            return first + width * (middle - below) / count.max(1.0);
        }
        below += count;
    }
    0.0
}

/// Noise below which an image is searched as it is, grey levels.
const QUIET_GRAY: f64 = 2.5;
/// Noise from which it is smoothed twice.
const LOUD_GRAY: f64 = 7.0;

/// An image in which outlines are searched for, and its remaining noise.
pub(super) struct Quietened<'a> {
    smoothed: Option<GrayImage>,
    image: &'a GrayImage,
    /// Standard deviation of the noise of each pixel of the original image, grey levels.
    pub noise_gray: f64,
    /// Standard deviation of the noise of the image to search.
    pub left_gray: f64,
}

impl<'a> Quietened<'a> {
    /// Smooths an image according to its noise. At a noise of 5 grey levels, most of the time of a search was spent on outlines of noise.
    pub fn new(image: &'a GrayImage) -> Self {
        let noise_gray = noise_gray(image);
        // Noise of unit variance is reduced to 9/64 by one pass in both directions, and to (35/128)² by two.
        let (smoothed, share) = match noise_gray {
            s if s < QUIET_GRAY => (None, 1.0),
            s if s < LOUD_GRAY => (Some(smooth(image)), 0.375),
            _ => (Some(smooth(&smooth(image))), 0.2734),
        };
        Quietened { smoothed, image, noise_gray, left_gray: share * noise_gray }
    }

    /// Returns the image to search.
    pub fn image(&self) -> &GrayImage {
        self.smoothed.as_ref().unwrap_or(self.image)
    }

    /// Returns whether the image to search has lost detail together with its noise.
    pub fn is_smoothed(&self) -> bool {
        self.smoothed.is_some()
    }

    /// Returns the difference of grey levels that noise rarely reaches within the tiles that the tag library compares.
    pub fn least_contrast(&self, least: u8) -> u8 {
        spread_of_tiles(self.left_gray, least)
    }

    /// Returns the same limit for the original image, in which the smallest markers are found.
    pub fn least_contrast_unsmoothed(&self, least: u8) -> u8 {
        spread_of_tiles(self.noise_gray, least)
    }
}

/// Returns the next whole grey level above the range of noise of this standard deviation in a tile, rounding to whole levels included.
pub(super) fn spread_of_tiles(noise_gray: f64, least: u8) -> u8 {
    (SPREAD_OF_TILES * noise_gray.hypot(ROUNDING_GRAY)).ceil().clamp(least as f64, MOST_GRAY) as u8
}

/// Standard deviation of rounding to whole grey levels, √(1/12).
const ROUNDING_GRAY: f64 = 0.2887;

/// Range of noise over a tile with its neighbours (144 pixels), in standard deviations: 5 on average, above this once in some thousand tiles.
const SPREAD_OF_TILES: f64 = 7.0;

/// Least distance between black and white of a well lit print, grey levels.
const MOST_GRAY: f64 = 120.0;

/// Smooths with the binomial filter 1 2 1 along rows and columns; the border is repeated outside the image.
fn smooth(image: &GrayImage) -> GrayImage {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let mut out =
        GrayImage { width_px: image.width_px, height_px: image.height_px, data: vec![0; image.data.len()] };
    if width < 2 || height < 2 {
        return image.clone();
    }
    let mut column_sums = vec![0u16; width + 2];
    for v in 0..height {
        let row = |r: usize| &image.data[r * width..(r + 1) * width];
        let (above, here, below) = (row(v.saturating_sub(1)), row(v), row((v + 1).min(height - 1)));
        for (sum, ((a, b), c)) in column_sums[1..=width].iter_mut().zip(above.iter().zip(here).zip(below)) {
            *sum = *a as u16 + 2 * *b as u16 + *c as u16;
        }
        (column_sums[0], column_sums[width + 1]) = (column_sums[1], column_sums[width]);
        let sums = column_sums.iter().zip(&column_sums[1..]).zip(&column_sums[2..]);
        for (value, ((a, b), c)) in out.data[v * width..(v + 1) * width].iter_mut().zip(sums) {
            *value = ((a + 2 * b + c + 8) / 16) as u8;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Pcg;

    /// Stripes, squares and a slope with noise.
    fn noisy(sigma: f64) -> GrayImage {
        let mut pcg = Pcg::new(5);
        let pattern = |u: u32, v: u32| match u / 100 {
            0 => 60.0 + 0.4 * v as f64,
            1 => 50.0 + 120.0 * ((u / 20 + v / 20) % 2) as f64,
            _ => 40.0 + 130.0 * ((v / 9) % 2) as f64,
        };
        let value =
            |k: u32| (pattern(k % 300, k / 300) + sigma * pcg.normal()).round().clamp(0.0, 255.0) as u8;
        GrayImage { width_px: 300, height_px: 300, data: (0..90_000).map(value).collect() }
    }

    #[test]
    fn noise_is_measured_beside_edges() {
        for sigma in [1.0, 2.0, 5.0, 10.0, 15.0] {
            let measured = noise_gray(&noisy(sigma));
            assert!((measured / sigma - 1.0).abs() < 0.15, "{sigma}: {measured}");
        }
        assert!(noise_gray(&noisy(0.0)) < 0.5);
        assert_eq!(noise_gray(&GrayImage::filled(2, 900, 8)), 0.0);
        assert_eq!(noise_gray(&GrayImage::filled(0, 0, 0)), 0.0);
    }

    /// In outlines of noise a search for an AprilGrid spent nine tenths of its time: at the library's own 5 grey levels every tile has one. The
    /// limit is rounded up and includes the rounding of the image: rounded down, 73 of 400 tiles reached it at a noise of 3.
    #[test]
    fn noise_holds_no_outlines() {
        for sigma in [1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 15.0] {
            let mut pcg = Pcg::new(9);
            let data = (0..240 * 240).map(|_| (128.0 + sigma * pcg.normal()).round() as u8).collect();
            let image = GrayImage { width_px: 240, height_px: 240, data };
            let quiet = Quietened::new(&image);
            let range = |tile: u32| {
                let (u, v) = (tile % 20 * 12, tile / 20 * 12);
                let values = (0..144).map(|k| quiet.image().at(u + k % 12, v + k / 12));
                values.clone().max().unwrap() - values.min().unwrap()
            };
            let loud = (0..400).filter(|tile| quiet.least_contrast(5) <= range(*tile)).count();
            assert!(loud <= 12, "{sigma}: {loud} of 400 tiles");
            assert!(quiet.least_contrast(5) <= 32, "{sigma}: {}", quiet.least_contrast(5));
        }
    }

    #[test]
    fn what_is_left_after_smoothing_is_as_promised() {
        for sigma in [1.0, 5.0, 12.0] {
            let image = noisy(sigma);
            let flat = |image: &GrayImage| {
                let values: Vec<f64> =
                    (0..300).map(|v| image.at(40, v) as f64 - (60.0 + 0.4 * v as f64)).collect();
                (values.iter().map(|x| x * x).sum::<f64>() / 300.0).sqrt()
            };
            let quiet = Quietened::new(&image);
            let left = flat(quiet.image());
            assert!((left / quiet.left_gray - 1.0).abs() < 0.2, "{sigma}: {left} {}", quiet.left_gray);
        }
    }
}
