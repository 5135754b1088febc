//! Images reduced by powers of two.

use crate::GrayImage;
use nalgebra::Vector2;
use std::borrow::Cow;

/// Columns that a reduced image has at most.
const MOST_COLUMNS: u32 = 800;

/// An image whose pixels are means of `factor` × `factor` ones.
pub(super) struct Reduced<'a> {
    /// That image itself where it is small enough.
    pub image: Cow<'a, GrayImage>,
    pub factor: u32,
}

impl<'a> Reduced<'a> {
    /// Halved until it is small enough.
    pub fn new(image: &'a GrayImage) -> Self {
        let factor = factor(image.width_px);
        let halvings = 0..factor.trailing_zeros();
        let image = halvings.fold(Cow::Borrowed(image), |image, _| Cow::Owned(halved(&image)));
        Reduced { image, factor }
    }

    /// A place of this image in the full-size one.
    pub fn full_size(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let factor = f64::from(self.factor);
        pixel.map(|x| factor * x + 0.5 * (factor - 1.0))
    }

    /// A place of the full-size image in this one.
    pub fn reduced(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let factor = f64::from(self.factor);
        pixel.map(|x| (x - 0.5 * (factor - 1.0)) / factor)
    }
}

/// A power of two.
fn factor(width_px: u32) -> u32 {
    let halvings = (0..8).find(|k| width_px >> k <= MOST_COLUMNS).unwrap_or(8);
    1 << halvings
}

/// Means of two by two; an odd last row or column is left out.
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
