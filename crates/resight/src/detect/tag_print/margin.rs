//! Measures the surroundings of a tag's black border: the white margin with which it is printed, or the ground on which it lies.
//!
//! A tag cut at its border lies on a ground that need not be as bright as its white cells. Fitted with a white margin it becomes too large, by
//! as much as the edge from black to grey is farther out than one from black to white would be. So where the margin does not look white, the
//! print is fitted a second time, with the brightness that is measured farther out on each side, and the print that explains more is used
//! (docs/math/tag_print.md section 5).

use super::ink::Print;
use crate::GrayImage;
use crate::detect::homography::{Homography, PlanePoint};
use resight_core::Pixel;

/// Brightness around a tag by side: top, right, bottom, left; −1 is the tag's own black and 1 its own white.
pub(super) type Margins = [f64; 4];

/// Distances at which the margin is sampled, in cells: its middle, and where the ground beyond is not affected by a blurred edge.
const NEAR_CELLS: f64 = 0.6;
const FAR_CELLS: f64 = 1.25;
/// If the margin is darker than this, there may be none.
const WHITE: f64 = 0.75;
/// Number of positions along a side.
const PLACES: usize = 9;
/// Least contrast between black and white, grey levels.
const CONTRAST_GRAY: f64 = 8.0;

/// Returns the brightness around a tag; `None` where its margin is white, where the family has cells there, or where too little is in the image.
pub(super) fn dark(image: &GrayImage, print: &Print, corners: &[Pixel; 4]) -> Option<Margins> {
    if !print.has_plain_margin() {
        return None;
    }
    let cells = (print.width - 2) as f64;
    let square = [(0.0, 0.0), (cells, 0.0), (cells, cells), (0.0, cells)];
    let pairs: Vec<(PlanePoint, Pixel)> =
        square.iter().zip(corners).map(|((x, y), u)| (PlanePoint::new(*x, *y), *u)).collect();
    let map = Homography::fit(&pairs)?;
    let gray = |x: f64, y: f64| sample(image, &map.at(&PlanePoint::new(x, y)));
    let [black, white] = levels(print, cells, &gray)?;
    let half = 0.5 * (white - black);
    if half < 0.5 * CONTRAST_GRAY {
        return None;
    }
    let side = |out: f64, k: usize| {
        let along = (0..PLACES).map(|i| cells * (0.1 + 0.8 * i as f64 / (PLACES - 1) as f64));
        let place = |t: f64| match k {
            0 => gray(t, -out),
            1 => gray(cells + out, t),
            2 => gray(t, cells + out),
            _ => gray(-out, t),
        };
        let seen: Vec<f64> = along.filter_map(place).collect();
        median(seen).map(|gray| (gray - black) / half - 1.0)
    };
    let near = [0, 1, 2, 3].map(|k| side(NEAR_CELLS, k));
    if near.iter().flatten().all(|brightness| WHITE <= *brightness) {
        return None;
    }
    let far = [0, 1, 2, 3].map(|k| side(FAR_CELLS, k).or(near[k]).map(|x| x.clamp(-0.9, 2.0)));
    Some([far[0]?, far[1]?, far[2]?, far[3]?])
}

/// Returns the grey levels of the black border and of the white cells.
fn levels(print: &Print, cells: f64, gray: &impl Fn(f64, f64) -> Option<f64>) -> Option<[f64; 2]> {
    let n = print.width - 2;
    let (mut black, mut white) = (Vec::new(), Vec::new());
    for (x, y) in (0..n).flat_map(|y| (0..n).map(move |x| (x, y))) {
        let at = || gray(x as f64 + 0.5, y as f64 + 0.5);
        let is_border = x == 0 || y == 0 || x as f64 + 1.0 == cells || y as f64 + 1.0 == cells;
        if is_border {
            black.extend(at());
        } else if print.is_white(x + 1, y + 1) {
            white.extend(at());
        }
    }
    Some([median(black)?, median(white)?])
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    (2 < values.len()).then(|| values[values.len() / 2])
}

/// Returns the grey level of the nearest pixel; `None` outside the image.
fn sample(image: &GrayImage, at: &Pixel) -> Option<f64> {
    let inside =
        |x: f64, n: u32| (-0.5..f64::from(n) - 0.5).contains(&x).then_some(x.round().max(0.0) as u32);
    Some(f64::from(image.at(inside(at.x, image.width_px)?, inside(at.y, image.height_px)?)))
}
