//! The minima of the reprojection error: the closed form's candidates and their mirror poses, each refined; more starts where
//! those leave a doubt. How many starts are enough was measured: docs/math/line_plus_one.md.

use crate::locate::choose::{AMBIGUITY_GATE_CHI2, Choice, Minima, NARROW_GATE_CHI2, insert};
use crate::locate::consistency::is_unlikely;
use crate::locate::curvature::is_bent;
use crate::locate::method::Method;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, refine_against, refine_to_the_end, residual_sums};
use crate::solve::Candidates;
use crate::solve::configuration::{Configuration, Geometry, are_four_places};
use crate::solve::line_plus_one::Weakness;
use crate::solve::{line_plus_one, p3p, planar, sqpnp};
use crate::{Bearing, Camera, Correspondence, Point, Pose, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector2, Vector3};

/// A second start farther off than this fits nothing near: it is not refined once a first minimum is known.
pub(crate) const HOPELESS_CHI2: f64 = 1e4;

/// Adds the minima reached from the closed form's candidates, and from more starts where those leave a doubt. Returns whether the
/// likelihood is bent at the lowest minimum; none where that is not known yet.
pub(crate) fn search(
    candidates: &Candidates,
    is_weak: bool,
    geometry: &Geometry,
    problem: &Problem,
    minima: &mut Minima,
) -> Option<bool> {
    let configuration = &geometry.configuration;
    let seen = problem.seen;
    let flat = matches!(configuration, Configuration::Planar | Configuration::LinePlusOne { .. });
    if flat {
        let normal = plane_normal(configuration, seen);
        refine_pair(candidates, &normal, problem, minima);
    } else {
        refine_each(candidates, problem, minima);
    }
    let known_chi2 = minima.first().map(|m| m.chi2);
    let is_bent = minima.first().map(|m| is_bent(m, &problem.held_at(&m.cam_from_target)));
    if minima.first().is_none_or(|m| is_unlikely(m.chi2, problem.degrees_of_freedom())) {
        refine_each(&sqpnp::sqpnp(seen), problem, minima);
        refine_each(&three_of(seen), problem, minima);
    } else if (geometry.is_between_layouts() || is_weak || is_bent == Some(true) || is_in_doubt(minima))
        && are_four_places(seen)
    {
        refine_each(&three_of(seen), problem, minima);
    }
    if geometry.is_narrow() {
        around_the_line(problem, minima);
    }
    // Another minimum may have taken the first place.
    is_bent.filter(|_| minima.first().map(|m| m.chi2) == known_chi2)
}

/// Sixths of a turn about the line that all points are near.
const SIXTHS: usize = 6;
/// Minima that are turned about it.
const LOWEST: usize = 2;

/// Adds the minima along the rotation about the line that all points are near, which their pixels hardly show. Where a descent does not come to an
/// end the place it came to counts if it fits: such a pose is not known, but it cannot be excluded.
#[cold]
#[inline(never)]
fn around_the_line(problem: &Problem, minima: &mut Minima) {
    let seen = problem.seen;
    let [i, j, _] = wide_triangle(seen);
    let (centre, along) = (centroid(seen), (seen[j].x_in_target - seen[i].x_in_target).normalize());
    let lowest: ArrayVec<Pose, LOWEST> = minima.iter().take(LOWEST).map(|m| m.cam_from_target).collect();
    for (pose, k) in lowest.iter().flat_map(|pose| (1..SIXTHS).map(move |k| (pose, k))) {
        let turn = pose.rotation * along * (core::f64::consts::TAU * k as f64 / SIXTHS as f64);
        let turned = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).rotation;
        let rotation = turned * pose.rotation;
        let start = Pose::new(rotation, *pose * centre - rotation * centre);
        let lowest_chi2 = minima.first().map(|m| m.chi2);
        if let Ok(end) = refine_to_the_end(&start, lowest_chi2, problem)
            && lowest_chi2.is_none_or(|lowest| end.chi2 - lowest < NARROW_GATE_CHI2)
        {
            insert(minima, end);
        }
    }
}

/// The two minima of a flat target: from the first, better candidate, then from its mirror pose or the other candidate, whichever
/// fits better to begin with. Closed forms often give one minimum twice; the mirror pose finds the other.
fn refine_pair(candidates: &Candidates, normal: &Vector3<f64>, problem: &Problem, minima: &mut Minima) {
    let Some((first, others)) = candidates.split_first() else { return };
    refine_each(&[*first], problem, minima);
    let Some(best) = minima.first() else { return refine_each(others, problem, minima) };
    let mirrored = mirrored(&best.cam_from_target, normal, &centroid(problem.seen), &Point::zeros());
    let Some(second) = others.first() else { return refine_each(&[mirrored], problem, minima) };
    let start_chi2 = |start: &Pose| residual_sums(start, problem).0;
    let (chi2_mirrored, chi2_second) = (start_chi2(&mirrored), start_chi2(second));
    let (near, far) = if chi2_second < chi2_mirrored { (second, &mirrored) } else { (&mirrored, second) };
    refine_each(&[*near], problem, minima);
    if minima.len() == 1 && chi2_mirrored.max(chi2_second) < HOPELESS_CHI2 {
        refine_each(&[*far], problem, minima);
    }
}

/// Whether the best minimum leaves room within the ambiguity gate for one not found yet: another is that near, or its own
/// χ² is that large. Four points have up to four minima, and the closed form's two candidates need not lead to the lowest:
/// of 586 photographed quadruples 6 had it elsewhere, of 20,000 random ones at 1 px 6 (1 with the P3P starts).
pub(crate) fn is_in_doubt(minima: &Minima) -> bool {
    let near = |chi2: f64| chi2 < AMBIGUITY_GATE_CHI2;
    minima.first().is_none_or(|m| !near(m.chi2))
        || minima.get(1).is_some_and(|m| near(m.chi2 - minima[0].chi2))
}

fn refine_each(candidates: &[Pose], problem: &Problem, minima: &mut Minima) {
    for candidate in candidates {
        let alternative = minima.first().map(|m| m.chi2);
        if let Ok(minimum) = refine_against(candidate, alternative, problem) {
            insert(minima, minimum);
        }
    }
}

/// The closed form of a method, and what makes the view weak.
pub(crate) fn of_method(
    method: Method,
    configuration: &Configuration,
    problem: &Problem,
) -> (Candidates, Option<Weakness>) {
    let seen = problem.seen;
    match (method, configuration) {
        (Method::LinePlusOne, Configuration::LinePlusOne { order }) => {
            let (bearings, points) = four_of(seen, order);
            let candidates = line_plus_one::line_plus_one(&bearings, &points);
            let sigma_rad = sigma_rad(&seen[order[3]], problem.camera);
            let weakness = line_plus_one::weakness(&candidates, &bearings, &points, sigma_rad);
            (better_first(candidates, problem), weakness)
        }
        (Method::P3p, _) => (three_of(seen), None),
        (Method::Planar, _) => (better_first(planar::planar(seen), problem), None),
        _ => (sqpnp::sqpnp(seen), None),
    }
}

fn better_first(mut candidates: Candidates, problem: &Problem) -> Candidates {
    let chi2 = |candidate: &Pose| residual_sums(candidate, problem).0;
    if candidates.len() == 2 && chi2(&candidates[1]) < chi2(&candidates[0]) {
        candidates.swap(0, 1);
    }
    candidates
}

/// Why two refined poses fit alike, where the closed form's candidates were too noisy to tell.
pub(crate) fn weakness_of_alternatives(
    configuration: &Configuration,
    choice: &Choice,
    problem: &Problem,
) -> Option<Weakness> {
    let (Configuration::LinePlusOne { order }, Some(alternative)) = (configuration, choice.alternative)
    else {
        return None;
    };
    // By the one that fits best, whichever is the more probable: a flat minimum is not known well enough to measure by.
    let is_first = choice.best.chi2 <= alternative.chi2;
    let (first, second) = if is_first { (choice.best, alternative) } else { (alternative, choice.best) };
    let alternatives: Candidates = [first.cam_from_target, second.cam_from_target].into_iter().collect();
    let (bearings, points) = four_of(problem.seen, order);
    line_plus_one::weakness(
        &alternatives,
        &bearings,
        &points,
        sigma_rad(&problem.seen[order[3]], problem.camera),
    )
}

/// The four points of a line-plus-one layout, in order along the line, the one off it last.
pub(crate) fn four_of(seen: &[Correspondence], order: &[usize; 4]) -> ([Bearing; 4], [Point; 4]) {
    (order.map(|i| seen[i].bearing), order.map(|i| seen[i].x_in_target))
}

/// P3P on the three points that span the largest triangle found from the first point.
pub(crate) fn three_of(seen: &[Correspondence]) -> Candidates {
    let [i, j, k] = wide_triangle(seen);
    let order = [i, j, k];
    p3p::p3p(&order.map(|i| seen[i].bearing), &order.map(|i| seen[i].x_in_target))
}

/// The farthest point from the first, the farthest from that, and the one farthest off their line.
fn wide_triangle(seen: &[Correspondence]) -> [usize; 3] {
    let x = |i: usize| seen[i].x_in_target;
    let farthest = |measure: &dyn Fn(usize) -> f64| {
        (0..seen.len()).fold(0, |best, i| if measure(best) < measure(i) { i } else { best })
    };
    let i = farthest(&|n| (x(n) - x(0)).norm_squared());
    let j = farthest(&|n| (x(n) - x(i)).norm_squared());
    let k = farthest(&|n| (x(n) - x(i)).cross(&(x(j) - x(i))).norm_squared());
    [i, j, k]
}

/// The standard deviation of a pixel as an angle, radians.
fn sigma_rad(c: &Correspondence, camera: &Camera) -> f64 {
    let beside = c.pixel + Vector2::new(c.sigma_px, 0.0);
    camera.bearing(&beside).map_or(f64::INFINITY, |b| b.cross(&c.bearing).norm())
}

/// Unit normal of a flat target, target frame.
fn plane_normal(configuration: &Configuration, seen: &[Correspondence]) -> Vector3<f64> {
    let [i, j, k] = match configuration {
        Configuration::LinePlusOne { order: [a, _, c, d] } => [*a, *c, *d],
        _ => wide_triangle(seen),
    };
    let x = |n: usize| seen[n].x_in_target;
    (x(j) - x(i)).cross(&(x(k) - x(i))).normalize()
}

/// The start for the other minimum of a flat target: the target mirrored in the plane through its centre perpendicular to the line
/// of sight, which begins at `eye`. From far away both have nearly the same image: docs/math/line_plus_one.md eqs. (9)–(11).
#[inline]
pub(crate) fn mirrored(
    b_from_target: &Pose,
    normal: &Vector3<f64>,
    centre: &Point,
    eye_in_b: &Point,
) -> Pose {
    let centre_in_b = b_from_target * centre;
    let sight = (centre_in_b - eye_in_b).normalize();
    let reflection = |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * 2.0;
    // Two reflections make a rotation; the one in the target's own plane does not move its points.
    let rotation = reflection(&sight) * b_from_target.rotation * reflection(normal);
    Pose::new(rotation, centre_in_b - rotation * centre)
}
