//! Predicts the image of a known print around one of its corners, and finds the shift that aligns it with the image.
//!
//! For an isolated corner, fitting its edges is more accurate (`corner`). In a small or strongly tilted board the markers are nearer to the
//! corners than a window for edges is wide, and every saddle-point detector loses corners; but the print there is known. The model of the image
//! at pixel p is a + g T(p − t), with T the print seen through the predicted homography and a Gaussian blur; the shift t, the brightness a and
//! the contrast g minimise the sum of squares (B. Lucas and T. Kanade, IJCAI 1981). The share of the variance that the model explains shows
//! whether the corner is visible at all; `scatter` computes the uncertainty of the shift.

mod coverage;
pub(super) mod scatter;

use super::homography::{Homography, PlanePoint};
use super::stop;
use crate::GrayImage;
use nalgebra::{Matrix4, Vector4};
use resight_core::Pixel;

/// A print fitted to an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    /// The corner's position.
    pub pixel: Pixel,
    /// Standard deviation of each coordinate due to the noise alone.
    pub noise_px: f64,
    /// Variance of the residual divided by that of the noise.
    pub excess: f64,
    /// Share of the variance, less that of the noise, that the print explains: 1 for a perfect fit.
    pub explained: f64,
    /// Grey levels from black to white; negative for a print with exchanged colours.
    pub contrast_gray: f64,
}

/// The position of a print, without its uncertainty.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lying {
    pub pixel: Pixel,
    /// As in [`Fit`].
    pub explained: f64,
    pub contrast_gray: f64,
}

impl Fit {
    /// Returns the standard deviation of each coordinate, estimated from this corner's own residual alone.
    pub fn sigma_px(&self) -> f64 {
        self.noise_px * self.excess.max(1.0).sqrt()
    }
}

/// A window of the image around a corner, and the parameters of the comparison.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    /// Number of pixels to each side.
    pub half_px: usize,
    /// Standard deviation of the blur, px.
    pub blur_px: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise_gray: f64,
    /// A print that ends farther than this from where it was drawn is drawn again there.
    pub redrawn_px: f64,
}

/// [`Window::redrawn_px`] for corners that are measured from saddle points or predictions,
pub(super) const REDRAWN_PX: f64 = 0.05;
/// and for those measured from their last position, where most still are: otherwise they are a tenth less accurate.
pub(super) const REDRAWN_AGAIN_PX: f64 = 0.01;

/// Largest number of steps of a search; each about squares the error.
const STEPS: usize = 8;
const SETTLED_PX: f64 = 2e-3;
/// The last step corrects for a blur that differs from the assumed one; a longer one has found something else.
const LAST_STEP_PX: f64 = 0.3;
/// Number of pixels around the window in which the shifted print and its slopes are known.
const RIM: usize = 3;

/// A print's image around the pixel nearest to its corner.
struct Picture {
    side: usize,
    values: Vec<f32>,
}

impl Picture {
    /// `ink` is −1 for black and 1 for white, on the plane; `middle` is the central pixel of the drawing; `shift` moves the image of the plane.
    fn draw(
        ink: &impl Fn(PlanePoint) -> f32,
        plane_from_image: &Homography,
        middle: Pixel,
        shift: Pixel,
        window: &Window,
    ) -> Self {
        let kernel = gaussian(window.blur_px);
        let reach = kernel.len() / 2;
        let wide = 2 * (window.half_px + RIM + reach) + 1;
        let offset = (wide / 2) as f64;
        let from = middle - shift - Pixel::new(offset, offset);
        let at = |u: f64, v: f64| {
            let [x, y, z] = plane_from_image.homogeneous([from.x + u, from.y + v]);
            (PlanePoint::new(x / z, y / z), z)
        };
        // Most pixels have one colour: the same at all their corners.
        let corners: Vec<f32> = (0..(wide + 1) * (wide + 1))
            .map(|k| ink(at((k % (wide + 1)) as f64 - 0.5, (k / (wide + 1)) as f64 - 0.5).0))
            .collect();
        let pixel = |k: usize| {
            let (u, v) = (k % wide, k / wide);
            let first = v * (wide + 1) + u;
            let around =
                [corners[first], corners[first + 1], corners[first + wide + 2], corners[first + wide + 1]];
            if around.iter().all(|x| *x == around[0]) {
                return around[0];
            }
            // Within a pixel the homography is affine, to within a ten-thousandth of a pixel.
            let (u, v) = (u as f64, v as f64);
            let (centre, z) = at(u, v);
            let [x_by, y_by] = plane_from_image.gradients([centre.x, centre.y], 1.0 / z);
            let place = |d: coverage::InPixel| {
                centre + PlanePoint::new(x_by[0] * d.x + x_by[1] * d.y, y_by[0] * d.x + y_by[1] * d.y)
            };
            let part = |x: f64| x - x as i64 as f64;
            let moved = [part(0.754878 * u + 0.618034 * v), part(0.569840 * u + 0.754878 * v)];
            coverage::mean(|d| ink(place(d)), around, moved)
        };
        let raw: Vec<f32> = (0..wide * wide).map(pixel).collect();
        let side = wide - 2 * reach;
        let along = |row: &[f32]| -> Vec<f32> {
            (0..side).map(|u| kernel.iter().zip(&row[u..]).map(|(k, x)| k * x).sum()).collect()
        };
        let rows: Vec<f32> = raw.chunks(wide).flat_map(along).collect();
        let down = |k: usize| {
            kernel.iter().enumerate().map(|(i, w)| w * rows[(k / side + i) * side + k % side]).sum()
        };
        Picture { side, values: (0..side * side).map(down).collect() }
    }

    /// Returns the image moved by less than [`RIM`] − 1 pixels along each axis, bilinearly, over a window and one pixel around it.
    fn moved(&self, shift: Pixel, half: usize) -> Moved {
        let side = 2 * half + 3;
        let first =
            [shift.x, shift.y].map(|x| (RIM as f64 - 1.0 - x).clamp(0.0, 2.0 * RIM as f64 - 2.0 - 1e-9));
        let [(u0, a), (v0, b)] = first.map(|x| (x as usize, x - x as usize as f64));
        let weights = [(1.0 - b) * (1.0 - a), (1.0 - b) * a, b * (1.0 - a), b * a];
        let mut values = Vec::with_capacity(side * side);
        for v in v0..v0 + side {
            let above = &self.values[v * self.side + u0..][..side + 1];
            let below = &self.values[(v + 1) * self.side + u0..][..side + 1];
            values.extend(above.windows(2).zip(below.windows(2)).map(|(above, below)| {
                let corners = [above[0], above[1], below[0], below[1]];
                weights.iter().zip(corners).map(|(w, x)| w * x as f64).sum::<f64>()
            }));
        }
        Moved { side, values }
    }
}

/// The drawn image at the position where it is compared.
struct Moved {
    side: usize,
    values: Vec<f64>,
}

impl Moved {
    /// Returns the values around a pixel of the window, row by row.
    fn around(&self, column: usize, row: usize) -> [[f64; 3]; 3] {
        let line = |k: usize| &self.values[(row + k) * self.side + column..][..3];
        [0, 1, 2].map(|k| [line(k)[0], line(k)[1], line(k)[2]])
    }

    /// Returns value and slopes at a pixel of the window.
    fn at(&self, column: usize, row: usize) -> (f64, f64, f64) {
        let t = self.around(column, row);
        (t[1][1], 0.5 * (t[1][2] - t[1][0]), 0.5 * (t[2][1] - t[0][1]))
    }

    /// Returns the second derivatives uu, uv and vv.
    fn bends(&self, column: usize, row: usize) -> [f64; 3] {
        let t = self.around(column, row);
        let twice = 2.0 * t[1][1];
        let across = t[2][2] - t[2][0] - t[0][2] + t[0][0];
        [t[1][2] + t[1][0] - twice, 0.25 * across, t[2][1] + t[0][1] - twice]
    }
}

fn gaussian(sigma_px: f64) -> Vec<f32> {
    let reach = (2.5 * sigma_px).ceil() as i64;
    let weights: Vec<f64> =
        (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma_px.max(0.1)).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// A print to be fitted: its colours on the plane, the homography to the image, and the position of the corner on the plane.
pub(super) struct Printed<'a, Ink> {
    /// −1 for black and 1 for white.
    pub ink: Ink,
    pub image_from_plane: &'a Homography,
    pub place: &'a PlanePoint,
}

/// Fits a print to the image near `start`, the image of `place` by `image_from_plane`. `None` where the window leaves the image, the print has
/// no structure, or the corner would be farther than `max_move_px` from `start`. With `max_move_px` zero nothing is moved.
pub(super) fn fit(
    image: &GrayImage,
    ink: impl Fn(PlanePoint) -> f32,
    image_from_plane: &Homography,
    place: &PlanePoint,
    start: Pixel,
    max_move_px: f64,
    window: Window,
) -> Option<Fit> {
    let printed = Printed { ink, image_from_plane, place };
    search(image, &printed, start, max_move_px, window, |sums, at, laid| {
        sums.fit(at, laid, 0.0 < max_move_px)
    })
}

/// Fits without the uncertainty of the position, in half of the time, to find out where a print is, and whether it is visible.
pub(super) fn lie(
    image: &GrayImage,
    printed: &Printed<impl Fn(PlanePoint) -> f32>,
    start: Pixel,
    max_move_px: f64,
    window: Window,
) -> Option<Lying> {
    search(image, printed, start, max_move_px, window, |sums, at, _| sums.lying(at, &window))
}

/// Moves a print, starting at `start`, and computes the result from the sums at the end.
fn search<Ink: Fn(PlanePoint) -> f32, Out>(
    image: &GrayImage,
    printed: &Printed<Ink>,
    start: Pixel,
    max_move_px: f64,
    window: Window,
    conclude: impl Fn(&Sums, Pixel, &Laid) -> Option<Out>,
) -> Option<Out> {
    let plane_from_image = printed.image_from_plane.inverse()?;
    let origin = printed.image_from_plane.at(printed.place);
    let middle = Pixel::new(start.x.round(), start.y.round());
    let half = window.half_px as f64;
    let inside = |c: f64, n: u32| half <= c && c + half < n as f64;
    if !inside(middle.x, image.width_px) || !inside(middle.y, image.height_px) || stop::is_stopped() {
        return None;
    }
    #[cfg(test)]
    super::work::count((2 * window.half_px + 1).pow(2) * STEPS);
    let mut at = start;
    // The print is drawn again where the first search ends: there the shift is small, and interpolation does not blur any more.
    for round in 0..2 {
        let picture = Picture::draw(&printed.ink, &plane_from_image, middle, at - origin, &window);
        let drawn_at = at;
        let laid = |at: Pixel| {
            let (shift, corner) = (at - drawn_at, drawn_at - middle);
            Laid { image, picture: &picture, middle, shift, corner, window }
        };
        for _ in 0..STEPS {
            let sums = Sums::over(image, &picture, middle, at - drawn_at, window.half_px);
            let step = sums.step()?;
            if max_move_px <= 0.0 {
                return conclude(&sums, at, &laid(at));
            }
            at += step;
            if !((at - start).norm() <= max_move_px) || !((at - drawn_at).norm() < RIM as f64 - 1.0) {
                return None;
            }
            if step.norm() < SETTLED_PX {
                break;
            }
        }
        if round == 1 || (at - drawn_at).norm() < window.redrawn_px {
            let sums = Sums::over(image, &picture, middle, at - drawn_at, window.half_px);
            return conclude(&sums, at, &laid(at));
        }
    }
    None
}

/// Sums of the normal equations of (a, g, g t): image ≈ a + g T − g t · ∇T.
struct Sums {
    normal: Matrix4<f64>,
    right: Vector4<f64>,
    squares: f64,
    n: f64,
}

/// Calls with (1, T, −∂T/∂u, −∂T/∂v) and the grey level of each pixel of a window, row by row.
fn each_pixel(
    image: &GrayImage,
    picture: &Picture,
    middle: Pixel,
    shift: Pixel,
    half: usize,
    mut call: impl FnMut(Vector4<f64>, f64),
) {
    let side = 2 * half + 1;
    let moved = picture.moved(shift, half);
    let (u0, v0) = (middle.x as usize - half, middle.y as usize - half);
    for row in 0..side {
        let line = &image.data[(v0 + row) * image.width_px as usize + u0..][..side];
        for (column, &gray) in line.iter().enumerate() {
            let (value, du, dv) = moved.at(column, row);
            // The middle grey level is subtracted to keep the sums small.
            call(Vector4::new(1.0, value, -du, -dv), gray as f64 - 128.0);
        }
    }
}

impl Sums {
    fn over(image: &GrayImage, picture: &Picture, middle: Pixel, shift: Pixel, half: usize) -> Self {
        let mut sums = Sums { normal: Matrix4::zeros(), right: Vector4::zeros(), squares: 0.0, n: 0.0 };
        each_pixel(image, picture, middle, shift, half, |line, gray| {
            sums.normal += line * line.transpose();
            sums.right += line * gray;
            sums.squares += gray * gray;
            sums.n += 1.0;
        });
        sums
    }

    fn step(&self) -> Option<Pixel> {
        let x = self.normal.cholesky()?.solve(&self.right);
        let step = Pixel::new(x[2] / x[1], x[3] / x[1]);
        (x.iter().all(|x| x.is_finite()) && step.norm().is_finite()).then_some(step)
    }

    fn lying(&self, pixel: Pixel, window: &Window) -> Option<Lying> {
        // Only the part of the shift that moved the print counts as explained, so that the print is compared at its final position.
        let (value, mean) = (self.normal[(1, 1)], self.normal[(0, 1)] / self.n);
        let gray = self.right[0] / self.n;
        let (tt, ti) = (value - self.n * mean * mean, self.right[1] - self.n * mean * gray);
        let total = self.squares - self.n * gray * gray;
        let contrast = ti / tt;
        let residual = (total - ti * ti / tt).max(0.0);
        let noise = self.n * window.noise_gray * window.noise_gray;
        let explained = 1.0 - (residual - noise).max(0.0) / (total - noise).max(1e-9);
        let is_finite = explained.is_finite() && contrast.is_finite();
        is_finite.then_some(Lying { pixel, explained, contrast_gray: 2.0 * contrast })
    }

    fn fit(&self, pixel: Pixel, laid: &Laid, is_moved: bool) -> Option<Fit> {
        let Lying { explained, contrast_gray, .. } = self.lying(pixel, &laid.window)?;
        let scatter = scatter::of(laid, 0.5 * contrast_gray)?;
        // The last step allows for a blur that differs from the assumed one.
        let pixel = if is_moved && scatter.step.norm() < LAST_STEP_PX { pixel + scatter.step } else { pixel };
        let (noise_px, excess) =
            (scatter.by_noise_px2.sqrt(), scatter.by_residual_px2 / scatter.by_noise_px2);
        let fit = Fit { pixel, noise_px, excess, explained, contrast_gray };
        [noise_px, excess].iter().all(|x| x.is_finite()).then_some(fit)
    }
}

/// A print's image at its position on the image.
struct Laid<'a> {
    image: &'a GrayImage,
    picture: &'a Picture,
    /// The central pixel of the drawing, and the shift of the image from where it was drawn.
    middle: Pixel,
    shift: Pixel,
    /// Position of the corner in the image, relative to its centre.
    corner: Pixel,
    window: Window,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two black squares, corner to corner at the plane's origin, a pixel to a unit.
    fn ink(x: PlanePoint) -> f32 {
        if x.x * x.y < 0.0 { -1.0 } else { 1.0 }
    }

    fn map() -> Homography {
        let corner = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
        let pairs =
            corner.map(|(x, y)| (PlanePoint::new(x, y), Pixel::new(20.0 + x + 0.1 * y, 20.0 - 0.1 * x + y)));
        Homography::fit(&pairs).unwrap()
    }

    fn drawn_at(shift: Pixel) -> GrayImage {
        let window = Window { half_px: 15, blur_px: 1.0, noise_gray: 0.0, redrawn_px: REDRAWN_PX };
        let middle = Pixel::new(20.0, 20.0);
        let picture = Picture::draw(&ink, &map().inverse().unwrap(), middle, shift, &window);
        let mut image = GrayImage::filled(41, 41, 0);
        let rim = (picture.side as i64 - 41) / 2;
        for (k, value) in image.data.iter_mut().enumerate() {
            let (u, v) = ((k % 41) as i64 + rim, (k / 41) as i64 + rim);
            let k = v.clamp(0, picture.side as i64 - 1) * picture.side as i64
                + u.clamp(0, picture.side as i64 - 1);
            *value = (120.0 + 80.0 * picture.values[k as usize]).round() as u8;
        }
        image
    }

    fn laid(image: &GrayImage, start: Pixel) -> Option<Fit> {
        let window = Window { half_px: 7, blur_px: 1.0, noise_gray: 0.3, redrawn_px: REDRAWN_PX };
        fit(image, ink, &map(), &PlanePoint::zeros(), start, 3.0, window)
    }

    #[test]
    fn a_print_is_laid_where_it_was_drawn() {
        // Sub-pixels of a third place a straight edge along the axes to some hundredths.
        for shift in [Pixel::new(0.0, 0.0), Pixel::new(1.3, -0.7), Pixel::new(-0.4, 1.6)] {
            let fit = laid(&drawn_at(shift), Pixel::new(20.0, 20.0)).unwrap();
            assert!((fit.pixel - shift - Pixel::new(20.0, 20.0)).norm() < 0.05, "{shift:?}: {fit:?}");
            assert!(0.99 < fit.explained && (fit.contrast_gray - 160.0).abs() < 3.0, "{fit:?}");
        }
    }

    #[test]
    fn what_is_no_such_print_is_not_explained() {
        let flat = GrayImage::filled(41, 41, 90);
        assert!(laid(&flat, Pixel::new(20.0, 20.0)).is_none_or(|fit| fit.contrast_gray.abs() < 1.0));
        let mut edge = flat;
        edge.data.iter_mut().enumerate().filter(|(k, _)| 20 < k % 41).for_each(|(_, x)| *x = 200);
        assert!(laid(&edge, Pixel::new(20.0, 20.0)).is_none_or(|fit| fit.explained < 0.3));
        for start in [Pixel::new(3.0, 20.0), Pixel::new(f64::NAN, 20.0), Pixel::new(1e300, -1e300)] {
            assert!(laid(&edge, start).is_none(), "{start:?}");
        }
    }
}
