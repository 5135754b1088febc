//! `resight_image`: grey levels.

use crate::call::{done, guarded};
use crate::message::Message;
use crate::pointer::{Out, borrowed, free, optional_text, path, slice, too_many};
use crate::status::{Refusal, Status};
use resight::GrayImage;
use resight::image::Channels;
use std::borrow::Cow;
use std::ffi::c_char;

/// Grey levels, and what the image is called in answers. It does not change: threads may share it.
pub struct Image {
    pub(crate) view: String,
    pub(crate) gray: GrayImage,
    pub(crate) remark: Option<String>,
}

/// Pixels in memory, row by row from the top. They are copied.
#[repr(C)]
pub struct Pixels {
    /// The first row.
    pub data: *const u8,
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Values of each pixel: 1 (grey), 3 (RGB or BGR) or 4 (with transparency, which is ignored).
    pub n_channels: usize,
    /// From the beginning of a row to that of the next; 0 where rows follow each other without a gap.
    pub stride_bytes: usize,
    /// What the image is called in answers; null for "image".
    pub view: *const c_char,
}

/// Reads a PNG or JPEG, by its content. Pixels are taken as they are stored, whatever EXIF says of their orientation.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_image_read(
    file: *const c_char,
    image: *mut *mut Image,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (image, file) = unsafe { (Out::handle("image", image)?, path(file)?) };
        let (gray, remark) = GrayImage::read_with_remark(file)?;
        image.give(Image { view: file.display().to_string(), gray, remark });
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Copies an image from memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_image_of_pixels(
    pixels: *const Pixels,
    image: *mut *mut Image,
    message: *mut Message,
) -> Status {
    let job = || {
        // SAFETY: what callers promise of their pointers.
        let (image, pixels) = unsafe { (Out::handle("image", image)?, borrowed("pixels", pixels)?) };
        // SAFETY: what callers promise of the pointers in their structures.
        let view = unsafe { optional_text("view", pixels.view) }?.unwrap_or("image").to_owned();
        // SAFETY: `data` holds the last byte of the last row.
        let data = unsafe { slice("data", pixels.data, pixels.n_bytes()?) }?;
        let channels = Channels {
            width_px: pixels.width_px,
            height_px: pixels.height_px,
            n_channels: pixels.n_channels,
            data: &pixels.without_gaps(data),
        };
        let gray = GrayImage::of_channels(&channels).map_err(Refusal::argument)?;
        image.give(Image { view, gray, remark: None });
        Ok(())
    };
    // SAFETY: the same.
    unsafe { done(message, job) }
}

/// Frees an image; null is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn resight_image_free(image: *mut Image) {
    // SAFETY: what callers promise of handles.
    guarded((), || unsafe { free(image) });
}

impl Pixels {
    fn row_bytes(&self) -> usize {
        self.width_px.saturating_mul(self.n_channels)
    }

    /// From the first to the last pixel; the last row need not be followed by a gap.
    fn n_bytes(&self) -> Result<usize, Refusal> {
        let (row, stride) = (self.row_bytes(), self.stride_bytes);
        if stride != 0 && stride < row {
            return Err(Refusal::argument(format!(
                "stride_bytes is {stride}; a row of {} px of {} channels has {row}",
                self.width_px, self.n_channels
            )));
        }
        let Some(rows_before) = self.height_px.checked_sub(1) else { return Ok(0) };
        let before = stride.max(row).checked_mul(rows_before);
        let all = before.and_then(|before| before.checked_add(row)).filter(|_| row != 0);
        match row {
            0 => Ok(0),
            _ => all.ok_or_else(|| too_many("data", self.height_px.saturating_mul(stride.max(row)))),
        }
    }

    fn without_gaps<'a>(&self, data: &'a [u8]) -> Cow<'a, [u8]> {
        let row = self.row_bytes();
        match self.stride_bytes {
            0 => data.into(),
            stride if stride == row || row == 0 => data.into(),
            stride => data.chunks(stride).flat_map(|line| &line[..row]).copied().collect::<Vec<u8>>().into(),
        }
    }
}
