//! Chessboards: inner corners through `calib-targets` (ChESS corners, saddle-point refinement), numbered our way.
//!
//! Corner ids run along the rows of `columns` corners, corner 0 next to a **black** square on its inner side
//! (between corners 0, 1 and `columns`), which for an odd sum of rows and columns (OpenCV's 9 × 6 board) leaves
//! exactly one numbering, the one OpenCV uses. Where the colours allow several (even sum: half a turn; square boards
//! of odd squares: quarter turns) no detector can tell them apart: the most upright is taken, the one whose last row
//! lies lowest below its first in the image, as OpenCV does. A mirrored numbering is never returned.

use super::homography::{Homography, PlanePoint};
use super::joints::{CornerWindow, Joint, corner_config, corners};
use super::noise::noise_gray;
use super::print::{self, Place, Seen};
use super::{DetectError, sigma};
use crate::GrayImage;
use calib_targets::chessboard::{ChessboardDetection, ChessboardDetector, ChessboardParams};
use calib_targets::core::DetectorConfig;
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{Chessboard, Feature};

/// Finds one chessboard.
pub(super) struct ChessboardFinder {
    board: Chessboard,
    window: CornerWindow,
    config: DetectorConfig,
    /// Tried in order until one shows the board: the library's own sweep, its default first.
    detectors: Vec<ChessboardDetector>,
}

impl ChessboardFinder {
    pub fn new(board: &Chessboard, window: CornerWindow) -> Result<Self, DetectError> {
        let n_corners = (board.rows * board.columns) as usize;
        let detectors = ChessboardParams::sweep_default()
            .into_iter()
            .map(|mut params| {
                params.min_labeled_corners = params.min_labeled_corners.min(n_corners);
                ChessboardDetector::new(params).map_err(|e| DetectError::Board { reason: e.to_string() })
            })
            .collect::<Result<_, _>>()?;
        Ok(ChessboardFinder { board: *board, window, config: corner_config(), detectors })
    }

    pub fn detect(&mut self, image: &GrayImage) -> Vec<Detection> {
        let corners = corners(image, &self.config);
        let found = self
            .detectors
            .iter()
            .flat_map(|detector| detector.detect_all(&corners))
            .find_map(|found| number(&Grid::new(&found), &self.board, image, self.window));
        found.unwrap_or_default()
    }
}

/// The labelled lattice: `nodes[v * width + u]`.
struct Grid {
    width: usize,
    height: usize,
    nodes: Vec<Option<Joint>>,
}

impl Grid {
    fn new(found: &ChessboardDetection) -> Self {
        let label = |x: i32| x.max(0) as usize;
        let width = 1 + found.corners.iter().map(|c| label(c.grid.u)).max().unwrap_or(0);
        let height = 1 + found.corners.iter().map(|c| label(c.grid.v)).max().unwrap_or(0);
        let mut nodes = vec![None; width * height];
        for c in &found.corners {
            let pixel = Pixel::new(c.position.x as f64, c.position.y as f64);
            let library_px = c.position_covariance.map(|k| k.sigma_max_px() as f64);
            nodes[label(c.grid.v) * width + label(c.grid.u)] =
                Some(Joint { pixel, sigma_px: sigma::saddle_px(library_px) });
        }
        Grid { width, height, nodes }
    }

    fn at(&self, u: i32, v: i32) -> Option<Joint> {
        let inside = 0 <= u && 0 <= v && (u as usize) < self.width && (v as usize) < self.height;
        if inside { self.nodes[v as usize * self.width + u as usize] } else { None }
    }
}

/// A way to lay the board over the lattice: board (column, row) → lattice (u, v).
#[derive(Debug, Clone, Copy)]
struct Placement {
    origin: (i32, i32),
    column_step: (i32, i32),
    row_step: (i32, i32),
}

impl Placement {
    fn node(&self, column: i32, row: i32) -> (i32, i32) {
        let along = |origin: i32, c: i32, r: i32| origin + column * c + row * r;
        (
            along(self.origin.0, self.column_step.0, self.row_step.0),
            along(self.origin.1, self.column_step.1, self.row_step.1),
        )
    }
}

/// At least this share of the corners must carry a label; fewer leave room for a board shifted by one row.
const MIN_LABELLED: f64 = 0.9;

/// Numbers the lattice as `board`, or says that this is not the board.
fn number(
    grid: &Grid,
    board: &Chessboard,
    image: &GrayImage,
    window: CornerWindow,
) -> Option<Vec<Detection>> {
    let fits: Vec<(usize, Placement)> = placements(grid, board)
        .into_iter()
        .map(|p| (n_labelled(grid, board, &p), p))
        .filter(|(n, p)| {
            MIN_LABELLED * (board.rows * board.columns) as f64 <= *n as f64 && is_right_handed(grid, board, p)
        })
        .collect();
    let most = fits.iter().map(|(n, _)| *n).max()?;
    let best = fits
        .iter()
        .filter(|(n, p)| *n == most && inner_square_is_black(grid, board, p, image))
        .max_by(|a, b| drop_px(grid, board, &a.1).total_cmp(&drop_px(grid, board, &b.1)))?;
    Some(refined(grid, board, &best.1, image, window))
}

/// A print further than this from the saddle point is another's, pixels.
const MAX_MOVE_PX: f64 = 1.5;

/// The corners, each measured by the print around it or in the window asked for.
fn refined(
    grid: &Grid,
    board: &Chessboard,
    p: &Placement,
    image: &GrayImage,
    window: CornerWindow,
) -> Vec<Detection> {
    let (rows, columns) = (board.rows as i32, board.columns as i32);
    let node = |column: i32, row: i32| {
        let (u, v) = p.node(column, row);
        grid.at(u, v).filter(|_| 0 <= column && column < columns && 0 <= row && row < rows)
    };
    let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    let nodes: Vec<(u32, Joint, Option<Place<_>>)> = cells
        .filter_map(|(column, row)| {
            let joint = node(column, row)?;
            Some(((row * columns + column) as u32, joint, place(board, &node, column, row)))
        })
        .collect();
    let detection = |id: u32, pixel: Pixel, sigma_px: f64| {
        let feature = Feature { id, corner: 0 };
        Detection { feature, pixel, sigma_px, lens_sigma_px: sigma::LENS_PX, covariance_px2: None }
    };
    if let CornerWindow::Half(half_px) = window {
        let joints = nodes.into_iter().map(|(id, joint, _)| (id, joint.refined(image, half_px)));
        return joints.map(|(id, joint)| detection(id, joint.pixel, joint.sigma_px)).collect();
    }
    let (ids, places): (Vec<_>, Vec<_>) =
        nodes.into_iter().filter_map(|(id, joint, place)| Some(((id, joint), place?))).unzip();
    let seen = print::measure(image, noise_gray(image), &places);
    let corners = ids.into_iter().zip(seen).filter_map(|((id, joint), seen)| match seen {
        Seen::Print { pixel, sigma_px } => Some(detection(id, pixel, sigma_px)),
        Seen::Outside => Some(detection(id, joint.pixel, joint.sigma_px)),
        Seen::Otherwise => None,
    });
    corners.collect()
}

/// The print around a corner, as the corners beside it say; none where they do not.
fn place(
    board: &Chessboard,
    node: &dyn Fn(i32, i32) -> Option<Joint>,
    column: i32,
    row: i32,
) -> Option<Place<impl Fn(PlanePoint) -> f32 + use<>>> {
    let at = |c: i32, r: i32| PlanePoint::new(c as f64, r as f64);
    let around = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (column + du, row + dv)));
    let pairs: Vec<(PlanePoint, Pixel)> =
        around.filter_map(|(c, r)| Some((at(c, r), node(c, r)?.pixel))).collect();
    let map = Homography::fit(&pairs)?;
    let place = at(column, row);
    let found = node(column, row)?.pixel;
    let beside = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)];
    let half_px = beside.map(|(x, y)| (map.at(&(place + PlanePoint::new(x, y))) - found).norm());
    let square_px = 2.0 * half_px.into_iter().fold(f64::INFINITY, f64::min);
    let last = PlanePoint::new(board.columns as f64, board.rows as f64);
    // Corner 0 has a black square between it and the next ones; outside of the outer squares the board is white.
    let ink = move |x: PlanePoint| {
        let is_inside = -1.0 <= x.x && -1.0 <= x.y && x.x < last.x && x.y < last.y;
        let is_even = (x.x.floor() + x.y.floor()).rem_euclid(2.0) == 0.0;
        if is_inside && is_even { -1.0 } else { 1.0 }
    };
    Some(Place { found, place, map, square_px, clear_px: f64::INFINITY, reach_px: MAX_MOVE_PX, ink })
}

/// Every window of the lattice as large as the board, in every orientation. The lattice is larger than the board
/// where the background continues the pattern by chance.
fn placements(grid: &Grid, board: &Chessboard) -> Vec<Placement> {
    let (w, h) = (grid.width as i32, grid.height as i32);
    let mut all = Vec::new();
    for (column_step, row_step) in [
        ((1, 0), (0, 1)),
        ((0, 1), (-1, 0)),
        ((-1, 0), (0, -1)),
        ((0, -1), (1, 0)),
        ((1, 0), (0, -1)),
        ((0, 1), (1, 0)),
        ((-1, 0), (0, 1)),
        ((0, -1), (-1, 0)),
    ] {
        for origin in (0..w).flat_map(|u| (0..h).map(move |v| (u, v))) {
            let placement = Placement { origin, column_step, row_step };
            let (u, v) = placement.node(board.columns as i32 - 1, board.rows as i32 - 1);
            if 0 <= u && u < w && 0 <= v && v < h {
                all.push(placement);
            }
        }
    }
    all
}

fn n_labelled(grid: &Grid, board: &Chessboard, p: &Placement) -> usize {
    let cells =
        (0..board.rows as i32).flat_map(|row| (0..board.columns as i32).map(move |column| (column, row)));
    cells.map(|(column, row)| p.node(column, row)).filter(|&(u, v)| grid.at(u, v).is_some()).count()
}

/// Mean of a lattice line of the placed board; rows when `along_row`, else columns.
fn line_mean(
    grid: &Grid,
    board: &Chessboard,
    p: &Placement,
    row: Option<i32>,
    column: Option<i32>,
) -> Option<Pixel> {
    let (rows, columns) = (board.rows as i32, board.columns as i32);
    let cells = (0..rows).flat_map(|r| (0..columns).map(move |c| (c, r)));
    let on_line = cells.filter(|&(c, r)| row.is_none_or(|x| x == r) && column.is_none_or(|x| x == c));
    let nodes: Vec<Pixel> =
        on_line.map(|(c, r)| p.node(c, r)).filter_map(|(u, v)| grid.at(u, v)).map(|n| n.pixel).collect();
    if nodes.is_empty() { None } else { Some(nodes.iter().sum::<Pixel>() / nodes.len() as f64) }
}

/// Seen from the front, x to the right and y down turn clockwise in the image.
fn is_right_handed(grid: &Grid, board: &Chessboard, p: &Placement) -> bool {
    let line = |row, column| line_mean(grid, board, p, row, column);
    let (last_row, last_column) = (board.rows as i32 - 1, board.columns as i32 - 1);
    let x_axis = line(None, Some(last_column)).zip(line(None, Some(0))).map(|(b, a)| b - a);
    let y_axis = line(Some(last_row), None).zip(line(Some(0), None)).map(|(b, a)| b - a);
    x_axis.zip(y_axis).is_some_and(|(x, y)| 0.0 < x.x * y.y - x.y * y.x)
}

/// How far the last row lies below the first, pixels.
fn drop_px(grid: &Grid, board: &Chessboard, p: &Placement) -> f64 {
    let row = |r| line_mean(grid, board, p, Some(r), None);
    row(board.rows as i32 - 1).zip(row(0)).map_or(f64::NEG_INFINITY, |(last, first)| last.y - first.y)
}

/// Whether squares of the colour of the one inside corner 0 are darker than the others.
fn inner_square_is_black(grid: &Grid, board: &Chessboard, p: &Placement, image: &GrayImage) -> bool {
    let mut sums = [0.0; 2];
    let mut counts = [0.0; 2];
    for row in 0..board.rows as i32 - 1 {
        for column in 0..board.columns as i32 - 1 {
            let node = |dc, dr| {
                let (u, v) = p.node(column + dc, row + dr);
                grid.at(u, v).map(|n| n.pixel)
            };
            let (Some(a), Some(b), Some(c), Some(d)) = (node(0, 0), node(1, 0), node(1, 1), node(0, 1))
            else {
                continue;
            };
            let parity = ((row + column) % 2) as usize;
            sums[parity] += sample(image, &((a + b + c + d) / 4.0));
            counts[parity] += 1.0;
        }
    }
    // A 2 × 2 board has one square only: nothing to compare with, and every numbering is as good.
    counts.contains(&0.0) || sums[0] / counts[0] < sums[1] / counts[1]
}

/// Grey value at the nearest pixel.
fn sample(image: &GrayImage, pixel: &Pixel) -> f64 {
    let clamp = |x: f64, n: u32| x.round().clamp(0.0, (n - 1) as f64) as u32;
    image.at(clamp(pixel.x, image.width_px), clamp(pixel.y, image.height_px)) as f64
}
