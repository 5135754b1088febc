//! The geometry of the views: the tilts of the target, its positions in the image, and views that are copies of others.

use super::adjust::Seen;
use crate::camera::ImageSize;
use crate::{Correspondence, Pixel};
use std::collections::HashMap;

/// Largest root mean square distance, px, of the corners of two views with the same pose, between which the target did not move …
const SAME_PLACE_PX: f64 = 2.0;
/// … if they share at least this part of their corners.
const SHARED: f64 = 0.8;
/// Largest distance of corners of exact copies, px.
const COPY_PX: f64 = 1e-6;

/// Columns and rows of the grid in which corners are counted.
pub const COVERAGE_GRID: [usize; 2] = [10, 8];

/// The number of corners in each cell of a grid over the image, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coverage {
    /// Cells in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Corners by cell.
    pub counts: Vec<usize>,
}

impl Coverage {
    /// Counts the corners in an image.
    pub fn of(corners: impl Iterator<Item = Pixel>, size: ImageSize) -> Self {
        let [columns, rows] = COVERAGE_GRID;
        let mut counts = vec![0; columns * rows];
        corners.for_each(|pixel| counts[cell(&pixel, size)] += 1);
        Coverage { columns, rows, counts }
    }

    /// Returns the centres of the cells with a corner.
    pub fn covered(&self, size: ImageSize) -> impl Iterator<Item = Pixel> {
        let (wide, high) = (f64::from(size.width_px), f64::from(size.height_px));
        let centre = move |i: usize| {
            let (column, row) = (i % self.columns, i / self.columns);
            let along = |k: usize, n: usize, side: f64| (k as f64 + 0.5) / n as f64 * side - 0.5;
            Pixel::new(along(column, self.columns, wide), along(row, self.rows, high))
        };
        (0..self.counts.len()).filter(|i| 0 < self.counts[*i]).map(centre)
    }

    /// Returns the share of cells with a corner.
    pub fn share(&self) -> f64 {
        self.counts.iter().filter(|n| 0 < **n).count() as f64 / self.counts.len().max(1) as f64
    }
}

/// Returns the index of a pixel's cell; pixels outside the image belong to the nearest one.
fn cell(pixel: &Pixel, size: ImageSize) -> usize {
    let [columns, rows] = COVERAGE_GRID;
    let along = |x: f64, side: u32, n: usize| {
        let part = (x + 0.5) / f64::from(side.max(1)) * n as f64;
        (part.max(0.0) as usize).min(n - 1)
    };
    along(pixel.y, size.height_px, rows) * columns + along(pixel.x, size.width_px, columns)
}

/// The views that repeat an earlier one.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Copies {
    /// Pairs of a view that is an exact copy, and the earlier view.
    pub copies: Vec<(usize, usize)>,
    /// Number of views between which target or camera moved.
    pub n_distinct: usize,
}

/// Compares every view with those before it that are not copies themselves.
pub(super) fn copies(views: &[(usize, &[Correspondence])]) -> Copies {
    let mut found = Copies::default();
    let mut kept: Vec<(usize, HashMap<[u64; 3], Pixel>)> = Vec::new();
    for (view, points) in views {
        let mut is_new = true;
        let mut copy_of = None;
        for (other, places) in &kept {
            let Some(px) = apart_px(points, places) else { continue };
            is_new &= SAME_PLACE_PX <= px;
            copy_of = copy_of.or((px < COPY_PX).then_some(*other));
        }
        found.n_distinct += usize::from(is_new);
        match copy_of {
            Some(other) => found.copies.push((*view, other)),
            None => kept.push((*view, places(points))),
        }
    }
    found
}

fn key(c: &Correspondence) -> [u64; 3] {
    [c.x_in_target.x.to_bits(), c.x_in_target.y.to_bits(), c.x_in_target.z.to_bits()]
}

fn places(points: &[Correspondence]) -> HashMap<[u64; 3], Pixel> {
    points.iter().map(|c| (key(c), c.pixel)).collect()
}

/// Returns the root mean square distance of the corners that two views share; `None` where they share few. Stops at the first corner that is far
/// off.
fn apart_px(points: &[Correspondence], places: &HashMap<[u64; 3], Pixel>) -> Option<f64> {
    let limit = SAME_PLACE_PX.powi(2) * points.len() as f64;
    let (mut sum, mut n) = (0.0, 0usize);
    for c in points {
        let Some(pixel) = places.get(&key(c)) else { continue };
        sum += (pixel - c.pixel).norm_squared();
        n += 1;
        if limit < sum {
            return None;
        }
    }
    let most = points.len().max(places.len());
    (0 < n && SHARED * most as f64 <= n as f64).then(|| (sum / n as f64).sqrt())
}

/// The tilts of flat targets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tilts {
    /// Largest angle between a target's normal and the camera's axis, rad.
    pub largest_rad: f64,
    /// Largest angle between the normals of two views, camera frame, rad.
    pub spread_rad: f64,
}

/// Returns the tilts; `None` where a target is not flat, z constant.
pub(super) fn tilts(seen: &[Seen]) -> Option<Tilts> {
    let is_flat = |view: &Seen| {
        let z = view.points.first().map_or(0.0, |c| c.x_in_target.z);
        view.points.iter().all(|c| (c.x_in_target.z - z).abs() <= 1e-9)
    };
    if seen.is_empty() || !seen.iter().all(is_flat) {
        return None;
    }
    // The normal of either side: its sign does not matter.
    let normals: Vec<_> =
        seen.iter().map(|view| view.cam_from_target.rotation.column(2).into_owned()).collect();
    let angle = |c: f64| c.abs().min(1.0).acos();
    let largest_rad = normals.iter().map(|n| angle(n.z)).fold(0.0, f64::max);
    let pairs = normals.iter().enumerate().flat_map(|(i, a)| normals[..i].iter().map(move |b| (a, b)));
    let spread_rad = pairs.map(|(a, b)| angle(a.dot(b))).fold(0.0, f64::max);
    Some(Tilts { largest_rad, spread_rad })
}
