//! The place of a lattice of dots in the grid: which circle each of its dots is.
//!
//! Derivation: docs/math/circle_grid.md section 3.

use super::Node;
use super::grow::Lattice;
use crate::GrayImage;
use crate::detect::dots::Dot;
use crate::detect::homography::{Homography, PlanePoint};
use resight_core::target::CircleGrid;
use resight_core::{Pixel, Target};
use std::collections::BTreeMap;

/// The grid that is searched for, and the image.
pub(super) struct Board<'a> {
    pub grid: &'a CircleGrid,
    pub dots: &'a [Dot],
    pub image: &'a GrayImage,
}

/// A lattice in coordinates of a grid, rotated by a multiple of a quarter turn: node and index of the dot.
type Rotated = Vec<(Node, usize)>;
/// The ids of circles, and the index of the dot of each.
pub(super) type Numbered = Vec<(u32, usize)>;

/// Least share of the circles of a partly hidden grid that must be visible, and their least number.
const LEAST_SHARE: f64 = 0.6;
const LEAST_OF_PART: usize = 12;
/// Least share of an outer line of dots that must be visible.
const LEAST_OF_LINE: f64 = 0.5;
/// Number of nearest circles from which a place beyond the grid is predicted.
const NEAREST: usize = 12;

/// Returns the lattice in coordinates of the grid, once for each rotation.
fn rotated(nodes: &BTreeMap<Node, usize>, asymmetric: bool) -> [Rotated; 4] {
    let straight = |(u, v): Node| if asymmetric { (u - v, u + v) } else { (u, v) };
    let by_quarters = |(x, y): Node, quarters: usize| (0..quarters).fold((x, y), |(x, y), _| (-y, x));
    [0, 1, 2, 3]
        .map(|quarters| nodes.iter().map(|(n, dot)| (by_quarters(straight(*n), quarters), *dot)).collect())
}

/// Returns the least and greatest column and row.
fn extent(nodes: &[(Node, usize)]) -> Option<(Node, Node)> {
    let first = nodes.first()?.0;
    Some(nodes.iter().fold((first, first), |(low, high), (n, _)| {
        ((low.0.min(n.0), low.1.min(n.1)), (high.0.max(n.0), high.1.max(n.1)))
    }))
}

/// Returns the greatest column and row of a grid.
fn last_node(grid: &CircleGrid) -> Node {
    let (rows, columns) = (grid.rows as i32, grid.columns as i32);
    if grid.asymmetric { (2 * columns - 1, rows - 1) } else { (columns - 1, rows - 1) }
}

/// Returns the grid, with the spacing of `like`, of which a lattice is all; `None` where it is none. Of the two ways to count the rows of a
/// symmetric grid, that with fewer rows is taken.
pub(super) fn complete_grid(lattice: &Lattice, like: &CircleGrid) -> Option<CircleGrid> {
    let found = |asymmetric: bool| {
        rotated(&without_sparse_lines(&lattice.nodes, asymmetric), asymmetric).into_iter().find_map(|nodes| {
            let (low, high) = extent(&nodes)?;
            let (width, height) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
            let columns = if asymmetric { width / 2 } else { width };
            let grid = CircleGrid { rows: height as u32, columns: columns as u32, asymmetric, ..*like };
            let is_all = Target::CircleGrid(grid).check().is_ok()
                && nodes.len() == (grid.rows * grid.columns) as usize;
            let is_inside = |((x, y), _): &(Node, usize)| grid.id_at((x - low.0, y - low.1)).is_some();
            (is_all && (asymmetric || height <= width) && nodes.iter().all(is_inside)).then_some(grid)
        })
    };
    found(false).or_else(|| found(true))
}

/// Removes outer lines with few dots, which the background adds by chance.
fn without_sparse_lines(nodes: &BTreeMap<Node, usize>, asymmetric: bool) -> BTreeMap<Node, usize> {
    let mut kept = nodes.clone();
    let place = |(u, v): &Node| if asymmetric { (u - v, u + v) } else { (*u, *v) };
    let spacing = if asymmetric { 2 } else { 1 };
    loop {
        let rotated: Rotated = kept.iter().map(|(n, dot)| (place(n), *dot)).collect();
        let Some((low, high)) = extent(&rotated) else { return kept };
        let count = |is_on: &dyn Fn(&Node) -> bool| rotated.iter().filter(|(n, _)| is_on(n)).count() as f64;
        let full = [high.1 - low.1, high.0 - low.0].map(|span| f64::from(span / spacing + 1));
        type Line<'a> = (&'a dyn Fn(&Node) -> bool, f64);
        let lines: [Line; 4] = [
            (&|n| n.0 == low.0, full[0]),
            (&|n| n.0 == high.0, full[0]),
            (&|n| n.1 == low.1, full[1]),
            (&|n| n.1 == high.1, full[1]),
        ];
        let share = |(is_on, full): &Line| count(is_on) / full;
        let sparsest = lines.iter().min_by(|a, b| share(a).total_cmp(&share(b)));
        let Some((is_on, _)) = sparsest.filter(|line| share(line) < LEAST_OF_LINE) else { return kept };
        kept.retain(|n, _| !is_on(&place(n)));
    }
}

impl Board<'_> {
    /// Numbers the dots of a lattice; `None` where it is not the grid, or it is not certain which part of it.
    pub fn place(&self, lattice: &Lattice) -> Option<Numbered> {
        let mut placed = self.placements(&lattice.nodes);
        if placed.is_empty() {
            placed = self.placements(&without_sparse_lines(&lattice.nodes, self.grid.asymmetric));
        }
        if placed.len() != self.grid.alike() as usize {
            return None;
        }
        let upright = placed.into_iter().max_by(|a, b| self.drop_px(a).total_cmp(&self.drop_px(b)))?;
        let is_whole = upright.len() == (self.grid.rows * self.grid.columns) as usize;
        let is_certain = if is_whole { !self.continues(&upright) } else { self.ends(&upright) };
        is_certain.then_some(upright)
    }

    /// Returns every way to number these dots as circles of the grid.
    fn placements(&self, nodes: &BTreeMap<Node, usize>) -> Vec<Numbered> {
        let last = last_node(self.grid);
        let mut all = Vec::new();
        for rotated in rotated(nodes, self.grid.asymmetric) {
            let Some((low, high)) = extent(&rotated) else { continue };
            let shifts =
                (-low.0..=last.0 - high.0).flat_map(|x| (-low.1..=last.1 - high.1).map(move |y| (x, y)));
            all.extend(shifts.filter_map(|(x, y)| {
                let circle =
                    |(node, dot): &(Node, usize)| Some((self.grid.id_at((node.0 + x, node.1 + y))?, *dot));
                rotated.iter().map(circle).collect::<Option<Numbered>>()
            }));
        }
        all
    }

    /// How far the later rows are below the earlier ones in the image: covariance of row and v.
    fn drop_px(&self, numbered: &Numbered) -> f64 {
        let row = |id: u32| f64::from(self.grid.node(id).1);
        let mean = numbered.iter().map(|(id, _)| row(*id)).sum::<f64>() / numbered.len().max(1) as f64;
        numbered.iter().map(|(id, dot)| (row(*id) - mean) * self.dots[*dot].centroid.y).sum()
    }

    /// Returns whether circles that were not measured, such as those cut by the edge of the image, continue a whole grid on a side.
    fn continues(&self, numbered: &Numbered) -> bool {
        self.sides(numbered).iter().any(|side| {
            let circles = side.iter().filter(|seen| **seen == Beyond::Circle).count();
            let known = side.iter().filter(|seen| **seen != Beyond::Outside).count();
            2 <= circles && known <= 2 * circles
        })
    }

    /// Returns whether a partly hidden grid shows all its sides: enough circles of each outer line, and paper beyond it.
    fn ends(&self, numbered: &Numbered) -> bool {
        let all = (self.grid.rows * self.grid.columns) as f64;
        let n = numbered.len();
        if n < LEAST_OF_PART || (n as f64) < LEAST_SHARE * all {
            return false;
        }
        let last = last_node(self.grid);
        let is_on: [&dyn Fn(Node) -> bool; 4] =
            [&|n| n.0 == 0, &|n| n.0 == last.0, &|n| n.1 == 0, &|n| n.1 == last.1];
        let lines = is_on.iter().all(|is_on| {
            let full = (0..all as u32).filter(|id| is_on(self.grid.node(*id))).count() as f64;
            let seen = numbered.iter().filter(|(id, _)| is_on(self.grid.node(*id))).count() as f64;
            LEAST_OF_LINE * full <= seen
        });
        lines && self.has_margin(numbered)
    }

    /// Returns whether most places beyond each side are white paper.
    pub fn has_margin(&self, numbered: &Numbered) -> bool {
        let is_paper =
            |side: &Vec<Beyond>| side.len() <= 2 * side.iter().filter(|seen| **seen == Beyond::Paper).count();
        self.sides(numbered).iter().all(is_paper)
    }

    /// Returns what the image shows one place beyond each side: where x < 0, x > last, y < 0, y > last.
    fn sides(&self, numbered: &Numbered) -> [Vec<Beyond>; 4] {
        let last = last_node(self.grid);
        let is_place = |(x, y): Node| !self.grid.asymmetric || (x + y).rem_euclid(2) == 0;
        let column = |x: i32| (0..=last.1).map(move |y| (x, y)).filter(move |n| is_place(*n));
        let row = |y: i32| (0..=last.0).map(move |x| (x, y)).filter(move |n| is_place(*n));
        let seen = |node: Node, outward: Node| self.beyond(numbered, node, outward);
        [
            column(-1).map(|n| seen(n, (-1, 0))).collect(),
            column(last.0 + 1).map(|n| seen(n, (1, 0))).collect(),
            row(-1).map(|n| seen(n, (0, -1))).collect(),
            row(last.1 + 1).map(|n| seen(n, (0, 1))).collect(),
        ]
    }

    /// Returns what the image shows at a place beyond the grid: its grey, compared with the nearest circle and the paper around it.
    fn beyond(&self, numbered: &Numbered, node: Node, outward: Node) -> Beyond {
        let at = |(x, y): Node| PlanePoint::new(f64::from(x), f64::from(y));
        let mut near: Vec<(f64, PlanePoint, usize)> = numbered
            .iter()
            .map(|(id, dot)| (at(self.grid.node(*id)), *dot))
            .map(|(place, dot)| ((place - at(node)).norm_squared(), place, dot))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEAREST);
        let pairs: Vec<(PlanePoint, Pixel)> =
            near.iter().map(|(_, place, dot)| (*place, self.dots[*dot].centroid)).collect();
        let (Some(map), Some((_, _, dot))) = (Homography::fit(&pairs), near.first()) else {
            return Beyond::Outside;
        };
        // Between circles, on the way to the place and behind it.
        let half = if self.grid.asymmetric { 1.0 } else { 0.5 };
        let grey = |steps: f64| self.grey(&map.at(&(at(node) + half * steps * at(outward))));
        let circle = self.grey(&self.dots[*dot].centroid).unwrap_or_default();
        let part = |grey: f64| (grey - circle) / -self.dots[*dot].contrast;
        match (grey(-1.0).map(part), grey(0.0).map(part), grey(1.0).map(part)) {
            (_, None, _) => Beyond::Outside,
            (_, Some(here), _) if IS_PAPER < here => Beyond::Paper,
            (before, Some(_), behind) => {
                let is_white = |part: Option<f64>| part.is_none_or(|part| IS_PAPER < part);
                if is_white(before) && is_white(behind) { Beyond::Circle } else { Beyond::Other }
            }
        }
    }

    fn grey(&self, at: &Pixel) -> Option<f64> {
        let inside =
            |x: f64, n: u32| (0.0 <= x.round() && x.round() < f64::from(n)).then_some(x.round() as u32);
        let (u, v) = (inside(at.x, self.image.width_px)?, inside(at.y, self.image.height_px)?);
        Some(f64::from(self.image.at(u, v)))
    }
}

/// Share of the contrast between ink and paper from which a pixel counts as paper.
const IS_PAPER: f64 = 0.6;

/// What the image shows at a place beyond the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Beyond {
    /// It is outside the image.
    Outside,
    Paper,
    /// Dark, with white before and behind it.
    Circle,
    Other,
}
