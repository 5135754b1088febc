//! Converts images so that a shadow on a print, or a ground darker than paper, does not break a tag's outline.
//!
//! The tag library separates black from white half-way between the darkest and the brightest value of a neighbourhood of a dozen pixels. Where
//! the edge of a shadow crosses a tag's margin, white in the shadow falls below that, and the outline of the black border breaks. Of simulated
//! tags of 20 to 80 px under three soft stripes, 3 to 40 % are found in the original image, 33 to 100 % in the stretched one; under hard stripes
//! 0 %, and 20 to 80 % from 32 px on in the logarithm; of tags without a white margin, of 20 px, 33 %, and 97 % if stretched.

use crate::GrayImage;

/// Size of the windows for the darkest and brightest values, pixels: a cell or two of a tag, narrower than the edges of most shadows.
const WINDOW_PX: usize = 9;
/// Size of the window in which these values are smoothed, pixels, so that they do not jump.
const SMOOTH_PX: usize = 4;
/// Larger images are searched unchanged: the copies would need most of the memory.
const MOST_PIXELS: usize = 16_000_000;
/// Grey levels below this count as dark: their logarithm would be that of noise.
const NO_LIGHT_GRAY: f64 = 4.0;

fn is_taken(image: &GrayImage) -> bool {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let least = 4 * WINDOW_PX;
    image.data.len() == width * height && image.data.len() <= MOST_PIXELS && least <= width && least <= height
}

/// Stretches each pixel between the darkest (0) and the brightest (255) value around it; 127 where these differ by less than `least_gray`, so
/// that noise is not amplified. `None` for an image that is too small or too large.
pub(super) fn stretched(image: &GrayImage, least_gray: u8) -> Option<GrayImage> {
    if !is_taken(image) {
        return None;
    }
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let mut data = vec![FLAT; image.data.len()];
    let mut part = Vec::new();
    for top in (0..height).step_by(PART_PX[1]) {
        for left in (0..width).step_by(PART_PX[0]) {
            let columns = Span::around(left, PART_PX[0], width);
            let rows = Span::around(top, PART_PX[1], height);
            part.clear();
            let line = |v: usize| &image.data[v * width..][columns.first..columns.end];
            (rows.first..rows.end).for_each(|v| part.extend_from_slice(line(v)));
            let n = columns.end - columns.first;
            if let Some([low, high]) = extremes(&part, n, least_gray) {
                let shift = SHIFT * (n + 1);
                for v in rows.own.clone() {
                    let at = (v - rows.first) * n + columns.own.start - columns.first;
                    // The first rows have no complete window.
                    let Some(before) = at.checked_sub(shift) else { continue };
                    let out = &mut data[v * width..][columns.own.clone()];
                    stretch(out, &part[at..], &low[before..], &high[before..], least_gray);
                }
            }
        }
    }
    Some(GrayImage { data, ..*image })
}

/// Columns and rows of the parts that are stretched at once: they fit the fastest memory, and those without contrast are left out.
const PART_PX: [usize; 2] = [256, 128];
/// The windows begin at their first pixel, so that their centre is this much farther.
const SHIFT: usize = WINDOW_PX / 2 + SMOOTH_PX / 4;

/// Columns or rows of a part, and those around it that its windows reach.
struct Span {
    own: std::ops::Range<usize>,
    first: usize,
    end: usize,
}

impl Span {
    fn around(start: usize, length: usize, size: usize) -> Self {
        let end = (start + length).min(size);
        Span {
            own: start..end,
            first: start.saturating_sub(SHIFT),
            end: (end + WINDOW_PX + SMOOTH_PX).min(size),
        }
    }
}

/// Returns the darkest and brightest values around the pixels of a part; `None` where nowhere these differ enough.
fn extremes(part: &[u8], width: usize, least_gray: u8) -> Option<[Vec<u8>; 2]> {
    let darkest = part.iter().fold(u8::MAX, |low, gray| low.min(*gray));
    let brightest = part.iter().fold(0, |high, gray| high.max(*gray));
    if brightest.saturating_sub(darkest) < least_gray.max(1) {
        return None;
    }
    let low = smoothed(extreme(part, width, |a, b| a.min(b)), width);
    Some([low, smoothed(extreme(part, width, |a, b| a.max(b)), width)])
}

/// Floating-point numbers around this one, 1.5 · 2²³, are whole numbers.
const WHOLE: f32 = 12_582_912.0;

/// Stretches the pixels of a row.
fn stretch(out: &mut [u8], gray: &[u8], low: &[u8], high: &[u8], least_gray: u8) {
    let n = out.len();
    let (gray, low, high) = (&gray[..n], &low[..n], &high[..n]);
    for i in 0..n {
        let range = high[i].saturating_sub(low[i]);
        let share = 255.0 * f32::from(gray[i].saturating_sub(low[i])) / f32::from(range.max(1));
        // Added to this number, the value is rounded to a whole number in its last bits. Quotients of whole numbers up to 255 are at least 1/255 below the next whole
        // number, so that this rounds down; unlike a conversion, it is computed for many pixels at once.
        let value = (share.min(255.0) - 0.498 + WHOLE).to_bits() as u8;
        out[i] = if least_gray.max(1) <= range { value } else { FLAT };
    }
}

/// The grey level of a pixel without contrast around it.
const FLAT: u8 = 127;

/// Edge length, in pixels, of the blocks in which an image is tested for structure.
const BLOCK_PX: usize = 8;

/// Returns whether grey levels differ by `least_gray` in two adjacent blocks: a readable tag covers two, and noise rarely has such a range in
/// both.
pub(super) fn has_structure(image: &GrayImage, least_gray: u8) -> bool {
    let width = image.width_px.max(1) as usize;
    let (mut low, mut high) = (vec![0u8; width], vec![0u8; width]);
    let mut above = vec![false; width.div_ceil(BLOCK_PX)];
    for rows in image.data.chunks(BLOCK_PX * width) {
        low.fill(255);
        high.fill(0);
        for row in rows.chunks(width) {
            low.iter_mut().zip(row).for_each(|(a, b)| *a = (*a).min(*b));
            high.iter_mut().zip(row).for_each(|(a, b)| *a = (*a).max(*b));
        }
        let mut is_left = false;
        for ((above, low), high) in above.iter_mut().zip(low.chunks(BLOCK_PX)).zip(high.chunks(BLOCK_PX)) {
            let (low, high) = (low.iter().min().copied(), high.iter().max().copied());
            let is_structured = least_gray <= high.unwrap_or(0).saturating_sub(low.unwrap_or(255));
            if is_structured && (is_left || *above) {
                return true;
            }
            (*above, is_left) = (is_structured, is_structured);
        }
    }
    false
}

/// Returns the logarithm of each pixel: a shadow subtracts the same from black and from white. `None` for an image that is too large.
pub(super) fn logarithm(image: &GrayImage) -> Option<GrayImage> {
    if !is_taken(image) {
        return None;
    }
    let of = |gray: usize| {
        let log = (gray as f64 / NO_LIGHT_GRAY + 1.0).ln() / (255.0 / NO_LIGHT_GRAY + 1.0).ln();
        (255.0 * log).round() as u8
    };
    let table: Vec<u8> = (0..256).map(of).collect();
    Some(GrayImage { data: image.data.iter().map(|gray| table[*gray as usize]).collect(), ..*image })
}

/// Returns the least or the greatest value of each window that begins at a pixel, by windows of two, four and eight; rows continue in the next.
fn extreme(data: &[u8], width: usize, of: impl Fn(u8, u8) -> u8 + Copy) -> Vec<u8> {
    let (mut out, mut spare) = (data.to_vec(), Vec::new());
    for step in [1, width] {
        let single = out.clone();
        for reach in [1, 2, 4] {
            join(&mut out, &mut spare, reach * step, of);
        }
        let ninth = single.get(8 * step..).unwrap_or_default();
        out.iter_mut().zip(ninth).for_each(|(a, b)| *a = of(*a, *b));
    }
    out
}

/// Returns the means of squares of [`SMOOTH_PX`] that begin at a pixel.
fn smoothed(mut data: Vec<u8>, width: usize) -> Vec<u8> {
    let mut spare = Vec::new();
    for step in [1, 2, width, 2 * width] {
        join(&mut data, &mut spare, step, |a, b| ((u16::from(a) + u16::from(b)) / 2) as u8);
    }
    data
}

/// Joins each value with the one `reach` farther, from one buffer to another, so that many are joined at once.
fn join(data: &mut Vec<u8>, spare: &mut Vec<u8>, reach: usize, of: impl Fn(u8, u8) -> u8) {
    let n = data.len().saturating_sub(reach);
    spare.clear();
    spare.extend(data.iter().zip(data.get(reach..).unwrap_or_default()).map(|(a, b)| of(*a, *b)));
    spare.extend_from_slice(&data[n..]);
    std::mem::swap(data, spare);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of 6 px, black and white, in the sun at the left and in a soft shadow at the right.
    fn shaded() -> GrayImage {
        let gray = |k: usize| {
            let (u, v) = (k % 160, k / 160);
            let ink = if (u / 6 + v / 6) % 2 == 0 { 0.9 } else { 0.1 };
            (ink * (240.0 - 160.0 * ((u as f64 - 70.0) / 30.0).clamp(0.0, 1.0))) as u8
        };
        GrayImage { width_px: 160, height_px: 120, data: (0..160 * 120).map(gray).collect() }
    }

    #[test]
    fn white_is_white_in_the_shadow_too() {
        let image = shaded();
        let stretched = stretched(&image, 15).unwrap();
        for (u, v) in (12..108).flat_map(|v| (12..148).map(move |u| (u, v))) {
            let is_inside = (2..4).contains(&(u % 6)) && (2..4).contains(&(v % 6));
            let is_white = (u / 6 + v / 6) % 2 == 0;
            if is_inside && is_white {
                assert!(150 < stretched.at(u, v), "{u} {v}: {}", stretched.at(u, v));
            } else if is_inside {
                assert!(stretched.at(u, v) < 105, "{u} {v}: {}", stretched.at(u, v));
            }
        }
    }

    /// Every grey level between every pair of extremes is stretched as by division of whole numbers.
    #[test]
    fn stretching_is_exact() {
        for (low, high) in (0..=255u8).flat_map(|low| (low..=255).map(move |high| (low, high))) {
            let gray: Vec<u8> = (0..=255).collect();
            let mut out = vec![1; 256];
            stretch(&mut out, &gray, &[low; 256], &[high; 256], 1);
            for (gray, out) in gray.iter().zip(&out) {
                let share = 255 * u32::from(gray.saturating_sub(low)) / u32::from(high - low).max(1);
                let expected = if low < high { share.min(255) as u8 } else { FLAT };
                assert_eq!(*out, expected, "{gray} between {low} and {high}");
            }
        }
    }

    #[test]
    fn even_walls_stay_even_whatever_their_noise() {
        let mut pcg = crate::render::Pcg::new(3);
        let data = (0..160 * 120).map(|_| (90.0 + 1.5 * pcg.normal()).round() as u8).collect();
        let image = GrayImage { width_px: 160, height_px: 120, data };
        let wall = stretched(&image, 15).unwrap();
        assert!(wall.data.iter().all(|gray| *gray == FLAT) && !has_structure(&image, 15));
        let mut spotted = image;
        (40..60).for_each(|u| spotted.data[70 * 160 + u] = 200);
        assert!(has_structure(&spotted, 15) && !has_structure(&spotted, 150));
        assert!(!has_structure(&GrayImage::filled(0, 0, 0), 1));
        assert!(stretched(&GrayImage::filled(20, 200, 9), 15).is_none());
    }

    #[test]
    fn logarithms_take_the_same_from_black_and_white() {
        let image =
            GrayImage { width_px: 64, height_px: 64, data: (0..4096).map(|k| (k % 256) as u8).collect() };
        let log = logarithm(&image).unwrap();
        let at = |gray: usize| f64::from(log.data[gray]);
        assert_eq!((at(0), at(255)), (0.0, 255.0));
        assert!(((at(200) - at(40)) - (at(100) - at(20))).abs() < 14.0);
        assert!(log.data[..256].is_sorted());
    }
}
