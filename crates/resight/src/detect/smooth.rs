//! Corners of a grid that do not lie where the corners around them show: something that looks like the print displaced them.
//!
//! The edge of a shadow or of an object in front of a board, along an edge of the print or just beside it, is measured as that edge, and the
//! residual of one corner does not show it. A lens bends the rows of a board smoothly. Of three neighbours in a row, the middle one lies off the
//! line between the others by a bend, which is nearly the same in the rows beside it; the difference between the two is the deviation of
//! a corner. It contains no model of the lens, and a map from a plane has no deviation to first order. Where the deviation is much larger than that of the other
//! corners, it is added to the corner's sigma.

use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use resight_core::{Pixel, Target};
use std::collections::BTreeMap;

/// Column and row in a grid of corners.
type Node = (i32, i32);

/// Deviations up to this are left to the sigma of the lens, pixels: twice that,
const LEAST_PX: f64 = 0.32;
/// up to this many times the median over all corners, which contains the bending by the lens,
const MEDIANS: f64 = 6.0;
/// and up to this share of the bend of the rows beside, which grows towards the rim of a lens and with perspective.
const BENDS: f64 = 0.5;
/// A corner that deviates by this many times the limit, and by this many pixels, is another point, such as one at the rim of an object in front
/// of the board; it is left out.
const OTHER: (f64, f64) = (4.0, 2.0);
/// Number of rounds in which displaced corners are removed, so that they do not make their neighbours deviate.
const ROUNDS: usize = 6;
/// Within this many columns and rows, only the corner that deviates most is displaced.
const REACH: i32 = 2;

/// How far a corner lies from where the rows beside it show.
#[derive(Debug, Clone, Copy)]
struct Deviation {
    px: f64,
    /// As a multiple of what a lens may cause.
    excess: f64,
}

/// How the corners of a target lie in a grid.
#[derive(Debug, Clone, Copy)]
pub(super) enum Grid {
    /// At equal distances.
    Even { columns: u32 },
    /// Pairs for the edges of tags, separated by a gap, in tag edges.
    Tags { columns: u32, first_id: u32, gap: f64 },
}

impl Grid {
    /// Returns the grid of a target; `None` for targets whose points do not lie in one.
    pub fn of(target: &Target) -> Option<Self> {
        match target.design() {
            Target::Chessboard(board) => Some(Grid::Even { columns: board.columns }),
            Target::Charuco(board) => Some(Grid::Even { columns: board.columns - 1 }),
            Target::AprilGrid(grid) => Some(Grid::Tags {
                columns: grid.columns,
                first_id: grid.first_id,
                gap: grid.tag_spacing_ratio,
            }),
            _ => None,
        }
    }

    fn node(&self, feature: &Feature) -> Node {
        match *self {
            Grid::Even { columns } => ((feature.id % columns) as i32, (feature.id / columns) as i32),
            Grid::Tags { columns, first_id, .. } => {
                let cell = feature.id.saturating_sub(first_id);
                let (right, up) = (matches!(feature.corner, 1 | 2), matches!(feature.corner, 0 | 1));
                (2 * (cell % columns) as i32 + i32::from(right), 2 * (cell / columns) as i32 + i32::from(up))
            }
        }
    }

    /// Returns the position of a column or row.
    fn position(&self, index: i32) -> f64 {
        match *self {
            Grid::Even { .. } => f64::from(index),
            Grid::Tags { gap, .. } => {
                f64::from(index.div_euclid(2)) * (1.0 + gap) + f64::from(index.rem_euclid(2))
            }
        }
    }

    /// Adds its deviation to the sigma of each displaced corner, and leaves out those that are other points.
    pub fn widen(&self, found: &mut Vec<Detection>) {
        let mut pixels: BTreeMap<Node, Pixel> =
            found.iter().map(|d| (self.node(&d.feature), d.pixel)).collect();
        let mut sorted: Vec<f64> =
            pixels.keys().filter_map(|node| Some(self.deviation(&pixels, *node, 1.0)?.px)).collect();
        sorted.sort_by(f64::total_cmp);
        let limit_px = LEAST_PX.max(MEDIANS * sorted.get(sorted.len() / 2).copied().unwrap_or(0.0));
        let mut displaced: BTreeMap<Node, Deviation> = BTreeMap::new();
        for _ in 0..ROUNDS {
            let deviation = |node: &Node| Some((*node, self.deviation(&pixels, *node, limit_px)?));
            let all: BTreeMap<Node, Deviation> = pixels.keys().filter_map(deviation).collect();
            let is_largest = |(node, own): &(&Node, &Deviation)| {
                let around = (-REACH..=REACH).flat_map(|u| (-REACH..=REACH).map(move |v| (u, v)));
                let others = around.map(|(u, v)| (node.0 + u, node.1 + v)).filter(|n| n != *node);
                let mut others = others.filter_map(|n| Some((n, all.get(&n)?.excess)));
                1.0 < own.excess
                    && others.all(|(n, excess)| excess < own.excess || (excess == own.excess && **node < n))
            };
            let worst: Vec<(Node, Deviation)> =
                all.iter().filter(is_largest).map(|(node, own)| (*node, *own)).collect();
            if worst.is_empty() {
                break;
            }
            displaced.extend(worst);
            pixels.retain(|node, _| !displaced.contains_key(node));
        }
        found.retain_mut(|d| {
            let Some(own) = displaced.get(&self.node(&d.feature)) else { return true };
            d.sigma_px = d.sigma_px.hypot(own.px);
            own.excess < OTHER.0 || own.px < OTHER.1
        });
    }

    /// Returns the deviation of a corner, the smaller one of those along its row and its column: a displaced neighbour changes only one of them.
    fn deviation(&self, pixels: &BTreeMap<Node, Pixel>, node: Node, limit_px: f64) -> Option<Deviation> {
        let along = |axis: usize| {
            let own = self.bend(pixels, node, axis)?;
            let beside: Vec<Pixel> =
                [-1, 1].iter().filter_map(|k| self.bend(pixels, moved(node, 1 - axis, *k), axis)).collect();
            let mean = beside.iter().sum::<Pixel>() / beside.len() as f64;
            let px = (own - mean).norm();
            let excess = px / limit_px.max(BENDS * mean.norm());
            excess.is_finite().then_some(Deviation { px, excess })
        };
        [along(0), along(1)].into_iter().flatten().reduce(|a, b| if a.excess < b.excess { a } else { b })
    }

    /// Returns how far a corner lies off the line between its neighbours along an axis.
    fn bend(&self, pixels: &BTreeMap<Node, Pixel>, node: Node, axis: usize) -> Option<Pixel> {
        let (before, after) = (moved(node, axis, -1), moved(node, axis, 1));
        let [first, middle, last] =
            [before, node, after].map(|n| self.position(if axis == 0 { n.0 } else { n.1 }));
        let share = (middle - first) / (last - first);
        let line = pixels.get(&before)? * (1.0 - share) + pixels.get(&after)? * share;
        Some(pixels.get(&node)? - line)
    }
}

fn moved(node: Node, axis: usize, by: i32) -> Node {
    if axis == 0 { (node.0 + by, node.1) } else { (node.0, node.1 + by) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA_PX: f64 = 0.02;

    /// A grid through a fisheye lens, with two displaced corners, one of them on the rim.
    fn found(features: impl Iterator<Item = (Feature, f64, f64)>, displaced: &[u32]) -> Vec<Detection> {
        let detection = |(feature, x, y): (Feature, f64, f64)| {
            let (x, y) = (0.1 * x - 0.4, 0.1 * y - 0.25);
            let r = x.hypot(y).max(1e-9);
            let mut pixel = Pixel::new(x, y) * (300.0 * r.atan() / r) + Pixel::new(400.0, 300.0);
            if displaced.contains(&feature.id) && feature.corner == 0 {
                pixel += Pixel::new(-0.9, 1.2);
            }
            Detection { feature, pixel, sigma_px: SIGMA_PX, lens_sigma_px: 0.16, covariance_px2: None }
        };
        features.map(detection).collect()
    }

    fn widened(grid: Grid, mut found: Vec<Detection>) -> Vec<(u32, u8, f64)> {
        grid.widen(&mut found);
        let wider = found.iter().filter(|d| SIGMA_PX < d.sigma_px);
        wider.map(|d| (d.feature.id, d.feature.corner, d.sigma_px)).collect()
    }

    #[test]
    fn widen_gives_displaced_corners_their_deviation() {
        let corners = || (0..54).map(|id| (Feature { id, corner: 0 }, f64::from(id % 9), f64::from(id / 9)));
        let grid = Grid::Even { columns: 9 };
        assert_eq!(widened(grid, found(corners(), &[])), []);
        let wide = widened(grid, found(corners(), &[31, 4]));
        assert_eq!(wide.iter().map(|w| w.0).collect::<Vec<_>>(), [4, 31], "{wide:?}");
        assert!(wide.iter().all(|w| (1.3..1.9).contains(&w.2)), "1.5 px each: {wide:?}");
    }

    #[test]
    fn widen_leaves_other_points_out() {
        let corners = || (0..54).map(|id| (Feature { id, corner: 0 }, f64::from(id % 9), f64::from(id / 9)));
        let mut seen = found(corners(), &[4]);
        seen[31].pixel += Pixel::new(5.0, 0.0);
        Grid::Even { columns: 9 }.widen(&mut seen);
        assert!(seen.iter().all(|d| d.feature.id != 31) && seen.len() == 53);
    }

    #[test]
    fn widen_takes_the_gaps_between_tags_into_account() {
        let corner = |id: u32, corner: u8| {
            let (right, up) = (matches!(corner, 1 | 2), matches!(corner, 0 | 1));
            let at = |cell: u32, is_second: bool| 1.3 * f64::from(cell) + f64::from(u8::from(is_second));
            (Feature { id, corner }, at(id % 4, right), at(id / 4, up))
        };
        let corners = || (0..12).flat_map(|id| (0..4).map(move |k| corner(id, k)));
        let grid = Grid::Tags { columns: 4, first_id: 0, gap: 0.3 };
        assert_eq!(widened(grid, found(corners(), &[])), []);
        let wide = widened(grid, found(corners(), &[5]));
        assert_eq!(wide.iter().map(|w| (w.0, w.1)).collect::<Vec<_>>(), [(5, 0)], "{wide:?}");
    }

    #[test]
    fn widen_leaves_a_few_corners_alone() {
        let corners = || (0..4).map(|id| (Feature { id, corner: 0 }, f64::from(id % 9), f64::from(id / 9)));
        assert_eq!(widened(Grid::Even { columns: 9 }, found(corners(), &[1])), []);
        assert_eq!(widened(Grid::Even { columns: 9 }, Vec::new()), []);
    }
}
