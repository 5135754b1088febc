//! Decodes large images to grey without a copy of their colours: an image of 64 megapixels needs 64 MB, not 256.

use super::{GrayImage, MAX_DECODED_BYTES};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Decodes a PNG row by row or, where its rows are interlaced, as a whole, which then must be small. Other data besides its pixels are not
/// unpacked.
pub(super) fn png(bytes: &[u8]) -> Result<GrayImage, String> {
    let reported = |e: png::DecodingError| format!("not a readable PNG or JPEG image: {e}");
    let limits = png::Limits { bytes: MAX_DECODED_BYTES as usize };
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(bytes), limits);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(reported)?;
    let (width, height) = (reader.info().width, reader.info().height);
    let (color, depth) = reader.output_color_type();
    let channels = color.samples();
    let mut data = Vec::with_capacity(width as usize * height as usize);
    if reader.info().interlaced {
        let most = MAX_DECODED_BYTES as usize;
        let size = reader.output_buffer_size().filter(|size| *size <= most).ok_or_else(|| {
            format!("interlaced PNG of {width}×{height} px; it takes more than {} MB, save it without interlacing", most / 1_000_000)
        })?;
        let mut whole = vec![0; size];
        let line_bytes = reader.next_frame(&mut whole).map_err(reported)?.line_size;
        whole.chunks_exact(line_bytes.max(1)).for_each(|row| add_greys(&mut data, row, channels, depth));
    } else {
        while let Some(row) = reader.next_row().map_err(reported)? {
            add_greys(&mut data, row.data(), channels, depth);
        }
    }
    if data.len() != width as usize * height as usize {
        return Err("not a readable PNG or JPEG image: it ends too early".to_string());
    }
    Ok(GrayImage { width_px: width, height_px: height, data })
}

/// Appends the grey levels of a row.
fn add_greys(data: &mut Vec<u8>, row: &[u8], channels: usize, depth: png::BitDepth) {
    match depth {
        png::BitDepth::Sixteen => {
            let wide = |pair: &[u8]| u16::from_be_bytes([pair[0], pair[1]]);
            data.extend(row.chunks_exact(2 * channels).map(|pixel| {
                let colour = [0, 1, 2].map(|i| {
                    let at = if channels < 3 { 0 } else { 2 * i };
                    wide(&pixel[at..at + 2]).into()
                });
                luma(colour, u16::MAX.into())
            }));
        }
        _ if channels == 1 => data.extend_from_slice(row),
        _ => data.extend(row.chunks_exact(channels).map(|pixel| {
            let colour = [0, 1, 2].map(|i| if channels < 3 { pixel[0] } else { pixel[i] }.into());
            luma(colour, u8::MAX.into())
        })),
    }
}

/// Returns the luma of a colour with components up to `most`, weighted and rounded as in the crate `image`.
fn luma([red, green, blue]: [u64; 3], most: u64) -> u8 {
    let (weighed, whole) = (2126 * red + 7152 * green + 722 * blue, 10_000 * most);
    ((weighed * 255 + whole / 2) / whole) as u8
}

/// Decodes the luma of a JPEG, and leaves its colours undecoded.
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

/// Returns whether a strict decoder finds every pixel of a JPEG.
pub(super) fn has_all_pixels(bytes: &[u8]) -> bool {
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(usize::from(u16::MAX))
        .set_max_height(usize::from(u16::MAX))
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options).decode().is_ok()
}
