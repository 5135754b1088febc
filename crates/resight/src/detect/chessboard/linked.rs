//! Lattices of saddle points that are linked along the edges of squares.
//!
//! Around a saddle point black and white alternate, so that four edges leave it, in turn with black on their right and on their left. An edge with
//! black on its right leads to the next saddle point, where it arrives with black on its left. Followed from neighbour to neighbour, the links
//! number the saddle points by column and row. No map from a plane has to fit, neither of the whole board nor of a part of it, so that a lens may
//! bend the rows by any amount.

use super::super::joints::Joint;
use super::lattice::{Lattice, Node};
use super::squares::edges;
use crate::GrayImage;
use resight_core::Pixel;
use std::collections::{BTreeMap, VecDeque};

/// Two links of one colour nearer to each other in direction than this cosine are alternatives: 45°.
const ALIKE: f64 = 0.7;
/// Largest change of direction from a link to the next one along a row, as a cosine: 60°.
const STRAIGHT: f64 = 0.5;
/// Fewer links than this do not hold a node: the corners of a square have two.
const LEAST_LINKS: usize = 2;

/// A link that leaves a saddle point.
#[derive(Debug, Clone, Copy)]
struct Link {
    to: usize,
    /// Of length 1.
    direction: Pixel,
    /// Whether black is on its right.
    is_black_right: bool,
}

/// The steps to the next column and row.
const STEPS: [Node; 2] = [(1, 0), (0, 1)];

/// Returns the lattices that saddle points, given in order of strength, form in an image; the largest comes first. In each, the squares whose
/// first node has an even u + v are black.
pub(super) fn lattices(joints: &[Joint], image: &GrayImage, noise_gray: f64) -> Vec<Lattice> {
    let links = links(joints, image, noise_gray);
    let mut is_used = vec![false; links.len()];
    let mut all = Vec::new();
    for seed in 0..links.len() {
        if is_used[seed] {
            continue;
        }
        let Some(axes) = axes(&links[seed]) else { continue };
        let mut nodes = followed(joints, &links, (seed, axes), &mut is_used);
        keep_held(&mut nodes, &links);
        let nodes: BTreeMap<Node, Joint> = nodes.into_iter().map(|(node, k)| (node, joints[k])).collect();
        if !nodes.is_empty() {
            all.push(Lattice { nodes });
        }
    }
    all.sort_by_key(|lattice| std::cmp::Reverse(lattice.nodes.len()));
    all
}

/// Returns the links of each saddle point; both of its ends have to prefer a link to its alternatives.
fn links(joints: &[Joint], image: &GrayImage, noise_gray: f64) -> Vec<Vec<Link>> {
    let right = edges(joints, image, noise_gray);
    let mut left = vec![Vec::new(); right.len()];
    right.iter().enumerate().for_each(|(from, ends)| ends.iter().for_each(|to| left[*to].push(from)));
    let apart = |a: usize, b: usize| joints[b].pixel - joints[a].pixel;
    let preferred = |ends: &[Vec<usize>]| -> Vec<Vec<usize>> {
        let of = |(from, ends): (usize, &Vec<usize>)| {
            let mut near = ends.clone();
            near.sort_by(|a, b| apart(from, *a).norm().total_cmp(&apart(from, *b).norm()).then(a.cmp(b)));
            let mut kept: Vec<usize> = Vec::new();
            for to in near {
                let direction = apart(from, to).normalize();
                if kept.iter().all(|other| direction.dot(&apart(from, *other).normalize()) < ALIKE) {
                    kept.push(to);
                }
            }
            kept
        };
        ends.iter().enumerate().map(of).collect()
    };
    let (right, left) = (preferred(&right), preferred(&left));
    let link = |from: usize, to: usize, is_black_right: bool| Link {
        to,
        direction: apart(from, to).normalize(),
        is_black_right,
    };
    let mut links = vec![Vec::new(); right.len()];
    for (from, ends) in right.iter().enumerate() {
        for &to in ends.iter().filter(|to| left[**to].contains(&from)) {
            links[from].push(link(from, to, true));
            links[to].push(link(to, from, false));
        }
    }
    links
}

/// Returns the directions of columns and rows at the first saddle point, where black is on the right of the columns' links; `None` where it has
/// no links of both colours.
fn axes(links: &[Link]) -> Option<[Pixel; 2]> {
    let of = |is_black_right: bool| links.iter().find(|link| link.is_black_right == is_black_right);
    let (u, v) = (of(true)?.direction, of(false)?.direction);
    let cross = u.x * v.y - u.y * v.x;
    (cross != 0.0).then_some([u, v * cross.signum()])
}

/// Numbers the saddle points that links lead to, with the directions of columns and rows at the first one.
fn followed(
    joints: &[Joint],
    links: &[Vec<Link>],
    (seed, axes): (usize, [Pixel; 2]),
    is_used: &mut [bool],
) -> BTreeMap<Node, usize> {
    let mut nodes = BTreeMap::from([((0, 0), seed)]);
    let mut queue: VecDeque<(usize, Node, [Pixel; 2])> = VecDeque::from([(seed, (0, 0), axes)]);
    is_used[seed] = true;
    while let Some((from, node, mut axes)) = queue.pop_front() {
        let is_even = (node.0 + node.1).rem_euclid(2) == 0;
        // Along columns, black is on the right at even nodes, along rows at odd ones.
        let along = |axis: usize, axes: &[Pixel; 2]| -> Vec<(i32, Link)> {
            let own = links[from].iter().filter(|link| link.is_black_right == (is_even == (axis == 0)));
            let sign = |link: &Link| {
                let cosine = link.direction.dot(&axes[axis]);
                (STRAIGHT < cosine.abs()).then_some(if 0.0 < cosine { 1 } else { -1 })
            };
            own.filter_map(|link| Some((sign(link)?, *link))).collect()
        };
        let found = [along(0, &axes), along(1, &axes)];
        for (axis, found) in found.iter().enumerate() {
            let sum: Pixel = found.iter().map(|(sign, link)| link.direction * f64::from(*sign)).sum();
            if 0.0 < sum.norm() {
                axes[axis] = sum.normalize();
            }
        }
        for (axis, (sign, link)) in found.iter().enumerate().flat_map(|(k, f)| f.iter().map(move |l| (k, l)))
        {
            let next = (node.0 + sign * STEPS[axis].0, node.1 + sign * STEPS[axis].1);
            if is_used[link.to] || nodes.contains_key(&next) {
                continue;
            }
            is_used[link.to] = true;
            nodes.insert(next, link.to);
            let mut there = axes;
            there[axis] = (joints[link.to].pixel - joints[from].pixel).normalize() * f64::from(*sign);
            queue.push_back((link.to, next, there));
        }
    }
    nodes
}

/// Removes nodes that are not linked to enough of their neighbours.
fn keep_held(nodes: &mut BTreeMap<Node, usize>, links: &[Vec<Link>]) {
    loop {
        let n_links = |node: &Node, k: usize| {
            let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(u, v)| (node.0 + u, node.1 + v));
            let is_linked = |other: &&usize| links[k].iter().any(|link| link.to == **other);
            beside.iter().filter_map(|n| nodes.get(n)).filter(is_linked).count()
        };
        let loose: Vec<Node> = nodes
            .iter()
            .filter(|(node, k)| n_links(node, **k) < LEAST_LINKS)
            .map(|(node, _)| *node)
            .collect();
        if loose.is_empty() {
            return;
        }
        nodes.retain(|node, _| !loose.contains(node));
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::joints::joints;
    use super::*;
    use crate::render::Pcg;

    const SIZE_PX: [u32; 2] = [480, 360];
    const FOCAL_PX: f64 = 150.0;
    const SQUARE: f64 = 0.5;
    const INNER: Node = (9, 6);

    fn centre() -> Pixel {
        Pixel::new(240.3, 179.6)
    }

    /// The image of an inner corner in an equidistant fisheye lens that looks straight at the board.
    fn corner(column: i32, row: i32) -> Pixel {
        let x = SQUARE
            * Pixel::new(
                f64::from(column) - 0.5 * f64::from(INNER.0 - 1),
                f64::from(row) - 0.5 * f64::from(INNER.1 - 1),
            );
        centre() + x * (FOCAL_PX * x.norm().atan() / x.norm().max(1e-9))
    }

    /// A board whose corners are up to 67° off the axis.
    fn board() -> GrayImage {
        let ink = |at: Pixel| {
            let p = at - centre();
            let angle = (p.norm() / FOCAL_PX).min(1.5);
            let x = p * (angle.tan() / p.norm().max(1e-9) / SQUARE);
            let (u, v) = (x.x + 0.5 * f64::from(INNER.0 + 1), x.y + 0.5 * f64::from(INNER.1 + 1));
            let is_inside = 0.0 <= u && 0.0 <= v && u < f64::from(INNER.0 + 1) && v < f64::from(INNER.1 + 1);
            if is_inside && (u.floor() + v.floor()) % 2.0 == 0.0 { 30.0 } else { 220.0 }
        };
        let mut pcg = Pcg::new(3);
        let gray = |k: u32| {
            let (u, v) = (f64::from(k % SIZE_PX[0]), f64::from(k / SIZE_PX[0]));
            let part = |i: u32| f64::from(i) / 5.0 - 0.4;
            let sum: f64 =
                (0..25).map(|i| ink(Pixel::new(u + 1.4 * part(i % 5), v + 1.4 * part(i / 5)))).sum();
            (sum / 25.0 + 2.0 * pcg.normal()).round().clamp(0.0, 255.0) as u8
        };
        GrayImage {
            width_px: SIZE_PX[0],
            height_px: SIZE_PX[1],
            data: (0..SIZE_PX[0] * SIZE_PX[1]).map(gray).collect(),
        }
    }

    #[test]
    fn lattices_numbers_a_fisheye_board_whole() {
        let image = board();
        let found = lattices(&joints(&image), &image, 2.0);
        let board = &found[0];
        let sizes: Vec<usize> = found.iter().map(|lattice| lattice.nodes.len()).collect();
        assert_eq!(board.nodes.len(), (INNER.0 * INNER.1) as usize, "{sizes:?}");
        // Each node is one corner, and neighbours in the lattice are neighbours on the board.
        let place = |joint: &Joint| {
            let all = (0..INNER.1).flat_map(|row| (0..INNER.0).map(move |column| (column, row)));
            let mut near = all.filter(|(column, row)| (corner(*column, *row) - joint.pixel).norm() < 1.0);
            near.next().unwrap_or_else(|| panic!("no corner at {}", joint.pixel))
        };
        for (node, joint) in &board.nodes {
            let own = place(joint);
            for step in STEPS {
                let Some(next) = board.at((node.0 + step.0, node.1 + step.1)) else { continue };
                let other = place(&next);
                assert_eq!((own.0 - other.0).abs() + (own.1 - other.1).abs(), 1, "{node:?}");
            }
        }
    }

    #[test]
    fn lattices_of_noise_are_small() {
        let mut pcg = Pcg::new(4);
        let gray = |_| (128.0 + 40.0 * pcg.normal()).round().clamp(0.0, 255.0) as u8;
        let image = GrayImage { width_px: 320, height_px: 240, data: (0..320 * 240).map(gray).collect() };
        let found = lattices(&joints(&image), &image, 40.0);
        assert!(
            found.iter().all(|lattice| lattice.nodes.len() < 9),
            "{:?}",
            found.first().map(|l| l.nodes.len())
        );
        assert!(lattices(&[], &image, 40.0).is_empty());
    }
}
