//! Images reduced by powers of two.

use crate::GrayImage;
use nalgebra::Vector2;
use std::borrow::Cow;

/// Largest number of columns of a reduced image.
const MOST_COLUMNS: u32 = 800;

/// An image whose pixels are means of `factor` × `factor` original pixels.
pub(super) struct Reduced<'a> {
    /// The original image itself where it is small enough.
    pub image: Cow<'a, GrayImage>,
    pub factor: u32,
}

impl<'a> Reduced<'a> {
    /// Halves the image until it is small enough.
    pub fn new(image: &'a GrayImage) -> Self {
        let factor = factor(image.width_px);
        let halvings = 0..factor.trailing_zeros();
        let image = halvings.fold(Cow::Borrowed(image), |image, _| Cow::Owned(halved(&image)));
        Reduced { image, factor }
    }

    /// Converts a position in this image to the full-size one.
    pub fn full_size(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let factor = f64::from(self.factor);
        pixel.map(|x| factor * x + 0.5 * (factor - 1.0))
    }

    /// Converts a position in the full-size image to this one.
    pub fn reduced(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let factor = f64::from(self.factor);
        pixel.map(|x| (x - 0.5 * (factor - 1.0)) / factor)
    }
}

/// Returns a power of two.
fn factor(width_px: u32) -> u32 {
    let halvings = (0..8).find(|k| width_px >> k <= MOST_COLUMNS).unwrap_or(8);
    1 << halvings
}

/// Returns the means of two by two pixels; an odd last row or column is left out.
fn halved(image: &GrayImage) -> GrayImage {
    let (width, height) = (image.width_px as usize / 2, image.height_px as usize / 2);
    let stride = image.width_px as usize;
    let mut data = Vec::with_capacity(width * height);
    for rows in image.data.chunks_exact(2 * stride).take(height) {
        let (upper, lower) = rows.split_at(stride);
        let mean = |(a, b): (&[u8], &[u8])| {
            ((u16::from(a[0]) + u16::from(a[1]) + u16::from(b[0]) + u16::from(b[1]) + 2) / 4) as u8
        };
        data.extend(upper.chunks_exact(2).zip(lower.chunks_exact(2)).map(mean));
    }
    GrayImage { width_px: width as u32, height_px: height as u32, data }
}
