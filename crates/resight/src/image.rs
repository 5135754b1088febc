//! Grey images: the one pixel type every detector reads.

use crate::FileError;
use std::path::Path;

/// An 8-bit grey image, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GrayImage {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// `width_px * height_px` values.
    pub data: Vec<u8>,
}

/// Largest image accepted, pixels: a header may claim more than the machine's memory.
const MAX_PIXELS: u64 = 64_000_000;

impl GrayImage {
    /// A uniform image.
    pub fn filled(width_px: u32, height_px: u32, value: u8) -> Self {
        GrayImage { width_px, height_px, data: vec![value; width_px as usize * height_px as usize] }
    }

    /// Value at column `u`, row `v`.
    #[inline]
    pub fn at(&self, u: u32, v: u32) -> u8 {
        self.data[v as usize * self.width_px as usize + u as usize]
    }

    /// Reads PNG or JPEG (by content), converting colour to luma. Refuses more than 64 Mpx before decoding.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = std::fs::read(path).map_err(|e| FileError::new(path, e.to_string()))?;
        Self::decode(&bytes).map_err(|reason| FileError::new(path, reason))
    }

    /// Decodes PNG or JPEG bytes.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let reader = || {
            ::image::ImageReader::new(std::io::Cursor::new(bytes))
                .with_guessed_format()
                .map_err(|e| e.to_string())
        };
        let (width, height) =
            reader()?.into_dimensions().map_err(|e| format!("not a readable PNG or JPEG image: {e}"))?;
        if MAX_PIXELS < width as u64 * height as u64 {
            return Err(format!("image is {width}×{height} px; the limit is 64 Mpx"));
        }
        let gray =
            reader()?.decode().map_err(|e| format!("not a readable PNG or JPEG image: {e}"))?.into_luma8();
        Ok(GrayImage { width_px: gray.width(), height_px: gray.height(), data: gray.into_raw() })
    }
}
