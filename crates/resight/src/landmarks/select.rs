//! Selects the landmarks of the reference: corners whose window determines a position, spread over the image.

use super::features::foreign;
use super::patch::Patch;
use super::pyramid::Reduced;
use crate::GrayImage;
use imageproc::corners::corners_fast9;
use imageproc::suppress::local_maxima;
use nalgebra::{Vector2, Vector3};
use resight_core::{Bearing, Camera};

/// A landmark of the reference.
pub(super) struct LandmarkPatch {
    /// Its position, px.
    pub pixel: Vector2<f64>,
    pub bearing: Bearing,
    /// Derivative of the bearing with respect to a pixel to the right, and one down.
    pub by_pixel: [Vector3<f64>; 2],
    /// The part of the image it is in; the landmarks of a part may share errors.
    pub neighbourhood: u32,
    /// Its window, full size.
    pub fine: Patch,
    /// Its window in the reduced image, where that determines a position too, and the centre of that window, full-size px.
    pub coarse: Option<(Patch, Vector2<f64>)>,
}

/// Number of cells along the sides of the image; each gives a few landmarks.
const CELLS: [u32; 2] = [12, 9];
/// Largest number of landmarks in a cell.
const IN_A_CELL: usize = 3;
/// Number of neighbourhoods along the sides.
const NEIGHBOURHOODS: [u32; 2] = [4, 3];
/// Least contrast of a corner, 8-bit greys.
const CONTRAST: u8 = 8;
/// Smallest distance between landmarks, px.
const APART_PX: u32 = 6;
/// Largest variance of a landmark's position for a unit variance of the grey levels, px²: 0.3 px at a noise of two grey levels.
const WORST_SENSITIVITY: f64 = 0.0225;

/// Selects the best corners of every cell.
pub(super) fn select(picture: &GrayImage, reduced: &Reduced, camera: &Camera) -> Vec<LandmarkPatch> {
    let Some(image) = foreign(picture) else { return Vec::new() };
    let corners = local_maxima(&corners_fast9(&image, CONTRAST), APART_PX);
    let mut cells: Vec<Vec<(f64, LandmarkPatch)>> = (0..CELLS[0] * CELLS[1]).map(|_| Vec::new()).collect();
    for corner in corners {
        let Some(fine) = Patch::new(picture, corner.x, corner.y) else { continue };
        let sensitivity = fine.sensitivity();
        if WORST_SENSITIVITY < sensitivity {
            continue;
        }
        let cell = cell(picture, corner.x, corner.y, CELLS);
        if let Some(mark) = mark(picture, reduced, camera, (corner.x, corner.y), fine) {
            cells[cell as usize].push((sensitivity, mark));
        }
    }
    let best = |mut cell: Vec<(f64, LandmarkPatch)>| {
        cell.sort_by(|a, b| a.0.total_cmp(&b.0));
        cell.truncate(IN_A_CELL);
        cell.into_iter().map(|(_, mark)| mark)
    };
    cells.into_iter().flat_map(best).collect()
}

/// Returns a landmark; `None` where the lens gives no direction.
fn mark(
    picture: &GrayImage,
    reduced: &Reduced,
    camera: &Camera,
    (u, v): (u32, u32),
    fine: Patch,
) -> Option<LandmarkPatch> {
    let pixel = Vector2::new(f64::from(u), f64::from(v));
    let bearing_at = |du: f64, dv: f64| camera.bearing(&(pixel + Vector2::new(du, dv))).ok();
    let by = |du: f64, dv: f64| {
        let (ahead, behind) = (bearing_at(du, dv)?, bearing_at(-du, -dv)?);
        Some((ahead.into_inner() - behind.into_inner()) / 2.0)
    };
    let at = reduced.reduced(pixel).map(f64::round);
    let coarse = Patch::new(&reduced.image, at.x as u32, at.y as u32)
        .filter(|patch| patch.sensitivity() <= WORST_SENSITIVITY)
        .map(|patch| (patch, reduced.full_size(at)));
    Some(LandmarkPatch {
        pixel,
        bearing: bearing_at(0.0, 0.0)?,
        by_pixel: [by(1.0, 0.0)?, by(0.0, 1.0)?],
        neighbourhood: cell(picture, u, v, NEIGHBOURHOODS),
        fine,
        coarse,
    })
}

fn cell(picture: &GrayImage, u: u32, v: u32, cells: [u32; 2]) -> u32 {
    v * cells[1] / picture.height_px * cells[0] + u * cells[0] / picture.width_px
}
