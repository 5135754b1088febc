//! A small window of the reference, and its position in another image to a fraction of a pixel.
//!
//! Both images are interpolated by the uniform cubic B-spline: it smooths slightly, is twice continuously differentiable, and so prefers no
//! fraction of a pixel. The illumination may change: gain and offset are fitted with the shift.
//!
//! ```text
//!   T(d)  template, mean removed   ·   ∇T  its gradient without what gain and offset explain   ·   M = Σ ∇T ∇Tᵀ
//!   I(p + A d) ≈ a T(d + δ) + o    ·   δ = M⁻¹ Σ ∇T (I/a − T)   ·   p ← p − A δ          docs/math/turn.md eqs. (8)–(10)
//! ```

use crate::GrayImage;
use nalgebra::{Matrix2, Vector2};

/// Radius of a window, px.
pub(super) const RADIUS: i32 = 6;
const SIDE: usize = 2 * RADIUS as usize + 1;
const AREA: usize = SIDE * SIDE;
type Window = [f32; AREA];

/// A window of the reference.
#[derive(Debug, Clone)]
pub(super) struct Patch {
    template: Window,
    gradient_u: Window,
    gradient_v: Window,
    /// Number of saturated pixels.
    saturated: usize,
    /// Σ T².
    energy: f32,
    /// M⁻¹.
    inverse: Matrix2<f64>,
    /// M⁻¹ W M⁻¹: covariance of the shift for unit variance of the smoothed grey levels, whose errors are correlated between neighbours.
    spread: Matrix2<f64>,
    /// M⁻¹ Σ ∇T T²: shift for a unit curvature of the tone curve, px.
    bend: Vector2<f64>,
}

/// A window found in an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aligned {
    /// Its centre, px of this image.
    pub pixel: Vector2<f64>,
    /// Covariance of the position from the residual grey levels of the window, px².
    pub covariance: Matrix2<f64>,
    /// Shift of the position for a tone curve with the curvature `BEND`, px.
    pub bent_px: Vector2<f64>,
}

/// Largest number of steps; most windows need two or three.
const STEPS: usize = 8;
/// A smaller step ends the search, px: the remaining error is smaller by its rate of convergence.
const SMALL_STEP_PX: f64 = 0.02;
/// Standard deviation expected of the tone curve's bend b in now = a T + a b T² + o, 1/grey: a gamma of 0.5 or 2 has 0.0025 at
/// middle grey.
const BEND: f64 = 0.005;
/// Number of pixels by which the saturated ones may differ from those in the reference, a tenth of the window: with more, a clipped edge seems
/// displaced, all along a skyline to the same side.
const MOST_CLIPPED: usize = AREA / 10;
/// Correlation with the template below which a window is rejected.
const LEAST_CORRELATION: f32 = 0.75;

impl Patch {
    /// Takes the window around a pixel; `None` at the border or where the contrast does not determine a position.
    pub fn new(image: &GrayImage, u: u32, v: u32) -> Option<Self> {
        let inside = |x: u32, size: u32| RADIUS + 2 <= x as i32 && (x as i32) < size as i32 - RADIUS - 2;
        if !inside(u, image.width_px) || !inside(v, image.height_px) {
            return None;
        }
        let mut patch = Patch {
            template: [0.0; AREA],
            gradient_u: [0.0; AREA],
            gradient_v: [0.0; AREA],
            saturated: saturated(image, u, v),
            energy: 0.0,
            inverse: Matrix2::zeros(),
            spread: Matrix2::zeros(),
            bend: Vector2::zeros(),
        };
        for (i, (du, dv)) in offsets().enumerate() {
            let grey = |x: i32, y: i32| f32::from(image.at((u as i32 + x) as u32, (v as i32 + y) as u32));
            let (value, slope_u, slope_v) = spline_at_knot(|x, y| grey(du + x, dv + y));
            (patch.template[i], patch.gradient_u[i], patch.gradient_v[i]) = (value, slope_u, slope_v);
        }
        patch.finished()
    }

    /// Removes the mean, and from the gradients what gain and offset explain.
    fn finished(mut self) -> Option<Self> {
        remove_mean(&mut self.template);
        self.energy = dot(&self.template, &self.template);
        for gradient in [&mut self.gradient_u, &mut self.gradient_v] {
            remove_mean(gradient);
            let share = dot(gradient, &self.template) / self.energy;
            gradient.iter_mut().zip(&self.template).for_each(|(g, t)| *g -= share * t);
        }
        let (u, v) = (&self.gradient_u, &self.gradient_v);
        let m = Matrix2::new(dot(u, u), dot(u, v), dot(u, v), dot(v, v)).map(f64::from);
        self.inverse = m.try_inverse().filter(|inverse| inverse.iter().all(|x| x.is_finite()))?;
        self.spread = self.inverse * spread(u, v) * self.inverse;
        let squares = self.template.map(|t| t * t);
        self.bend = self.inverse * Vector2::new(dot(u, &squares), dot(v, &squares)).map(f64::from);
        (0.0 < self.energy && 0.0 < self.inverse.trace()).then_some(self)
    }

    /// Returns the variance in the worst direction for a unit variance of the grey levels, px².
    pub fn sensitivity(&self) -> f64 {
        self.inverse.trace()
    }

    /// Finds the window near `start`; `slope` is the affine map of its neighbourhood (pixels here by pixels of the reference). `None` where it
    /// leaves the image, moves farther than `reach_px`, is clipped or shows something else.
    pub fn find(
        &self,
        image: &GrayImage,
        start: Vector2<f64>,
        slope: &Matrix2<f64>,
        reach_px: f64,
    ) -> Option<Aligned> {
        let mut pixel = start;
        let mut window = [0.0; AREA];
        for _ in 0..STEPS {
            read(image, pixel, slope, &mut window)?;
            let (gain, _) = self.normalise(&mut window)?;
            let step = self.inverse * self.score(&window, gain).map(f64::from);
            pixel -= slope * step;
            if !((pixel - start).norm() < reach_px) {
                return None;
            }
            if step.norm() < SMALL_STEP_PX {
                break;
            }
        }
        read(image, pixel, slope, &mut window)?;
        let (gain, correlation) = self.normalise(&mut window)?;
        let variance = f64::from(self.unexplained(&window, gain));
        let saturated = saturated(image, pixel.x.round() as u32, pixel.y.round() as u32);
        if MOST_CLIPPED < saturated.abs_diff(self.saturated) {
            return None;
        }
        let covariance = slope * (self.spread * variance) * slope.transpose();
        let bent_px = slope * self.bend * -BEND;
        (LEAST_CORRELATION <= correlation).then_some(Aligned { pixel, covariance, bent_px })
    }

    /// Removes the mean; returns gain and correlation with the template.
    fn normalise(&self, window: &mut Window) -> Option<(f32, f32)> {
        remove_mean(window);
        let (both, own) = (dot(window, &self.template), dot(window, window));
        let gain = both / self.energy;
        (0.0 < gain && 0.0 < own).then(|| (gain, both / (self.energy * own).sqrt()))
    }

    /// Returns Σ ∇T (I/a − T).
    fn score(&self, window: &Window, gain: f32) -> Vector2<f32> {
        // Gradients are orthogonal to the template, which therefore drops out.
        Vector2::new(dot(window, &self.gradient_u), dot(window, &self.gradient_v)) / gain
    }

    /// Returns the variance of I/a − T over the window, corrected for the four numbers fitted.
    fn unexplained(&self, window: &Window, gain: f32) -> f32 {
        let rest = dot(window, window) / (gain * gain) - self.energy;
        rest.max(0.0) / (AREA - 4) as f32
    }
}

/// Returns W = Σ (Sᵀ∇T)(Sᵀ∇T)ᵀ/¼, the covariance of Σ ∇T I for white noise of the pixels and unit variance of a smoothed grey level. S, the
/// spline at its knots, smooths by [1 4 1]/6 along rows and columns and leaves a quarter of the noise's variance.
fn spread(u: &Window, v: &Window) -> Matrix2<f64> {
    let (u, v) = (smeared(u), smeared(v));
    let dot = |a: &Smeared, b: &Smeared| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>() / 0.25;
    Matrix2::new(dot(&u, &u), dot(&u, &v), dot(&u, &v), dot(&v, &v))
}

const WIDE: usize = SIDE + 2;
type Smeared = [f32; WIDE * WIDE];

/// Returns a window spread over its pixels and their neighbours by [1 4 1]/6.
fn smeared(window: &Window) -> Smeared {
    let weights = [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0];
    let mut out = [0.0; WIDE * WIDE];
    for (i, value) in window.iter().enumerate() {
        let first = i / SIDE * WIDE + i % SIDE;
        for (j, by_row) in weights.iter().enumerate() {
            for (k, by_column) in weights.iter().enumerate() {
                out[first + j * WIDE + k] += value * by_row * by_column;
            }
        }
    }
    out
}

/// Returns the number of pixels of a window that are completely black or white.
fn saturated(image: &GrayImage, u: u32, v: u32) -> usize {
    let is_clipped = |(du, dv): &(i32, i32)| {
        let grey = image.at((u as i32 + du) as u32, (v as i32 + dv) as u32);
        grey == 0 || grey == u8::MAX
    };
    offsets().filter(is_clipped).count()
}

fn offsets() -> impl Iterator<Item = (i32, i32)> {
    (-RADIUS..=RADIUS).flat_map(|dv| (-RADIUS..=RADIUS).map(move |du| (du, dv)))
}

fn dot(a: &Window, b: &Window) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn remove_mean(window: &mut Window) {
    let mean = window.iter().sum::<f32>() / AREA as f32;
    window.iter_mut().for_each(|x| *x -= mean);
}

/// Returns value and slopes of the spline at a pixel's centre.
fn spline_at_knot(grey: impl Fn(i32, i32) -> f32) -> (f32, f32, f32) {
    let smooth = |a: f32, b: f32, c: f32| (a + 4.0 * b + c) / 6.0;
    let row = |y: i32| smooth(grey(-1, y), grey(0, y), grey(1, y));
    let column = |x: i32| smooth(grey(x, -1), grey(x, 0), grey(x, 1));
    (smooth(row(-1), row(0), row(1)), 0.5 * (column(1) - column(-1)), 0.5 * (row(1) - row(-1)))
}

/// Returns the weights of the four knots around a position a fraction `f` after the second.
#[inline]
fn weights(f: f32) -> [f32; 4] {
    let (g, f2) = (1.0 - f, f * f);
    let f3 = f2 * f;
    [g * g * g / 6.0, (4.0 - 6.0 * f2 + 3.0 * f3) / 6.0, (1.0 + 3.0 * (f + f2 - f3)) / 6.0, f3 / 6.0]
}

/// A window with less distortion than this, px at its rim, is read without it: windows are symmetric, so that the error does not shift them.
const NOT_DRAWN_PX: f64 = 0.05;

/// Reads the window around `pixel`; `None` where it leaves the image.
fn read(image: &GrayImage, pixel: Vector2<f64>, slope: &Matrix2<f64>, window: &mut Window) -> Option<()> {
    let drawn = (slope - Matrix2::identity()).abs();
    let rim = f64::from(RADIUS);
    let reach = rim * (1.0 + drawn.row_sum().max().max(drawn.column_sum().max()));
    let inside = |x: f64, size: u32| reach + 2.0 < x && x < f64::from(size) - reach - 3.0;
    if !inside(pixel.x, image.width_px) || !inside(pixel.y, image.height_px) {
        return None;
    }
    match rim * drawn.max() < NOT_DRAWN_PX {
        true => read_straight(image, pixel, window),
        false => read_drawn(image, pixel, slope, window),
    }
    Some(())
}

/// Interpolates along rows first, then down: all samples have the same fraction.
fn read_straight(image: &GrayImage, pixel: Vector2<f64>, window: &mut Window) {
    let (left, top) = (pixel.x.floor(), pixel.y.floor());
    let (wu, wv) = (weights((pixel.x - left) as f32), weights((pixel.y - top) as f32));
    let first_u = (left as i32 - RADIUS - 1) as usize;
    let first_v = (top as i32 - RADIUS - 1) as usize;
    let mut rows = [[0.0f32; SIDE]; SIDE + 3];
    for (dv, row) in rows.iter_mut().enumerate() {
        let at = (first_v + dv) * image.width_px as usize + first_u;
        let mut grey = [0.0f32; SIDE + 3];
        grey.iter_mut().zip(&image.data[at..at + SIDE + 3]).for_each(|(g, x)| *g = f32::from(*x));
        for (i, value) in row.iter_mut().enumerate() {
            *value = wu[0] * grey[i] + wu[1] * grey[i + 1] + wu[2] * grey[i + 2] + wu[3] * grey[i + 3];
        }
    }
    for (dv, out) in window.chunks_exact_mut(SIDE).enumerate() {
        for (i, value) in out.iter_mut().enumerate() {
            *value = (0..4).map(|k| wv[k] * rows[dv + k][i]).sum();
        }
    }
}

/// Interpolates each sample with a fraction of its own.
fn read_drawn(image: &GrayImage, pixel: Vector2<f64>, slope: &Matrix2<f64>, window: &mut Window) {
    let stride = image.width_px as usize;
    for (value, (du, dv)) in window.iter_mut().zip(offsets()) {
        let at = pixel + slope * Vector2::new(f64::from(du), f64::from(dv));
        let (left, top) = (at.x.floor(), at.y.floor());
        let (wu, wv) = (weights((at.x - left) as f32), weights((at.y - top) as f32));
        let first = (top as usize - 1) * stride + left as usize - 1;
        *value = (0..4)
            .map(|k| {
                let row = &image.data[first + k * stride..first + k * stride + 4];
                wv[k] * row.iter().zip(&wu).map(|(x, w)| f32::from(*x) * w).sum::<f32>()
            })
            .sum();
    }
}
