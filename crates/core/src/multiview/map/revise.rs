//! Adjusts, and corrects what the adjustment shows to be wrong, until nothing changes.
//!
//! Each round: places of one target that agree become one; a target that contradicts the map gets the size that explains it, or else another
//! place. docs/math/map.md sections 2 and 3.

use super::places::{Connected, Place, join};
use super::size::size;
use super::{Adjusted, MapConfig, MapProblem, adjust, resized};
use crate::locate::consistency::is_unlikely;
use crate::locate::{Config, locate};
use crate::multiview::rig::Cause;
use crate::{Error, Point, Pose};

/// Rounds of corrections; each solves once. More than so many kinds of fault in one walk are left to the verdict.
const MAX_ROUNDS: usize = 8;
/// At most one of so many tags has another size; where more seem to, the camera is wrong.
const MOST_SIZES: usize = 4;
/// Least number of observations of another place.
pub(super) const ENOUGH: usize = 2;

pub(super) fn revised(
    problem: &MapProblem,
    config: &MapConfig,
    connected: &Connected,
) -> Result<Adjusted, Error> {
    let mut adjusted = adjust(problem, config, connected.places.clone(), vec![1.0; problem.n_targets])?;
    let mut copies = connected.copies.clone();
    for _ in 0..MAX_ROUNDS {
        if blames_lens(&adjusted) {
            // A wrong lens explains everything else.
            break;
        }
        let (mut places, mut sizes) = (adjusted.places.clone(), adjusted.sizes.clone());
        add_copies(problem, &adjusted, &mut copies, &mut places);
        resize(problem, config, &adjusted, &mut places, &mut sizes);
        let is_resized = |target: usize| sizes[target] != adjusted.sizes[target];
        part(problem, &adjusted, &mut places, is_resized);
        unite(problem, &adjusted, &mut places);
        if places == adjusted.places && sizes == adjusted.sizes {
            break;
        }
        adjusted = adjust(problem, config, places, sizes)?;
    }
    Ok(adjusted)
}

fn blames_lens(adjusted: &Adjusted) -> bool {
    adjusted.rig.verdict.cameras.iter().any(|camera| camera.cause == Some(Cause::Intrinsics))
}

/// Distributes the observations of targets that a view shows more than once over their places, and makes new ones.
fn add_copies(problem: &MapProblem, adjusted: &Adjusted, copies: &mut Vec<usize>, places: &mut Vec<Place>) {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    let mut centres: Vec<(usize, Point)> = adjusted
        .rig
        .targets
        .iter()
        .enumerate()
        .map(|(place, target)| (place, target.body_from_target.translation))
        .collect();
    for i in std::mem::take(copies) {
        let observation = &problem.observations[i];
        let Some(pose) = cam_from_map[observation.view] else { continue };
        let seen = resized(&observation.seen, adjusted.sizes[observation.target]);
        let Ok(found) = locate(&seen, problem.camera, &Config::default()) else { continue };
        let centre = pose.inverse() * found.cam_from_target.translation;
        // Far enough for the error of one view, near enough for another tag of the same wall.
        let reach_m = 0.1 * found.cam_from_target.translation.norm();
        let shows = |place: &Place, view: usize| {
            place.observations.iter().any(|k| problem.observations[*k].view == view)
        };
        let near = centres
            .iter()
            .filter(|(place, _)| places[*place].target == observation.target)
            .filter(|(place, _)| !shows(&places[*place], observation.view))
            .map(|(place, known)| ((known - centre).norm(), *place))
            .filter(|(distance_m, _)| *distance_m < reach_m)
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match near {
            Some((_, place)) => {
                let one = Place { target: observation.target, observations: vec![i] };
                join(&mut places[place], one, problem);
            }
            None => {
                centres.push((places.len(), centre));
                places.push(Place { target: observation.target, observations: vec![i] });
            }
        }
    }
}

/// Returns the observations of a target, from views that the map places, that no place has: what contradicts every place is dropped.
pub(super) fn without_place(problem: &MapProblem, adjusted: &Adjusted, target: usize) -> Vec<usize> {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    let mut is_taken = vec![false; problem.observations.len()];
    adjusted.taken.iter().for_each(|(_, i)| is_taken[*i] = true);
    let is_own = |i: &usize| {
        let observation = &problem.observations[*i];
        observation.target == target
            && !observation.seen.is_empty()
            && cam_from_map[observation.view].is_some()
    };
    (0..problem.observations.len()).filter(|i| !is_taken[*i] && is_own(i)).collect()
}

/// Gives targets that contradict the map the size that explains them, and a place again to those that have lost it.
fn resize(
    problem: &MapProblem,
    config: &MapConfig,
    adjusted: &Adjusted,
    places: &mut Vec<Place>,
    sizes: &mut [f64],
) {
    let mut is_explained = false;
    let doubted: Vec<(usize, Option<usize>, Vec<usize>)> =
        (0..problem.n_targets).filter_map(|target| doubted(problem, adjusted, target)).collect();
    if doubted.len() <= usize::max(1, problem.n_targets / MOST_SIZES) {
        for (target, own, observations) in doubted {
            // With a wrong size it pulls the cameras of its views to where that fits.
            let others = adjusted.places.iter().filter(|place| place.target != target).cloned().collect();
            let Ok(without) = adjust(problem, config, others, adjusted.sizes.clone()) else { continue };
            let Some(found) = size(problem, &without, &observations) else { continue };
            sizes[target] *= found.ratio;
            is_explained = true;
            match own {
                Some(p) => places[p].observations = observations,
                None => places.push(Place { target, observations }),
            }
        }
    }
    if is_explained {
        return;
    }
    // Smaller errors leave no observation out; one is corrected at a time, because all sizes are relative to each other.
    let worst = |p: &usize| {
        let scale = &adjusted.rig.scales[*p];
        (scale.ratio - 1.0).abs() / scale.sigma
    };
    let wrong =
        (0..adjusted.places.len()).filter(|p| adjusted.rig.verdict.targets[*p].cause == Some(Cause::Size));
    let n_wrong = wrong.clone().count();
    if adjusted.places.len() < MOST_SIZES * n_wrong {
        return;
    }
    if let Some(p) = wrong.max_by(|a, b| worst(a).total_cmp(&worst(b))) {
        sizes[adjusted.places[p].target] *= adjusted.rig.scales[p].ratio.clamp(0.5, 2.0);
    }
}

/// Returns a target whose observations contradict the map, with its place and all observations that may show it there.
fn doubted(
    problem: &MapProblem,
    adjusted: &Adjusted,
    target: usize,
) -> Option<(usize, Option<usize>, Vec<usize>)> {
    let lost = without_place(problem, adjusted, target);
    let own = adjusted.places.iter().position(|place| place.target == target);
    let n_contradicting = own.map_or(0, |p| adjusted.of_place(p, false).len());
    let mut observations = own.map_or_else(Vec::new, |p| adjusted.places[p].observations.clone());
    let is_doubted = ENOUGH <= lost.len() + n_contradicting;
    observations.extend(lost);
    observations.sort_unstable();
    is_doubted.then_some((target, own, observations))
}

/// Makes observations that contradict their place a place of their own.
fn part(
    problem: &MapProblem,
    adjusted: &Adjusted,
    places: &mut Vec<Place>,
    is_resized: impl Fn(usize) -> bool,
) {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    for (p, place) in adjusted.places.iter().enumerate() {
        let target = place.target;
        if is_resized(target) {
            continue;
        }
        let is_placed = |i: &usize| cam_from_map[problem.observations[*i].view].is_some();
        let lost: Vec<usize> = adjusted.of_place(p, false).into_iter().filter(is_placed).collect();
        let n_kept = adjusted.of_place(p, true).len();
        let is_own = adjusted.places.iter().position(|other| other.target == target) == Some(p);
        // Those that a place does not hold together agree on nothing.
        if lost.len() < ENOUGH || (!is_own && n_kept < ENOUGH.max(lost.len())) {
            continue;
        }
        places[p].observations.retain(|i| !lost.contains(i));
        places.push(Place { target, observations: lost });
    }
}

/// Joins places of one target that agree.
fn unite(problem: &MapProblem, adjusted: &Adjusted, places: &mut Vec<Place>) {
    let mut gone: Vec<usize> = Vec::new();
    for a in 0..adjusted.places.len() {
        for b in a + 1..adjusted.places.len() {
            let is_one = adjusted.places[a].target == adjusted.places[b].target;
            if is_one && !gone.contains(&a) && !gone.contains(&b) && agree(adjusted, a, b) {
                let other = places[b].clone();
                join(&mut places[a], other, problem);
                gone.push(b);
            }
        }
    }
    gone.sort_unstable();
    gone.into_iter().rev().for_each(|b| drop(places.remove(b)));
}

/// Returns whether two places are one, as far as their uncertainty shows: docs/math/map.md eqs. (1) and (2). A place of few views may have the
/// second pose of a square, which has the same centre.
fn agree(adjusted: &Adjusted, a: usize, b: usize) -> bool {
    let pose = |p: usize| adjusted.rig.targets[p].body_from_target;
    let difference = |a: Pose, b: Pose| (a * b.inverse()).log();
    let motion = difference(pose(a), pose(b));
    let (of_a, of_b, cross) = (adjusted.joint(a, a), adjusted.joint(b, b), adjusted.joint(a, b));
    let covariance = of_a + of_b - cross - cross.transpose();
    let chi2 = covariance.cholesky().map(|c| motion.dot(&c.solve(&motion)));
    if chi2.is_some_and(|chi2| !is_unlikely(chi2, 6)) {
        return true;
    }
    let (t_a, t_b) = (pose(a).translation, pose(b).translation);
    let mut by = nalgebra::SMatrix::<f64, 3, 6>::zeros();
    by.fixed_view_mut::<3, 3>(0, 0).copy_from(&-((t_a + t_b) * 0.5).cross_matrix());
    by.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
    let apart = t_a - t_b;
    let chi2 = (by * covariance * by.transpose()).cholesky().map(|c| apart.dot(&c.solve(&apart)));
    let are_few = adjusted.places[a].observations.len().min(adjusted.places[b].observations.len()) < FEW;
    are_few && chi2.is_some_and(|chi2| !is_unlikely(chi2, 3))
}

/// Below so many views a place may have the second pose of a square.
const FEW: usize = 6;
