//! The initial poses of a rig: three-ray solutions over triples far apart, and the poses from single cameras.

use super::RigView;
use super::cost::RigCost;
use crate::locate::method::{Method, resolve};
use crate::locate::multi_start::{mirrored, of_method};
use crate::locate::problem::Problem;
use crate::solve::configuration::{MAX_PLANE_THICKNESS, classify};
use crate::solve::gp3p::{Ray, gp3p};
use crate::{Correspondence, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Unit, Vector3};

/// Largest number of starts, best first. Three rays have up to eight poses, and the true one may be any of them.
const MAX_STARTS: usize = 12;
/// Starts nearer to each other than this (chord of the rotation; translation over distance) lead to one minimum.
const DUPLICATES: f64 = 0.03;

/// Where noise has made two roots complex their minimum still exists: the roots of a triangle scaled by one of these factors lead to it.
const SCALES: [f64; 7] = [1.0, 1.01, 0.99, 1.04, 0.96, 1.15, 0.85];
/// Largest number of points for which the minima of χ² are nearly those of a triple.
const FEW: usize = 5;

/// Poses to refine, ordered by their cost.
pub(crate) type Starts = ArrayVec<(f64, Pose), MAX_STARTS>;

/// A point with the camera that observes it.
type Observed<'a> = (&'a RigView<'a>, &'a Correspondence);

/// Adds the starts of triple number `round` = 0, 1, …; each round has two triples, one without regard to cameras and one across cameras.
pub(crate) fn push_triples(starts: &mut Starts, cost: &RigCost, round: usize) {
    for across in [false, true] {
        let Some(triple) = triple(cost, round, across) else { continue };
        let (rays, places) = (triple.map(ray), triple.map(|(_, c)| c.x_in_target));
        let scales = if cost.n_points() <= FEW || 0 < round { &SCALES[..] } else { &SCALES[..1] };
        for scale in scales {
            let scaled = places.map(|x| places[0] + (x - places[0]) * *scale);
            for pose in gp3p(&rays, &scaled) {
                push(starts, cost, pose);
            }
        }
    }
}

/// Adds the poses from each single camera with at least three points that are not on a line.
pub(crate) fn push_single_cameras(starts: &mut Starts, cost: &RigCost) {
    for view in cost.views {
        let Ok(configuration) = classify(view.seen) else { continue };
        let Ok(method) = resolve(Method::Auto, &configuration) else { continue };
        let problem = Problem::new(view.seen, view.camera);
        let rig_from_cam = view.cam_from_rig.inverse();
        for cam_from_target in of_method(method, &configuration, &problem).0 {
            push(starts, cost, rig_from_cam * cam_from_target);
        }
    }
}

/// Inserts a start in order, without duplicates; the worst is removed when the list is full.
fn push(starts: &mut Starts, cost: &RigCost, rig_from_target: Pose) {
    let chi2 = cost.residual_sums(&rig_from_target).0;
    if !chi2.is_finite() {
        return;
    }
    let is_duplicate = |other: &Pose| {
        let shift = (other.translation - rig_from_target.translation).norm();
        let turn = (other.rotation - rig_from_target.rotation).norm();
        turn < DUPLICATES && shift < DUPLICATES * rig_from_target.translation.norm()
    };
    if let Some(duplicate) = starts.iter().position(|(_, other)| is_duplicate(other)) {
        if starts[duplicate].0 <= chi2 {
            return;
        }
        starts.remove(duplicate);
    }
    if starts.is_full() {
        starts.pop();
    }
    let place = starts.iter().position(|(other, _)| chi2 < *other).unwrap_or(starts.len());
    starts.insert(place, (chi2, rig_from_target));
}

fn ray((view, c): Observed) -> Ray {
    Ray {
        origin_in_rig: view.cam_from_rig.origin(),
        bearing_in_rig: Unit::new_unchecked(view.cam_from_rig.rotation.tr_mul(&c.bearing)),
    }
}

/// Returns three points far apart: in round 0 from the point farthest from the first one, later from one picked along the list. With `across`
/// the second is of another camera than the first, the third of a third one, where possible.
fn triple<'a>(cost: &RigCost<'a>, round: usize, across: bool) -> Option<[Observed<'a>; 3]> {
    let n = cost.n_points();
    let any = cost.points().nth(round * 7 % n)?;
    let first =
        if round == 0 { farthest(cost.points(), |x| (x - any.1.x_in_target).norm_squared())? } else { any };
    let from_first = |x: &Point| (x - first.1.x_in_target).norm_squared();
    let is_other = |a: &Observed, b: &Observed| !core::ptr::eq(a.0, b.0);
    let others = cost.points().filter(|p| !across || is_other(p, &first));
    let second = farthest(others, from_first)?;
    let along = second.1.x_in_target - first.1.x_in_target;
    let off_line = |x: &Point| (x - first.1.x_in_target).cross(&along).norm_squared();
    let best = farthest(cost.points(), off_line)?;
    let third = cost.points().filter(|p| is_other(p, &first) && is_other(p, &second));
    // A point in a third camera is preferred up to a factor of two in the distance from the line.
    let third = farthest(third, off_line)
        .filter(|third| across && 0.25 * off_line(&best.1.x_in_target) < off_line(&third.1.x_in_target));
    Some([first, second, third.unwrap_or(best)])
}

fn farthest<'a>(
    points: impl Iterator<Item = Observed<'a>>,
    measure: impl Fn(&Point) -> f64,
) -> Option<Observed<'a>> {
    let measured = points.map(|p| (measure(&p.1.x_in_target), p));
    measured.reduce(|best, next| if best.0 < next.0 { next } else { best }).map(|(_, p)| p)
}

/// Extents of all points: length, width across it, thickness across both; the directions of length and width, and the normal.
pub(crate) struct Extents {
    pub length: f64,
    pub width: f64,
    normal: Vector3<f64>,
    thickness: f64,
}

impl Extents {
    pub fn new(cost: &RigCost) -> Option<Self> {
        let [a, b, c] = triple(cost, 0, false)?.map(|p| p.1.x_in_target);
        let length = (b - a).norm();
        let normal = (b - a).cross(&(c - a));
        let width = normal.norm() / length;
        let normal = normal / normal.norm();
        let off_plane = |x: &Point| (x - a).dot(&normal).abs();
        let thickness = cost.points().map(|p| off_plane(&p.1.x_in_target)).fold(0.0, f64::max);
        Some(Extents { length, width, normal, thickness })
    }

    /// Adds the start of the other minimum of a flat target, as observed from the middle of the cameras.
    pub fn push_mirrored(&self, starts: &mut Starts, cost: &RigCost, rig_from_target: &Pose, centre: &Point) {
        let is_flat = self.thickness <= MAX_PLANE_THICKNESS * self.width;
        if !is_flat {
            return;
        }
        let cameras = cost.views.iter().map(|view| view.cam_from_rig.origin()).sum::<Point>();
        let eye_in_rig = cameras / cost.views.len() as f64;
        push(starts, cost, mirrored(rig_from_target, &self.normal, centre, &eye_in_rig));
    }
}
