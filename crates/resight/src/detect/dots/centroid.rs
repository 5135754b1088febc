//! Measures the position of a dot: the centroid of the coverage around a region, its standard deviation, and the dot's shape.
//!
//! Notation: I grey, b(x) plane through the surroundings, f(x) plane through the inside, w = (I − b)/(f − b) the part of
//! a pixel that the dot covers, C = f − b the contrast, S = Σw the area; docs/math/dots.md eqs. (1)–(6).
//! A symmetric blur leaves ∑w·x where it is, so no model of the edge is needed. Of dark dots f − b is proportional to b, because light falls
//! on ink and paper alike; dots without a flat inside (lamps) take it constant. Pixels deep inside count 1, those far outside 0: they carry noise and no information.

use super::components::Component;
use super::threshold::{DARK, LIGHT};
use crate::GrayImage;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use resight_core::Pixel;

/// A dot: its position, the uncertainty of that, and its shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Centroid of its image, pixels (not corrected for perspective).
    pub centroid: Pixel,
    /// Standard deviation of each coordinate of the centroid, px.
    pub sigma_px: f64,
    /// Second central moments of its image, px²; for a disc seen frontally the diagonal is radius²/4, plus the contributions of blur and of the
    /// pixel's own width.
    pub moments_px2: Matrix2<f64>,
    /// Standard deviation of each entry of the moments by noise, px².
    pub moments_sigma_px2: f64,
    /// Grey of the dot minus grey around it: positive for light dots.
    pub contrast: f64,
}

impl Dot {
    /// Semi-axes of the ellipse of equal moments, px, longer first.
    pub fn semi_axes_px(&self) -> [f64; 2] {
        let e = self.moments_px2.symmetric_eigenvalues();
        let axis = |x: f64| 2.0 * x.max(0.0).sqrt();
        [axis(e[0].max(e[1])), axis(e[0].min(e[1]))]
    }
}

/// Width of the ring of surroundings, px.
const RING_PX: f64 = 3.0;
/// Dots with a larger standard deviation are useless for a pose, and would match anything.
const MAX_SIGMA_PX: f64 = 0.3;
/// Foreign pixels in the ring reach into the rim of the dot too: error of the centroid, px, for a completely foreign ring.
const FOREIGN_PX: f64 = 0.15;
/// Least half width of the band around the edge, px.
const LEAST_MARGIN_PX: f64 = 2.0;
/// Half width of the band in standard deviations of the blur.
const EDGE_BLURS: f64 = 2.5;
/// Recentring steps of the window; the shift shrinks about tenfold each.
const STEPS: usize = 4;
/// Below this shift another step changes the centroid by less than 0.002 px.
const SETTLED_PX: f64 = 0.02;

/// The window: an ellipse with semi-axes along given directions.
#[derive(Clone, Copy)]
struct Window {
    centre: Pixel,
    /// Unit direction of the first axis.
    along: Vector2<f64>,
    semi_px: [f64; 2],
    /// Half the width of the band around the edge in which pixels are mixed.
    margin_px: f64,
}

impl Window {
    fn of(moments: &Matrix2<f64>, centre: Pixel) -> Window {
        let eigen = moments.symmetric_eigen();
        let semi = |i: usize| 2.0 * eigen.eigenvalues[i].max(0.02).sqrt();
        let semi_px = [semi(0), semi(1)];
        // It allows for a blur of σ ≤ 1.5 px.
        let margin_px = (0.8 * semi_px[0].min(semi_px[1])).clamp(LEAST_MARGIN_PX, 4.0);
        Window { centre, along: eigen.eigenvectors.column(0).into(), semi_px, margin_px }
    }

    /// Narrows the band to a measured edge, dots.md eq. (6b): pixels beyond it carry noise and no information.
    fn narrow(&mut self, edge_sum_px2: f64) {
        let [a, b] = self.semi_px;
        let perimeter_px = std::f64::consts::PI * (3.0 * (a + b) - ((3.0 * a + b) * (a + 3.0 * b)).sqrt());
        let blur_px = std::f64::consts::PI.sqrt() * edge_sum_px2 / perimeter_px;
        let needed_px = EDGE_BLURS * blur_px + 0.5;
        self.margin_px = self.margin_px.min(needed_px.max(LEAST_MARGIN_PX));
    }

    /// Returns whether `x` (from the centre) is inside the ellipse enlarged by `by_px`; nothing is inside an ellipse that has shrunk to nothing.
    fn holds(&self, x: &Vector2<f64>, by_px: f64) -> bool {
        let (a, b) = (self.semi_px[0] + by_px, self.semi_px[1] + by_px);
        if a <= 0.0 || b <= 0.0 {
            return false;
        }
        let along = x.dot(&self.along) / a;
        let across = x.perp(&self.along) / b;
        along * along + across * across <= 1.0
    }
}

/// A plane of grey fitted to some pixels: value = p · (x, y, 1), x from the window's centre.
struct GreyPlane {
    p: Vector3<f64>,
    /// Standard deviation of the pixels around it.
    sigma: f64,
    /// Σx² + Σy² over its pixels, which determines the accuracy of its slope.
    spread: f64,
    /// Share of the pixels that did not fit.
    foreign: f64,
}

/// Fits a plane to the pixels near their median, then again to those within 3 σ of it, so that an edge of the sheet or the light of a neighbour
/// in part of the ring does not tilt it.
fn fit_plane(pixels: &[(Vector2<f64>, f64)]) -> Option<GreyPlane> {
    let middle = median(pixels.iter().map(|p| p.1))?;
    let spread = median(pixels.iter().map(|p| (p.1 - middle).abs()))?;
    // 1.4826 MAD is σ; four of them, and a step of grey for the rounding, leave room for a gradient.
    let first =
        GreyPlane { p: Vector3::new(0.0, 0.0, middle), sigma: 2.0 * spread + 0.7, spread: 1.0, foreign: 0.0 };
    let second = fit_near(pixels, &first)?;
    fit_near(pixels, &second)
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
}

/// Fits a plane by least squares to the pixels within 3 σ of an earlier plane.
fn fit_near(pixels: &[(Vector2<f64>, f64)], earlier: &GreyPlane) -> Option<GreyPlane> {
    let (mut n, mut sums, mut rhs) = (0.0, Matrix3::zeros(), Vector3::zeros());
    let near = |p: &&(Vector2<f64>, f64)| (p.1 - earlier.at(&p.0)).abs() <= 3.0 * earlier.sigma.max(0.5);
    for (x, g) in pixels.iter().filter(near) {
        let row = Vector3::new(x.x, x.y, 1.0);
        sums += row * row.transpose();
        rhs += row * *g;
        n += 1.0;
    }
    if n < 6.0 || n < 0.5 * pixels.len() as f64 {
        return None;
    }
    let p = sums.cholesky()?.solve(&rhs);
    let mut plane = GreyPlane { p, sigma: 0.0, spread: sums[(0, 0)] + sums[(1, 1)], foreign: 0.0 };
    let squares: f64 = pixels.iter().filter(near).map(|(x, g)| (g - plane.at(x)).powi(2)).sum();
    plane.sigma = (squares / (n - 3.0)).sqrt();
    plane.foreign = 1.0 - n / pixels.len() as f64;
    Some(plane)
}

impl GreyPlane {
    fn at(&self, x: &Vector2<f64>) -> f64 {
        self.p.x * x.x + self.p.y * x.y + self.p.z
    }
}

/// Pixels of a window, sorted by their use.
#[derive(Default)]
pub(super) struct Scratch {
    ring: Vec<(Vector2<f64>, f64)>,
    band: Vec<(Vector2<f64>, f64)>,
    inside: Vec<(Vector2<f64>, f64)>,
}

/// Measures one region; `None` when it is not the image of a disc, or its surroundings leave the image.
pub(super) fn measure(
    image: &GrayImage,
    classes: &[u8],
    component: &Component,
    noise_sigma: f64,
    scratch: &mut Scratch,
) -> Option<Dot> {
    let [uu, uv, vv] = component.moments;
    let mut window =
        Window::of(&Matrix2::new(uu, uv, uv, vv), Pixel::new(component.mean[0], component.mean[1]));
    let mut dot = None;
    for step in 0..STEPS {
        let foreign = scratch.collect(image, classes, component.class, &window)?;
        // Another dot's light in the window pulls the centroid; a speck of noise does not.
        if 0.03 < foreign {
            return None;
        }
        let (found, edge_sum_px2) = weigh(scratch, &window, component, noise_sigma)?;
        let shift = (found.centroid - window.centre).norm();
        if 1.0 + 0.3 * window.semi_px[0].min(window.semi_px[1]) < shift {
            return None;
        }
        window.centre = found.centroid;
        dot = Some(found);
        if step != 0 && shift < SETTLED_PX {
            break;
        }
        if let Some(edge_sum_px2) = edge_sum_px2.filter(|_| step == 0) {
            window.narrow(edge_sum_px2);
        }
    }
    dot.filter(|d| is_disc(d, component))
}

impl Scratch {
    /// Sorts the pixels around a window, and returns the share of the window's rim that belongs to another region of the same class; `None` when
    /// the ring leaves the image.
    fn collect(&mut self, image: &GrayImage, classes: &[u8], class: u8, window: &Window) -> Option<f64> {
        self.ring.clear();
        self.band.clear();
        self.inside.clear();
        let margin = window.margin_px;
        let reach = window.semi_px[0].max(window.semi_px[1]) + margin + RING_PX;
        let low = window.centre.map(|x| (x - reach).floor());
        let high = window.centre.map(|x| (x + reach).ceil());
        let (width, height) = (image.width_px as f64, image.height_px as f64);
        if low.x < 0.0 || low.y < 0.0 || width <= high.x || height <= high.y {
            return None;
        }
        let (mut foreign, mut rim) = (0.0, 1.0);
        for v in low.y as usize..=high.y as usize {
            for u in low.x as usize..=high.x as usize {
                let x = Pixel::new(u as f64, v as f64) - window.centre;
                if !window.holds(&x, margin + RING_PX) {
                    continue;
                }
                let i = v * image.width_px as usize + u;
                let pixel = (x, image.data[i] as f64);
                if !window.holds(&x, margin) {
                    if classes[i] != class {
                        self.ring.push(pixel);
                    }
                } else if window.holds(&x, -margin) {
                    self.inside.push(pixel);
                } else {
                    if !window.holds(&x, 0.75 * margin) {
                        rim += 1.0;
                        foreign += f64::from(u8::from(classes[i] == class));
                    }
                    self.band.push(pixel);
                }
            }
        }
        Some(foreign / rim)
    }
}

/// The contrast between inside and outside, and the conversion of pixels to coverage.
struct Coverage {
    around: GreyPlane,
    /// Plane of the inside where there is one.
    inside: Option<GreyPlane>,
    contrast: f64,
    /// Whether ink and paper have the same light, so that the contrast varies as the surroundings do.
    is_print: bool,
}

impl Coverage {
    fn of(scratch: &Scratch, component: &Component) -> Option<Coverage> {
        let around = fit_plane(&scratch.ring)?;
        let inside = if 12 <= scratch.inside.len() { fit_plane(&scratch.inside) } else { None };
        let sign = if component.class == LIGHT { 1.0 } else { -1.0 };
        let largest = |best: f64, (x, g): &(Vector2<f64>, f64)| best.max(sign * (g - around.at(x)));
        let contrast = match &inside {
            Some(f) => f.p.z - around.p.z,
            None => sign * scratch.band.iter().chain(&scratch.inside).fold(0.0, largest),
        };
        let is_print = inside.is_some() && component.class == DARK;
        (0.0 < sign * contrast).then_some(Coverage { around, inside, contrast, is_print })
    }

    fn of_pixel(&self, x: &Vector2<f64>, grey: f64) -> f64 {
        let b = self.around.at(x);
        if self.is_print {
            return (grey - b) / (self.contrast * (b / self.around.p.z).max(0.25));
        }
        let c = self.inside.as_ref().map_or(self.contrast, |f| f.at(x) - b);
        // The two planes may cross far from the dot; there the contrast of the centre is the better guess.
        let c = if c * self.contrast <= 0.25 * self.contrast * self.contrast { self.contrast } else { c };
        (grey - b) / c
    }
}

/// Sums over the weighed pixels.
#[derive(Default)]
struct Sums {
    s: f64,
    first: Vector2<f64>,
    second: Matrix2<f64>,
    /// Σ|x|² and Σ|x|⁴ over the noisy pixels.
    x2: f64,
    x4: f64,
    /// Σ(1 − w)|x|² and Σw|x|²: how the slopes of the planes around and inside enter.
    around: f64,
    inside: f64,
    /// Σw(1 − w) over the band.
    edge: f64,
}

impl Sums {
    fn add(&mut self, w: f64, x: &Vector2<f64>) {
        self.s += w;
        self.first += x * w;
        self.second += x * x.transpose() * w;
    }

    fn add_noisy(&mut self, w: f64, x: &Vector2<f64>, flat: bool) {
        self.edge += w * (1.0 - w);
        let r2 = x.norm_squared();
        self.x2 += r2;
        self.x4 += r2 * r2;
        self.around += if flat { (1.0 - w) * r2 } else { r2 };
        self.inside += if flat { w * r2 } else { 0.0 };
    }
}

/// dots.md eqs. (2)–(6b): the dot, and Σw(1 − w) of its edge where it has a flat inside.
fn weigh(
    scratch: &Scratch,
    window: &Window,
    component: &Component,
    noise_sigma: f64,
) -> Option<(Dot, Option<f64>)> {
    let coverage = Coverage::of(scratch, component)?;
    let flat = coverage.inside.is_some();
    let mut sums = Sums::default();
    for (x, grey) in scratch.band.iter().chain(if flat { &[][..] } else { &scratch.inside[..] }) {
        let w = coverage.of_pixel(x, *grey);
        sums.add(w, x);
        sums.add_noisy(w, x, flat);
    }
    if flat {
        scratch.inside.iter().for_each(|(x, _)| sums.add(1.0, x));
    }
    if !(1.0 < sums.s) {
        return None;
    }
    let mean = sums.first / sums.s;
    let slope = coverage.inside.as_ref().filter(|_| !coverage.is_print);
    let of_inside = slope.map_or(0.0, |f| sums.inside.powi(2) / f.spread);
    let slopes = sums.around.powi(2) / coverage.around.spread + of_inside;
    let noise = coverage.noise(noise_sigma) / (coverage.contrast * sums.s).abs();
    let foreign = FOREIGN_PX * coverage.around.foreign;
    let grey_noise = coverage.noise(noise_sigma) / coverage.contrast;
    let edge_px2 = sums.edge + scratch.band.len() as f64 * grey_noise * grey_noise;
    let dot = Dot {
        centroid: window.centre + mean,
        sigma_px: (noise * noise * 0.5 * (sums.x2 + slopes) + foreign * foreign).sqrt(),
        moments_px2: sums.second / sums.s - mean * mean.transpose(),
        moments_sigma_px2: noise * (0.5 * sums.x4).sqrt(),
        contrast: coverage.contrast,
    };
    Some((dot, flat.then_some(edge_px2)))
}

impl Coverage {
    /// Returns the noise of a pixel: the larger of the estimates from the whole image and from the surroundings of this dot.
    fn noise(&self, image_sigma: f64) -> f64 {
        let inside = self.inside.as_ref().map_or(0.0, |f| f.sigma);
        image_sigma.max(self.around.sigma).max(inside)
    }
}

/// Returns by how much blurs up to σ = 2 px lengthen a semi-axis that is measured from moments.
fn widened(axis_px: f64) -> f64 {
    const MOST_BLUR_PX: f64 = 2.0;
    let sharp_px2 = axis_px * axis_px - 4.0 * MOST_BLUR_PX * MOST_BLUR_PX;
    axis_px / sharp_px2.max(0.25 * axis_px * axis_px).sqrt()
}

/// Returns whether the moments are positive and the region is as large as their ellipse (with a tolerance for the rounding of its rim).
fn is_disc(dot: &Dot, component: &Component) -> bool {
    let [long, short] = dot.semi_axes_px();
    let area = std::f64::consts::PI * long * short;
    // A blurred spot is wider than its half-height region: up to 2.9 times in area for a Gaussian (σ² against 2 ln 2 σ²/4).
    let most = if short < 6.0 { 3.5 } else { (1.08 * widened(long) * widened(short)).max(1.25) };
    // Structured surroundings (text, texture) make sigma large; then neither position nor shape is meaningful.
    let clean = dot.sigma_px < MAX_SIGMA_PX && dot.moments_sigma_px2 < 0.25 * dot.moments_px2.trace();
    clean
        && 0.2 < short
        && long < 6.0 * short
        && component.area < 1.3 * area + 4.0
        && area < most * component.area + 6.0
}
