//! Finds the inner corners of a ChArUco board whose markers are known.
//!
//! Each corner is predicted from the markers around it, and the print around it is fitted to the image; it is accepted if the print explains the
//! image. On 48 frames of four webcams the corners then fit a plane to 0.04–0.07 px in the median. Refined in windows that exclude the markers
//! (an eighth of a square) they leave 0.11–0.13 px, in 11 px windows, which confuse the markers' edges with the corner's, 0.16–0.45 px.

use super::CharucoFinder;
use crate::GrayImage;
use crate::detect::apriltag::DecodedTag;
use crate::detect::corner::refine_corner;
use crate::detect::homography::{Homography, PlanePoint};
use crate::detect::joints::CornerWindow;
use crate::detect::print::{self, Common};
use crate::detect::sigma;
use crate::detect::template::{self, Fit, Printed, REDRAWN_PX, Window};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use std::collections::BTreeSet;

/// Radius around its prediction in which a corner is searched for, in squares. The nearest saddle points that are not corners lie in the
/// markers, at least a margin and a border cell away (0.2 squares on common boards).
const SEARCH_SQUARES: f64 = 0.1;
/// but at least this radius, pixels.
const SEARCH_PX: f64 = 2.0;
/// Radius around a corner in which the print is compared, in squares,
const PRINT_SQUARES: f64 = 0.45;
/// within these bounds, pixels.
const PRINT_PX: (f64, f64) = (4.0, 7.0);
/// Least share of the variance that the print has to explain (apart from noise).
const EXPLAINED: f64 = 0.6;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 10.0;

/// At least this many markers that agree need no further evidence;
const VOUCHING_MARKERS: usize = 3;
/// with fewer, the print has to explain most corners beside them this well.
const CLEARLY_EXPLAINED: f64 = 0.8;

/// Blurs that are tried, standard deviations in pixels; the first is used where nothing can be compared.
const BLURS_PX: [f64; 6] = [0.7, 0.35, 1.1, 1.6, 2.2, 3.0];
/// Number of corners from which the blur is estimated.
const BLUR_CORNERS: usize = 4;

/// A predicted corner.
struct Expected {
    id: u32,
    place: PlanePoint,
    map: Homography,
    at: Pixel,
    /// Shortest edge of the squares around the corner, pixels.
    square_px: f64,
    /// Radius of the search around `at`, pixels.
    reach_px: f64,
}

impl CharucoFinder {
    /// Finds the visible inner corners, sorted by id.
    pub(super) fn corners(
        &self,
        markers: &[DecodedTag],
        image: &GrayImage,
        noise_gray: f64,
    ) -> Vec<Detection> {
        let (rows, columns) = (self.board.rows - 1, self.board.columns - 1);
        let expected: Vec<Expected> =
            (0..rows * columns).filter_map(|id| self.expected(markers, id, image)).collect();
        let look = Comparison { finder: self, image, noise_gray, redrawn_px: REDRAWN_PX };
        let blur_px = look.blur_px(&expected);
        let corners = look.corners(&expected, blur_px);
        let is_vouched =
            VOUCHING_MARKERS <= markers.len() || self.beside_are_seen(markers, &expected, &look, blur_px);
        if is_vouched { corners } else { Vec::new() }
    }

    /// Returns whether all corners are among the detections.
    pub fn is_whole(&self, seen: &[Detection]) -> bool {
        seen.iter().map(|d| d.feature.id).eq(0..(self.board.rows - 1) * (self.board.columns - 1))
    }

    /// Measures the corners of a whole board that are picked, by the print around the given positions of all.
    pub fn measured_near(
        &self,
        image: &GrayImage,
        common: Common,
        places: &[Detection],
        picked: &BTreeSet<Feature>,
    ) -> (Vec<Detection>, f64) {
        let picked = places.iter().filter(|d| picked.contains(&d.feature));
        let expected: Vec<Expected> = picked.filter_map(|d| self.expected_again(places, d)).collect();
        let look =
            Comparison { finder: self, image, noise_gray: common.noise_gray, redrawn_px: common.redrawn_px };
        let blur_px = common.blur_px.unwrap_or_else(|| look.blur_px(&expected));
        (look.corners(&expected, blur_px), blur_px)
    }

    /// Predicts a corner at its position in the plane of those beside it.
    fn expected_again(&self, seen: &[Detection], corner: &Detection) -> Option<Expected> {
        let place = |d: &Detection| self.corner_place(d.feature.id);
        let at = place(corner);
        let beside = seen.iter().filter(|d| (place(d) - at).amax() < 1.5);
        let pairs: Vec<(PlanePoint, Pixel)> = beside.map(|d| (place(d), d.pixel)).collect();
        let expected = self.expected_at(corner.feature.id, Homography::fit(&pairs)?)?;
        Some(Expected { at: corner.pixel, reach_px: SEARCH_PX, ..expected })
    }

    /// Returns the position of an inner corner on the board, in squares from the board's top-left corner.
    fn corner_place(&self, id: u32) -> PlanePoint {
        let columns = self.board.columns - 1;
        PlanePoint::new((id % columns + 1) as f64, (id / columns + 1) as f64)
    }

    /// Whether the print shows at most of the corners beside these markers, and clearly: a marker that was misread has another's around it.
    fn beside_are_seen(
        &self,
        markers: &[DecodedTag],
        expected: &[Expected],
        look: &Comparison,
        blur_px: f64,
    ) -> bool {
        let is_beside = |c: &&Expected| markers.iter().any(|m| (self.centre(m.id) - c.place).amax() < 0.6);
        let beside: Vec<&Expected> = expected.iter().filter(is_beside).collect();
        let is_clear =
            |c: &&&Expected| look.print(c, blur_px).is_some_and(|fit| CLEARLY_EXPLAINED <= fit.explained);
        beside.len() <= 2 * beside.iter().filter(is_clear).count() && !beside.is_empty()
    }

    fn expected(&self, markers: &[DecodedTag], id: u32, image: &GrayImage) -> Option<Expected> {
        let map = Homography::fit(&self.pairs_near(markers, &self.corner_place(id)))?;
        let inside = |x: f64, n: u32| -0.5 <= x && x < n as f64;
        let is_inside = |at: &Pixel| inside(at.x, image.width_px) && inside(at.y, image.height_px);
        self.expected_at(id, map).filter(|corner| is_inside(&corner.at))
    }

    fn expected_at(&self, id: u32, map: Homography) -> Option<Expected> {
        let place = self.corner_place(id);
        let at = map.at(&place);
        let beside = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)];
        let half_px = beside.map(|(x, y)| (map.at(&(place + PlanePoint::new(x, y))) - at).norm());
        let square_px = 2.0 * half_px.into_iter().fold(f64::INFINITY, f64::min);
        let reach_px = (SEARCH_SQUARES * square_px).max(SEARCH_PX);
        square_px.is_finite().then_some(Expected { id, place, map, at, square_px, reach_px })
    }

    /// −1 where the board is black and 1 where it is white, at a place in squares.
    fn ink(&self, x: PlanePoint) -> f32 {
        let (columns, rows) = (self.board.columns as f64, self.board.rows as f64);
        if !(0.0 <= x.x && x.x < columns && 0.0 <= x.y && x.y < rows) {
            return 1.0;
        }
        // Whole numbers of 32 bits are faster made than those of 64.
        let (column, row) = (x.x as i32, x.y as i32);
        let Some(print) = &self.prints[row as usize * self.board.columns as usize + column as usize] else {
            return -1.0;
        };
        let (u, v) = (x.x - column as f64 - 0.5, x.y - row as f64 - 0.5);
        if !(u.abs() < self.half_marker && v.abs() < self.half_marker) {
            return 1.0;
        }
        let at = |x: f64| ((x + self.half_marker) * self.cells_a_square) as i32 as usize + print.inset_cells;
        let cell = |x: f64| at(x).min(print.width_cells - 1);
        if print.white[cell(v) * print.width_cells + cell(u)] { 1.0 } else { -1.0 }
    }
}

/// The print that every corner of an image is compared with.
struct Comparison<'a> {
    finder: &'a CharucoFinder,
    image: &'a GrayImage,
    noise_gray: f64,
    redrawn_px: f64,
}

impl Comparison<'_> {
    /// The corners that are seen.
    fn corners(&self, expected: &[Expected], blur_px: f64) -> Vec<Detection> {
        let (seen, fits): (Vec<&Expected>, Vec<Fit>) =
            expected.iter().filter_map(|corner| Some((corner, self.print(corner, blur_px)?))).unzip();
        let sigmas_px = print::sigmas_px(&fits);
        let measured = seen.iter().zip(fits.iter().zip(sigmas_px));
        measured.map(|(corner, (fit, sigma_px))| self.corner(corner, fit, sigma_px)).collect()
    }

    /// Returns the blur that explains the corners best.
    fn blur_px(&self, expected: &[Expected]) -> f64 {
        let every = (expected.len() / BLUR_CORNERS).max(1);
        let mut shares = [0.0; BLURS_PX.len()];
        for corner in expected.iter().skip(every / 2).step_by(every) {
            // Once one corner's print fits with a blur, the others start with it.
            let mut seen = None;
            for (share, blur_px) in shares.iter_mut().zip(BLURS_PX) {
                let start = seen.unwrap_or_else(|| self.start(corner, blur_px));
                let Some(lying) = self.lie(corner, start, blur_px) else { continue };
                if self.is_seen(lying.explained, lying.contrast_gray) {
                    seen = Some(lying.pixel);
                    *share += lying.explained;
                }
            }
        }
        let best = (0..BLURS_PX.len()).max_by(|&a, &b| shares[a].total_cmp(&shares[b]).then(b.cmp(&a)));
        BLURS_PX[best.unwrap_or(0)]
    }

    fn corner(&self, corner: &Expected, fit: &Fit, sigma_px: f64) -> Detection {
        let by_print = (fit.pixel, sigma_px);
        let (pixel, sigma_px) = match self.finder.window {
            CornerWindow::Clear => by_print,
            // In a fixed window the residual says nothing about this corner alone, so that every corner has the same sigma.
            CornerWindow::Half(half_px) => {
                let refined = refine_corner(self.image, &fit.pixel, half_px, half_px as f64);
                refined.map_or(by_print, |c| (c.pixel, sigma::WINDOW_PX))
            }
        };
        let feature = Feature { id: corner.id, corner: 0 };
        Detection { feature, pixel, sigma_px, lens_sigma_px: sigma::LENS_PX, covariance_px2: None }
    }

    /// Fits the print around a corner; `None` where it does not explain the image.
    fn print(&self, corner: &Expected, blur_px: f64) -> Option<Fit> {
        let ink = |x: PlanePoint| self.finder.ink(x);
        let (window, reach_px) = (self.window(corner, blur_px), corner.reach_px);
        let start = self.start(corner, blur_px);
        let fit = template::fit(self.image, ink, &corner.map, &corner.place, start, reach_px, window)?;
        let is_near = (fit.pixel - corner.at).norm() <= reach_px;
        (is_near && self.is_seen(fit.explained, fit.contrast_gray)).then_some(fit)
    }

    fn is_seen(&self, explained: f64, contrast_gray: f64) -> bool {
        let contrast_gray = if self.finder.is_inverted { -contrast_gray } else { contrast_gray };
        EXPLAINED <= explained && CONTRAST_GRAY <= contrast_gray
    }

    /// Returns the start of the search for a corner: with more blur, the fit converges from farther away.
    fn start(&self, corner: &Expected, blur_px: f64) -> Pixel {
        let reach_px = corner.reach_px;
        let is_far = SEARCH_PX < reach_px;
        let blurred = || self.lie(corner, corner.at, blur_px.max(0.4 * reach_px).min(3.0));
        let near = if is_far { blurred() } else { None };
        near.map_or(corner.at, |lying| lying.pixel)
    }

    fn lie(&self, corner: &Expected, start: Pixel, blur_px: f64) -> Option<template::Lying> {
        let ink = |x: PlanePoint| self.finder.ink(x);
        let printed = Printed { ink, image_from_plane: &corner.map, place: &corner.place };
        let (window, reach_px) = (self.window(corner, blur_px), corner.reach_px);
        let lying = template::lie(self.image, &printed, start, reach_px, window)?;
        ((lying.pixel - corner.at).norm() <= reach_px).then_some(lying)
    }

    fn window(&self, corner: &Expected, blur_px: f64) -> Window {
        let half_px = (PRINT_SQUARES * corner.square_px).clamp(PRINT_PX.0, PRINT_PX.1) as usize;
        Window { half_px, blur_px, noise_gray: self.noise_gray, redrawn_px: self.redrawn_px }
    }
}
