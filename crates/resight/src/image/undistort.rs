//! Removes distortion: converts an image to that of a pinhole camera.

use crate::core::{Camera, CameraMatrix, Pixel, Point};
use rayon::prelude::*;

/// An 8-bit image of one or several channels, stored row by row from the top, pixel by pixel from the left, channel by channel.
#[derive(Debug, Clone, Copy)]
pub struct Channels<'a> {
    /// Columns.
    pub width_px: usize,
    /// Rows.
    pub height_px: usize,
    /// Values per pixel: 1, 3 or 4.
    pub n_channels: usize,
    /// `width_px * height_px * n_channels` values.
    pub data: &'a [u8],
}

/// Returns the image, of the same size, that a pinhole with `matrix` would have taken from the same position. Each of its pixels is interpolated
/// bilinearly where the lens images the same ray, and 0 where it does not, as in OpenCV's `undistort`.
pub fn undistorted(image: &Channels, camera: &Camera, matrix: &CameraMatrix) -> Vec<u8> {
    let Channels { width_px, height_px, n_channels, .. } = *image;
    let row_of = |v: usize| {
        let mut row = vec![0; width_px * n_channels];
        for (u, pixel) in row.chunks_exact_mut(n_channels).enumerate() {
            let (x, y) = ((u as f64 - matrix.cx_px) / matrix.fx_px, (v as f64 - matrix.cy_px) / matrix.fy_px);
            if let Some(at) = camera.project(&Point::new(x, y, 1.0)) {
                image.interpolate(&at, pixel);
            }
        }
        row
    };
    crate::parallel::on_all_cores(|| (0..height_px).into_par_iter().flat_map_iter(row_of).collect())
}

impl Channels<'_> {
    /// Interpolates a pixel; outside the image all values are 0.
    fn interpolate(&self, at: &Pixel, into: &mut [u8]) {
        let (left, top) = (at.x.floor(), at.y.floor());
        let is_near =
            -1.0 <= left && left < self.width_px as f64 && -1.0 <= top && top < self.height_px as f64;
        if !is_near {
            return;
        }
        let (s, t) = (at.x - left, at.y - top);
        let corners =
            [(0, 0, (1.0 - s) * (1.0 - t)), (1, 0, s * (1.0 - t)), (0, 1, (1.0 - s) * t), (1, 1, s * t)];
        for (channel, value) in into.iter_mut().enumerate() {
            let of = |(right, down, weight): (isize, isize, f64)| {
                weight * self.value(left as isize + right, top as isize + down, channel)
            };
            *value = corners.into_iter().map(of).sum::<f64>().round() as u8;
        }
    }

    fn value(&self, u: isize, v: isize, channel: usize) -> f64 {
        match (usize::try_from(u), usize::try_from(v)) {
            (Ok(u), Ok(v)) if u < self.width_px && v < self.height_px => {
                f64::from(self.data[(v * self.width_px + u) * self.n_channels + channel])
            }
            _ => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Lens;
    use crate::core::camera::{BrownConrady, Pinhole};

    const MATRIX: CameraMatrix = CameraMatrix { fx_px: 60.0, fy_px: 62.0, cx_px: 39.5, cy_px: 29.5 };

    fn lens(lens: Lens) -> Camera {
        Camera { lens, size: None }
    }

    /// The image of a pinhole is unchanged, to the last bit; half a pixel aside, two neighbours are averaged.
    #[test]
    fn without_distortion_nothing_changes() {
        let data: Vec<u8> = (0..80 * 60 * 3).map(|i| (i * 7 % 251) as u8).collect();
        let image = Channels { width_px: 80, height_px: 60, n_channels: 3, data: &data };
        let camera = lens(Lens::Pinhole(Pinhole { matrix: MATRIX }));
        assert_eq!(undistorted(&image, &camera, &MATRIX), data);
        let beside = undistorted(&image, &camera, &CameraMatrix { cx_px: 39.0, ..MATRIX });
        let mean = (f64::from(data[0]) + f64::from(data[3])) / 2.0;
        assert_eq!(beside[0], mean.round() as u8);
        assert_eq!(
            undistorted(&image, &camera, &CameraMatrix { cx_px: -1e6, ..MATRIX }),
            vec![0; data.len()]
        );
    }

    /// A ramp seen through a lens: the value at each pixel of the pinhole is that where the lens images its ray, except for rounding.
    #[test]
    fn each_pixel_is_where_the_lens_sees_its_ray() {
        let data: Vec<u8> = (0..60).flat_map(|v| (0..80).map(move |u| (u + v) as u8)).collect();
        let image = Channels { width_px: 80, height_px: 60, n_channels: 1, data: &data };
        let camera =
            lens(Lens::BrownConrady(BrownConrady::new(MATRIX, &[-0.2, 0.05, 0.0, 0.0]).expect("a lens")));
        let straight = undistorted(&image, &camera, &MATRIX);
        for (u, v) in [(40, 30), (10, 8), (70, 50)] {
            let ray = Point::new((f64::from(u) - 39.5) / 60.0, (f64::from(v) - 29.5) / 62.0, 1.0);
            let at = camera.project(&ray).expect("in the field");
            assert!((f64::from(straight[(v * 80 + u) as usize]) - (at.x + at.y)).abs() <= 0.5 + 1e-9);
        }
    }
}
