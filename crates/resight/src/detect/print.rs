//! Measures corners by the print around them, for boards whose print is known once the corners are found.

use super::homography::{Homography, PlanePoint};
use super::template::{self, Fit, Printed, REDRAWN_PX, Window};
use crate::GrayImage;
use resight_core::Pixel;

/// Radius around a corner in which the print is compared, in squares,
const PRINT_SQUARES: f64 = 0.45;
/// within these bounds, pixels.
const PRINT_PX: (f64, f64) = (4.0, 7.0);
/// Smallest radius that shows two edges, pixels; a corner nearer to the image's edge is not compared.
const LEAST_HALF_PX: usize = 3;
/// Least share of the variance that the print has to explain (apart from noise).
const EXPLAINED: f64 = 0.8;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 10.0;

/// A residual with this many times the variance of the common one is attributed to this corner alone.
pub(super) const OWN_EXCESS: f64 = 3.0;
/// The error of the method itself, standard deviation in pixels: 0.0015 px on rendered boards without noise, rounding included.
const METHOD_PX: f64 = 0.0013;
/// Smallest excess used: the image's noise is known to a fifth, and a smaller residual is chance.
const LEAST_EXCESS: f64 = 0.6;

/// Blurs that are tried, standard deviations in pixels.
const BLURS_PX: [f64; 6] = [0.35, 0.7, 1.1, 1.6, 2.2, 3.0];
/// Number of corners from which the blur is estimated.
const BLUR_CORNERS: usize = 4;

/// A corner that was found, with the print around it.
pub(super) struct Place<Ink> {
    /// Its measured position.
    pub found: Pixel,
    /// Its position on the plane, and the map of the plane around it.
    pub place: PlanePoint,
    pub map: Homography,
    /// Shortest edge of the squares around it, pixels.
    pub square_px: f64,
    /// Radius in which the print is known, pixels.
    pub clear_px: f64,
    /// If the print is farther away than this, in pixels, it belongs to another position.
    pub reach_px: f64,
    /// −1 where black and 1 where white, on the plane.
    pub ink: Ink,
}

/// The result of comparing a corner with its print.
#[derive(Debug, Clone, Copy)]
pub(super) enum Observed {
    /// The print is visible.
    Print { pixel: Pixel, sigma_px: f64 },
    /// Something else is visible: the corner is covered, or was wrong.
    Otherwise,
    /// The corner is too near to the edge of the image to be compared.
    Outside,
}

/// Returns the variances of corners, from their noise and from the residuals of all (docs/math/corner_sigma.md section 3).
pub(super) fn sigmas_px(fits: &[Fit]) -> Vec<f64> {
    let mut excess: Vec<f64> = fits.iter().map(|fit| fit.excess).collect();
    excess.sort_by(f64::total_cmp);
    let common = excess.get(excess.len() / 2).copied().unwrap_or(1.0).max(LEAST_EXCESS);
    let of = |fit: &Fit| {
        let own = if OWN_EXCESS * common < fit.excess { fit.excess } else { common };
        (own * fit.noise_px * fit.noise_px + METHOD_PX * METHOD_PX).sqrt()
    };
    fits.iter().map(of).collect()
}

/// The data shared by all corners of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Common {
    /// Standard deviation of the noise of each pixel, grey levels.
    pub noise_gray: f64,
    /// Standard deviation of the blur, pixels; `None` where it is not known yet.
    pub blur_px: Option<f64>,
    /// As in [`Window`].
    pub redrawn_px: f64,
}

/// Returns the blur that explains most, from blurs in ascending order, starting with the second: up to the best one more blur explains more, and
/// beyond it less.
pub(super) fn best_blur_px(blurs_px: &[f64], mut explained: impl FnMut(f64) -> f64) -> f64 {
    let mut at = 1.min(blurs_px.len() - 1);
    let mut best = explained(blurs_px[at]);
    for step in [-1, 1] {
        let first = at;
        while let Some(&blur_px) = at.checked_add_signed(step).and_then(|next| blurs_px.get(next)) {
            let share = explained(blur_px);
            // Where nothing is explained yet, the best may be farther on.
            if share < best || (share == best && 0.0 < best) {
                break;
            }
            (at, best) = (at.saturating_add_signed(step), share);
        }
        if at != first && 0.0 < best {
            break;
        }
    }
    blurs_px[at]
}

/// Returns the blur that explains most of some of these corners.
fn blur_px<Ink: Fn(PlanePoint) -> f32>(image: &GrayImage, noise_gray: f64, places: &[Place<Ink>]) -> f64 {
    let every = (places.len() / BLUR_CORNERS).max(1);
    best_blur_px(&BLURS_PX, |blur_px| {
        let explained = |place: &Place<Ink>| place.explained(image, noise_gray, blur_px);
        places.iter().skip(every / 2).step_by(every).map(explained).sum()
    })
}

/// Compares corners with their print, all with one blur, which is returned too.
pub(super) fn measure<Ink: Fn(PlanePoint) -> f32>(
    image: &GrayImage,
    common: Common,
    places: &[Place<Ink>],
) -> (Vec<Observed>, f64) {
    let Common { noise_gray, redrawn_px, .. } = common;
    let blur_px = common.blur_px.unwrap_or_else(|| blur_px(image, noise_gray, places));
    let look = |place: &Place<Ink>, blur_px: f64| place.look(image, noise_gray, blur_px, redrawn_px);
    let fits: Vec<Option<Option<Fit>>> = places.iter().map(|place| look(place, blur_px)).collect();
    let seen: Vec<Fit> = fits.iter().flatten().flatten().copied().collect();
    let mut sigmas_px = sigmas_px(&seen).into_iter();
    let said = fits.into_iter().map(|fit| match fit {
        Some(Some(fit)) => {
            Observed::Print { pixel: fit.pixel, sigma_px: sigmas_px.next().unwrap_or(f64::NAN) }
        }
        Some(None) => Observed::Otherwise,
        None => Observed::Outside,
    });
    (said.collect(), blur_px)
}

impl<Ink: Fn(PlanePoint) -> f32> Place<Ink> {
    /// Fits the print; `None` where it is not visible or too near to the edge of the image.
    fn look(&self, image: &GrayImage, noise_gray: f64, blur_px: f64, redrawn_px: f64) -> Option<Option<Fit>> {
        let window = Window { half_px: self.half_px(image)?, blur_px, noise_gray, redrawn_px };
        let fit = template::fit(image, &self.ink, &self.map, &self.place, self.found, self.reach_px, window);
        Some(fit.filter(|fit| is_seen(fit.explained, fit.contrast_gray)))
    }

    /// Returns the share of the variance that the print explains, 0 where it is not visible.
    fn explained(&self, image: &GrayImage, noise_gray: f64, blur_px: f64) -> f64 {
        let Some(half_px) = self.half_px(image) else { return 0.0 };
        let window = Window { half_px, blur_px, noise_gray, redrawn_px: REDRAWN_PX };
        let printed = Printed { ink: &self.ink, image_from_plane: &self.map, place: &self.place };
        let lying = template::lie(image, &printed, self.found, self.reach_px, window);
        lying.filter(|l| is_seen(l.explained, l.contrast_gray)).map_or(0.0, |l| l.explained)
    }

    /// Returns the radius of the comparison, pixels to each side; `None` too near to the edge of the image.
    fn half_px(&self, image: &GrayImage) -> Option<usize> {
        let size = |n: u32| n as f64 - 1.0;
        let (u, v) = (self.found.x.round(), self.found.y.round());
        let room_px = u.min(v).min(size(image.width_px) - u).min(size(image.height_px) - v);
        let half_px =
            (PRINT_SQUARES * self.square_px).clamp(PRINT_PX.0, PRINT_PX.1).min(self.clear_px).min(room_px);
        (LEAST_HALF_PX as f64 <= half_px).then_some(half_px as usize)
    }
}

fn is_seen(explained: f64, contrast_gray: f64) -> bool {
    EXPLAINED <= explained && CONTRAST_GRAY <= contrast_gray
}
