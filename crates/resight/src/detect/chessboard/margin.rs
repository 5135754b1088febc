//! The white margin of a board: beyond the end of the outer squares, whole or cut, the paper is white.
//!
//! The margin shows where a board does not continue: beyond the squares of a larger board black turns into white and white into black, and at an
//! object in front of a board white squares end together with the black ones, unless the object is as white as the paper.

use super::super::homography::{Homography, PlanePoint};
use super::lattice::{Lattice, Node};
use super::squares;
use crate::GrayImage;

/// A square outside the outermost corners is sampled from here on, in squares from the corners,
const FIRST: f64 = 0.25;
/// in these steps,
const STEP: f64 = 0.05;
/// this many times: to a third of a square beyond a whole one.
const STEPS: usize = 23;
/// Largest difference between the ends of the squares of one side, in squares.
const ALIKE: f64 = 0.12;
/// The margin begins within this many steps of the end of a black square; the narrowest margins are a tenth of a square.
const MARGIN_STEPS: usize = 4;
/// Level between black (0) and white (1) at which a square ends,
const HALF: f64 = 0.5;
/// and from which it is white.
const WHITE: f64 = 0.6;
/// Least difference of black and white, grey levels.
const CONTRAST_GRAY: f64 = 10.0;
/// Smallest number of black squares that show the end of a board on one side.
const LEAST: usize = 2;

/// Checks whether the margin is visible along the whole side of a board to which the step `outside` leads. Black are the squares whose first
/// node has an even u + v (`dark` 0), or the others (1).
pub(super) fn shows(image: &GrayImage, lattice: &Lattice, dark: i32, outside: Node) -> bool {
    let Some(extent) = lattice.extent() else { return false };
    let along = if outside.0 == 0 { (1, 0) } else { (0, 1) };
    let (mut black, mut white) = (Vec::new(), Vec::new());
    for &node in lattice.nodes.keys().filter(|n| extent.is_outermost(n, outside)) {
        let next = (node.0 + along.0, node.1 + along.1);
        let Some(map) = lattice.map_near(node).filter(|_| lattice.at(next).is_some()) else { continue };
        // The square between the two nodes, outside the line.
        let first = node.0 + outside.0.min(0) + node.1 + outside.1.min(0);
        let is_black = first.rem_euclid(2) == dark;
        let squares = if is_black { &mut black } else { &mut white };
        squares.extend(Square::new(image, &map, along, outside));
    }
    let mut ends: Vec<f64> = black.iter().filter_map(Square::end).collect();
    ends.sort_by(f64::total_cmp);
    let Some(&middle) = ends.get(ends.len() / 2) else { return false };
    let alike = ends.iter().filter(|end| (*end - middle).abs() <= ALIKE).count();
    let whole = white.iter().filter(|square| square.is_one_colour_to(middle)).count();
    LEAST <= alike && 3 * black.len() <= 4 * alike && 3 * white.len() <= 4 * whole
}

/// Grey levels along the middle of a square, outwards from the line of corners, as a share of the way from the square's own colour (0) to the
/// other colour (1).
struct Square(Vec<f64>);

impl Square {
    /// Samples a square; `None` where it leaves the image, or hardly differs from the square on the other side of the line.
    fn new(image: &GrayImage, map: &Homography, along: Node, outside: Node) -> Option<Self> {
        let gray = |out: f64| {
            let place = PlanePoint::new(
                0.5 * f64::from(along.0) + out * f64::from(outside.0),
                0.5 * f64::from(along.1) + out * f64::from(outside.1),
            );
            squares::gray(image, map.at(&place))
        };
        let (own, other) = (gray(FIRST)?, gray(-0.5)?);
        if (other - own).abs() < CONTRAST_GRAY {
            return None;
        }
        let shares: Vec<f64> = (0..STEPS)
            .map_while(|k| gray(FIRST + STEP * k as f64))
            .map(|g| (g - own) / (other - own))
            .collect();
        Some(Square(shares))
    }

    /// Returns the end of a black square before a white margin, in squares from the line of corners.
    fn end(&self) -> Option<f64> {
        let end = self.0.iter().position(|share| HALF < *share)?;
        let margin = self.0[end..].iter().take(1 + MARGIN_STEPS);
        (WHITE <= margin.copied().fold(0.0, f64::max)).then_some(FIRST + STEP * end as f64)
    }

    /// Returns whether the square has its own colour up to that distance.
    fn is_one_colour_to(&self, out: f64) -> bool {
        let steps = ((out - FIRST) / STEP).round().max(0.0) as usize;
        steps < self.0.len() && self.0[..=steps].iter().all(|share| *share < HALF)
    }
}
