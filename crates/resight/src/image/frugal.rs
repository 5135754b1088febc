//! Large images decoded to grey without a copy of their colours: an image of 64 megapixels takes 64 MB, not 256.

use super::GrayImage;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// A PNG row by row; none where its rows do not come in order (interlaced).
pub(super) fn png_rows(bytes: &[u8]) -> Result<Option<GrayImage>, String> {
    let reported = |e: png::DecodingError| format!("not a readable PNG or JPEG image: {e}");
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(reported)?;
    let (width, height) = (reader.info().width, reader.info().height);
    if reader.info().interlaced {
        return Ok(None);
    }
    let (color, depth) = reader.output_color_type();
    let channels = color.samples();
    let mut data = Vec::with_capacity(width as usize * height as usize);
    while let Some(row) = reader.next_row().map_err(reported)? {
        match depth {
            png::BitDepth::Sixteen => {
                let wide = |pair: &[u8]| u16::from_be_bytes([pair[0], pair[1]]);
                let pixels = row.data().chunks_exact(2 * channels);
                data.extend(pixels.map(|pixel| {
                    let colour = [0, 1, 2].map(|i| {
                        let at = if channels < 3 { 0 } else { 2 * i };
                        wide(&pixel[at..at + 2]).into()
                    });
                    luma(colour, u16::MAX.into())
                }));
            }
            _ if channels == 1 => data.extend_from_slice(row.data()),
            _ => {
                let pixels = row.data().chunks_exact(channels);
                data.extend(pixels.map(|pixel| {
                    let colour = [0, 1, 2].map(|i| if channels < 3 { pixel[0] } else { pixel[i] }.into());
                    luma(colour, u8::MAX.into())
                }));
            }
        }
    }
    if data.len() != width as usize * height as usize {
        return Err("not a readable PNG or JPEG image: it ends too early".to_string());
    }
    Ok(Some(GrayImage { width_px: width, height_px: height, data }))
}

/// Luma of a colour whose parts go up to `most`, weighed and rounded as by the crate `image`.
fn luma([red, green, blue]: [u64; 3], most: u64) -> u8 {
    let (weighed, whole) = (2126 * red + 7152 * green + 722 * blue, 10_000 * most);
    ((weighed * 255 + whole / 2) / whole) as u8
}

/// The brightness of a JPEG, whose colours stay undecoded.
pub(super) fn jpeg_luma(bytes: &[u8]) -> Result<GrayImage, String> {
    let reported = |e: &dyn std::fmt::Display| format!("not a readable PNG or JPEG image: {e}");
    let options = DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(|e| reported(&e))?;
    let (width, height) = decoder.dimensions().ok_or_else(|| reported(&"it has no size"))?;
    if data.len() != width * height {
        return Err(reported(&"its colours cannot be distinguished from its brightness"));
    }
    Ok(GrayImage { width_px: width as u32, height_px: height as u32, data })
}

/// Whether a JPEG comes in several passes, all of whose numbers must be held at once.
pub(super) fn is_progressive(bytes: &[u8]) -> bool {
    let mut at = 2;
    while let Some(&[0xff, marker]) = bytes.get(at..at + 2) {
        match marker {
            0xc2 | 0xc6 | 0xca | 0xce => return true,
            0xda | 0xd9 => return false,
            // Fill bytes and markers without a length.
            0xff => at += 1,
            0x01 | 0xd0..=0xd8 => at += 2,
            _ => match bytes.get(at + 2..at + 4) {
                Some(&[high, low]) => at += 2 + usize::from(u16::from_be_bytes([high, low])),
                _ => return false,
            },
        }
    }
    false
}
