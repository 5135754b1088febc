//! Saddle points of an image: where two black squares meet corner to corner.

use super::corner::refine_corner;
use super::{sigma, stop};
use crate::GrayImage;
use crate::parallel::on_all_cores;
use calib_targets_chessboard::{ChessCorner, detect_corner_frame};
use calib_targets_core::{
    DetectorConfig, GrayImageView, ImageRefiner, NoiseLevel, Uncertainty, default_chess_config,
};
use resight_core::Pixel;

/// A saddle point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Joint {
    pub pixel: Pixel,
    pub sigma_px: f64,
}

impl Joint {
    pub fn new(c: &ChessCorner) -> Self {
        let library_px = c.position_covariance.map(|k| k.sigma_max_px() as f64);
        Joint {
            pixel: Pixel::new(c.position.x as f64, c.position.y as f64),
            sigma_px: sigma::saddle_px(library_px),
        }
    }
}

/// The window in which a corner is refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CornerWindow {
    /// No window: the print around a corner is fitted to the image, 4 to 7 px to each side.
    #[default]
    Clear,
    /// A window of this many pixels to each side, whatever is in it: for comparison with OpenCV's `cornerSubPix` and its `winSize`.
    Half(u32),
}

impl Joint {
    /// Refines the joint in a window of `half_px` pixels to each side, whatever is in it; returns it unchanged when that fails.
    pub fn refined(self, image: &GrayImage, half_px: u32) -> Self {
        // In a fixed window the residual says nothing about this corner alone, so that every corner has the same sigma.
        let refined = refine_corner(image, &self.pixel, half_px, half_px as f64);
        refined.map_or(self, |c| Joint { pixel: c.pixel, sigma_px: sigma::WINDOW_PX })
    }
}

/// Configures ChESS corners refined as saddle points: 3–5 times more accurate than the library's default centre of mass (0.03 px instead of 0.09
/// px on rendered boards), with a covariance from the measured image noise.
pub(super) fn corner_config() -> DetectorConfig {
    default_chess_config()
        .with_refiner(ImageRefiner::saddle_point())
        .with_uncertainty(Uncertainty::Propagated { noise: NoiseLevel::Estimate })
}

/// Smallest image edge, pixels: the corner detector's ring, its peak search and the fit windows need 20 px, which the library does not check.
const MIN_EDGE_PX: u32 = 32;

/// Converts an image to the library's type; `None` when it is too small or the buffer does not have the stated size.
pub(super) fn view(image: &GrayImage) -> Option<GrayImageView<'_>> {
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let large = MIN_EDGE_PX <= image.width_px && MIN_EDGE_PX <= image.height_px;
    let whole = large && width * height == image.data.len();
    whole.then_some(GrayImageView { width, height, data: &image.data })
}

/// Finds every saddle point of the image.
pub(super) fn joints(image: &GrayImage) -> Vec<Joint> {
    corners(image, &corner_config()).iter().map(Joint::new).collect()
}

/// Largest image, in pixels, in which corners are searched for at once: the detector uses four bytes and more for each pixel.
const WHOLE_PIXELS: usize = 16_000_000;
/// Number of pixels in a strip of a larger image.
const STRIP_PIXELS: usize = 4_000_000;
/// Number of rows by which strips overlap: more than the detector's ring, its peak search and its fit windows reach.
const OVERLAP_ROWS: usize = 32;
/// Smallest number of rows of a strip: in a very wide image most of the work would otherwise be in the overlap.
const STRIP_ROWS: usize = 128;

/// The library distributes its work over threads.
fn corners_of(image: &GrayImageView, config: &DetectorConfig) -> Vec<ChessCorner> {
    on_all_cores(|| detect_corner_frame(image, config).corners)
}

/// Returns the corners that the library finds, in a large image strip by strip.
pub(super) fn corners(image: &GrayImage, config: &DetectorConfig) -> Vec<ChessCorner> {
    let Some(whole) = view(image).filter(|_| !stop::is_stopped()) else { return Vec::new() };
    #[cfg(test)]
    super::work::count(image.data.len());
    if image.data.len() <= WHOLE_PIXELS {
        return corners_of(&whole, config);
    }
    let rows = (STRIP_PIXELS / whole.width).max(STRIP_ROWS);
    let mut all = Vec::new();
    for first in (0..whole.height).step_by(rows) {
        let end = (first + rows).min(whole.height);
        let (from, to) = (first.saturating_sub(OVERLAP_ROWS), (end + OVERLAP_ROWS).min(whole.height));
        if stop::is_stopped() {
            break;
        }
        let data = &image.data[from * whole.width..to * whole.width];
        let strip = GrayImageView { width: whole.width, height: to - from, data };
        for mut corner in corners_of(&strip, config) {
            corner.position.y += from as f32;
            // A corner may be refined to a position just outside the image.
            let is_after = first == 0 || first as f32 <= corner.position.y;
            let is_before = end == whole.height || corner.position.y < end as f32;
            if is_after && is_before {
                all.push(corner);
            }
        }
    }
    all
}

/// Returns the image at half its size, each pixel the mean of four; a last odd column or row is left out.
pub(super) fn halved(image: &GrayImage) -> GrayImage {
    let (width, height) = (image.width_px as usize / 2, image.height_px as usize / 2);
    let stride = image.width_px as usize;
    let mut data = Vec::with_capacity(width * height);
    for rows in image.data.chunks_exact((2 * stride).max(1)).take(height) {
        let (above, below) = rows.split_at(stride);
        let quads = above.chunks_exact(2).zip(below.chunks_exact(2));
        let sums = quads.map(|(a, b)| a[0] as u16 + a[1] as u16 + b[0] as u16 + b[1] as u16);
        data.extend(sums.map(|sum| ((sum + 2) / 4) as u8));
    }
    GrayImage { width_px: width as u32, height_px: height as u32, data }
}

/// Returns the image with each pixel as dark as the darkest one among its eight neighbours.
pub(super) fn darkened(image: &GrayImage) -> GrayImage {
    let width = (image.width_px as usize).max(1);
    let darkest = |gray: &[u8], step: usize| -> Vec<u8> {
        let of = |k: usize| {
            let beside = |k: Option<usize>| k.and_then(|k| gray.get(k)).copied().unwrap_or(u8::MAX);
            gray[k].min(beside(k.checked_sub(step))).min(beside(k.checked_add(step)))
        };
        (0..gray.len()).map(of).collect()
    };
    let rows = image.data.chunks(width).flat_map(|row| darkest(row, 1)).collect::<Vec<u8>>();
    GrayImage { data: darkest(&rows, width), ..*image }
}

/// Returns the joint nearest to a position, if it is within the given distance.
pub(super) fn nearest(joints: &[Joint], pixel: &Pixel, within_px: f64) -> Option<Joint> {
    let distance = |joint: &Joint| (joint.pixel - pixel).norm();
    let close = joints.iter().filter(|joint| distance(joint) <= within_px);
    close.min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
}
