//! The position and orientation in the board of a piece of its pattern.

use super::lattice::{Extent, Lattice, Node};
use crate::GrayImage;
use resight_core::Pixel;
use resight_core::target::Chessboard;

/// A possible placement of the board on the lattice: board (column, row) → lattice (u, v).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Placement {
    origin: Node,
    column_step: Node,
    row_step: Node,
}

impl Placement {
    pub fn node(&self, column: i32, row: i32) -> Node {
        let along = |origin: i32, c: i32, r: i32| origin + column * c + row * r;
        (
            along(self.origin.0, self.column_step.0, self.row_step.0),
            along(self.origin.1, self.column_step.1, self.row_step.1),
        )
    }

    /// Returns the part of the lattice that the board covers.
    pub fn extent(&self, board: &Chessboard) -> Extent {
        let (a, b) = (self.node(0, 0), self.node(board.columns as i32 - 1, board.rows as i32 - 1));
        Extent { u: (a.0.min(b.0), a.0.max(b.0)), v: (a.1.min(b.1), a.1.max(b.1)) }
    }

    /// Iterates over every (column, row) of a board, row by row.
    pub fn cells(board: &Chessboard) -> impl Iterator<Item = (i32, i32)> + Clone + use<> {
        let (rows, columns) = (board.rows as i32, board.columns as i32);
        (0..rows).flat_map(move |row| (0..columns).map(move |column| (column, row)))
    }
}

/// The eight rotations and reflections of a lattice.
const WAYS: [(Node, Node); 8] = [
    ((1, 0), (0, 1)),
    ((0, 1), (-1, 0)),
    ((-1, 0), (0, -1)),
    ((0, -1), (1, 0)),
    ((1, 0), (0, -1)),
    ((0, 1), (1, 0)),
    ((-1, 0), (0, 1)),
    ((0, -1), (-1, 0)),
];

/// The sides on which the print of the board's outer edge is visible: before the first column or row, after the last.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Ends {
    pub u: (bool, bool),
    pub v: (bool, bool),
}

/// A lattice's possible places in the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// The only possible place, up to a rotation that the colours of the board do not distinguish.
    Known(Placement),
    /// One of this many places.
    OneOf(usize),
    /// The lattice is not part of the board.
    Nowhere,
}

/// The data by which a placement of a lattice is judged.
pub(super) struct Observed<'a> {
    lattice: &'a Lattice,
    board: &'a Chessboard,
    extent: Extent,
    /// Sums of the steps in the image from node to node along u and along v.
    steps: (Pixel, Pixel),
    /// Colour of the squares: 0 if those whose first node has an even u + v are dark, 1 if the others are; `None` where only one colour is
    /// visible.
    dark: Option<i32>,
    size_px: Pixel,
}

/// Least number of places reported for a lattice that may be part of a larger board, or a board with a line less.
const LEAST_PLACES: usize = 2;

/// Least share of the corners that must be labelled where there is no other evidence for a place,
pub(super) const MIN_LABELLED: f64 = 0.9;
/// and of each outer row and column: a few wrong labels there would shift the board.
const MIN_OUTER: f64 = 0.5;

impl<'a> Observed<'a> {
    /// Collects the data; `None` for a lattice without a step in either direction.
    pub fn new(lattice: &'a Lattice, board: &'a Chessboard, image: &GrayImage) -> Option<Self> {
        let sum = |du: i32, dv: i32| -> Option<Pixel> {
            let nodes = lattice.nodes.iter();
            let steps = nodes.filter_map(|(n, a)| Some(lattice.at((n.0 + du, n.1 + dv))?.pixel - a.pixel));
            steps.reduce(|a, b| a + b)
        };
        let steps = (sum(1, 0)?, sum(0, 1)?);
        let size_px = Pixel::new(image.width_px as f64, image.height_px as f64);
        Some(Observed {
            lattice,
            board,
            extent: lattice.extent()?,
            steps,
            dark: dark(lattice, image),
            size_px,
        })
    }

    /// Determines the place in which each node is a corner of the board, the colours are right, and the board ends where its edge is visible
    /// (`ends`). There is none where the board would continue beyond a side on which it probably ends (`likely`).
    pub fn place(&self, ends: Ends, likely: Ends) -> Place {
        let fits: Vec<Placement> = self
            .placements()
            .filter(|p| p.extent(self.board).holds(&self.extent) && self.ends_at(p, ends))
            .filter(|p| self.is_possible(p))
            .collect();
        let place = self.most_upright(&fits);
        if let Place::Known(p) = place {
            if !self.ends_at(&p, likely) {
                return Place::Nowhere;
            }
            if !self.is_anchored(&p, ends) {
                return Place::OneOf(LEAST_PLACES);
            }
        }
        place
    }

    /// Returns whether a placement has no line of the board beyond the sides on which it ends.
    fn ends_at(&self, p: &Placement, ends: Ends) -> bool {
        let (seen, window) = (self.extent, p.extent(self.board));
        let side = |is_end: bool, seen: i32, window: i32| !is_end || seen == window;
        side(ends.u.0, seen.u.0, window.u.0)
            && side(ends.u.1, seen.u.1, window.u.1)
            && side(ends.v.0, seen.v.0, window.v.0)
            && side(ends.v.1, seen.v.1, window.v.1)
    }

    /// Returns whether an edge of the board is visible along each direction in which whole lines are missing inside the image. Without it, only
    /// the stated size says that they are hidden, and a board with a line less looks the same.
    fn is_anchored(&self, p: &Placement, ends: Ends) -> bool {
        let (seen, window) = (self.extent, p.extent(self.board));
        let sides = [
            (window.u.0 < seen.u.0, (-1, 0), ends.u),
            (seen.u.1 < window.u.1, (1, 0), ends.u),
            (window.v.0 < seen.v.0, (0, -1), ends.v),
            (seen.v.1 < window.v.1, (0, 1), ends.v),
        ];
        sides.iter().all(|(is_missing, outside, (first, last))| {
            !is_missing || *first || *last || !self.is_inside_beyond(*outside)
        })
    }

    /// Returns whether most of the line beyond the outermost one on a side would be inside the image.
    fn is_inside_beyond(&self, outside: Node) -> bool {
        let is_outermost = |n: &Node| self.extent.is_outermost(n, outside);
        let beyond = self.lattice.nodes.iter().filter(|(n, _)| is_outermost(n)).filter_map(|(n, joint)| {
            let step = joint.pixel - self.lattice.at((n.0 - outside.0, n.1 - outside.1))?.pixel;
            let (at, rim) = (joint.pixel + step, 0.5 * step.norm());
            Some((0..2).all(|axis| rim <= at[axis] && at[axis] + rim < self.size_px[axis]))
        });
        let (inside, all) = beyond.fold((0, 0), |(n, all), is_inside| (n + usize::from(is_inside), all + 1));
        all < 2 * inside
    }

    /// Determines the place of a lattice with nearly all corners of the board. It may be larger than the board where the background continues
    /// the pattern by chance.
    pub fn place_whole(&self) -> Place {
        let needed = MIN_LABELLED * (self.board.rows * self.board.columns) as f64;
        if (self.lattice.nodes.len() as f64) < needed {
            return Place::Nowhere;
        }
        let fits: Vec<(usize, Placement)> = self
            .placements()
            .filter(|p| self.extent.holds(&p.extent(self.board)) && self.is_possible(p))
            .map(|p| (self.n_labelled(&p, |_, _| true).0, p))
            .filter(|(n, p)| needed <= *n as f64 && self.outer_lines_are_seen(p) && !self.continues_beyond(p))
            .collect();
        let most = fits.iter().map(|(n, _)| *n).max().unwrap_or(0);
        let best: Vec<Placement> = fits.iter().filter(|(n, _)| *n == most).map(|(_, p)| *p).collect();
        self.most_upright(&best)
    }

    /// Iterates over every window of the lattice as large as the board, or of the board as large as the lattice, in every orientation.
    fn placements(&self) -> impl Iterator<Item = Placement> {
        let seen = self.extent;
        WAYS.into_iter().flat_map(move |(column_step, row_step)| {
            let at_zero = Placement { origin: (0, 0), column_step, row_step };
            let window = at_zero.extent(self.board);
            let shifts = |seen: (i32, i32), window: (i32, i32)| {
                let (first, last) = (seen.0 - window.0, seen.1 - window.1);
                first.min(last)..=first.max(last)
            };
            let rows = shifts(seen.v, window.v);
            let origins = shifts(seen.u, window.u).flat_map(move |u| rows.clone().map(move |v| (u, v)));
            origins.map(move |origin| Placement { origin, ..at_zero })
        })
    }

    /// Returns whether the board is seen from its front (x to y is clockwise in the image), and the square inside corner 0 is black.
    fn is_possible(&self, p: &Placement) -> bool {
        let (x, y) = (self.along(p.column_step), self.along(p.row_step));
        let (a, b) = (p.node(0, 0), p.node(1, 1));
        let parity = (a.0.min(b.0) + a.1.min(b.1)).rem_euclid(2);
        0.0 < x.x * y.y - x.y * y.x && self.dark.is_none_or(|dark| dark == parity)
    }

    fn along(&self, step: Node) -> Pixel {
        self.steps.0 * step.0 as f64 + self.steps.1 * step.1 as f64
    }

    /// Selects, among placements that cover the same part of the lattice, the one whose rows go down the most.
    fn most_upright(&self, fits: &[Placement]) -> Place {
        let mut windows: Vec<Extent> = fits.iter().map(|p| p.extent(self.board)).collect();
        windows.sort_by_key(|w| (w.u, w.v));
        windows.dedup();
        let drop_px = |p: &Placement| self.along(p.row_step).y;
        match fits.iter().max_by(|a, b| drop_px(a).total_cmp(&drop_px(b))) {
            None => Place::Nowhere,
            Some(best) if windows.len() == 1 => Place::Known(*best),
            Some(_) => Place::OneOf(windows.len()),
        }
    }

    /// Counts the labelled corners of the board on some lines, and all corners on them.
    fn n_labelled(&self, p: &Placement, is_on: impl Fn(i32, i32) -> bool) -> (usize, usize) {
        let on_line = Placement::cells(self.board).filter(|&(c, r)| is_on(c, r));
        on_line.fold((0, 0), |(seen, all), (c, r)| {
            (seen + self.lattice.at(p.node(c, r)).is_some() as usize, all + 1)
        })
    }

    /// Returns whether the pattern continues beyond the board by a whole line: it is then a larger board, of which this could be several parts.
    fn continues_beyond(&self, p: &Placement) -> bool {
        let (rows, columns) = (self.board.rows as i32, self.board.columns as i32);
        let is_line = |nodes: &mut dyn Iterator<Item = (i32, i32)>, length: i32| {
            let labelled = nodes.filter(|(c, r)| self.lattice.at(p.node(*c, *r)).is_some()).count();
            MIN_OUTER * f64::from(length) < labelled as f64
        };
        [-1, columns].into_iter().any(|c| is_line(&mut (0..rows).map(|r| (c, r)), rows))
            || [-1, rows].into_iter().any(|r| is_line(&mut (0..columns).map(|c| (c, r)), columns))
    }

    /// Returns whether enough corners of the first and last rows and columns are labelled.
    fn outer_lines_are_seen(&self, p: &Placement) -> bool {
        let (last_row, last_column) = (self.board.rows as i32 - 1, self.board.columns as i32 - 1);
        let is_seen = |(seen, all): (usize, usize)| MIN_OUTER * all as f64 <= seen as f64;
        is_seen(self.n_labelled(p, |c, _| c == 0))
            && is_seen(self.n_labelled(p, |c, _| c == last_column))
            && is_seen(self.n_labelled(p, |_, r| r == 0))
            && is_seen(self.n_labelled(p, |_, r| r == last_row))
    }
}

/// Determines which squares are darker: those whose first node has an even u + v (0) or the others (1).
pub(super) fn dark(lattice: &Lattice, image: &GrayImage) -> Option<i32> {
    let mut sums = [0.0; 2];
    let mut counts = [0.0; 2];
    for (&(u, v), a) in &lattice.nodes {
        let others = [(u + 1, v), (u + 1, v + 1), (u, v + 1)].map(|n| lattice.at(n));
        let [Some(b), Some(c), Some(d)] = others else { continue };
        let parity = (u + v).rem_euclid(2) as usize;
        sums[parity] += sample(image, &((a.pixel + b.pixel + c.pixel + d.pixel) / 4.0));
        counts[parity] += 1.0;
    }
    // A 2 × 2 board has only one square, so that nothing can be compared and every numbering is equally good.
    (!counts.contains(&0.0)).then(|| (sums[1] / counts[1] <= sums[0] / counts[0]) as i32)
}

/// Returns the grey level of the nearest pixel.
fn sample(image: &GrayImage, pixel: &Pixel) -> f64 {
    let clamp = |x: f64, n: u32| x.round().clamp(0.0, (n - 1) as f64) as u32;
    image.at(clamp(pixel.x, image.width_px), clamp(pixel.y, image.height_px)) as f64
}
