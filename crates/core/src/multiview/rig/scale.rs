//! The test of each target's stated size against all other lengths: one more parameter for each target, at the minimum, without solving again.
//!
//! docs/math/rig.md eqs. (10)–(11).

use super::TargetScale;
use super::adjust::Adjusted;
use super::layout::Layout;
use crate::least_squares::PivotedPose;
use crate::least_squares::rig::{Common, Eliminated};
use crate::locate::refine::whitening;
use crate::{Camera, Correspondence, Point, Vector6};
use nalgebra::Vector3;

/// A scale that nothing else in the rig shows keeps only this share of its information, by rounding: it is the gauge of size.
const NOTHING_LEFT: f64 = 1e-10;

/// JᵀWj, jᵀWj and jᵀWr of a target's scale.
struct Sums {
    by_motion: Vector6,
    own: f64,
    pull: f64,
}

pub(super) fn scales(
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    noise_scale: f64,
    has_distances: bool,
) -> Vec<TargetScale> {
    let takes_part = |target: &usize| {
        let own =
            layout.observations.iter().zip(&adjusted.parts.is_used).filter(|(s, _)| s.target == *target);
        own.into_iter().any(|(_, used)| used.iter().any(|u| *u))
    };
    let targets = 0..layout.first_target.len();
    // The size of the only target is the gauge itself, whatever information rounding leaves.
    let compares = has_distances || 1 < targets.clone().filter(takes_part).count();
    let of_target = |target: usize| match compares {
        true => scale(target, layout, adjusted, eliminated, noise_scale),
        false => unknown(extent_m(target, layout)),
    };
    targets.map(of_target).collect()
}

fn unknown(extent_m: f64) -> TargetScale {
    TargetScale { ratio: 1.0, sigma: f64::INFINITY, extent_m }
}

fn scale(
    target: usize,
    layout: &Layout,
    adjusted: &Adjusted,
    eliminated: &Eliminated,
    noise_scale: f64,
) -> TargetScale {
    let BySize { common, own, pull } = by_size(target, layout, adjusted);
    let extent_m = extent_m(target, layout);
    let left = own - adjusted.equations.lost_to_poses(eliminated, &common);
    if NOTHING_LEFT * own < left {
        return TargetScale { ratio: 1.0 + pull / left, sigma: (noise_scale / left).sqrt(), extent_m };
    }
    unknown(extent_m)
}

/// JᵀWj of a target's scale for all poses, jᵀWj and jᵀWr.
pub(super) struct BySize {
    pub(super) common: Common,
    own: f64,
    pull: f64,
}

pub(super) fn by_size(target: usize, layout: &Layout, adjusted: &Adjusted) -> BySize {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let mut common = Common::new(graph);
    let (mut own, mut pull) = (0.0, 0.0);
    for (i, link) in graph.links.iter().enumerate() {
        if link.target != target || !graph.is_active[link.body] {
            continue;
        }
        let used = layout.observations[i]
            .seen
            .iter()
            .zip(&adjusted.parts.is_used[i])
            .filter(|(_, u)| **u)
            .map(|(c, _)| c);
        let sums =
            sums(used, &places.of_link(link, graph), &layout.pivot_in_target[target], layout.camera(i));
        common.add(places, graph, link, &sums.by_motion);
        own += sums.own;
        pull += sums.pull;
    }
    BySize { common, own, pull }
}

/// Sums over points, all of which can be projected.
fn sums<'a>(
    used: impl Iterator<Item = &'a Correspondence>,
    place: &PivotedPose,
    pivot: &Point,
    camera: &Camera,
) -> Sums {
    let mut sums = Sums { by_motion: Vector6::zeros(), own: 0.0, pull: 0.0 };
    for c in used {
        // The scale multiplies the arm from the pivot.
        let y = place.rotation * (c.x_in_target - pivot);
        let Some((pixel, jacobian)) = camera.project_with_jacobian(&(y + place.pivot_in_cam)) else {
            continue;
        };
        let e = c.pixel - pixel;
        let (a, b, d) = whitening(c, &jacobian);
        let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
        sums.add(a * e.x + b * e.y, &y, &(ju * a + jv * b));
        sums.add(d * e.y, &y, &(jv * d));
    }
    sums
}

impl Sums {
    fn add(&mut self, residual: f64, y: &Vector3<f64>, j: &Vector3<f64>) {
        let (by_scale, turn) = (j.dot(y), y.cross(j));
        self.by_motion += Vector6::new(turn.x, turn.y, turn.z, j.x, j.y, j.z) * by_scale;
        self.own += by_scale * by_scale;
        self.pull += by_scale * residual;
    }
}

/// Returns about the largest distance between two observed points of a target: the point farthest from any, and the one farthest from that.
fn extent_m(target: usize, layout: &Layout) -> f64 {
    let points = || {
        let own = layout.observations.iter().filter(move |s| s.target == target);
        own.flat_map(|s| s.seen.iter().map(|c| c.x_in_target))
    };
    let Some(any) = points().next() else { return 0.0 };
    let farthest = |from: Point| {
        points().fold(from, |best, x| if (best - from).norm() < (x - from).norm() { x } else { best })
    };
    let end = farthest(any);
    (farthest(end) - end).norm()
}
