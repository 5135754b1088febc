//! Grows a piece of a checker pattern to the visible part of the board; the print confirms each node.
//!
//! The known nodes predict their neighbours through a homography; where the print explains the image, the neighbour becomes a node. Angles,
//! lengths and gaps do not matter, so that this finds boards that the library's rules about them exclude: boards in strong perspective, blurred
//! by motion, partly hidden. At the outer edge of the board the print differs (squares on one side, the white margin on the other), which shows
//! where the board ends. Derived in docs/math/print.md, section 3.

use super::super::homography::{PlanePoint, floor};
use super::super::joints::{Joint, nearest};
use super::super::template::{self, Fit, Printed, REDRAWN_PX, Window};
use super::lattice::{Extent, Lattice, Node};
use super::margin;
use super::place::Ends;
use super::squares;
use crate::GrayImage;
use resight_core::Pixel;
use std::collections::BTreeMap;

/// Least share of the variance that the print has to explain. At the end of the board, its inner print explains a third.
const EXPLAINED: f64 = 0.6;
/// Least contrast of a print, grey levels.
const CONTRAST_GRAY: f64 = 10.0;
/// Radius around its prediction in which a node is searched for, in squares,
const SEARCH_SQUARES: f64 = 0.2;
/// within these bounds, pixels.
const SEARCH_PX: (f64, f64) = (2.0, 4.0);
/// Radius around a node in which the print is compared, in squares,
const PRINT_SQUARES: f64 = 0.45;
/// within these bounds, pixels.
const PRINT_PX: (f64, f64) = (4.0, 8.0);
/// Bending of the rows by the lens from square to square, in squares: a saddle point this near to a prediction is tried first.
const JOINT_SQUARES: f64 = 0.3;
/// Largest distance between the print and its saddle point, pixels.
const JOINT_PX: f64 = 2.0;
/// Shortest edge of a square with a visible print.
const LEAST_SQUARE_PX: f64 = 4.0;
/// A joint farther than this from the position of its print, in pixels, is another one.
const SAME_PX: f64 = 1.5;
/// Blurs that are tried, standard deviations in pixels.
const BLURS_PX: [f64; 4] = [0.8, 1.3, 2.0, 3.2];
/// Number of nodes from which the blur is estimated.
const BLUR_NODES: usize = 6;
/// A node is searched for again once this many more of its neighbours are known.
const MORE_KNOWN: usize = 3;
/// Largest number of nodes searched for beyond gaps.
const MOST_LOOKS: usize = 2000;
/// Larger lattices are not grown: each node takes a tenth of a millisecond, and boards have hundreds.
pub(super) const MOST_NODES: usize = 4000;
/// A black square outside the outermost corners is sampled within its outer edge and beyond it, squares from the corners,
const INSIDE: f64 = 0.8;
const BEYOND: f64 = 1.2;
/// and has to be black there, and no longer black, to within these shares of the contrast.
const STILL_BLACK: f64 = 0.15;
const NO_LONGER_BLACK: f64 = 0.2;
/// Smallest number of nodes that show the edge of the board on one side.
const LEAST_AT_EDGE: usize = 2;

/// A checker pattern in an image.
pub(super) struct Pattern<'a> {
    pub image: &'a GrayImage,
    /// The saddle points of the image.
    joints: &'a [Joint],
    pub noise_gray: f64,
    /// Colour of the squares: 0 if those whose first node has an even u + v are black, 1 if the others are.
    pub dark: i32,
    blur_px: f64,
    /// The part of the lattice that the board covers, once it is known.
    board: Option<Extent>,
}

/// The side on which the board ends at a node: the step that leads out of the board.
type Outside = Option<Node>;

impl<'a> Pattern<'a> {
    /// Returns the pattern that explains most of a lattice's nodes best.
    pub fn new(
        image: &'a GrayImage,
        joints: &'a [Joint],
        noise_gray: f64,
        dark: i32,
        lattice: &Lattice,
    ) -> Self {
        let every = (lattice.nodes.len() / BLUR_NODES).max(1);
        let explained = |blur_px: f64| -> f64 {
            let pattern = Pattern { image, joints, noise_gray, dark, blur_px, board: None };
            let some = lattice.nodes.keys().skip(every / 2).step_by(every).take(BLUR_NODES);
            some.filter_map(|node| pattern.look(lattice, *node, None)).map(|fit| fit.explained).sum()
        };
        let shares = BLURS_PX.map(explained);
        let best = (0..BLURS_PX.len()).max_by(|&a, &b| shares[a].total_cmp(&shares[b]).then(b.cmp(&a)));
        Pattern { image, joints, noise_gray, dark, blur_px: BLURS_PX[best.unwrap_or(0)], board: None }
    }

    /// Removes nodes without a visible print, and moves the others to their print.
    pub fn keep_vouched(&self, lattice: &mut Lattice) {
        let vouched = |(node, joint): (&Node, &Joint)| {
            let fit = self.look(lattice, *node, None)?;
            ((fit.pixel - joint.pixel).norm() <= SAME_PX).then(|| (*node, printed(&fit)))
        };
        lattice.nodes = lattice.nodes.iter().filter_map(vouched).collect();
    }

    /// Adds neighbours of nodes as long as their print is visible, up to `most` columns and rows.
    pub fn grow(&self, lattice: &mut Lattice, most: i32) {
        let mut tried: BTreeMap<Node, usize> = BTreeMap::new();
        for _ in 0..2 * most {
            let mut rim = rim(lattice);
            rim.retain(|(node, known)| {
                2 <= *known && tried.get(node).is_none_or(|before| before + MORE_KNOWN <= *known)
            });
            rim.sort_by_key(|(node, known)| (std::cmp::Reverse(*known), *node));
            let mut grew = false;
            for (node, known) in rim {
                tried.insert(node, known);
                if MOST_NODES <= lattice.nodes.len() {
                    break;
                }
                if fits_within(lattice, node, most) && self.add(lattice, node) {
                    grew = true;
                }
            }
            if !grew {
                break;
            }
        }
        trim(lattice);
    }

    /// Searches for all nodes of the board, beyond gaps too, and again for those beside its outer squares, whose window may contain the margin.
    pub fn complete(&mut self, lattice: &mut Lattice, board: Extent, nodes: impl Iterator<Item = Node>) {
        self.board = Some(board);
        let Extent { u, v } = board;
        for node in nodes.take(MOST_LOOKS) {
            let is_outermost = node.0 == u.0 || node.0 == u.1 || node.1 == v.0 || node.1 == v.1;
            let is_known = lattice.at(node).is_some();
            if is_outermost && is_known {
                match self.look(lattice, node, None) {
                    Some(fit) => lattice.nodes.insert(node, printed(&fit)),
                    None => lattice.nodes.remove(&node),
                };
            } else if !is_known {
                self.add(lattice, node);
            }
        }
    }

    fn add(&self, lattice: &mut Lattice, node: Node) -> bool {
        let Some(fit) = self.look(lattice, node, None) else { return false };
        // A second node at the same position would lead to a lattice that is folded over.
        if lattice.nodes.values().any(|joint| (joint.pixel - fit.pixel).norm() < LEAST_SQUARE_PX) {
            return false;
        }
        lattice.nodes.insert(node, printed(&fit));
        true
    }

    /// Returns the sides on which the print of the board's outer edge is visible.
    pub fn ends(&self, lattice: &Lattice) -> Ends {
        let Some(extent) = lattice.extent() else { return Ends::default() };
        let is_end = |outside: Node| {
            let is_outermost = |n: &Node| extent.is_outermost(n, outside);
            let beyond = lattice.nodes.keys().filter(|n| is_outermost(n));
            let beyond = beyond.map(|n| (n.0 + outside.0, n.1 + outside.1));
            let looks: Vec<bool> =
                beyond.map(|node| self.look(lattice, node, Some(outside)).is_some()).collect();
            let seen = looks.iter().filter(|x| **x).count();
            LEAST_AT_EDGE <= seen && looks.len() <= 2 * seen
                || self.squares_end(lattice, outside, is_outermost)
        };
        Ends { u: (is_end((-1, 0)), is_end((1, 0))), v: (is_end((0, -1)), is_end((0, 1))) }
    }

    /// Returns whether the print of inner corners is visible on most of the line beyond a side of the board.
    pub fn continues(&self, lattice: &Lattice, board: &Extent, outside: Node) -> bool {
        let seen: Vec<bool> =
            lattice.beyond(board, outside).map(|node| self.look(lattice, node, None).is_some()).collect();
        seen.len() < 2 * seen.iter().filter(|x| **x).count()
    }

    /// Returns the sides on which the board probably ends: its outer squares end there, before a white margin or at their full length. An object
    /// in front of the board may look the same by chance, so that this shows where a board does not continue, but not where it is.
    pub fn likely_ends(&self, lattice: &Lattice) -> Ends {
        let Some(extent) = lattice.extent() else { return Ends::default() };
        let is_end = |outside: Node| {
            self.squares_end(lattice, outside, |n| extent.is_outermost(n, outside))
                || margin::shows(self.image, lattice, self.dark, outside)
        };
        Ends { u: (is_end((-1, 0)), is_end((1, 0))), v: (is_end((0, -1)), is_end((0, 1))) }
    }

    /// Checks whether the black squares outside an outermost line end one square farther out, as with a narrow margin: all along the line, where
    /// the edge of an object in front of the board would run only by chance.
    fn squares_end(&self, lattice: &Lattice, outside: Node, is_outermost: impl Fn(&Node) -> bool) -> bool {
        let along = if outside.0 == 0 { (1, 0) } else { (0, 1) };
        let (mut ends, mut n) = (0, 0);
        for &node in lattice.nodes.keys().filter(|n| is_outermost(n)) {
            let next = (node.0 + along.0, node.1 + along.1);
            // The square between the two nodes, outside the line.
            let first = (node.0 + outside.0.min(0), node.1 + outside.1.min(0));
            let is_black = (first.0 + first.1).rem_euclid(2) == self.dark;
            let Some(map) = lattice.map_near(node).filter(|_| is_black && lattice.at(next).is_some()) else {
                continue;
            };
            let gray = |out: f64| {
                let place = PlanePoint::new(
                    0.5 * along.0 as f64 + out * outside.0 as f64,
                    0.5 * along.1 as f64 + out * outside.1 as f64,
                );
                squares::gray(self.image, map.at(&place))
            };
            // Inside the line the square is white.
            let seen = gray(-0.5).zip(gray(0.5)).zip(gray(INSIDE).zip(gray(BEYOND)));
            let Some(((white, black), (inside, beyond))) = seen else { continue };
            n += 1;
            let share = |gray: f64| (gray - black) / (white - black).max(CONTRAST_GRAY);
            ends += usize::from(share(inside) < STILL_BLACK && NO_LONGER_BLACK < share(beyond));
        }
        LEAST_AT_EDGE <= ends && 3 * n <= 4 * ends
    }

    /// Fits the print around a node; `None` where it does not explain the image.
    fn look(&self, lattice: &Lattice, node: Node, outside: Outside) -> Option<Fit> {
        let map = lattice.map_near(node)?;
        let zero = PlanePoint::zeros();
        let at = map.at(&zero);
        let beside = [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
        let edges_px = beside.map(|(x, y)| (map.at(&PlanePoint::new(0.5 * x, 0.5 * y)) - at).norm());
        let square_px = 2.0 * edges_px.into_iter().fold(f64::INFINITY, f64::min);
        if !(LEAST_SQUARE_PX <= square_px && square_px.is_finite()) {
            return None;
        }
        let reach_px = (SEARCH_SQUARES * square_px).clamp(SEARCH_PX.0, SEARCH_PX.1);
        let half_px = (PRINT_SQUARES * square_px).clamp(PRINT_PX.0, PRINT_PX.1) as usize;
        let ink = |x: PlanePoint| self.ink(node, x, outside);
        let lay = |start: Pixel, middle: Pixel, within_px: f64, blur_px: f64| {
            let window = Window { half_px, blur_px, noise_gray: self.noise_gray, redrawn_px: REDRAWN_PX };
            let fit = template::fit(self.image, ink, &map, &zero, start, within_px, window)?;
            ((fit.pixel - middle).norm() <= within_px).then_some(fit)
        };
        let shows = |fit: &Fit| EXPLAINED <= fit.explained && CONTRAST_GRAY <= fit.contrast_gray;
        // The edge of a board has no saddle points.
        let joint = if outside.is_some() { None } else { self.joint_of(lattice, node, at, square_px) };
        let at_joint = joint.and_then(|joint| lay(joint, joint, JOINT_PX, self.blur_px)).filter(shows);
        if at_joint.is_some() {
            return at_joint;
        }
        // With more blur, the fit converges from farther away.
        let far_px = self.blur_px.max(0.4 * reach_px);
        let window = Window { half_px, blur_px: far_px, noise_gray: self.noise_gray, redrawn_px: REDRAWN_PX };
        let printed = Printed { ink, image_from_plane: &map, place: &zero };
        let far = template::lie(self.image, &printed, at, reach_px, window);
        let far = far.filter(|far| (far.pixel - at).norm() <= reach_px);
        let near = lay(far.map_or(at, |far| far.pixel), at, reach_px, self.blur_px);
        near.or_else(|| far.and_then(|_| lay(at, at, reach_px, far_px))).filter(shows)
    }

    /// Returns the saddle point of a node: that of a known node, or the nearest one to its predicted position.
    fn joint_of(&self, lattice: &Lattice, node: Node, at: Pixel, square_px: f64) -> Option<Pixel> {
        let known = lattice.at(node).map(|joint| joint.pixel);
        known.or_else(|| nearest(self.joints, &at, JOINT_SQUARES * square_px).map(|joint| joint.pixel))
    }

    /// Returns −1 where the board is black and 1 where it is white, in squares from a node.
    fn ink(&self, node: Node, x: PlanePoint, outside: Outside) -> f32 {
        if outside.is_some_and(|(u, v)| 0.0 < x.x * u as f64 + x.y * v as f64) {
            return 1.0;
        }
        let is_beyond = |x: f64, (first, last): (i32, i32)| x < first as f64 - 1.0 || last as f64 + 1.0 < x;
        if self
            .board
            .is_some_and(|b| is_beyond(node.0 as f64 + x.x, b.u) || is_beyond(node.1 as f64 + x.y, b.v))
        {
            return 1.0;
        }
        let square = floor(x.x) + floor(x.y) + node.0 + node.1;
        if square.rem_euclid(2) == self.dark { -1.0 } else { 1.0 }
    }
}

fn printed(fit: &Fit) -> Joint {
    Joint { pixel: fit.pixel, sigma_px: fit.sigma_px() }
}

/// Returns the nodes beside the known ones, each with the number of its eight neighbours that are known.
fn rim(lattice: &Lattice) -> Vec<(Node, usize)> {
    let mut known: BTreeMap<Node, usize> = BTreeMap::new();
    for &(u, v) in lattice.nodes.keys() {
        let around = (-1..=1).flat_map(|du| (-1..=1).map(move |dv| (u + du, v + dv)));
        around.filter(|n| lattice.at(*n).is_none()).for_each(|n| *known.entry(n).or_default() += 1);
    }
    known.into_iter().collect()
}

fn fits_within(lattice: &Lattice, node: Node, most: i32) -> bool {
    let Some(Extent { u, v }) = lattice.extent() else { return false };
    u.1.max(node.0) - u.0.min(node.0) < most && v.1.max(node.1) - v.0.min(node.1) < most
}

/// Removes outer columns and rows with a single node, which is not enough to report the place of a board.
fn trim(lattice: &mut Lattice) {
    while let Some(Extent { u, v }) = lattice.extent() {
        let single = |is_on: &dyn Fn(&Node) -> bool| {
            let mut on = lattice.nodes.keys().filter(|n| is_on(n));
            on.next().copied().filter(|_| on.next().is_none())
        };
        let lines: [&dyn Fn(&Node) -> bool; 4] =
            [&|n| n.0 == u.0, &|n| n.0 == u.1, &|n| n.1 == v.0, &|n| n.1 == v.1];
        let Some(lone) = lines.iter().find_map(|line| single(line)) else { return };
        lattice.nodes.remove(&lone);
    }
}
