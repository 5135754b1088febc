//! Finds grids of circles: dark dots (`dots`) joined to a square lattice (`grow`), its place in the grid (`place`), and the centre of each circle
//! from the centre of its image (`centre`).
//!
//! Ids run along the rows as OpenCV's. Where the grid looks the same after a rotation, the most upright numbering is taken, whose last row is
//! lowest below its first row in the image. A mirrored numbering is never returned. A partly hidden grid gets ids when white paper beyond each
//! of its sides shows where it ends; a grid with another number of rows or columns gets none. Derivations: docs/math/circle_grid.md.

mod centre;
mod grow;
mod place;

use super::DetectError;
use super::dots::{Dot, DotConfig, DotFinder, Polarity};
use crate::GrayImage;
use grow::Lattice;
use place::{Board, Numbered};
use resight_core::correspondence::Detection;
use resight_core::target::CircleGrid;

/// A place in a lattice, or a column and row of the grid in units of its spacing.
type Node = (i32, i32);

/// Finds one grid of circles; keeps its buffers between images.
pub(super) struct CircleFinder {
    grid: CircleGrid,
    dots: DotFinder,
}

/// Fewer circles are no grid that is worth naming: among hundreds of dots, chance forms some.
const LEAST_NAMED: u32 = 16;
/// Smaller lattices arise by chance among dots.
const LEAST_NODES: usize = 6;

impl CircleFinder {
    pub fn new(grid: &CircleGrid) -> Self {
        let dots = DotFinder::new(Polarity::DarkOnLight, DotConfig::default().min_contrast);
        CircleFinder { grid: *grid, dots }
    }

    /// Finds the centres of the circles. Fails where several such grids are in view.
    pub fn detect(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DetectError> {
        let dots = self.dots.dots(image)?;
        let board = Board { grid: &self.grid, dots: &dots, image };
        let mut found: Vec<Numbered> = lattices(&dots).filter_map(|l| board.place(&l)).collect();
        match found.len() {
            0 => Ok(Vec::new()),
            1 => Ok(centre::centres(&self.grid, &dots, &found.remove(0))),
            count => Err(DetectError::BoardCopies { kind: "circle grid", count }),
        }
    }

    /// Returns the largest rectangle of circles in an image, symmetric or not, with the spacing of the grid searched for, and whether its margin
    /// shows that it is all of a grid; `None` where there is none.
    pub fn largest_grid(&mut self, image: &GrayImage) -> Option<(CircleGrid, bool)> {
        let dots = self.dots.dots(image).ok()?;
        let complete = |lattice: Lattice| {
            let grid = place::complete_grid(&lattice, &self.grid)?;
            let board = Board { grid: &grid, dots: &dots, image };
            let is_all = board.place(&lattice).is_some_and(|numbered| board.has_margin(&numbered));
            (LEAST_NAMED <= grid.rows * grid.columns).then_some((grid, is_all))
        };
        lattices(&dots).filter_map(complete).max_by_key(|(grid, _)| grid.rows * grid.columns)
    }
}

/// Returns the lattices of an image, each dot in at most one of them.
fn lattices(dots: &[Dot]) -> impl Iterator<Item = Lattice> + '_ {
    let mut is_taken = vec![false; dots.len()];
    (0..dots.len()).filter_map(move |seed| {
        let lattice =
            Some(seed).filter(|seed| !is_taken[*seed]).and_then(|seed| grow::grown(dots, &is_taken, seed))?;
        let is_one = LEAST_NODES <= lattice.nodes.len() && lattice.is_regular(dots);
        if is_one {
            lattice.nodes.values().for_each(|dot| is_taken[*dot] = true);
        }
        is_one.then_some(lattice)
    })
}
