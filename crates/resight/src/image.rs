//! Grey images, the only pixel type that detectors read.

use crate::FileError;
use crate::input::{self, Kind, what_is_it};
use std::path::Path;

pub mod exif;
mod frugal;
mod header;
mod undistort;

pub use undistort::{Channels, undistorted};

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

/// Memory that a decoded image may need in addition to its file, bytes.
const MAX_DECODED_BYTES: u64 = 144_000_000;

/// Largest progressive JPEG, pixels: its decoder needs up to six more bytes for each pixel.
const MAX_PROGRESSIVE_PIXELS: u64 = 24_000_000;

/// Reads width and height of a PNG or JPEG from its header, pixels.
///
/// # Errors
/// A missing file, or a file that is not an image.
pub fn size(path: impl AsRef<Path>) -> Result<(u32, u32), FileError> {
    let path = path.as_ref();
    let bytes = input::read(path, Kind::Image)?;
    header::dimensions(&bytes).ok_or_else(|| FileError::new(path, what_is_it::that_is_no_image(&bytes)))
}

/// Memory that decoding takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DecodingBytes {
    /// Of the decoded image.
    pub image: u64,
    /// Besides, at most, until it is decoded.
    pub besides: u64,
}

impl DecodingBytes {
    /// Reads the size of a PNG or JPEG from its header; `None` where the bytes are neither.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let (width, height) = header::dimensions(bytes)?;
        let image = u64::from(width) * u64::from(height);
        Some(DecodingBytes { image, besides: image.saturating_mul(4).min(MAX_DECODED_BYTES) })
    }

    /// Returns both together.
    pub fn sum(self) -> u64 {
        self.image.saturating_add(self.besides)
    }
}

/// Returns the remark on images that EXIF asks viewers to show otherwise than they are stored.
pub fn orientation_remark(which: &str, how: &str) -> String {
    format!(
        "EXIF asks viewers to show {which} {how}; pixels are taken as stored, so the intrinsics have to be of images stored the same way (OpenCV's imread rotates \
         unless IMREAD_IGNORE_ORIENTATION is given)"
    )
}

impl GrayImage {
    /// Creates a uniform image.
    pub fn filled(width_px: u32, height_px: u32, value: u8) -> Self {
        GrayImage { width_px, height_px, data: vec![value; width_px as usize * height_px as usize] }
    }

    /// Converts an image of one channel, or of colours, to grey: a quarter of the first and the third and half of the second channel, so that
    /// RGB and BGR give the same. A fourth channel is transparency, and is ignored.
    ///
    /// # Errors
    /// Another number of channels, no pixels, more than 64 Mpx.
    pub fn of_channels(image: &Channels) -> Result<Self, String> {
        let Channels { width_px, height_px, n_channels, data } = *image;
        if width_px == 0 || height_px == 0 {
            return Err("an image without pixels".to_owned());
        }
        let n_pixels = (width_px as u64).saturating_mul(height_px as u64);
        if MAX_PIXELS < n_pixels {
            return Err(format!("image is {width_px}×{height_px} px; the limit is 64 Mpx, reduce it"));
        }
        if n_pixels.saturating_mul(n_channels as u64) != data.len() as u64 {
            return Err(format!(
                "{} values are no {width_px}×{height_px} px of {n_channels} channels",
                data.len()
            ));
        }
        let grey = |pixel: &[u8]| {
            ((u16::from(pixel[0]) + 2 * u16::from(pixel[1]) + u16::from(pixel[2]) + 2) / 4) as u8
        };
        let data = match n_channels {
            1 => data.to_vec(),
            3 | 4 => data.chunks_exact(n_channels).map(grey).collect(),
            n => {
                return Err(format!(
                    "{n} channels; 1 (grey), 3 (colour) or 4 (colour and transparency) are needed"
                ));
            }
        };
        Ok(GrayImage { width_px: width_px as u32, height_px: height_px as u32, data })
    }

    /// Returns the value at column `u`, row `v`. Panics outside the image.
    #[inline]
    pub fn at(&self, u: u32, v: u32) -> u8 {
        self.data[v as usize * self.width_px as usize + u as usize]
    }

    /// Reads a PNG or JPEG (by content, whatever its name), converting colour to luma and 16 bits to 8. Before it decodes, it refuses more than
    /// 64 Mpx, or 96 MiB of file; fails on files that are not images, are truncated, or empty.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let bytes = input::read(path, Kind::Image)?;
        Self::decode(&bytes).map_err(|reason| FileError::new(path, reason))
    }

    /// Reads as [`GrayImage::read`], and returns how EXIF asks viewers to show the image, where that is rotated or mirrored. Pixels are always
    /// taken as they are stored.
    ///
    /// # Errors
    /// As of [`GrayImage::read`].
    pub fn read_with_orientation(path: impl AsRef<Path>) -> Result<(Self, Option<&'static str>), FileError> {
        let path = path.as_ref();
        let bytes = input::read(path, Kind::Image)?;
        let image = Self::decode(&bytes).map_err(|reason| FileError::new(path, reason))?;
        Ok((image, exif::orientation(&bytes)))
    }

    /// Reads as [`GrayImage::read_with_orientation`], and returns the orientation as a remark.
    ///
    /// # Errors
    /// As of [`GrayImage::read`].
    pub fn read_with_remark(path: impl AsRef<Path>) -> Result<(Self, Option<String>), FileError> {
        let path = path.as_ref();
        let (image, orientation) = Self::read_with_orientation(path)?;
        Ok((image, orientation.map(|how| orientation_remark("this image", how))))
    }

    /// Decodes PNG or JPEG bytes.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        // Other crates may enable more decoders; the formats that are read must not depend on that.
        let format = ::image::guess_format(bytes).map_err(|_| what_is_it::that_is_no_image(bytes))?;
        if !matches!(format, ::image::ImageFormat::Png | ::image::ImageFormat::Jpeg) {
            let name = format.extensions_str().first().map_or_else(String::new, |name| name.to_uppercase());
            return Err(format!("a {name} image; save it as PNG or JPEG"));
        }
        let unreadable =
            |reason: &dyn std::fmt::Display| format!("not a readable PNG or JPEG image: {reason}");
        let (width, height) = header::dimensions(bytes).ok_or_else(|| unreadable(&"it has no size"))?;
        let pixels = u64::from(width) * u64::from(height);
        if MAX_PIXELS < pixels {
            return Err(format!("image is {width}×{height} px; the limit is 64 Mpx, reduce it"));
        }
        if format == ::image::ImageFormat::Png {
            return frugal::png(bytes);
        }
        // An image without an end marker is truncated, unless all of its pixels are there.
        let is_torn = !header::has_end(bytes) && !frugal::has_all_pixels(bytes);
        if is_torn {
            return Err(unreadable(&"it ends too early: the file is torn; copy or save it again"));
        }
        if MAX_PROGRESSIVE_PIXELS < pixels && header::is_progressive(bytes) {
            return Err(format!(
                "progressive JPEG of {width}×{height} px; the limit is 24 Mpx, save it as a baseline JPEG"
            ));
        }
        if MAX_DECODED_BYTES < 4 * pixels {
            return frugal::jpeg_luma(bytes);
        }
        let mut decoder =
            ::image::ImageReader::with_format(std::io::Cursor::new(bytes), ::image::ImageFormat::Jpeg);
        let mut limits = ::image::Limits::default();
        limits.max_alloc = Some(MAX_DECODED_BYTES);
        decoder.limits(limits);
        let gray = decoder.decode().map_err(|e| unreadable(&e))?.into_luma8();
        Ok(GrayImage { width_px: gray.width(), height_px: gray.height(), data: gray.into_raw() })
    }

    /// Encodes the image as PNG, without loss.
    ///
    /// # Errors
    /// The encoder's message for an invalid image.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        use ::image::ImageEncoder;
        let mut bytes = Vec::new();
        ::image::codecs::png::PngEncoder::new(&mut bytes)
            .write_image(&self.data, self.width_px, self.height_px, ::image::ExtendedColorType::L8)
            .map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    /// Encodes the image as JPEG, as a camera does; `quality` from 1 to 100.
    ///
    /// # Errors
    /// The encoder's message for an invalid image.
    pub fn jpeg(&self, quality: u8) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        ::image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, quality.clamp(1, 100))
            .encode(&self.data, self.width_px, self.height_px, ::image::ExtendedColorType::L8)
            .map_err(|e| e.to_string())?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::{ExtendedColorType, ImageEncoder, codecs};

    fn png(values: &[u8], width: u32, height: u32, color: ExtendedColorType) -> Vec<u8> {
        let mut bytes = Vec::new();
        codecs::png::PngEncoder::new(&mut bytes).write_image(values, width, height, color).unwrap();
        bytes
    }

    /// Returns a PNG whose header (bytes 16 to 24) states another size, under a valid checksum.
    fn png_claiming(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = png(&[1, 2, 3, 4], 2, 2, ExtendedColorType::L8);
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let mut crc = !0u32;
        for byte in &bytes[12..29] {
            crc ^= *byte as u32;
            for _ in 0..8 {
                crc = (crc >> 1) ^ ((crc & 1) * 0xedb8_8320);
            }
        }
        bytes[29..33].copy_from_slice(&(!crc).to_be_bytes());
        bytes
    }

    #[test]
    fn gray_png_round_trips() {
        let values = [0, 1, 127, 128, 254, 255];
        let image = GrayImage::decode(&png(&values, 3, 2, ExtendedColorType::L8)).unwrap();
        assert_eq!(image, GrayImage { width_px: 3, height_px: 2, data: values.to_vec() });
        assert_eq!((image.at(0, 0), image.at(2, 0), image.at(0, 1)), (0, 127, 128));
        assert_eq!(GrayImage::decode(&image.png().unwrap()).unwrap(), image);
    }

    /// The full 16-bit range becomes the full 8-bit range.
    #[test]
    fn sixteen_bits_become_eight() {
        let values: Vec<u8> = [0u16, 257 * 100, 65535].iter().flat_map(|x| x.to_ne_bytes()).collect();
        let image = GrayImage::decode(&png(&values, 3, 1, ExtendedColorType::L16)).unwrap();
        assert_eq!(image.data, [0, 100, 255]);
    }

    #[test]
    fn colour_becomes_luma() {
        let image =
            GrayImage::decode(&png(&[255, 0, 0, 0, 255, 0, 9, 9, 9], 3, 1, ExtendedColorType::Rgb8)).unwrap();
        assert!(image.data[0] < image.data[1] && image.data[2] == 9, "{:?}", image.data);
    }

    #[test]
    fn claimed_size_is_refused_before_memory_is_taken() {
        let error = GrayImage::decode(&png_claiming(60_000, 60_000)).unwrap_err();
        assert!(error.contains("60000×60000") && error.contains("64 Mpx"), "{error}");
        assert!(GrayImage::decode(&png_claiming(5_000, 5_000)).unwrap_err().contains("not a readable"));
    }

    /// Decoding row by row or as a whole gives the same grey levels.
    #[test]
    fn rows_are_decoded_as_the_whole_is() {
        let bytes: Vec<u8> =
            (0..40 * 30 * 8u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
        for color in [
            ExtendedColorType::L8,
            ExtendedColorType::La8,
            ExtendedColorType::Rgb8,
            ExtendedColorType::Rgba8,
            ExtendedColorType::L16,
            ExtendedColorType::Rgb16,
            ExtendedColorType::Rgba16,
        ] {
            let values = &bytes[..40 * 30 * color.bits_per_pixel() as usize / 8];
            let file = png(values, 40, 30, color);
            let rows = frugal::png(&file).unwrap();
            let whole = ::image::load_from_memory(&file).unwrap().into_luma8();
            assert_eq!(rows.data, whole.into_raw(), "{color:?}");
        }
    }

    /// The large JPEG gives the luma stored in its file; the small one is decoded to colours and weighted again.
    #[test]
    fn a_large_jpeg_gives_its_brightness() {
        let values: Vec<u8> = (0..64 * 48 * 3u32).map(|k| 40 + (k / 3 % 64 * 2) as u8).collect();
        let mut file = Vec::new();
        codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 95)
            .write_image(&values, 64, 48, ExtendedColorType::Rgb8)
            .unwrap();
        let luma = frugal::jpeg_luma(&file).unwrap();
        let whole = GrayImage::decode(&file).unwrap();
        assert_eq!((luma.width_px, luma.height_px), (64, 48));
        assert!(luma.data.iter().zip(&whole.data).all(|(a, b)| a.abs_diff(*b) <= 2));
        assert!(
            !header::is_progressive(&file)
                && !header::is_progressive(b"")
                && !header::is_progressive(b"\xff\xd8\xff")
        );
    }

    #[test]
    fn torn_and_foreign_files_are_named() {
        let values: Vec<u8> = (0..64 * 64u32).map(|k| (k * k / 7 % 251) as u8).collect();
        let whole = png(&values, 64, 64, ExtendedColorType::L8);
        for bytes in [&whole[..whole.len() / 2], &whole[..20], b"P5 2 2 255 abcd", b"", b"\xff\xd8\xff\xe0"] {
            let error = GrayImage::decode(bytes).expect_err(&format!("{} bytes", bytes.len()));
            assert!(error.contains("PNG or JPEG"), "{error}");
        }
        let error = GrayImage::read(Path::new("no/such/picture.png")).unwrap_err();
        assert!(error.to_string().starts_with("no/such/picture.png: "), "{error}");
    }
}
