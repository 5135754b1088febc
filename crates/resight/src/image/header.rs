//! Reads size, EXIF and completeness of a PNG or JPEG from its bytes alone. No decoder is used, because one may unpack any data in the image (a
//! colour profile of a gigabyte in a file of a megabyte).

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Returns columns and rows stated in the header.
pub(super) fn dimensions(bytes: &[u8]) -> Option<(u32, u32)> {
    if bytes.starts_with(PNG) {
        let number = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        return if bytes.get(12..16)? == b"IHDR" { Some((number(16)?, number(20)?)) } else { None };
    }
    let frame = segments(bytes).find(|segment| is_frame(segment.marker))?.data;
    let number = |at: usize| Some(u16::from_be_bytes(frame.get(at..at + 2)?.try_into().ok()?).into());
    Some((number(3)?, number(1)?))
}

/// Returns the EXIF block from its container.
pub(super) fn exif(bytes: &[u8]) -> Option<&[u8]> {
    if bytes.starts_with(PNG) {
        return chunks(bytes).find(|(name, _)| *name == b"eXIf").map(|(_, data)| data);
    }
    let is_exif = |segment: &Segment| segment.marker == 0xe1 && segment.data.starts_with(b"Exif\0\0");
    segments(bytes).find(is_exif).map(|segment| &segment.data[6..])
}

/// Iterates over the chunks of a PNG, up to where it is truncated: name and contents.
fn chunks(bytes: &[u8]) -> impl Iterator<Item = (&[u8], &[u8])> {
    let mut rest = &bytes[PNG.len().min(bytes.len())..];
    std::iter::from_fn(move || {
        let length = u32::from_be_bytes(rest.get(..4)?.try_into().ok()?) as usize;
        let chunk = (rest.get(4..8)?, rest.get(8..8usize.checked_add(length)?)?);
        rest = rest.get(length + 12..).unwrap_or_default();
        Some(chunk)
    })
}

/// A segment of a JPEG before its pixels.
struct Segment<'a> {
    marker: u8,
    data: &'a [u8],
    /// Position of the next segment.
    end: usize,
}

/// Iterates over the segments of a JPEG up to and including the first scan.
fn segments(bytes: &[u8]) -> impl Iterator<Item = Segment<'_>> {
    let (mut at, mut is_over) = (if bytes.starts_with(&[0xff, 0xd8]) { 2 } else { bytes.len() }, false);
    std::iter::from_fn(move || {
        let segment = segment_at(bytes, at).filter(|_| !is_over)?;
        (at, is_over) = (segment.end, segment.marker == 0xda);
        Some(segment)
    })
}

/// Returns the segment at a marker; fill bytes and markers without a length are skipped.
fn segment_at(bytes: &[u8], mut at: usize) -> Option<Segment<'_>> {
    loop {
        match bytes.get(at..at + 2)? {
            [0xff, 0xff] => at += 1,
            [0xff, 0x01 | 0xd0..=0xd8] => at += 2,
            [0xff, 0xd9] => return None,
            [0xff, marker] => {
                let length = usize::from(u16::from_be_bytes(bytes.get(at + 2..at + 4)?.try_into().ok()?));
                let data = bytes.get(at + 4..(at + 2 + length).max(at + 4))?;
                return Some(Segment { marker: *marker, data, end: at + 2 + length.max(2) });
            }
            _ => return None,
        }
    }
}

/// Returns whether a marker begins a frame, which states the size of the image.
fn is_frame(marker: u8) -> bool {
    matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc)
}

/// Returns whether a JPEG is progressive, so that all of its numbers must be in memory at once.
pub(super) fn is_progressive(bytes: &[u8]) -> bool {
    let frame = segments(bytes).find(|segment| is_frame(segment.marker));
    frame.is_some_and(|segment| matches!(segment.marker, 0xc2 | 0xc6 | 0xca | 0xce))
}

/// Returns whether a JPEG has its end marker: that of the image itself, not that of a preview in its header. A truncated file does not.
pub(super) fn has_end(bytes: &[u8]) -> bool {
    let Some(scan) = segments(bytes).find(|segment| segment.marker == 0xda) else { return false };
    let mut at = scan.end;
    loop {
        // In pixels 0xff is followed only by 0 or by the numbers of restarts; every other marker ends a scan.
        let Some(found) = bytes.get(at..).and_then(|rest| rest.iter().position(|b| *b == 0xff)) else {
            return false;
        };
        at += found;
        match bytes.get(at + 1) {
            Some(0x00 | 0xd0..=0xd7) => at += 2,
            Some(0xff) => at += 1,
            Some(0xd9) => return true,
            Some(_) => match segment_at(bytes, at) {
                Some(segment) => at = segment.end,
                None => return false,
            },
            None => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::codecs::jpeg::JpegEncoder;
    use ::image::{ExtendedColorType, ImageEncoder};

    fn jpeg() -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut to = JpegEncoder::new(&mut bytes);
        to.set_exif_metadata(b"II*\0\xff\xd9\xff\xda".to_vec()).expect("EXIF"); // A preview's end, and its scan.
        let noise: Vec<u8> = (0..64 * 48u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 23) as u8).collect();
        to.write_image(&noise, 64, 48, ExtendedColorType::L8).expect("a JPEG");
        bytes
    }

    #[test]
    fn a_jpeg_is_whole_to_its_last_byte_and_not_before() {
        let whole = jpeg();
        assert!(has_end(&whole) && has_end(&[&whole[..], b"what a camera appends"].concat()));
        assert_eq!((dimensions(&whole), is_progressive(&whole)), (Some((64, 48)), false));
        assert_eq!(exif(&whole), Some(b"II*\0\xff\xd9\xff\xda".as_slice()));
        assert!((0..whole.len()).all(|length| !has_end(&whole[..length])));
        // The file is truncated and its rest filled with zeros, as after an interrupted copy.
        let half = whole.len() / 2;
        assert!(!has_end(&[&whole[..half], &vec![0; half]].concat()));
    }

    #[test]
    fn whatever_is_there_nothing_panics() {
        let whole = jpeg();
        for at in 0..whole.len() {
            for value in [0, 0xff, 0xd9, 0xda] {
                let mut bent = whole.clone();
                bent[at] = value;
                let _ =
                    (dimensions(&bent), exif(&bent).map(<[u8]>::len), has_end(&bent), is_progressive(&bent));
            }
        }
        let png = [PNG, &u32::MAX.to_be_bytes(), b"IHDR"].concat();
        assert_eq!((dimensions(&png), exif(&png), dimensions(b""), exif(b"")), (None, None, None, None));
    }
}
