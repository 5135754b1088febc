//! Conversion of `sensor_msgs/Image` and `sensor_msgs/CompressedImage` (Foxglove's `RawImage` and `CompressedImage` have the same fields) to
//! grey.
//!
//! Encodings: sensor_msgs/image_encodings.hpp. Colours become luma with the weights of Rec. 709, as in images read from files.

use super::bayer;
use resight::GrayImage;
use resight_recording::ros::value::Value;

/// Largest image accepted, pixels, as for images.
const MAX_PIXELS: u64 = 64_000_000;

/// The layout of pixels in memory.
enum Pixels {
    Gray,
    Gray16,
    /// Number of channels, and the indices of red, green and blue.
    Color(usize, [usize; 3]),
    /// Two bytes for each pixel; brightness is the first or the second.
    Yuv422(usize),
    /// A plane of brightness, then one of colours at half its height or more.
    Planes,
    Bayer,
    Bayer16,
}
use Pixels::{Bayer, Bayer16, Color, Gray, Gray16, Planes, Yuv422};

const ENCODINGS: [(&[&str], Pixels); 11] = [
    (&["mono8", "8UC1"], Gray),
    (&["mono16", "16UC1"], Gray16),
    (&["rgb8"], Color(3, [0, 1, 2])),
    (&["bgr8", "8UC3"], Color(3, [2, 1, 0])),
    (&["rgba8"], Color(4, [0, 1, 2])),
    (&["bgra8", "8UC4"], Color(4, [2, 1, 0])),
    (&["yuv422", "uyvy"], Yuv422(1)),
    (&["yuv422_yuy2", "yuyv"], Yuv422(0)),
    (&["nv21", "nv12", "nv24"], Planes),
    (&["bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"], Bayer),
    (&["bayer_rggb16", "bayer_bggr16", "bayer_gbrg16", "bayer_grbg16"], Bayer16),
];

impl Pixels {
    fn bytes(&self) -> usize {
        match self {
            Gray | Planes | Bayer => 1,
            Gray16 | Bayer16 | Yuv422(_) => 2,
            Color(channels, _) => *channels,
        }
    }
}

/// Returns the image of an image message.
///
/// # Errors
/// An encoding without brightness, more than 64 Mpx, fewer bytes than the size needs.
pub(super) fn raw(message: &Value<'_>) -> Result<GrayImage, String> {
    let (width, height) = (message.count("width")?, message.count("height")?);
    let encoding = message.text("encoding")?;
    let known = ENCODINGS.iter().find(|(names, _)| names.contains(&encoding));
    let pixels = &known.ok_or_else(|| unknown(encoding))?.1;
    let size = u64::from(width) * u64::from(height);
    if size == 0 || MAX_PIXELS < size {
        return Err(format!("image is {width}×{height} px; 1 px to 64 Mpx are read"));
    }
    let data = message.bytes("data")?;
    let row = width as usize * pixels.bytes();
    let stride = message.count("step").ok().filter(|step| 0 < *step).map_or(row, |step| step as usize);
    let needed = stride as u64 * u64::from(height - 1) + row as u64;
    if stride < row || (data.len() as u64) < needed {
        let seen = data.len();
        return Err(format!(
            "{seen} bytes in rows of {stride}; {width}×{height} px of {encoding} need {needed} bytes in rows of {row}"
        ));
    }
    let rows = data.chunks(stride).take(height as usize).map(|chunk| &chunk[..row]);
    let is_big_endian = message.number("is_bigendian").is_ok_and(|flag| flag != 0.0);
    let data = brightness(pixels, rows, (width as usize, height as usize), is_big_endian);
    Ok(GrayImage { width_px: width, height_px: height, data })
}

fn brightness<'a>(
    pixels: &Pixels,
    rows: impl Iterator<Item = &'a [u8]>,
    (width, height): (usize, usize),
    is_big_endian: bool,
) -> Vec<u8> {
    let wide = |bytes: &[u8]| match is_big_endian {
        true => u16::from_be_bytes([bytes[0], bytes[1]]),
        false => u16::from_le_bytes([bytes[0], bytes[1]]),
    };
    let words = |rows: &mut dyn Iterator<Item = &'a [u8]>| -> Vec<u16> {
        rows.flat_map(|row| row.chunks_exact(2).map(wide)).collect()
    };
    let mut rows = rows;
    match pixels {
        Gray | Planes => rows.collect::<Vec<_>>().concat(),
        Gray16 => to_eight_bits(&words(&mut rows)),
        Color(channels, [r, g, b]) => rows
            .flat_map(|row| row.chunks_exact(*channels).map(|pixel| luma(pixel[*r], pixel[*g], pixel[*b])))
            .collect(),
        Yuv422(at) => rows.flat_map(|row| row.iter().skip(*at).step_by(2)).copied().collect(),
        Bayer => bayer::gray(&rows.collect::<Vec<_>>().concat(), width, height),
        Bayer16 => bayer::gray(&to_eight_bits(&words(&mut rows)), width, height),
    }
}

fn luma(r: u8, g: u8, b: u8) -> u8 {
    ((2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b)) / 10_000) as u8
}

/// Converts to eight bits. Sensors of 10, 12 and 14 bits leave the high bits empty: the range is the smallest of these that holds the image.
fn to_eight_bits(words: &[u16]) -> Vec<u8> {
    let brightest = words.iter().copied().max().unwrap_or_default();
    let bits = [8u32, 10, 12, 14].into_iter().find(|bits| u32::from(brightest) < 1 << bits).unwrap_or(16);
    words.iter().map(|word| (word >> (bits - 8)) as u8).collect()
}

fn unknown(encoding: &str) -> String {
    let names: Vec<&str> = ENCODINGS.iter().flat_map(|(names, _)| names.iter().copied()).collect();
    let encoding: String = encoding.chars().take(40).collect();
    format!("encoding `{encoding}` is not read; publish one of {}", names.join(", "))
}

/// Returns the image of a compressed image message.
///
/// # Errors
/// Anything but a PNG or JPEG.
pub(super) fn compressed(message: &Value<'_>) -> Result<GrayImage, String> {
    let format = message.text("format").unwrap_or_default();
    if format.contains("compressedDepth") {
        return Err(format!("format `{format}` holds distances; the topic of a camera is needed"));
    }
    let data = message.bytes("data")?;
    GrayImage::decode(data).map_err(|reason| {
        let format: String = format.chars().take(40).collect();
        format!("format `{format}`, {} bytes: {reason}", data.len())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(
        encoding: &'static str,
        size: (u32, u32),
        step: u32,
        big: bool,
        data: Vec<u8>,
    ) -> Value<'static> {
        let number = |x: u32| Value::Number(f64::from(x));
        Value::Message(vec![
            ("width".into(), number(size.0)),
            ("height".into(), number(size.1)),
            ("encoding".into(), Value::Text(encoding.into())),
            ("is_bigendian".into(), number(big.into())),
            ("step".into(), number(step)),
            ("data".into(), Value::Bytes(data.into())),
        ])
    }

    fn read(encoding: &'static str, size: (u32, u32), step: u32, data: &[u8]) -> Vec<u8> {
        raw(&image(encoding, size, step, false, data.to_vec())).unwrap().data
    }

    #[test]
    fn every_layout_gives_its_brightness() {
        assert_eq!(read("mono8", (2, 2), 3, &[1, 2, 9, 3, 4, 9]), [1, 2, 3, 4], "rows end in padding");
        assert_eq!(read("mono8", (2, 2), 3, &[1, 2, 9, 3, 4]), [1, 2, 3, 4], "but for the last");
        // 200 times 0.2126, 0.7152 and 0.0722, without the fraction.
        let (red, green, blue, grey) = (42, 143, 14, 7);
        let rgb = [200, 0, 0, 0, 200, 0, 0, 0, 200, 7, 7, 7];
        assert_eq!(read("rgb8", (4, 1), 0, &rgb), [red, green, blue, grey]);
        assert_eq!(read("bgr8", (4, 1), 0, &rgb), [blue, green, red, grey]);
        assert_eq!(read("rgba8", (2, 1), 0, &[200, 0, 0, 99, 0, 200, 0, 99]), [red, green]);
        assert_eq!(read("bgra8", (2, 1), 0, &[200, 0, 0, 99, 0, 200, 0, 99]), [blue, green]);
        assert_eq!(read("yuv422", (2, 1), 0, &[128, 5, 128, 6]), [5, 6]);
        assert_eq!(read("yuyv", (2, 1), 0, &[5, 128, 6, 128]), [5, 6]);
        assert_eq!(read("nv12", (2, 2), 2, &[1, 2, 3, 4, 128, 128]), [1, 2, 3, 4]);
    }

    #[test]
    fn sixteen_bits_keep_either_byte_order_and_the_sensor_s_range() {
        let twelve = [0u16, 0x0800, 0x0fff];
        let bytes = |to: fn(u16) -> [u8; 2]| twelve.iter().flat_map(|x| to(*x)).collect::<Vec<u8>>();
        for (big, to) in [(false, u16::to_le_bytes as fn(u16) -> [u8; 2]), (true, u16::to_be_bytes)] {
            assert_eq!(raw(&image("mono16", (3, 1), 6, big, bytes(to))).unwrap().data, [0, 0x80, 0xff]);
        }
        assert_eq!(read("mono16", (2, 1), 0, &[0, 0x80, 0xff, 0xff]), [0x80, 0xff]);
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_is_needed() {
        let reported = |value: &Value| raw(value).unwrap_err();
        assert!(
            reported(&image("32FC1", (1, 1), 4, false, vec![0; 4]))
                .contains("`32FC1` is not read; publish one of mono8")
        );
        let huge = image("mono8", (100_000, 100_000), 0, false, vec![0; 8]);
        assert!(reported(&huge).contains("100000×100000 px; 1 px to 64 Mpx"));
        assert!(reported(&image("rgb8", (4, 4), 4, false, vec![0; 64])).contains("rows of 12"));
        assert!(reported(&image("rgb8", (4, 4), 12, false, vec![0; 47])).contains("need 48 bytes"));
        assert!(reported(&image("mono8", (0, 4), 0, false, Vec::new())).contains("0×4"));
    }
}
