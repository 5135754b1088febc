//! The print of a flat target as outlines, for printers: the pattern that [`render`](super::render) samples.
//!
//! Black cells that share an edge become one outline, so that no thin gap is visible between them.

use super::family::Cells;
use super::pattern::{self, Extent, Pattern};
use super::{RenderError, Style};
use resight_core::{Point, Pose, Target};

/// A black shape on white.
#[derive(Debug, Clone, PartialEq)]
pub enum Ink {
    /// Closed outlines of one area, metres: points inside an odd number of them are black.
    Area(Vec<Vec<[f64; 2]>>),
    /// A disc.
    Disc {
        /// Its centre, metres.
        centre_m: [f64; 2],
        /// Its radius, metres.
        radius_m: f64,
    },
}

/// The print of a target in its plane z = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Least x and y of the pattern, including a tag's white rim, metres.
    pub low_m: [f64; 2],
    /// Greatest x and y.
    pub high_m: [f64; 2],
    /// Whether y points up for the viewer.
    pub is_y_up: bool,
    /// All black shapes.
    pub ink: Vec<Ink>,
}

/// Returns the print of a flat target as designed; `style` states the width of a tag's frame and the diameter of dots.
///
/// # Errors
/// Invalid dimensions, families and ids; surveyed points, and maps whose tags are in more than one plane.
pub fn sheet(target: &Target, style: &Style) -> Result<Sheet, RenderError> {
    let target = target.design();
    target.check()?;
    let down = |extent: Extent| Sheet::of(&extent, false);
    Ok(match target {
        Target::LinePlusOne(t) => down(pattern::line_plus_one(t, style)),
        Target::Tag(t) => down(pattern::tag(&t.family, t.id, t.size_m, style)?),
        Target::AprilGrid(t) => Sheet::of(&pattern::april_grid(t, style)?, true),
        Target::Chessboard(t) => down(pattern::chessboard(t)),
        Target::Charuco(t) => down(pattern::charuco(t)?),
        Target::CircleGrid(t) => down(pattern::circle_grid(t, style)),
        Target::TagMap(t) => {
            let facing =
                t.sheet_facing().ok_or(RenderError::Unsupported { kind: "tag_map in several planes" })?;
            let one = |tag: &resight_core::target::MapTag| {
                let extent = pattern::tag(&t.family, tag.id, tag.size_m, style)?;
                Ok(Sheet::of(&extent, false).moved(&tag.world_from_tag))
            };
            let tags = t.tags.iter().map(one).collect::<Result<Vec<Sheet>, RenderError>>()?;
            Sheet::joined(tags, facing < 0.0)
        }
        other => return Err(RenderError::Unsupported { kind: other.kind() }),
    })
}

impl Sheet {
    fn of((low_m, high_m, pattern): &Extent, is_y_up: bool) -> Self {
        Sheet { low_m: *low_m, high_m: *high_m, is_y_up, ink: ink(pattern, *low_m, *high_m) }
    }

    /// Returns the sheet moved within the plane.
    fn moved(self, plane_from_tag: &Pose) -> Self {
        let place = |[x, y]: [f64; 2]| {
            let p = *plane_from_tag * Point::new(x, y, 0.0);
            [p.x, p.y]
        };
        let area = |ink: Ink| match ink {
            Ink::Area(outlines) => {
                Ink::Area(outlines.into_iter().map(|o| o.into_iter().map(place).collect()).collect())
            }
            Ink::Disc { centre_m, radius_m } => Ink::Disc { centre_m: place(centre_m), radius_m },
        };
        let ([x0, y0], [x1, y1]) = (self.low_m, self.high_m);
        let (low_m, high_m) = bounds([[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(place));
        Sheet { low_m, high_m, ink: self.ink.into_iter().map(area).collect(), ..self }
    }

    fn joined(parts: Vec<Sheet>, is_y_up: bool) -> Self {
        let (low_m, high_m) = bounds(parts.iter().flat_map(|p| [p.low_m, p.high_m]));
        Sheet { low_m, high_m, is_y_up, ink: parts.into_iter().flat_map(|p| p.ink).collect() }
    }

    /// Returns the box around all black shapes, metres: least and greatest x and y.
    pub fn ink_bounds(&self) -> ([f64; 2], [f64; 2]) {
        let corners = self.ink.iter().flat_map(|ink| match ink {
            Ink::Area(outlines) => outlines.concat(),
            Ink::Disc { centre_m: [x, y], radius_m: r } => vec![[x - r, y - r], [x + r, y + r]],
        });
        bounds(corners)
    }
}

/// Returns the least and greatest value of each coordinate.
pub(crate) fn bounds(points: impl IntoIterator<Item = [f64; 2]>) -> ([f64; 2], [f64; 2]) {
    let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    points.into_iter().fold(none, |(low, high), p| {
        ([low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])])
    })
}

/// Black cells of a lattice: cell (row, column) begins at `origin` + (column, row) · `step`.
struct Lattice<'a> {
    origin: [f64; 2],
    step: [f64; 2],
    columns: usize,
    rows: usize,
    is_black: &'a dyn Fn(usize, usize) -> bool,
}

fn ink(pattern: &Pattern, low: [f64; 2], high: [f64; 2]) -> Vec<Ink> {
    match pattern {
        Pattern::Dots { centres, radius_m } => {
            centres.iter().map(|c| Ink::Disc { centre_m: *c, radius_m: *radius_m }).collect()
        }
        Pattern::Tag { cells, cell_m, origin_m } => vec![of_cells(cells, *origin_m, [*cell_m; 2], 0)],
        Pattern::Grid { tags, columns, size_m, gap_m } => grid(tags, *columns, *size_m, *gap_m),
        Pattern::Chess { square_m } => {
            let count = |i: usize| ((high[i] - low[i]) / square_m).round() as usize;
            // The outer corner is one square before corner 0, where squares of even sum are black.
            let is_black = |row: usize, column: usize| (row + column).is_multiple_of(2);
            let (columns, rows) = (count(0), count(1));
            vec![Lattice { origin: low, step: [*square_m; 2], columns, rows, is_black: &is_black }.outlined()]
        }
        Pattern::Charuco { markers, columns, square_m, marker_m, odd } => {
            let rows = markers.len() / columns.max(&1);
            let is_black = |row: usize, column: usize| (row + column) % 2 == *odd;
            let squares = Lattice {
                origin: [0.0; 2],
                step: [*square_m; 2],
                columns: *columns,
                rows,
                is_black: &is_black,
            };
            let marker = |(i, cells): (usize, &Option<Cells>)| {
                let cells = cells.as_ref()?;
                let cell_m = marker_m / cells.per_size as f64;
                let corner = |k: usize| (k as f64 + 0.5) * square_m - 0.5 * cells.per_side as f64 * cell_m;
                Some(of_cells(cells, [corner(i % columns), corner(i / columns)], [cell_m; 2], 0))
            };
            let markers = markers.iter().enumerate().filter_map(marker);
            std::iter::once(squares.outlined()).chain(markers).collect()
        }
    }
}

/// Returns the cells of a tag without its `cut` outer rings; `origin` is the corner of the whole tag.
fn of_cells(cells: &Cells, origin: [f64; 2], step: [f64; 2], cut: usize) -> Ink {
    let n = cells.per_side.saturating_sub(2 * cut);
    let is_black = |row: usize, column: usize| !cells.is_white(row + cut, column + cut);
    let origin = [0, 1].map(|i| origin[i] + cut as f64 * step[i]);
    Lattice { origin, step, columns: n, rows: n, is_black: &is_black }.outlined()
}

/// Returns Kalibr's grid, y up: tags without their rim, and a square at each crossing of gaps.
fn grid(tags: &[Cells], columns: usize, size_m: f64, gap_m: f64) -> Vec<Ink> {
    let pitch = size_m + gap_m;
    let rows = tags.len() / columns.max(1);
    let tag = |(i, cells): (usize, &Cells)| {
        let cell_m = size_m / cells.per_size as f64;
        let rim = (cells.per_side - cells.per_size) / 2;
        let (x, y) = ((i % columns) as f64 * pitch, (i / columns) as f64 * pitch + size_m);
        let origin = [x - rim as f64 * cell_m, y + rim as f64 * cell_m];
        of_cells(cells, origin, [cell_m, -cell_m], rim)
    };
    let square = |i: usize| {
        let at = |k: usize| k as f64 * pitch - gap_m;
        let origin = [at(i % (columns + 1)), at(i / (columns + 1))];
        Lattice { origin, step: [gap_m; 2], columns: 1, rows: 1, is_black: &|_, _| true }.outlined()
    };
    // All are one area: some rasterisers move a path that is a single rectangle to whole pixels.
    let all = tags.iter().enumerate().map(tag).chain((0..(columns + 1) * (rows + 1)).map(square));
    let outlines = all.flat_map(|ink| if let Ink::Area(outlines) = ink { outlines } else { Vec::new() });
    vec![Ink::Area(outlines.collect())]
}

/// Sides of a cell: towards greater column, greater row, lesser column, lesser row; a right turn leads from each to the next.
const STEPS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

impl Lattice<'_> {
    fn is_inked(&self, row: isize, column: isize) -> bool {
        let inside = 0 <= row && 0 <= column && row < self.rows as isize && column < self.columns as isize;
        inside && (self.is_black)(row as usize, column as usize)
    }

    /// Returns whether the edge that leaves a node along a side has black on its right, and white on its left.
    fn is_edge(&self, (x, y): (isize, isize), side: usize) -> bool {
        let (right, left) = match side {
            0 => ((y, x), (y - 1, x)),
            1 => ((y, x - 1), (y, x)),
            2 => ((y - 1, x - 1), (y, x - 1)),
            _ => ((y - 1, x), (y - 1, x - 1)),
        };
        self.is_inked(right.0, right.1) && !self.is_inked(left.0, left.1)
    }

    /// Returns outlines of the black cells, with black on their right; cells that touch at a corner only are separate.
    fn outlined(&self) -> Ink {
        let mut outlines = Vec::new();
        let width = self.columns + 1;
        // Every outline has an edge of the first kind.
        let mut walked = vec![false; width * (self.rows + 1)];
        for start in 0..walked.len() {
            let node = ((start % width) as isize, (start / width) as isize);
            if !walked[start] && self.is_edge(node, 0) {
                outlines.push(self.walk(node, &mut walked));
            }
        }
        Ink::Area(outlines)
    }

    /// Follows one outline, and returns only the nodes where it turns.
    fn walk(&self, start: (isize, isize), walked: &mut [bool]) -> Vec<[f64; 2]> {
        let (mut node, mut side) = (start, 0);
        let mut outline = Vec::new();
        // An outline is no longer than the number of all edges.
        for _ in 0..4 * walked.len() {
            if side == 0 {
                walked[node.1 as usize * (self.columns + 1) + node.0 as usize] = true;
            }
            node = (node.0 + STEPS[side].0, node.1 + STEPS[side].1);
            // The right turn is tried first: it stays with the same cell where two touch.
            let Some(next) =
                [1, 0, 3].map(|turn| (side + turn) % 4).into_iter().find(|s| self.is_edge(node, *s))
            else {
                break;
            };
            if next != side {
                outline.push([
                    self.origin[0] + node.0 as f64 * self.step[0],
                    self.origin[1] + node.1 as f64 * self.step[1],
                ]);
            }
            side = next;
            if node == start && side == 0 {
                break;
            }
        }
        outline
    }
}

#[cfg(test)]
mod tests;
