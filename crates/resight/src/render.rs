//! Renders images of targets from a known pose: the ground truth for tests, and the images of `demo`.
//!
//! For each pixel: bearing → nearest plane (or ball) on it → grey level of the pattern there, averaged over sub-pixels where the neighbourhood
//! is not uniform; then clutter, illumination, blur and noise. Any camera model works, because only `Camera::bearing` is used. The light is
//! linear and the pixel response a box: there is no gamma, motion blur or rolling shutter.

pub mod clutter;
pub mod family;
mod finish;
mod pattern;
pub mod ink;

use crate::GrayImage;
use pattern::Patch;
use resight_core::target::Feature;
use resight_core::{Camera, Pixel, Point, Pose, Target};
use thiserror::Error;

pub use clutter::Blob;
pub use finish::Pcg;

/// Why no image can be rendered.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The camera has no image size.
    #[error("the camera has no image size; set width_px and height_px")]
    NoImageSize,
    /// More pixels than an image may have.
    #[error("image of {width_px}×{height_px} px is too large; the limit is 64 Mpx")]
    TooLarge {
        /// Columns asked for.
        width_px: u32,
        /// Rows asked for.
        height_px: u32,
    },
    /// There is no code table of this name.
    #[error(
        "unknown tag family {family:?}; known are tag36h11, tag25h9, tagStandard41h12, … and OpenCV's DICT_ names"
    )]
    UnknownFamily {
        /// The name given.
        family: String,
    },
    /// The family has no such id.
    #[error("tag family {family} has ids 0 to {last}, {id} asked for")]
    UnknownId {
        /// Family name.
        family: String,
        /// Id asked for.
        id: u32,
        /// Largest id of the family.
        last: u32,
    },
    /// Invalid dimensions of a target.
    #[error(transparent)]
    Target(#[from] resight_core::Error),
    /// A kind of target without an appearance.
    #[error("targets of kind {kind} cannot be drawn")]
    Unsupported {
        /// The kind.
        kind: &'static str,
    },
}

/// The scene in front of the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The targets; where two overlap the nearer one is visible.
    pub placed: Vec<Placed>,
    /// Grey of everything else, 0 to 255.
    pub background: f64,
    /// Spots on the background, behind every target, drawn in order.
    pub clutter: Vec<Blob>,
}

/// A target with its pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// The target.
    pub target: Target,
    /// Where it is.
    pub cam_from_target: Pose,
    /// Its appearance.
    pub style: Style,
}

/// The appearance of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// Grey level of the print (or of the lamps), 0 to 255.
    pub ink: f64,
    /// Grey level of the sheet, 0 to 255; `None` for no sheet: the background is visible between dots (boards then use `255 - ink`).
    pub paper: Option<f64>,
    /// Width of the empty rim around the pattern, metres; by default a tenth of the pattern's larger side.
    pub margin_m: Option<f64>,
    /// Diameter of dots, metres; by default a third of the smallest distance between two dots, or what a circle grid states.
    pub dot_diameter_m: Option<f64>,
    /// Width of the black frame of tags in bits; by default 2 for an AprilGrid (as Kalibr prints it), 1 for all others.
    pub tag_border_bits: Option<u32>,
}

impl Default for Style {
    /// Returns black on white paper.
    fn default() -> Self {
        Style { ink: 20.0, paper: Some(235.0), margin_m: None, dot_diameter_m: None, tag_border_bits: None }
    }
}

impl Style {
    /// Returns light dots without a sheet, like lamps or retro-reflectors.
    pub fn lamps(diameter_m: f64) -> Self {
        Style { ink: 235.0, paper: None, dot_diameter_m: Some(diameter_m), ..Style::default() }
    }
}

/// The effects of lens, light and sensor on the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finish {
    /// Standard deviation of the Gaussian blur, px.
    pub blur_sigma_px: f64,
    /// Standard deviation of the noise of each pixel, grey levels.
    pub noise_sigma: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// Relative change of the illumination from the left edge to the right and from the top to the bottom;
    /// `[0.5, 0.0]`: 25 % darker at the left, 25 % lighter at the right.
    pub illumination_gradient: [f64; 2],
    /// Share of the light that the lens loses in the corners of the image, proportional to the square of the distance from the centre.
    pub vignetting: f64,
    /// Number of sub-pixels along each side of a pixel that is not uniform.
    pub samples_per_axis: u32,
}

impl Default for Finish {
    /// Returns a good industrial camera: blur 0.7 px, noise 2 grey levels.
    fn default() -> Self {
        Finish {
            blur_sigma_px: 0.7,
            noise_sigma: 2.0,
            seed: 1,
            illumination_gradient: [0.0; 2],
            vignetting: 0.0,
            samples_per_axis: 4,
        }
    }
}

impl Scene {
    /// Returns a scene with one target on a mid-grey background.
    pub fn of(target: Target, cam_from_target: Pose, style: Style) -> Self {
        let placed = vec![Placed { target, cam_from_target, style }];
        Scene { placed, background: 120.0, clutter: Vec::new() }
    }
}

/// Renders the scene as seen by the camera. Pixels outside the camera's valid field are black.
pub fn render(scene: &Scene, camera: &Camera, finish: &Finish) -> Result<GrayImage, RenderError> {
    let size = camera.size.ok_or(RenderError::NoImageSize)?;
    let (width, height) = (size.width_px as usize, size.height_px as usize);
    if 64_000_000 < width as u64 * height as u64 {
        return Err(RenderError::TooLarge { width_px: size.width_px, height_px: size.height_px });
    }
    let mut patches = Vec::new();
    for placed in &scene.placed {
        patches.extend(pattern::patches(placed)?);
    }
    let mut grey = vec![scene.background as f32; width * height];
    clutter::draw(&scene.clutter, &mut grey, width, height);
    let small = small_dots(&patches, camera, width, height);
    trace(&patches, camera, finish.samples_per_axis.clamp(1, 64), &small, &mut grey, width);
    finish::illuminate(&mut grey, width, finish.illumination_gradient);
    finish::vignette(&mut grey, width, finish.vignetting);
    finish::blur(&mut grey, width, finish.blur_sigma_px);
    let data = finish::expose(&grey, finish.noise_sigma, finish.seed);
    Ok(GrayImage { width_px: size.width_px, height_px: size.height_px, data })
}

/// Returns the true position of each feature of a placed target, if it is inside the image. Occlusion is not checked.
pub fn true_pixels(placed: &Placed, camera: &Camera) -> Vec<(Feature, Pixel)> {
    let inside = |p: &Pixel| match camera.size {
        None => true,
        Some(s) => {
            let range = |x: f64, n: u32| -0.5 <= x && x <= n as f64 - 0.5;
            range(p.x, s.width_px) && range(p.y, s.height_px)
        }
    };
    let pixel = |feature: Feature| {
        let x_in_target = placed.target.point(feature)?.position;
        camera.project(&(placed.cam_from_target * x_in_target)).filter(inside)
    };
    placed.target.features().into_iter().filter_map(|f| pixel(f).map(|p| (f, p))).collect()
}

/// Marks the pixels around dots so small that testing a pixel's corners and centre could miss them.
fn small_dots(patches: &[Patch], camera: &Camera, width: usize, height: usize) -> Vec<bool> {
    let mut marked = vec![false; width * height];
    for (centre, radius_m) in patches.iter().flat_map(Patch::dots_in_cam) {
        let Some(p) = camera.project(&centre) else { continue };
        let edge = camera.project(&(centre + Point::new(radius_m, 0.0, 0.0)));
        let reach = edge.map_or(3.0, |e| (e - p).norm());
        if 4.0 < reach {
            continue;
        }
        let reach = reach.ceil() + 2.0;
        let span =
            |x: f64, n: usize| ((x - reach).max(0.0) as usize)..(((x + reach).max(0.0) as usize + 1).min(n));
        for v in span(p.y, height) {
            for u in span(p.x, width) {
                marked[v * width + u] = true;
            }
        }
    }
    marked
}

/// Returns the rays through the corners of one row of pixels; `None` outside the camera's field.
fn corner_rays(camera: &Camera, width: usize, v: f64) -> Vec<Option<Point>> {
    (0..=width).map(|u| camera.bearing(&Pixel::new(u as f64 - 0.5, v)).ok().map(|b| b.into_inner())).collect()
}

fn trace(patches: &[Patch], camera: &Camera, samples: u32, small: &[bool], grey: &mut [f32], width: usize) {
    if width == 0 {
        return;
    }
    let look = |ray: &Option<Point>| ray.as_ref().map(|r| hit(patches, r));
    let mut top = corner_rays(camera, width, -0.5);
    let mut top_seen: Vec<_> = top.iter().map(look).collect();
    for (v, row) in grey.chunks_mut(width).enumerate() {
        let bottom = corner_rays(camera, width, v as f64 + 0.5);
        let bottom_seen: Vec<_> = bottom.iter().map(look).collect();
        for (u, pixel) in row.iter_mut().enumerate() {
            let (Some(a), Some(b), Some(c), Some(d)) = (top[u], top[u + 1], bottom[u], bottom[u + 1]) else {
                *pixel = 0.0;
                continue;
            };
            let middle = hit(patches, &(a + b + c + d));
            let around = [top_seen[u], top_seen[u + 1], bottom_seen[u], bottom_seen[u + 1]];
            if !small[v * width + u] && around.iter().all(|s| *s == Some(middle)) {
                *pixel = middle.map_or(*pixel, |value| value as f32);
            } else {
                *pixel = average(patches, &[a, b, c, d], samples, *pixel);
            }
        }
        (top, top_seen) = (bottom, bottom_seen);
    }
}

/// Averages over `samples`² rays, interpolated bilinearly between those of the pixel's corners: over one pixel a bearing bends by less than
/// (1/f)²/8, about 1e-4 px at f = 1000 px.
fn average(patches: &[Patch], [a, b, c, d]: &[Point; 4], samples: u32, behind: f32) -> f32 {
    let mut sum = 0.0;
    for i in 0..samples {
        let y = (i as f64 + 0.5) / samples as f64;
        let (left, right) = (a * (1.0 - y) + c * y, b * (1.0 - y) + d * y);
        for j in 0..samples {
            let x = (j as f64 + 0.5) / samples as f64;
            sum += hit(patches, &(left * (1.0 - x) + right * x)).unwrap_or(behind as f64);
        }
    }
    (sum / (samples * samples) as f64) as f32
}

/// Returns the grey level of the nearest object along a ray from the camera centre.
fn hit(patches: &[Patch], ray: &Point) -> Option<f64> {
    let mut nearest = 0.0;
    let mut value = None;
    for patch in patches {
        match patch.hit(ray) {
            Some((nearness, grey)) if nearest < nearness => (nearest, value) = (nearness, Some(grey)),
            _ => {}
        }
    }
    value
}
