//! Finds chessboards: saddle points (ChESS corners) joined to a lattice, and numbered in the convention of this crate.
//!
//! Corner ids run along the rows of `columns` corners. Corner 0 has a **black** square on its inner side (between corners 0, 1 and `columns`).
//! For an odd sum of rows and columns (OpenCV's 9 × 6 board) this leaves exactly one numbering, that of OpenCV. Where the colours allow several
//! (even sum: half a turn; square boards of odd squares: quarter turns) no detector can distinguish them: as in OpenCV, the most upright is
//! taken, whose last row is lowest below its first row in the image. A mirrored numbering is never returned.
//!
//! A board that `calib-targets` finds nearly whole is used directly. Otherwise its pieces, or black squares found here (`squares`), are grown
//! node by node (`grow`). The ids of a partly visible board follow from its outer edges (`place`); where these are not conclusive, no id is
//! given, and [`Outcome::Part`] is returned.

mod grow;
mod lattice;
mod margin;
mod outline;
mod place;
pub(super) mod squares;

use super::homography::{Homography, PlanePoint, floor};
use super::joints::{CornerWindow, Joint, corner_config, corners, halved};
use super::print::{self, Common, Place as Surroundings};
use super::template::REDRAWN_PX;
use super::{DetectError, noise, sigma};
use crate::GrayImage;
use calib_targets_chessboard::{ChessCorner, ChessboardDetector, ChessboardParams};
use calib_targets_core::DetectorConfig;
use grow::{MOST_NODES, Pattern};
use lattice::Lattice;
use outline::Outline;
use place::{MIN_LABELLED, Observed, Place, Placement};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{Chessboard, Feature};
use std::collections::BTreeSet;

/// Finds one chessboard.
pub(super) struct ChessboardFinder {
    board: Chessboard,
    window: CornerWindow,
    config: DetectorConfig,
    /// Tried in order until one finds the board: the library's own list of settings, its default first.
    detectors: Vec<ChessboardDetector>,
}

/// The part of a board that an image shows.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outcome {
    /// Its corners.
    Board(Vec<Detection>),
    /// A part of the pattern, with this many columns and rows of corners, that fits this many places of the board.
    Part { columns: u32, rows: u32, places: usize },
    /// The number of boards in view.
    Copies(usize),
    /// No board.
    Nothing,
}

/// The image is searched at full, half and quarter size: saddle points blurred over more than the detector's ring are found in the smaller ones.
const LEVELS: usize = 3;
/// Number of pieces of a library's search, and of squares, that are grown at each level.
const MOST_SEEDS: usize = 3;
/// Largest distance between two measurements of the same corner, pixels.
const SAME_CORNER_PX: f64 = 3.0;
/// Fewer nodes than this do not make a board, unless it has no more.
const LEAST_NODES: usize = 6;
/// If the corners beside a board are at least this share of a board, a second one is searched for among them.
const SHARE_OF_COPY: f64 = 0.5;
/// Least share of a line's nodes that must be present.
const LEAST_OF_LINE: f64 = 0.5;
/// Smallest number of nodes of a part that is reported.
const LEAST_OF_PART: usize = 12;

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

    /// Finds the corners. Fails where several such boards are in view.
    pub fn detect(&self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        match self.look(image) {
            Outcome::Board(found) => Ok(found),
            Outcome::Copies(count) => Err(DetectError::BoardCopies { kind: "chessboard", count }),
            Outcome::Part { .. } | Outcome::Nothing => Ok(Vec::new()),
        }
    }

    /// Returns the rows and columns of inner corners of the largest grid in an image, rows ≤ columns, for any board; `None` where there is no
    /// grid of nine corners.
    pub fn largest_grid(&self, image: &GrayImage) -> Option<(usize, usize)> {
        let corners = corners(image, &self.config);
        let lattices = self.detectors.iter().flat_map(|detector| detector.detect_all(&corners));
        let size = |lattice: Lattice| {
            let lattice = lattice.without_sparse_lines(LEAST_OF_LINE);
            let (columns, rows) = lattice.extent()?.size();
            let is_full = MIN_LABELLED * f64::from(columns * rows) <= lattice.nodes.len() as f64;
            is_full.then_some((columns.min(rows) as usize, columns.max(rows) as usize))
        };
        let sizes = lattices.filter_map(|found| size(Lattice::labelled(&found)));
        sizes.filter(|(rows, _)| 3 <= *rows).max_by_key(|(rows, columns)| rows * columns)
    }

    /// Determines which part of the board the image shows.
    pub fn look(&self, image: &GrayImage) -> Outcome {
        let corners = corners(image, &self.config);
        let search = Search { finder: self, image, noise_gray: noise::noise_gray(image) };
        let mut pieces = Vec::new();
        for detector in &self.detectors {
            let (whole, others) = search.split(detector, &corners);
            pieces.extend(others);
            match whole.len() {
                0 => {}
                1 => {
                    let found = whole.into_iter().map(|(l, p)| search.whole(l, &p, &corners)).next();
                    return search.alone(found.unwrap_or(Outcome::Nothing), &corners);
                }
                count => return Outcome::Copies(count),
            }
        }
        let found = search.by_pieces(pieces, &corners);
        search.alone(found, &corners)
    }

    /// Returns whether all corners are among the detections.
    pub fn is_whole(&self, seen: &[Detection]) -> bool {
        seen.iter().map(|d| d.feature.id).eq(0..self.board.rows * self.board.columns)
    }

    /// Measures the corners of a whole board that are picked, by the print around the given positions of all.
    pub fn measured_near(
        &self,
        image: &GrayImage,
        common: Common,
        places: &[Detection],
        picked: &BTreeSet<Feature>,
    ) -> (Vec<Detection>, f64) {
        let (rows, columns) = (self.board.rows as i32, self.board.columns as i32);
        let node = |column: i32, row: i32| {
            let is_corner = 0 <= column && column < columns && 0 <= row && row < rows;
            let d = is_corner.then(|| &places[(row * columns + column) as usize])?;
            Some(Joint { pixel: d.pixel, sigma_px: d.sigma_px })
        };
        self.measured(&node, image, common, &|id| picked.contains(&Feature { id, corner: 0 }), false)
    }

    /// Refines each corner by the print around it, or in the window that was requested. In a board that was grown by its print (`is_printed`), a
    /// corner without a visible print of its own keeps the position that it had.
    fn refined(
        &self,
        lattice: &Lattice,
        p: &Placement,
        image: &GrayImage,
        is_printed: bool,
    ) -> Vec<Detection> {
        let (rows, columns) = (self.board.rows as i32, self.board.columns as i32);
        let node = |column: i32, row: i32| {
            let is_corner = 0 <= column && column < columns && 0 <= row && row < rows;
            lattice.at(p.node(column, row)).filter(|_| is_corner)
        };
        let common = Common { noise_gray: noise::noise_gray(image), blur_px: None, redrawn_px: REDRAWN_PX };
        self.measured(&node, image, common, &|_| true, is_printed).0
    }

    /// Measures corners given by column and row, those with an id that is picked.
    fn measured(
        &self,
        node: &dyn Fn(i32, i32) -> Option<Joint>,
        image: &GrayImage,
        common: Common,
        is_picked: &dyn Fn(u32) -> bool,
        is_printed: bool,
    ) -> (Vec<Detection>, f64) {
        let columns = self.board.columns as i32;
        let id = |column: i32, row: i32| (row * columns + column) as u32;
        let corner = |(column, row): (i32, i32)| {
            Some((id(column, row), node(column, row)?, around(&self.board, node, column, row)))
        };
        let nodes: Vec<(u32, Joint, Option<Surroundings<_>>)> =
            Placement::cells(&self.board).filter(|(c, r)| is_picked(id(*c, *r))).filter_map(corner).collect();
        let detection = |id: u32, pixel: Pixel, sigma_px: f64| {
            let feature = Feature { id, corner: 0 };
            Detection { feature, pixel, sigma_px, lens_sigma_px: sigma::LENS_PX, covariance_px2: None }
        };
        if let CornerWindow::Half(half_px) = self.window {
            let joints = nodes.into_iter().map(|(id, joint, _)| (id, joint.refined(image, half_px)));
            let refined = joints.map(|(id, joint)| detection(id, joint.pixel, joint.sigma_px));
            return (refined.collect(), 0.0);
        }
        let (joints, places): (Vec<_>, Vec<_>) =
            nodes.into_iter().filter_map(|(id, joint, place)| Some(((id, joint), place?))).unzip();
        let (said, blur_px) = print::measure(image, common, &places);
        let corners = joints.into_iter().zip(said).filter_map(|((id, joint), said)| match said {
            print::Observed::Print { pixel, sigma_px } => Some(detection(id, pixel, sigma_px)),
            print::Observed::Otherwise if !is_printed => None,
            print::Observed::Outside | print::Observed::Otherwise => {
                Some(detection(id, joint.pixel, joint.sigma_px))
            }
        });
        (corners.collect(), blur_px)
    }
}

/// A print that lies farther than this from the saddle point, in pixels, belongs to another corner.
const MAX_MOVE_PX: f64 = 1.5;

/// Fits the print around a corner that the corners beside it predict; `None` where they do not.
fn around(
    board: &Chessboard,
    node: &dyn Fn(i32, i32) -> Option<Joint>,
    column: i32,
    row: i32,
) -> Option<Surroundings<impl Fn(PlanePoint) -> f32 + use<>>> {
    let at = |c: i32, r: i32| PlanePoint::new(c as f64, r as f64);
    let near = (-1..=1).flat_map(|dv| (-1..=1).map(move |du| (column + du, row + dv)));
    let pairs: Vec<(PlanePoint, Pixel)> =
        near.filter_map(|(c, r)| Some((at(c, r), node(c, r)?.pixel))).collect();
    let map = Homography::fit(&pairs)?;
    let place = at(column, row);
    let found = node(column, row)?.pixel;
    let beside = [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)];
    let half_px = beside.map(|(x, y)| (map.at(&(place + PlanePoint::new(x, y))) - found).norm());
    let square_px = 2.0 * half_px.into_iter().fold(f64::INFINITY, f64::min);
    let last = PlanePoint::new(board.columns as f64, board.rows as f64);
    // Corner 0 has a black square between it and the next corners; outside the outer squares the board is white.
    let ink = move |x: PlanePoint| {
        let is_inside = -1.0 <= x.x && -1.0 <= x.y && x.x < last.x && x.y < last.y;
        let is_even = (floor(x.x) + floor(x.y)) % 2 == 0;
        if is_inside && is_even { -1.0 } else { 1.0 }
    };
    Some(Surroundings { found, place, map, square_px, clear_px: f64::INFINITY, reach_px: MAX_MOVE_PX, ink })
}

/// The search for a board whose pieces are grown.
struct Search<'a> {
    finder: &'a ChessboardFinder,
    image: &'a GrayImage,
    noise_gray: f64,
}

impl Search<'_> {
    /// Splits the result of a library's search into nearly whole boards and other pieces.
    fn split(
        &self,
        detector: &ChessboardDetector,
        corners: &[ChessCorner],
    ) -> (Vec<(Lattice, Placement)>, Vec<Lattice>) {
        let (mut whole, mut others) = (Vec::new(), Vec::new());
        for found in detector.detect_all(corners) {
            let lattice = Lattice::labelled(&found);
            let seen = Observed::new(&lattice, &self.finder.board, self.image);
            match seen.map(|seen| seen.place_whole()) {
                Some(Place::Known(p)) => whole.push((lattice, p)),
                _ => others.push(lattice),
            }
        }
        (whole, others)
    }

    /// Returns the board, unless the corners beside it form another one.
    fn alone(&self, found: Outcome, corners: &[ChessCorner]) -> Outcome {
        let Outcome::Board(board) = &found else { return found };
        let beside = Outline::around(board, &self.finder.board);
        let rest: Vec<ChessCorner> = corners
            .iter()
            .filter(|c| !beside.holds(&Pixel::new(c.position.x as f64, c.position.y as f64)))
            .cloned()
            .collect();
        let needed = (self.finder.board.rows * self.finder.board.columns) as f64;
        if (rest.len() as f64) < SHARE_OF_COPY * needed {
            return found;
        }
        for detector in &self.finder.detectors {
            let (whole, others) = self.split(detector, &rest);
            if !whole.is_empty() {
                return Outcome::Copies(1 + whole.len());
            }
            let large = |piece: &&Lattice| SHARE_OF_COPY * needed <= piece.nodes.len() as f64;
            for piece in others.iter().filter(large).filter(|piece| piece.nodes.len() <= MOST_NODES).take(1) {
                let Some(dark) = place::dark(piece, self.image) else { continue };
                let joints = strongest_first(&rest, 1.0);
                if matches!(self.grown(piece.clone(), dark, &joints, &mut Vec::new()), Outcome::Board(_)) {
                    return Outcome::Copies(2);
                }
            }
        }
        found
    }

    /// Returns a board found by the library, with the corners that it missed where their print is visible.
    fn whole(&self, lattice: Lattice, p: &Placement, corners: &[ChessCorner]) -> Outcome {
        let board = &self.finder.board;
        let mut found = self.finder.refined(&lattice, p, self.image, false);
        let is_whole = found.len() == (board.rows * board.columns) as usize;
        let dark =
            place::dark(&lattice, self.image).filter(|_| !is_whole && lattice.nodes.len() <= MOST_NODES);
        let grown =
            dark.map(|dark| self.grown(lattice, dark, &strongest_first(corners, 1.0), &mut Vec::new()));
        if let Some(Outcome::Board(more)) = grown {
            let known = found.clone();
            let same = |d: &Detection| known.iter().find(|k| k.feature == d.feature);
            // The new corners are used only if they are numbered in the same way.
            if more.iter().all(|d| same(d).is_none_or(|k| (k.pixel - d.pixel).norm() < SAME_CORNER_PX)) {
                found.extend(more.into_iter().filter(|d| same(d).is_none()));
                found.sort_by_key(|d| d.feature);
            }
        }
        Outcome::Board(found)
    }

    /// Returns the best board grown at the levels of the image, starting with what was found at full size.
    fn by_pieces(&self, pieces: Vec<Lattice>, corners: &[ChessCorner]) -> Outcome {
        let mut best = self.at_level(pieces, corners, 1.0);
        let mut reduced = halved(self.image);
        for level in 1..LEVELS {
            if self.is_enough(&best) {
                break;
            }
            let corners = super::joints::corners(&reduced, &self.finder.config);
            best = better(best, self.at_level(Vec::new(), &corners, (1 << level) as f64));
            reduced = halved(&reduced);
        }
        best
    }

    fn is_enough(&self, found: &Outcome) -> bool {
        let n_corners = (self.finder.board.rows * self.finder.board.columns) as usize;
        matches!(found, Outcome::Board(corners) if n_corners <= 2 * corners.len())
    }

    /// Grows the largest pieces, and squares that are in none of them. `scale` is the factor by which the image of the corners is reduced.
    fn at_level(&self, mut pieces: Vec<Lattice>, corners: &[ChessCorner], scale: f64) -> Outcome {
        pieces.sort_by_key(|piece| std::cmp::Reverse(piece.nodes.len()));
        pieces.retain(|piece| piece.nodes.len() <= MOST_NODES);
        pieces.truncate(1);
        let joints = strongest_first(corners, scale);
        let mut best = Outcome::Nothing;
        let mut grown: Vec<Lattice> = Vec::new();
        for piece in pieces {
            if let Some(dark) = place::dark(&piece, self.image) {
                best = better(best, self.grown(piece, dark, &joints, &mut grown));
            }
        }
        if self.is_enough(&best) {
            return best;
        }
        let squares = squares::black_squares(&joints, self.image, self.noise_gray);
        for square in squares {
            if MOST_SEEDS <= grown.len() || self.is_enough(&best) {
                break;
            }
            let corners = square.map(|k| joints[k]);
            if grown.iter().any(|lattice| corners.iter().any(|joint| holds(lattice, joint))) {
                continue;
            }
            let nodes = [(0, 0), (1, 0), (1, 1), (0, 1)].into_iter().zip(corners);
            best = better(best, self.grown(Lattice { nodes: nodes.collect() }, 0, &joints, &mut grown));
        }
        best
    }

    /// Grows a piece, and returns it with its place in the board.
    fn grown(&self, mut lattice: Lattice, dark: i32, joints: &[Joint], all: &mut Vec<Lattice>) -> Outcome {
        let board = &self.finder.board;
        let mut pattern = Pattern::new(self.image, joints, self.noise_gray, dark, &lattice);
        pattern.keep_vouched(&mut lattice);
        // The limit is one more than the board has, so that a larger board is recognised as another one.
        let most = board.rows.max(board.columns) as i32 + 1;
        pattern.grow(&mut lattice, most);
        let n = lattice.nodes.len();
        let outcome = match Observed::new(&lattice, board, self.image) {
            Some(seen) if LEAST_NODES.min((board.rows * board.columns) as usize) <= n => {
                seen.place(pattern.ends(&lattice), pattern.likely_ends(&lattice))
            }
            _ => Place::Nowhere,
        };
        let (columns, rows) = lattice.extent().map_or((0, 0), |extent| extent.size());
        let outcome = match outcome {
            Place::Known(p) => {
                let nodes = Placement::cells(board).map(|(c, r)| p.node(c, r));
                pattern.complete(&mut lattice, p.extent(board), nodes);
                Outcome::Board(self.finder.refined(&lattice, &p, self.image, true))
            }
            Place::OneOf(places) if LEAST_OF_PART <= n => {
                Outcome::Part { columns: columns as u32, rows: rows as u32, places }
            }
            _ => Outcome::Nothing,
        };
        all.push(lattice);
        outcome
    }
}

/// Converts saddle points of an image reduced by `scale` to the original image.
fn strongest_first(corners: &[ChessCorner], scale: f64) -> Vec<Joint> {
    let mut strongest: Vec<&ChessCorner> = corners.iter().collect();
    strongest.sort_by(|a, b| b.strength.total_cmp(&a.strength));
    strongest.into_iter().map(|c| enlarged(Joint::new(c), scale)).collect()
}

/// Returns whether a joint is already a node of a lattice.
fn holds(lattice: &Lattice, joint: &Joint) -> bool {
    lattice.nodes.values().any(|node| (node.pixel - joint.pixel).norm() < 3.0)
}

/// Converts a joint of a reduced image, whose pixels are means of `scale` × `scale`, to the original image.
fn enlarged(joint: Joint, scale: f64) -> Joint {
    let middle = Pixel::new(0.5, 0.5) * (scale - 1.0);
    Joint { pixel: joint.pixel * scale + middle, sigma_px: scale * joint.sigma_px }
}

/// Returns the more complete of two outcomes.
fn better(a: Outcome, b: Outcome) -> Outcome {
    let worth = |x: &Outcome| match x {
        Outcome::Board(corners) => (2, corners.len() as u64),
        Outcome::Part { columns, rows, .. } => (1, *columns as u64 * *rows as u64),
        Outcome::Copies(count) => (3, *count as u64),
        Outcome::Nothing => (0, 0),
    };
    if worth(&a) < worth(&b) { b } else { a }
}
