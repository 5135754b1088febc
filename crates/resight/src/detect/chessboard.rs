//! Finds chessboards: saddle points (ChESS corners) joined to a lattice, and numbered in the convention of this crate.
//!
//! Corner ids run along the rows of `columns` corners. Corner 0 has a **black** square on its inner side (between corners 0, 1 and `columns`).
//! For an odd sum of rows and columns (OpenCV's 9 × 6 board) this leaves exactly one numbering, that of OpenCV. Where the colours allow several
//! (even sum: half a turn; square boards of odd squares: quarter turns) no detector can distinguish them: as in OpenCV, the most upright is
//! taken, whose last row is lowest below its first row in the image. A mirrored numbering is never returned.
//!
//! Saddle points are linked along the edges of squares (`linked`), whatever the lens. A board that is nearly whole then, or that `calib-targets` finds
//! nearly whole, is used directly. Otherwise the pieces, or black squares (`squares`), are grown node by node (`grow`). The ids of a partly visible board follow from its outer edges (`place`); where these are not conclusive, no id is
//! given, and [`Outcome::Part`] is returned.

mod grow;
mod lattice;
mod linked;
mod margin;
mod outline;
mod place;
pub(super) mod squares;

use super::homography::{Homography, PlanePoint, floor};
use super::joints::{CornerWindow, Joint, corner_config, corners, darkened, halved, nearest};
use super::print::{self, Common, Place as Surroundings};
use super::template::REDRAWN_PX;
use super::{DetectError, noise, sigma};
use crate::GrayImage;
use calib_targets_chessboard::{ChessCorner, ChessboardDetector, ChessboardParams};
use calib_targets_core::DetectorConfig;
use grow::{MOST_NODES, Pattern};
use lattice::{Lattice, Node, SIDES};
use outline::Outline;
use place::{MIN_LABELLED, Observed, Place, Placement};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{Chessboard, Feature};
use std::cell::OnceCell;
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
/// An image is searched as an overexposed one where one lattice has at least this share of the corners.
const SHARE_OF_PIECE: f64 = 0.25;
/// Largest distance between the same saddle point at two levels, pixels of the smaller image.
const SAME_JOINT: f64 = 1.0;
/// Radius in which a saddle point belongs to a line beyond the board, in squares.
const BESIDE_SQUARES: f64 = 0.3;
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
        let search = Search {
            finder: self,
            image,
            noise_gray: noise::noise_gray(image),
            corners: &corners,
            levels: Default::default(),
        };
        let (found, mut pieces) = search.linked();
        if found != Outcome::Nothing {
            return search.alone(found);
        }
        for detector in &self.detectors {
            let (whole, others) = search.split(labelled(detector, &corners));
            pieces.extend(others);
            match whole.len() {
                0 => {}
                1 => {
                    let found = whole.into_iter().map(|(l, p)| search.whole(l, &p, false)).next();
                    return search.alone(found.unwrap_or(Outcome::Nothing));
                }
                count => return Outcome::Copies(count),
            }
        }
        let found = search.by_pieces(pieces);
        search.alone(found)
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

fn detection(id: u32, pixel: Pixel, sigma_px: f64) -> Detection {
    let feature = Feature { id, corner: 0 };
    Detection { feature, pixel, sigma_px, lens_sigma_px: sigma::LENS_PX, covariance_px2: None }
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
    /// The saddle points of the image at full size.
    corners: &'a [ChessCorner],
    /// The saddle points of each level, once they are needed.
    levels: [OnceCell<Vec<Joint>>; LEVELS],
}

impl Search<'_> {
    /// Returns the saddle points of a level, the strongest first, in pixels of the original image. Those of a reduced image that a larger one
    /// shows too have their position there, which is more accurate.
    fn joints(&self, level: usize) -> &[Joint] {
        self.levels[level].get_or_init(|| match level {
            0 => strongest_first(self.corners, 1.0),
            _ => self.joints_of(&self.reduced(level), level),
        })
    }

    /// Returns the image at a level.
    fn reduced(&self, level: usize) -> GrayImage {
        (1..level).fold(halved(self.image), |image, _| halved(&image))
    }

    fn joints_of(&self, reduced: &GrayImage, level: usize) -> Vec<Joint> {
        let scale = (1 << level) as f64;
        let mut joints = strongest_first(&corners(reduced, &self.finder.config), scale);
        for joint in &mut joints {
            let mut larger =
                (0..level).filter_map(|k| nearest(self.joints(k), &joint.pixel, SAME_JOINT * scale));
            *joint = larger.next().unwrap_or(*joint);
        }
        joints
    }

    /// Returns the saddle points of all levels, with those between black squares that white separates: in an overexposed image, it flows over the
    /// corners. They are found in reduced images in which white is narrower by a pixel to each side.
    fn joints_of_overexposed(&self) -> Vec<Joint> {
        let darkened = (1..LEVELS).map(|level| self.joints_of(&darkened(&self.reduced(level)), level));
        let levels = (0..LEVELS).map(|level| self.joints(level).to_vec());
        let mut all: Vec<Joint> = Vec::new();
        for joint in darkened.chain(levels).flatten() {
            if nearest(&all, &joint.pixel, SAME_CORNER_PX).is_none() {
                all.push(joint);
            }
        }
        all
    }

    /// Returns the most complete board whose saddle points are linked by edges, and the lattices that are not nearly whole.
    fn linked(&self) -> (Outcome, Vec<Lattice>) {
        let n_corners = (self.finder.board.rows * self.finder.board.columns) as usize;
        let (mut best, mut pieces) = (None::<(Lattice, Placement)>, Vec::<Lattice>::new());
        for level in 0..=LEVELS {
            let known = pieces.iter().chain(best.iter().map(|(lattice, _)| lattice));
            let largest = known.map(|lattice| lattice.nodes.len()).max().unwrap_or(0);
            let lattices = match level {
                LEVELS if (largest as f64) < SHARE_OF_PIECE * n_corners as f64 => break,
                LEVELS => linked::lattices(&self.joints_of_overexposed(), self.image, self.noise_gray),
                _ => linked::lattices(self.joints(level), self.image, self.noise_gray),
            };
            let (whole, others) = self.split(lattices);
            pieces.extend(others);
            if 1 < whole.len() {
                return (Outcome::Copies(whole.len()), pieces);
            }
            let more = |(lattice, _): &(Lattice, Placement)| {
                best.as_ref().is_none_or(|(known, _)| known.nodes.len() < lattice.nodes.len())
            };
            best = whole.into_iter().find(more).or(best);
            if best.as_ref().is_some_and(|(lattice, _)| n_corners <= lattice.nodes.len()) {
                break;
            }
        }
        match best {
            Some((lattice, p)) if self.continues(&lattice, &p) => {
                pieces.push(lattice);
                (Outcome::Nothing, pieces)
            }
            Some((lattice, p)) => (self.whole(lattice, &p, true), pieces),
            None => (Outcome::Nothing, pieces),
        }
    }

    /// Returns whether the print of the pattern is visible beyond a side of the board, on a line that edges do not link to it.
    fn continues(&self, lattice: &Lattice, p: &Placement) -> bool {
        let board = p.extent(&self.finder.board);
        let joints = self.levels.iter().filter_map(OnceCell::get);
        let has_joint = |node: Node| {
            let Some(map) = lattice.map_near(node) else { return false };
            let at = map.at(&PlanePoint::zeros());
            let square_px =
                [(1.0, 0.0), (0.0, 1.0)].map(|(x, y)| (map.at(&PlanePoint::new(x, y)) - at).norm());
            let within_px = BESIDE_SQUARES * square_px[0].min(square_px[1]);
            joints.clone().any(|joints| nearest(joints, &at, within_px).is_some())
        };
        let has_joints = |outside: &Node| lattice.beyond(&board, *outside).any(has_joint);
        let sides: Vec<Node> = SIDES.into_iter().filter(has_joints).collect();
        let Some(dark) = place::dark(lattice, self.image).filter(|_| !sides.is_empty()) else { return false };
        let pattern = Pattern::new(self.image, self.joints(0), self.noise_gray, dark, lattice);
        sides.into_iter().any(|outside| pattern.continues(lattice, &board, outside))
    }

    /// Splits lattices into nearly whole boards and other pieces.
    fn split(&self, lattices: Vec<Lattice>) -> (Vec<(Lattice, Placement)>, Vec<Lattice>) {
        let (mut whole, mut others) = (Vec::new(), Vec::new());
        for lattice in lattices {
            let seen = Observed::new(&lattice, &self.finder.board, self.image);
            match seen.map(|seen| seen.place_whole()) {
                Some(Place::Known(p)) => whole.push((lattice, p)),
                _ => others.push(lattice),
            }
        }
        (whole, others)
    }

    /// Returns the board, unless the corners beside it form another one.
    fn alone(&self, found: Outcome) -> Outcome {
        let Outcome::Board(board) = &found else { return found };
        let beside = Outline::around(board, &self.finder.board);
        let rest: Vec<ChessCorner> = self
            .corners
            .iter()
            .filter(|c| !beside.holds(&Pixel::new(c.position.x as f64, c.position.y as f64)))
            .cloned()
            .collect();
        let needed = (self.finder.board.rows * self.finder.board.columns) as f64;
        if (rest.len() as f64) < SHARE_OF_COPY * needed {
            return found;
        }
        for detector in &self.finder.detectors {
            let (whole, others) = self.split(labelled(detector, &rest));
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

    /// Returns a nearly whole board, with the corners that it misses where their print is visible. Corners that are linked by edges remain without
    /// a visible print too, since they are there, but their positions are uncertain.
    fn whole(&self, lattice: Lattice, p: &Placement, is_linked: bool) -> Outcome {
        let board = &self.finder.board;
        let mut found = self.finder.refined(&lattice, p, self.image, false);
        let n_corners = (board.rows * board.columns) as usize;
        let dark = place::dark(&lattice, self.image)
            .filter(|_| found.len() < n_corners && lattice.nodes.len() <= MOST_NODES);
        let grown = dark.map(|dark| self.grown(lattice.clone(), dark, self.joints(0), &mut Vec::new()));
        if let Some(Outcome::Board(more)) = grown {
            // The new corners are used only if they are numbered in the same way.
            let is_same = |d: &Detection| {
                let known = found.iter().find(|k| k.feature == d.feature);
                known.is_none_or(|k| (k.pixel - d.pixel).norm() < SAME_CORNER_PX)
            };
            if more.iter().all(is_same) {
                add(&mut found, more.into_iter());
            }
        }
        if is_linked {
            let corner = |(column, row): (i32, i32)| {
                let joint = lattice.at(p.node(column, row))?;
                let sigma_px = joint.sigma_px.max(sigma::UNEXPLAINED_PX);
                Some(detection((row * board.columns as i32 + column) as u32, joint.pixel, sigma_px))
            };
            add(&mut found, Placement::cells(board).filter_map(corner));
        }
        found.sort_by_key(|d| d.feature);
        Outcome::Board(found)
    }

    /// Returns the best board grown at the levels of the image, starting with what was found already.
    fn by_pieces(&self, mut pieces: Vec<Lattice>) -> Outcome {
        let mut best = Outcome::Nothing;
        for level in 0..LEVELS {
            best = better(best, self.at_level(std::mem::take(&mut pieces), self.joints(level)));
            if self.is_enough(&best) {
                break;
            }
        }
        best
    }

    fn is_enough(&self, found: &Outcome) -> bool {
        let n_corners = (self.finder.board.rows * self.finder.board.columns) as usize;
        matches!(found, Outcome::Board(corners) if n_corners <= 2 * corners.len())
    }

    /// Grows the largest piece, and squares that are not in it.
    fn at_level(&self, mut pieces: Vec<Lattice>, joints: &[Joint]) -> Outcome {
        pieces.sort_by_key(|piece| std::cmp::Reverse(piece.nodes.len()));
        pieces.retain(|piece| piece.nodes.len() <= MOST_NODES);
        pieces.truncate(1);
        let mut best = Outcome::Nothing;
        let mut grown: Vec<Lattice> = Vec::new();
        for piece in pieces {
            if let Some(dark) = place::dark(&piece, self.image) {
                best = better(best, self.grown(piece, dark, joints, &mut grown));
            }
        }
        if self.is_enough(&best) {
            return best;
        }
        let squares = squares::black_squares(joints, self.image, self.noise_gray);
        for square in squares {
            if MOST_SEEDS <= grown.len() || self.is_enough(&best) {
                break;
            }
            let corners = square.map(|k| joints[k]);
            if grown.iter().any(|lattice| corners.iter().any(|joint| holds(lattice, joint))) {
                continue;
            }
            let nodes = [(0, 0), (1, 0), (1, 1), (0, 1)].into_iter().zip(corners);
            best = better(best, self.grown(Lattice { nodes: nodes.collect() }, 0, joints, &mut grown));
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

/// Adds the corners that are not known yet.
fn add(found: &mut Vec<Detection>, more: impl Iterator<Item = Detection>) {
    let known: BTreeSet<Feature> = found.iter().map(|d| d.feature).collect();
    found.extend(more.filter(|d| !known.contains(&d.feature)));
}

/// Returns the lattices that the library finds among saddle points.
fn labelled(detector: &ChessboardDetector, corners: &[ChessCorner]) -> Vec<Lattice> {
    detector.detect_all(corners).iter().map(Lattice::labelled).collect()
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
