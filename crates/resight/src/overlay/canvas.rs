//! An RGB image with anti-aliased strokes.
//!
//! Canvas coordinates follow the convention of the project: (0, 0) is the centre of the top-left pixel. The coverage of a stroke is accumulated
//! over all its segments and blended once, so that joints of translucent lines are invisible.

use crate::GrayImage;
use nalgebra::Vector2;

/// A line through points, canvas pixels.
pub type Path = Vec<Vector2<f64>>;
/// Red, green, blue.
pub type Color = [u8; 3];

/// Segments are cut into pieces of this length, px, so that a long diagonal does not visit its whole bounding box.
const PIECE: f64 = 24.0;

/// An image being drawn.
pub struct Canvas {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Number of rows, from the top, on which strokes are drawn; `height` unless set lower.
    pub open_rows: u32,
    rgb: Vec<u8>,
    coverage: Vec<f32>,
    touched: Vec<usize>,
}

/// The appearance of a line.
#[derive(Debug, Clone, Copy)]
pub struct Pen {
    /// Its colour.
    pub color: Color,
    /// Its width, canvas pixels.
    pub width: f64,
    /// Opacity: 1 opaque, 0 invisible.
    pub opacity: f64,
}

impl Canvas {
    /// Creates a photograph, each of its pixels `scale` by `scale`, above `margin` rows of `background`.
    pub fn from_photograph(image: &GrayImage, scale: u32, margin: u32, background: Color) -> Self {
        let (width, photo_height) = (image.width_px * scale, image.height_px * scale);
        let height = photo_height + margin;
        let n = width as usize * height as usize;
        let mut rgb = Vec::with_capacity(3 * n);
        for y in 0..photo_height {
            for x in 0..width {
                rgb.extend([image.at(x / scale, y / scale); 3]);
            }
        }
        while rgb.len() < 3 * n {
            rgb.extend(background);
        }
        Canvas { width, height, open_rows: height, rgb, coverage: vec![0.0; n], touched: Vec::new() }
    }

    /// Creates a canvas of one colour.
    pub fn blank(width: u32, height: u32, color: Color) -> Self {
        let n = width as usize * height as usize;
        let rgb = color.iter().copied().cycle().take(3 * n).collect();
        Canvas { width, height, open_rows: height, rgb, coverage: vec![0.0; n], touched: Vec::new() }
    }

    /// Sets the colour of one pixel; ignored outside the image.
    pub fn set(&mut self, x: u32, y: u32, color: Color) {
        if x < self.width && y < self.height {
            let i = 3 * (y as usize * self.width as usize + x as usize);
            self.rgb[i..i + 3].copy_from_slice(&color);
        }
    }

    /// Draws paths with one pen; a path of one point is a dot.
    pub fn stroke(&mut self, paths: &[Path], pen: Pen) {
        for path in paths {
            if let [dot] = path.as_slice() {
                self.cover(*dot, *dot, pen.width);
            }
            for pair in path.windows(2) {
                self.segment(pair[0], pair[1], pen.width);
            }
        }
        self.blend(pen);
    }

    /// Draws as `stroke`, over a dark rim that keeps the line readable on any photograph.
    pub fn stroke_with_rim(&mut self, paths: &[Path], pen: Pen) {
        let rim = Pen { color: [0, 0, 0], width: 1.8 * pen.width + 1.2, opacity: 0.55 * pen.opacity };
        self.stroke(paths, rim);
        self.stroke(paths, pen);
    }

    /// Encodes the image as PNG.
    pub fn png(&self) -> Result<Vec<u8>, String> {
        use ::image::ImageEncoder;
        use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
            .write_image(&self.rgb, self.width, self.height, ::image::ExtendedColorType::Rgb8)
            .map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    /// Returns the colour of a pixel.
    pub fn at(&self, x: u32, y: u32) -> Color {
        let i = 3 * (y as usize * self.width as usize + x as usize);
        [self.rgb[i], self.rgb[i + 1], self.rgb[i + 2]]
    }

    fn segment(&mut self, a: Vector2<f64>, b: Vector2<f64>, width: f64) {
        let Some((a, b)) = self.clipped(a, b, width + 2.0) else { return };
        let pieces = ((b - a).norm() / PIECE).ceil().max(1.0);
        let step = (b - a) / pieces;
        for i in 0..pieces as usize {
            self.cover(a + step * i as f64, a + step * (i + 1) as f64, width);
        }
    }

    /// Raises the coverage of the pixels near a segment to that by the segment.
    fn cover(&mut self, a: Vector2<f64>, b: Vector2<f64>, width: f64) {
        let reach = 0.5 * width + 1.0;
        let range = |lo: f64, hi: f64, n: u32| {
            let first = (lo.min(hi) - reach).ceil().max(0.0);
            let last = (lo.max(hi) + reach).floor().min(n as f64 - 1.0);
            if first <= last { first as usize..last as usize + 1 } else { 0..0 }
        };
        let (along, length2) = (b - a, (b - a).norm_squared());
        for y in range(a.y, b.y, self.open_rows.min(self.height)) {
            for x in range(a.x, b.x, self.width) {
                let p = Vector2::new(x as f64, y as f64) - a;
                let t = if 0.0 < length2 { (p.dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let covered = (0.5 * width + 0.5 - (p - along * t).norm()).clamp(0.0, width.min(1.0)) as f32;
                let i = y * self.width as usize + x;
                if self.coverage[i] < covered {
                    if self.coverage[i] == 0.0 {
                        self.touched.push(i);
                    }
                    self.coverage[i] = covered;
                }
            }
        }
    }

    fn blend(&mut self, pen: Pen) {
        for i in self.touched.drain(..) {
            let alpha = self.coverage[i] as f64 * pen.opacity;
            self.coverage[i] = 0.0;
            for (channel, ink) in self.rgb[3 * i..3 * i + 3].iter_mut().zip(pen.color) {
                *channel = (*channel as f64 + alpha * (ink as f64 - *channel as f64)).round() as u8;
            }
        }
    }

    /// Returns the part of a segment inside the image widened by `margin` (Liang–Barsky).
    fn clipped(&self, a: Vector2<f64>, b: Vector2<f64>, margin: f64) -> Option<(Vector2<f64>, Vector2<f64>)> {
        if !(a.iter().chain(b.iter()).all(|x| x.is_finite())) {
            return None;
        }
        let d = b - a;
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let limits = [self.width as f64 - 1.0 + margin, self.height as f64 - 1.0 + margin];
        for axis in 0..2 {
            for (direction, distance) in [(-d[axis], a[axis] + margin), (d[axis], limits[axis] - a[axis])] {
                match direction {
                    _ if direction == 0.0 && distance < 0.0 => return None,
                    _ if direction < 0.0 => enter = enter.max(distance / direction),
                    _ if 0.0 < direction => leave = leave.min(distance / direction),
                    _ => {}
                }
            }
        }
        (enter <= leave).then(|| (a + d * enter, a + d * leave))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blank(width: u32, height: u32) -> Canvas {
        Canvas::from_photograph(&GrayImage::filled(width, height, 0), 1, 0, [0; 3])
    }

    const WHITE: Pen = Pen { color: [255; 3], width: 1.0, opacity: 1.0 };

    #[test]
    fn line_through_pixel_centres_colours_exactly_those_pixels() {
        let mut c = blank(9, 5);
        c.stroke(&[vec![Vector2::new(2.0, 2.0), Vector2::new(6.0, 2.0)]], WHITE);
        let lit: Vec<_> =
            (0..5).flat_map(|y| (0..9).map(move |x| (x, y))).filter(|&(x, y)| c.at(x, y)[0] == 255).collect();
        assert_eq!(lit, (2..=6).map(|x| (x, 2)).collect::<Vec<_>>());
    }

    /// The ink of an oblique line is its length times its width, whatever its direction.
    #[test]
    fn ink_is_length_times_width() {
        for angle in [0.1_f64, 0.5, 1.0, 1.4] {
            let mut c = blank(120, 120);
            let d = Vector2::new(angle.cos(), angle.sin()) * 100.0;
            c.stroke(
                &[vec![Vector2::new(8.0, 8.0), Vector2::new(8.0, 8.0) + d]],
                Pen { width: 2.0, ..WHITE },
            );
            let ink: f64 = (0..120)
                .flat_map(|y| (0..120).map(move |x| (x, y)))
                .map(|(x, y)| c.at(x, y)[0] as f64 / 255.0)
                .sum();
            assert!((ink - 203.0).abs() < 4.0, "{angle}: {ink}");
        }
    }

    #[test]
    fn translucent_joints_do_not_show() {
        let mut c = blank(40, 9);
        let path: Path = (0..=30).map(|i| Vector2::new(5.0 + i as f64, 4.0)).collect();
        c.stroke(&[path], Pen { opacity: 0.5, ..WHITE });
        assert!((6..34).all(|x| c.at(x, 4) == [128; 3]));
    }

    #[test]
    fn strokes_far_outside_or_not_finite_draw_nothing() {
        let mut c = blank(8, 8);
        let far = |x: f64, y: f64| Vector2::new(x, y);
        c.stroke(&[vec![far(-1e9, -50.0), far(1e9, -50.0)], vec![far(f64::NAN, 1.0), far(3.0, 3.0)]], WHITE);
        assert!((0..64).all(|i| c.at(i % 8, i / 8) == [0; 3]));
    }

    #[test]
    fn a_line_across_everything_is_clipped_not_lost() {
        let mut c = blank(8, 8);
        c.stroke(&[vec![Vector2::new(-1e7, 3.0), Vector2::new(1e7, 3.0)]], WHITE);
        assert!((0..8).all(|x| c.at(x, 3) == [255; 3]));
    }
}
