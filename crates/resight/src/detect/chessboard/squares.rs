//! Black squares between saddle points, from which the rest of a board is found.
//!
//! Along an edge that leads from one saddle point to the next, black is on one side all the way; beyond the next one the colours are exchanged.
//! Edges with black on their right go around black squares, two of them from each node. No angle or length is required, so that squares are
//! found in strong perspective too, where the axes of a board nearly coincide in the image.

use super::super::joints::Joint;
use crate::GrayImage;
use resight_core::Pixel;

/// Corners of a black square, clockwise in the image.
pub(in super::super) type Square = [usize; 4];

/// Number of saddle points considered, the strongest first: a board has hundreds, noise and foliage have thousands.
const MOST_JOINTS: usize = 1500;
/// Number of neighbours to which an edge may lead. At a tilt of 75° a dozen nodes are nearer than the next one along the long edges, and about
/// as many saddle points of the background.
const NEIGHBOURS: usize = 24;
/// Largest number of edges with black on their right that start at a node: two, and some by chance.
const MOST_EDGES: usize = 4;
/// Shortest edge, pixels.
const LEAST_EDGE_PX: f64 = 5.0;
/// Least difference of grey levels across an edge, whatever the noise.
const LEAST_STEP_GRAY: f64 = 5.0;
/// Least share of the full contrast in each part of an edge; an edge that ends half-way has less in some part.
const LEAST_SHARE: f64 = 0.3;
/// Positions along an edge at which its two sides are compared.
const PARTS: [f64; 5] = [0.2, 0.35, 0.5, 0.65, 0.8];

/// Finds black squares among the saddle points `joints`, given in order of strength; those that share corners with most others come first.
pub(in super::super) fn black_squares(joints: &[Joint], image: &GrayImage, noise_gray: f64) -> Vec<Square> {
    let edges = edges(joints, image, noise_gray);
    let mut squares = Vec::new();
    for a in 0..edges.len() {
        for &b in &edges[a] {
            for &c in edges[b].iter().filter(|&&c| c != a) {
                for &d in edges[c].iter().filter(|&&d| d != b && d != a) {
                    let square = [a, b, c, d];
                    // Each square is found from all its corners; the first one counts.
                    let is_first = a < b && a < c && a < d;
                    if is_first && edges[d].contains(&a) && is_convex(square.map(|k| joints[k].pixel)) {
                        squares.push(square);
                    }
                }
            }
        }
    }
    let mut touching = vec![0usize; edges.len()];
    squares.iter().flatten().for_each(|&k| touching[k] += 1);
    squares.sort_by_key(|square| std::cmp::Reverse(square.iter().map(|&k| touching[k]).sum::<usize>()));
    squares
}

/// Returns, for each joint among the strongest, the ends of the edges with black on their right.
pub(super) fn edges(joints: &[Joint], image: &GrayImage, noise_gray: f64) -> Vec<Vec<usize>> {
    let joints = &joints[..joints.len().min(MOST_JOINTS)];
    let least_gray = LEAST_STEP_GRAY.max(noise_gray);
    let from = |a: &Joint| {
        let mut near: Vec<(f64, usize)> =
            joints.iter().enumerate().map(|(k, b)| ((b.pixel - a.pixel).norm_squared(), k)).collect();
        let by_distance = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0);
        if NEIGHBOURS < near.len() {
            near.select_nth_unstable_by(NEIGHBOURS, by_distance);
            near.truncate(NEIGHBOURS);
        }
        near.sort_by(by_distance);
        let ends = near.into_iter().filter(|(d, _)| LEAST_EDGE_PX.powi(2) <= *d).map(|(_, k)| k);
        ends.filter(|&k| has_black_on_its_right(image, a.pixel, joints[k].pixel, least_gray))
            .take(MOST_EDGES)
            .collect()
    };
    joints.iter().map(from).collect()
}

/// Returns whether the line from a to b is darker on its right along its whole length.
fn has_black_on_its_right(image: &GrayImage, a: Pixel, b: Pixel, least_gray: f64) -> bool {
    let along = b - a;
    let length_px = along.norm();
    let right = Pixel::new(-along.y, along.x) / length_px * (0.08 * length_px).clamp(1.5, 4.0);
    let steps = PARTS.map(|t| {
        let middle = a + along * t;
        gray(image, middle - right).zip(gray(image, middle + right)).map_or(0.0, |(left, right)| left - right)
    });
    let most = steps.iter().copied().fold(0.0, f64::max);
    let least = steps.iter().copied().fold(f64::INFINITY, f64::min);
    let mean = steps.iter().sum::<f64>() / PARTS.len() as f64;
    least_gray <= mean && LEAST_SHARE * most <= least
}

/// Interpolates between the 2 × 2 pixels around a position; `None` outside the image.
pub(super) fn gray(image: &GrayImage, at: Pixel) -> Option<f64> {
    let inside = |x: f64, n: u32| 0.0 <= x && x + 1.0 < n as f64;
    if !inside(at.x, image.width_px) || !inside(at.y, image.height_px) {
        return None;
    }
    let (a, b) = (at.x.fract(), at.y.fract());
    let value = |du: u32, dv: u32| image.at(at.x as u32 + du, at.y as u32 + dv) as f64;
    Some(
        (1.0 - b) * ((1.0 - a) * value(0, 0) + a * value(1, 0))
            + b * ((1.0 - a) * value(0, 1) + a * value(1, 1)),
    )
}

/// Returns whether the polygon of four corners is clockwise in the image at each corner.
fn is_convex(corners: [Pixel; 4]) -> bool {
    (0..4).all(|k| {
        let (a, b, c) = (corners[k], corners[(k + 1) % 4], corners[(k + 2) % 4]);
        let (x, y) = (b - a, c - b);
        0.1 < (x.x * y.y - x.y * y.x) / (x.norm() * y.norm()).max(1e-9)
    })
}
