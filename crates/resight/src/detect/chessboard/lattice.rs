//! A piece of a checker pattern: nodes by their position in a lattice, whose place in the board may be unknown.

use super::super::homography::{Homography, PlanePoint};
use super::super::joints::Joint;
use super::super::sigma;
use calib_targets_chessboard::ChessboardDetection;
use resight_core::Pixel;
use std::collections::BTreeMap;

/// A position in a lattice.
pub(super) type Node = (i32, i32);

/// The steps that lead out of a lattice.
pub(super) const SIDES: [Node; 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];

/// A set of connected nodes.
#[derive(Debug, Clone, Default)]
pub(super) struct Lattice {
    pub nodes: BTreeMap<Node, Joint>,
}

/// Number of nodes from which a local homography is estimated: enough to average, few enough to follow the distortion of a lens.
const NEAREST: usize = 12;
/// Beyond this distance, in squares, the distortion of a lens is not the same any more.
const LOCAL_SQUARES: i32 = 4;

impl Lattice {
    /// Builds a lattice of the corners that the library has labelled.
    pub fn labelled(found: &ChessboardDetection) -> Self {
        let nodes = found.corners.iter().map(|c| {
            let pixel = Pixel::new(c.position.x as f64, c.position.y as f64);
            let library_px = c.position_covariance.map(|k| k.sigma_max_px() as f64);
            ((c.grid.u, c.grid.v), Joint { pixel, sigma_px: sigma::saddle_px(library_px) })
        });
        Lattice { nodes: nodes.collect() }
    }

    pub fn at(&self, node: Node) -> Option<Joint> {
        self.nodes.get(&node).copied()
    }

    /// Returns the first and last columns and rows; `None` for an empty lattice.
    pub fn extent(&self) -> Option<Extent> {
        let (u, v) = (self.nodes.keys().map(|n| n.0), self.nodes.keys().map(|n| n.1));
        Some(Extent { u: (u.clone().min()?, u.max()?), v: (v.clone().min()?, v.max()?) })
    }

    /// Iterates over the nodes beside those of the outermost line of a part, outside it.
    pub fn beyond(&self, part: &Extent, outside: Node) -> impl Iterator<Item = Node> + use<'_> {
        let part = *part;
        let outermost = self.nodes.keys().filter(move |n| part.has(n) && part.is_outermost(n, outside));
        outermost.map(move |n| (n.0 + outside.0, n.1 + outside.1))
    }

    /// Removes outer lines with a smaller share of nodes than `least`, which the background adds by chance.
    pub fn without_sparse_lines(mut self, least: f64) -> Self {
        while let Some(Extent { u, v }) = self.extent() {
            type Line<'a> = (&'a dyn Fn(&Node) -> bool, (i32, i32));
            let lines: [Line; 4] =
                [(&|n| n.0 == u.0, v), (&|n| n.0 == u.1, v), (&|n| n.1 == v.0, u), (&|n| n.1 == v.1, u)];
            let share = |(is_on, span): &Line| {
                self.nodes.keys().filter(|n| is_on(n)).count() as f64 / f64::from(span.1 - span.0 + 1)
            };
            let sparsest = lines.iter().min_by(|a, b| share(a).total_cmp(&share(b)));
            let Some((is_on, _)) = sparsest.filter(|line| share(line) < least) else { break };
            self.nodes.retain(|n, _| !is_on(n));
        }
        self
    }

    /// Returns the homography from lattice positions, relative to `around`, to the image near there; `None` where the nodes do not determine it.
    pub fn map_near(&self, around: Node) -> Option<Homography> {
        let squares = |n: &Node| (n.0 - around.0).pow(2) + (n.1 - around.1).pow(2);
        let window = -LOCAL_SQUARES..=LOCAL_SQUARES;
        let columns = window.clone().flat_map(|u| window.clone().map(move |v| (around.0 + u, around.1 + v)));
        let mut near: Vec<(Node, Joint)> = columns.filter_map(|n| Some((n, self.at(n)?))).collect();
        if near.len() < 4 {
            // Beyond a gap there are no nodes nearby, so all are used.
            near = self.nodes.iter().map(|(n, joint)| (*n, *joint)).collect();
        }
        near.sort_by_key(|(n, _)| (squares(n), *n));
        near.truncate(NEAREST);
        let spans = |along: fn(&Node) -> i32| near.iter().any(|(n, _)| along(n) != along(&near[0].0));
        if near.len() < 4 || !spans(|n| n.0) || !spans(|n| n.1) {
            return None;
        }
        let place = |n: &Node| PlanePoint::new((n.0 - around.0) as f64, (n.1 - around.1) as f64);
        let pairs: Vec<(PlanePoint, Pixel)> = near.iter().map(|(n, j)| (place(n), j.pixel)).collect();
        Homography::fit(&pairs)
    }
}

/// The first and last columns and rows of a lattice that have nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Extent {
    pub u: (i32, i32),
    pub v: (i32, i32),
}

impl Extent {
    pub fn holds(&self, other: &Extent) -> bool {
        let within = |all: (i32, i32), part: (i32, i32)| all.0 <= part.0 && part.1 <= all.1;
        within(self.u, other.u) && within(self.v, other.v)
    }

    fn has(&self, node: &Node) -> bool {
        (self.u.0..=self.u.1).contains(&node.0) && (self.v.0..=self.v.1).contains(&node.1)
    }

    /// Returns whether a node is on the outermost line of the side to which the step `outside` leads.
    pub fn is_outermost(&self, node: &Node, outside: Node) -> bool {
        match outside {
            (-1, _) => node.0 == self.u.0,
            (1, _) => node.0 == self.u.1,
            (_, -1) => node.1 == self.v.0,
            _ => node.1 == self.v.1,
        }
    }

    /// Returns the numbers of columns and rows.
    pub fn size(&self) -> (i32, i32) {
        (self.u.1 - self.u.0 + 1, self.v.1 - self.v.0 + 1)
    }
}
