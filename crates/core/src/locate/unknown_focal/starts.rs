//! Where descents start: the closed forms for an unknown focal length on few of the points, and those for a known one at focal lengths a
//! factor apart, docs/math/focal.md section 6.

use super::cost::{FocalProblem, FocalState};
use super::lens::LensPrior;
use crate::locate::method::{Method, resolve};
use crate::locate::multi_start::of_method;
use crate::locate::problem::Problem;
use crate::solve::configuration::Geometry;
use crate::solve::p4pf::p4pf;
use crate::solve::p5pf::p5pf;
use crate::solve::p35pf::p35pf;
use crate::solve::unknown_focal::FocalPose;
use crate::{Correspondence, Pixel, Pose};

/// Descents at most; where the best pose is known its others are near the top of the list.
const MAX_STARTS: usize = 12;
/// Focal lengths tried with the closed forms for a known one, in widths of the image: 118° of field of view to 2.8°.
const FIRST_FOCAL: f64 = 0.3;
const FOCAL_FACTOR: f64 = 1.6;
const FOCALS: i32 = 10;
/// Subsets of the points given to the closed forms.
const SUBSETS: usize = 4;
/// Two starts nearer than this (chordal rotation, log of the focal length) lead to one minimum.
const SAME_ROTATION: f64 = 0.05;
const SAME_LOG_FOCAL: f64 = 0.1;

/// The starts that fit best, the best first.
pub(super) fn starts(problem: &FocalProblem, geometry: &Geometry) -> Vec<FocalState> {
    let mut found = by_closed_forms(problem.seen, problem.lens);
    found.extend(by_known_focals(problem.seen, problem.lens, geometry));
    let scored = found.iter().filter_map(|start| {
        let state = problem.state(&start.cam_from_target, start.focal_px);
        let chi2 = problem.equations(&state)?.chi2;
        Some((chi2, state, start))
    });
    let mut scored: Vec<_> = scored.collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<(FocalState, &FocalPose)> = Vec::new();
    for (_, state, start) in scored {
        if kept.len() < MAX_STARTS && !kept.iter().any(|(_, other)| are_same(other, start)) {
            kept.push((state, start));
        }
    }
    kept.into_iter().map(|(state, _)| state).collect()
}

fn are_same(a: &FocalPose, b: &FocalPose) -> bool {
    let rotation = (a.cam_from_target.rotation - b.cam_from_target.rotation).norm();
    rotation < SAME_ROTATION && (a.focal_px / b.focal_px).ln().abs() < SAME_LOG_FOCAL
}

/// Four points, five points, and of four the three and a half, which have an answer where noise leaves the four none.
fn by_closed_forms(seen: &[Correspondence], lens: &LensPrior) -> Vec<FocalPose> {
    let centre = lens.centre_px();
    let mut found = Vec::new();
    for first in 0..SUBSETS.min(seen.len()) {
        let order = spread_from(seen, first);
        if let Some(four) = order.first_chunk::<4>() {
            let (pixels, points) = (four.map(|i| seen[i].pixel - centre), four.map(|i| seen[i].x_in_target));
            found.extend(p4pf(&pixels, &points));
            let [a, b, c, d]: [Pixel; 4] = pixels;
            if seen.len() == 4 {
                found.extend(p35pf(&[a, b, c], d.x, &points));
            }
        }
        if let Some(five) = order.first_chunk::<5>() {
            found.extend(p5pf(&five.map(|i| seen[i].pixel - centre), &five.map(|i| seen[i].x_in_target)));
        }
    }
    found
}

/// Five points far from each other in the target, four where there are no more, the farthest from a given one first.
fn spread_from(seen: &[Correspondence], first: usize) -> Vec<usize> {
    let between = |i: usize, j: usize| (seen[i].x_in_target - seen[j].x_in_target).norm_squared();
    let step = seen.len() / SUBSETS.min(seen.len()).max(1);
    let mut chosen = vec![first * step];
    while chosen.len() < seen.len().min(5) {
        let from_chosen = |i: usize| chosen.iter().map(|j| between(i, *j)).fold(f64::INFINITY, f64::min);
        let farthest = (0..seen.len()).max_by(|i, j| from_chosen(*i).total_cmp(&from_chosen(*j)));
        let Some(next) = farthest.filter(|i| !chosen.contains(i)) else { break };
        chosen.push(next);
    }
    chosen
}

fn by_known_focals(seen: &[Correspondence], lens: &LensPrior, geometry: &Geometry) -> Vec<FocalPose> {
    let Ok(method) = resolve(Method::Auto, &geometry.configuration) else { return Vec::new() };
    let mut found = Vec::new();
    for k in 0..FOCALS {
        let focal_px = lens.width_px() * FIRST_FOCAL * FOCAL_FACTOR.powi(k);
        let Some(camera) = lens.camera(&lens.state(focal_px)) else { continue };
        let through = |c: &Correspondence| {
            let bearing = camera.bearing(&c.pixel).ok()?;
            Some(Correspondence { bearing, ..*c })
        };
        let Some(through) = seen.iter().map(through).collect::<Option<Vec<_>>>() else { continue };
        let problem = Problem::new(&through, &camera);
        let (poses, _) = of_method(method, &geometry.configuration, &problem);
        let with_focal = |cam_from_target: Pose| FocalPose { cam_from_target, focal_px };
        found.extend(poses.into_iter().map(with_focal));
    }
    found
}
