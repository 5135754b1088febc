//! Pictures made smaller and encoded.

use resight::GrayImage;

/// Means of squares of pixels, so that the longer side is within the limit.
pub fn reduced(image: &GrayImage, limit_px: u32) -> GrayImage {
    let k = image.width_px.max(image.height_px).div_ceil(limit_px).max(1);
    if k == 1 {
        return image.clone();
    }
    let (width_px, height_px) = (image.width_px / k, image.height_px / k);
    let mut data = Vec::with_capacity((width_px * height_px) as usize);
    let mut sums = vec![0u32; width_px as usize];
    for v in 0..height_px {
        sums.fill(0);
        for row in 0..k {
            let from = ((v * k + row) * image.width_px) as usize;
            let pixels = &image.data[from..from + (width_px * k) as usize];
            add(&mut sums, pixels, k as usize);
        }
        data.extend(sums.iter().map(|sum| (sum / (k * k)) as u8));
    }
    GrayImage { width_px, height_px, data }
}

/// Sums of `k` neighbours; by two and three, which most cameras need, with chunks that the compiler knows.
fn add(sums: &mut [u32], pixels: &[u8], k: usize) {
    match k {
        2 => add_chunks::<2>(sums, pixels),
        3 => add_chunks::<3>(sums, pixels),
        _ => {
            for (sum, square) in sums.iter_mut().zip(pixels.chunks_exact(k)) {
                *sum += square.iter().map(|p| u32::from(*p)).sum::<u32>();
            }
        }
    }
}

fn add_chunks<const K: usize>(sums: &mut [u32], pixels: &[u8]) {
    for (sum, square) in sums.iter_mut().zip(pixels.as_chunks::<K>().0) {
        *sum += square.iter().map(|p| u32::from(*p)).sum::<u32>();
    }
}

/// A message: length of the header (u32, little end first), header, JPEG.
pub fn message(header: &impl serde::Serialize, image: &GrayImage, quality: u8) -> Option<Vec<u8>> {
    let header = serde_json::to_string(header).ok()?;
    let mut message = u32::try_from(header.len()).ok()?.to_le_bytes().to_vec();
    message.extend(header.as_bytes());
    let GrayImage { width_px, height_px, data } = image;
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut message, quality);
    encoder.encode(data, *width_px, *height_px, image::ExtendedColorType::L8).ok()?;
    Some(message)
}

/// Returns where the JPEG of a message begins.
pub fn jpeg_at(message: &[u8]) -> Option<usize> {
    let length = u32::from_le_bytes(message.get(..4)?.try_into().ok()?) as usize;
    Some(4 + length).filter(|at| *at < message.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduced_picture_is_the_mean_of_its_squares() {
        for (k, limit) in [(1u32, 100u32), (2, 30), (3, 20), (4, 15), (5, 12)] {
            let (width_px, height_px) = (60, 40);
            let data: Vec<u8> = (0..width_px * height_px).map(|i| (i * 7 % 251) as u8).collect();
            let image = GrayImage { width_px, height_px, data };
            let small = reduced(&image, limit);
            assert_eq!((small.width_px, small.height_px), (60 / k, 40 / k));
            for (i, got) in small.data.iter().enumerate() {
                let (u, v) = (i as u32 % small.width_px * k, i as u32 / small.width_px * k);
                let square = (0..k * k).map(|j| ((v + j / k) * width_px + u + j % k) as usize);
                let sum: u32 = square.map(|at| u32::from(image.data[at])).sum();
                assert_eq!(u32::from(*got), sum / (k * k), "{k}, pixel {i}");
            }
        }
    }

    #[test]
    fn a_message_is_a_header_and_a_jpeg() {
        let image = GrayImage::filled(16, 8, 100);
        let made = message(&serde_json::json!({ "camera": "gate" }), &image, 80).expect("a message");
        let at = jpeg_at(&made).expect("a picture");
        assert_eq!(&made[4..at], b"{\"camera\":\"gate\"}");
        let read = image::load_from_memory(&made[at..]).expect("a picture");
        assert_eq!((read.width(), read.height()), (16, 8));
        assert_eq!(jpeg_at(&made[..10]), None);
    }
}
