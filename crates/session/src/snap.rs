//! Finds the dot, corner or crossing near a pixel.

use crate::command::SnapTo;
use resight::GrayImage;
use resight::core::Pixel;
use resight::detect::corner::refine_corner;
use resight::detect::dots::DotFinder;
use schemars::JsonSchema;
use serde::Serialize;

/// What a point would snap to.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Snapped {
    /// Column.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard deviation of each.
    pub sigma_px: f64,
    /// What it is, in a sentence.
    pub words: String,
}

/// Half width of the windows for corners and crossings, px.
const CORNER_PX: u32 = 5;
const CROSSING_PX: u32 = 10;
/// Radius of the search for a dot, px.
const DOT_PX: u32 = 60;

/// Returns the position of the feature; `None` where there is none.
pub fn snap(image: &GrayImage, at: &Pixel, to: SnapTo) -> Option<Snapped> {
    let (pixel, sigma_px, what) = match to {
        SnapTo::Dot => dot(image, at).map(|(pixel, sigma)| (pixel, sigma, "the middle of a dot"))?,
        SnapTo::Corner => corner(image, at, CORNER_PX).map(|(pixel, sigma)| (pixel, sigma, "a corner"))?,
        SnapTo::Crossing => {
            corner(image, at, CROSSING_PX).map(|(pixel, sigma)| (pixel, sigma, "where lines cross"))?
        }
    };
    let words = format!("{what}, {:.1} px from here, ± {sigma_px:.2} px", (pixel - at).norm());
    Some(Snapped { u_px: pixel.x, v_px: pixel.y, sigma_px, words })
}

fn corner(image: &GrayImage, at: &Pixel, half: u32) -> Option<(Pixel, f64)> {
    let found = refine_corner(image, at, half, 1.5 * f64::from(half))?;
    Some((found.pixel, found.sigma_px))
}

/// The dot nearest to a pixel, in a window around it.
fn dot(image: &GrayImage, at: &Pixel) -> Option<(Pixel, f64)> {
    let clamp = |x: f64, n: u32| (x.max(0.0) as u32).min(n.saturating_sub(1));
    let (u, v) = (clamp(at.x, image.width_px), clamp(at.y, image.height_px));
    let (left, top) = (u.saturating_sub(DOT_PX), v.saturating_sub(DOT_PX));
    let (right, bottom) = ((u + DOT_PX).min(image.width_px - 1), (v + DOT_PX).min(image.height_px - 1));
    let (width_px, height_px) = (right - left + 1, bottom - top + 1);
    let row = |v: u32| {
        let from = (v * image.width_px + left) as usize;
        image.data[from..from + width_px as usize].iter().copied()
    };
    let part = GrayImage { width_px, height_px, data: (top..=bottom).flat_map(row).collect() };
    let dots = DotFinder::default().dots(&part).ok()?;
    let corner = Pixel::new(f64::from(left), f64::from(top));
    let near = dots.iter().map(|dot| (dot.centroid + corner, dot.sigma_px));
    near.min_by(|a, b| (a.0 - at).norm().total_cmp(&(b.0 - at).norm()))
        .filter(|dot| (dot.0 - at).norm() < f64::from(DOT_PX) / 2.0)
}
