//! Joins dots to a square lattice, neighbour by neighbour: each step is predicted by the steps beside it, so that neither perspective nor a lens
//! nor a bent sheet is an obstacle.
//!
//! The first two steps are found in coordinates in which the dot's own ellipse is a circle (docs/math/circle_grid.md eq. (1)): there the
//! nearest neighbours of a foreshortened lattice are those of the grid. Every lattice has the orientation of the image, u to the right, v down.

use super::Node;
use crate::detect::dots::Dot;
use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, VecDeque};

/// Dots by their place in a square lattice.
pub(super) struct Lattice {
    /// Index of the dot at each node.
    pub nodes: BTreeMap<Node, usize>,
}

/// Steps along the two axes of the lattice, px.
type Frame = [Vector2<f64>; 2];

const STEPS: [Node; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
/// Largest distance of a dot from its prediction, in steps. Perspective changes steps by less than a fifth from one to the next.
const REACH_STEPS: f64 = 0.3;
/// Largest ratio of the areas of neighbours.
const ALIKE_AREAS: f64 = 2.2;
/// The first steps differ less than this in length, and from a right angle by less than this cosine, where the ellipse is a circle.
const ALIKE_STEPS: f64 = 1.4;
const UPRIGHT_COS: f64 = 0.35;
/// Root mean square by which the four corners of a cell miss a parallelogram, in steps: 0.02 of a print in perspective, 0.3 of chance.
const REGULAR_STEPS: f64 = 0.08;

/// Returns the lattice that grows from one dot; `None` where its neighbours form no square.
pub(super) fn grown(dots: &[Dot], is_taken: &[bool], seed: usize) -> Option<Lattice> {
    let mut growth = Growth {
        dots,
        is_used: is_taken.to_vec(),
        nodes: BTreeMap::from([((0, 0), seed)]),
        frames: BTreeMap::from([((0, 0), first_frame(dots, is_taken, seed)?)]),
    };
    growth.is_used[seed] = true;
    let mut queue = VecDeque::from([(0, 0)]);
    while let Some(node) = queue.pop_front() {
        for step in STEPS {
            let next = (node.0 + step.0, node.1 + step.1);
            if !growth.nodes.contains_key(&next) && growth.join(node, step, next) {
                queue.push_back(next);
            }
        }
    }
    Some(Lattice { nodes: growth.nodes })
}

struct Growth<'a> {
    dots: &'a [Dot],
    is_used: Vec<bool>,
    nodes: BTreeMap<Node, usize>,
    frames: BTreeMap<Node, Frame>,
}

impl Growth<'_> {
    /// Adds the dot at a node, one step from another, where there is one.
    fn join(&mut self, node: Node, step: Node, next: Node) -> bool {
        let frame = self.frames[&node];
        let Some(inverse) = Matrix2::from_columns(&frame).try_inverse() else { return false };
        let predicted = self.predicted(next);
        let reference = area_px2(&self.dots[self.nodes[&node]]);
        let free = (0..self.dots.len()).filter(|i| !self.is_used[*i]);
        let off = |i: usize| (inverse * (self.dots[i].centroid - predicted)).norm();
        let nearest = free.map(|i| (off(i), i)).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, dot)) = nearest.filter(|(off, i)| {
            let ratio = area_px2(&self.dots[*i]) / reference;
            *off < REACH_STEPS && (1.0 / ALIKE_AREAS..ALIKE_AREAS).contains(&ratio)
        }) else {
            return false;
        };
        let walked = self.dots[dot].centroid - self.dots[self.nodes[&node]].centroid;
        let axis = usize::from(step.0 == 0);
        let mut frame = frame;
        frame[axis] = walked * f64::from(step.0 + step.1);
        self.is_used[dot] = true;
        self.nodes.insert(next, dot);
        self.frames.insert(next, frame);
        true
    }

    /// Returns the mean of the predictions from all neighbours of a node.
    fn predicted(&self, next: Node) -> Vector2<f64> {
        let from = |step: Node| {
            let node = (next.0 - step.0, next.1 - step.1);
            let [along, across] = self.frames.get(&node)?;
            let place = self.dots[self.nodes[&node]].centroid;
            Some(place + along * f64::from(step.0) + across * f64::from(step.1))
        };
        let all: Vec<Vector2<f64>> = STEPS.into_iter().filter_map(from).collect();
        all.iter().sum::<Vector2<f64>>() / all.len().max(1) as f64
    }
}

/// Proportional to the area of a dot, px².
fn area_px2(dot: &Dot) -> f64 {
    dot.moments_px2.determinant().max(0.0).sqrt()
}

/// Returns the steps from a dot to its two nearest neighbours at a right angle.
fn first_frame(dots: &[Dot], is_taken: &[bool], seed: usize) -> Option<Frame> {
    let round = round_from_image(&dots[seed].moments_px2)?;
    let reference = area_px2(&dots[seed]);
    let mut near: Vec<(f64, Vector2<f64>, Vector2<f64>)> = (0..dots.len())
        .filter(|i| *i != seed && !is_taken[*i])
        .filter(|i| (1.0 / ALIKE_AREAS..ALIKE_AREAS).contains(&(area_px2(&dots[*i]) / reference)))
        .map(|i| {
            let step = dots[i].centroid - dots[seed].centroid;
            let straight = round * step;
            (straight.norm(), straight, step)
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (length, along, first) = *near.first()?;
    let is_across = |(other, across, _): &&(f64, Vector2<f64>, Vector2<f64>)| {
        *other < ALIKE_STEPS * length && along.dot(across).abs() < UPRIGHT_COS * length * other
    };
    let (_, across, second) = near.iter().find(is_across)?;
    let second = if along.perp(across) < 0.0 { -second } else { *second };
    Some([first, second])
}

/// Returns the symmetric map under which a dot with these moments is a circle, docs/math/circle_grid.md eq. (1).
fn round_from_image(moments: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let eigen = moments.symmetric_eigen();
    let scale = eigen.eigenvalues.map(|x| 1.0 / x.max(0.0).sqrt());
    let v = eigen.eigenvectors;
    let map = v * Matrix2::from_diagonal(&scale) * v.transpose();
    map.iter().all(|x| x.is_finite()).then_some(map)
}

impl Lattice {
    /// Returns whether its cells are nearly parallelograms, as those of a print, and not of dots that chance has joined.
    pub fn is_regular(&self, dots: &[Dot]) -> bool {
        let at = |node: Node| self.nodes.get(&node).map(|dot| dots[*dot].centroid);
        let (mut sum, mut count) = (0.0, 0);
        for (u, v) in self.nodes.keys() {
            let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(du, dv)| at((u + du, v + dv)));
            let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
            let area_px2 = (b - a).perp(&(c - a)).abs();
            sum += (a - b - c + d).norm_squared()
                / (b - a).norm_squared().max((c - a).norm_squared()).max(area_px2);
            count += 1;
        }
        0 < count && sum <= REGULAR_STEPS * REGULAR_STEPS * f64::from(count)
    }
}
