//! The world: the frame of one target, or that in which targets are known, with what both say of each other.
//!
//! ```text
//!   W  world_from_map   ·   a_k  map_from_target, covariance Σ   ·   p_k  world_from_target as known, covariance P
//!   d_k = log(p_k (W a_k)⁻¹) = w + Ad α_k − ε_k,   C = Ad Σ Adᵀ + P     docs/math/map.md eqs. (4)–(10)
//! ```

use super::merge::{self, Merged, Placed};
use super::places::{Connected, Place};
use super::revise::{ENOUGH, without_place};
use super::second::SecondPose;
use super::{Adjusted, Gauge, KnownTarget, MapConfig, MapProblem, MapSolution, TargetFault, TargetInMap};
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::locate::consistency::{is_inconsistent, loses_too_many, noise_scale};
use crate::locate::refine::OVERFLOW;
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The poses in the world with their covariance together.
struct World {
    world_from_map: Pose,
    gauge: Gauge,
    /// Ascending in target.
    placed: Vec<Placed>,
    joint: DMatrix<f64>,
    displaced: Vec<(usize, TargetFault)>,
    /// Targets with two poses of which one is known to be wrong.
    decided: Vec<usize>,
}

pub(super) fn placed(
    problem: &MapProblem,
    config: &MapConfig,
    connected: Connected,
    adjusted: Adjusted,
    second: Vec<SecondPose>,
) -> Result<MapSolution, Error> {
    let chosen = chosen(problem, &adjusted);
    let is_known = config.known.iter().any(|k| chosen[k.target].is_some());
    let world =
        if is_known { known(problem, config, &adjusted, &chosen, &second)? } else { own(&adjusted, &chosen) };
    let mut targets = vec![NOT_PLACED; problem.n_targets];
    for (i, one) in world.placed.iter().enumerate() {
        let target = &mut targets[one.target];
        target.world_from_target = Some(one.world_from_target);
        target.covariance = crate::pose::symmetric(&world.joint.fixed_view::<6, 6>(6 * i, 6 * i).into());
    }
    let in_world = |pose: &Pose| world.world_from_map * *pose;
    for (target, entry) in targets.iter_mut().enumerate() {
        let other =
            chosen[target].and_then(|place| second[place]).filter(|_| !world.decided.contains(&target));
        entry.faults = faults(problem, &connected, &adjusted, other, (target, chosen[target]), in_world);
        let Some(place) = chosen[target] else { continue };
        let tally = tally(&adjusted, place);
        (entry.n_used, entry.rms_px) = (tally.0, tally.1);
        entry.n_rejected = n_rejected(problem, &adjusted, target, place);
        entry.scale = Some(adjusted.rig.scales[place].clone());
    }
    for (target, fault) in world.displaced {
        targets[target].faults.push(fault);
    }
    let rig = adjusted.rig;
    let solution = MapSolution {
        gauge: world.gauge,
        placed: world.placed.iter().map(|one| one.target).collect(),
        joint_covariance: world.joint,
        groups: connected.groups,
        bridges: connected.bridges,
        rms_px: rig.rms_px,
        chi2: rig.chi2,
        degrees_of_freedom: rig.degrees_of_freedom,
        noise_scale: rig.noise_scale,
        view_scale: rig.view_scale,
        n_views: rig.bodies.len(),
        n_seen: rig.n_seen,
        n_used: rig.n_used,
        contradicting_views: rig.verdict.contradicting_views.clone(),
        verdict: rig.verdict,
        targets,
    };
    let is_finite = |t: &TargetInMap| {
        let pose = t.world_from_target.map_or(0.0, |p| p.rotation.sum() + p.translation.sum());
        (pose + t.covariance.sum() + t.rms_px).is_finite()
    };
    if solution.targets.iter().all(is_finite) { Ok(solution) } else { Err(OVERFLOW) }
}

const NOT_PLACED: TargetInMap = TargetInMap {
    world_from_target: None,
    covariance: Matrix6::new(
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ),
    n_used: 0,
    n_rejected: 0,
    rms_px: 0.0,
    scale: None,
    faults: Vec::new(),
};

/// Returns the place of each target that the map shows: the one with the most observations that took part.
fn chosen(problem: &MapProblem, adjusted: &Adjusted) -> Vec<Option<usize>> {
    let mut best: Vec<Option<(usize, usize)>> = vec![None; problem.n_targets];
    for (p, place) in adjusted.places.iter().enumerate() {
        let n = adjusted.of_place(p, true).len();
        let entry = &mut best[place.target];
        if 0 < n && entry.is_none_or(|(most, _)| most < n) {
            *entry = Some((n, p));
        }
    }
    // The frame of the first place is that of the map, whose covariance is zero.
    if let Some(first) = adjusted.places.first()
        && !adjusted.of_place(0, true).is_empty()
    {
        best[first.target] = Some((0, 0));
    }
    best.into_iter().map(|found| found.map(|(_, p)| p)).collect()
}

/// Returns the views of a place, and its root mean square residual, px.
fn tally(adjusted: &Adjusted, place: usize) -> (usize, f64) {
    let (mut n, mut n_points, mut sum) = (0, 0.0, 0.0);
    for ((p, _), result) in adjusted.taken.iter().zip(&adjusted.rig.observations) {
        if *p == place && result.rejected.is_none() {
            n += 1;
            for (e, _) in result.residuals_px.iter().flatten().filter(|(_, used)| *used) {
                n_points += 1.0;
                sum += e.norm_squared();
            }
        }
    }
    (n, (sum / f64::max(n_points, 1.0)).sqrt())
}

/// Returns the number of observations of a target that contradict the place, except for those of another proven place; those that no place has
/// are among them.
fn n_rejected(problem: &MapProblem, adjusted: &Adjusted, target: usize, place: usize) -> usize {
    let is_other = |p: usize| p == place || adjusted.of_place(p, true).len() < ENOUGH;
    let own = (0..adjusted.places.len()).filter(|p| adjusted.places[*p].target == target);
    let of_places: usize = own
        .map(|p| {
            let n_lost = adjusted.of_place(p, false).len();
            n_lost + if p != place && is_other(p) { adjusted.of_place(p, true).len() } else { 0 }
        })
        .sum();
    of_places + without_place(problem, adjusted, target).len()
}

fn faults(
    problem: &MapProblem,
    connected: &Connected,
    adjusted: &Adjusted,
    second: SecondPose,
    (target, place): (usize, Option<usize>),
    in_world: impl Fn(&Pose) -> Pose,
) -> Vec<TargetFault> {
    let Some(place) = place else {
        let group = connected.groups.iter().position(|group| group.contains(&target));
        let n_views = connected.n_alone[target];
        let is_seen = problem.observations.iter().any(|s| s.target == target && !s.seen.is_empty());
        return vec![match group {
            Some(group) => TargetFault::NotConnected { group },
            None if 0 < n_views => TargetFault::Alone { n_views },
            None if is_seen => {
                let n = problem.observations.iter().filter(|s| s.target == target).count();
                TargetFault::Contradicts { n_lost: n, n_observations: n }
            }
            None => TargetFault::NotSeen,
        }];
    };
    let mut faults = Vec::new();
    let own = adjusted.rig.targets[place].body_from_target;
    for (p, other) in adjusted.places.iter().enumerate() {
        let used = adjusted.of_place(p, true);
        if p == place || other.target != target || used.len() < ENOUGH {
            continue;
        }
        let there = adjusted.rig.targets[p].body_from_target;
        let (views, other_views) = (views(problem, &adjusted.of_place(place, true)), views(problem, &used));
        faults.push(TargetFault::Elsewhere {
            world_from_target: in_world(&there),
            distance_m: (there.translation - own.translation).norm(),
            rotation_rad: there.angle_to_rad(&own),
            views,
            other_views,
            are_two: views[0] <= other_views[1] && other_views[0] <= views[1],
        });
    }
    let size = adjusted.sizes[target];
    if size != 1.0 {
        let scale = &adjusted.rig.scales[place];
        faults.push(TargetFault::Size { ratio: size * scale.ratio, sigma: size * scale.sigma });
    }
    if let Some((other, ratio)) = second {
        faults.push(TargetFault::Ambiguous { world_from_target: in_world(&other), ratio });
    }
    let n_lost = n_rejected(problem, adjusted, target, place);
    let n_observations = n_lost + adjusted.of_place(place, true).len();
    if loses_too_many(n_lost, n_observations) {
        faults.push(TargetFault::Contradicts { n_lost, n_observations });
    }
    faults
}

/// Returns the first and the last view of some observations.
fn views(problem: &MapProblem, observations: &[usize]) -> [usize; 2] {
    let views = || observations.iter().map(|i| problem.observations[*i].view);
    [views().min().unwrap_or(0), views().max().unwrap_or(0)]
}

/// The frame of the first place.
fn own(adjusted: &Adjusted, chosen: &[Option<usize>]) -> World {
    let placed: Vec<(usize, usize)> =
        chosen.iter().enumerate().filter_map(|(target, place)| Some((target, (*place)?))).collect();
    let joint = blocks(placed.len(), |i, j| adjusted.joint(placed[i].1, placed[j].1));
    let pose = |(target, place): &(usize, usize)| Placed {
        target: *target,
        world_from_target: adjusted.rig.targets[*place].body_from_target,
    };
    World {
        world_from_map: Pose::identity(),
        gauge: Gauge::Reference { target: adjusted.places.first().map_or(0, |p: &Place| p.target) },
        placed: placed.iter().map(pose).collect(),
        joint,
        displaced: Vec::new(),
        decided: Vec::new(),
    }
}

/// Targets that are known and seen.
struct Survey<'a> {
    config: &'a MapConfig<'a>,
    adjusted: &'a Adjusted,
    /// Index into `known`, and the place.
    both: Vec<(usize, usize)>,
    /// A place that is taken to have another pose.
    instead: Option<(usize, Pose)>,
}

/// The solution for some of them.
struct Fit {
    world_from_map: Pose,
    /// Factor of C.
    factor: Cholesky<f64, Dyn>,
    /// d at the solution.
    left: DVector<f64>,
    /// M = (JᵀC⁻¹J)⁻¹.
    covariance: Matrix6,
    chi2: f64,
}

/// The frame in which targets are known; those that contradict the others are left out.
fn known(
    problem: &MapProblem,
    config: &MapConfig,
    adjusted: &Adjusted,
    chosen: &[Option<usize>],
    second: &[SecondPose],
) -> Result<World, Error> {
    let both = config.known.iter().enumerate().filter_map(|(k, one)| Some((k, chosen[one.target]?)));
    let (mut doubtful, mut both): (Vec<_>, Vec<_>) = both.partition(|(_, place)| second[*place].is_some());
    if both.is_empty() {
        both = core::mem::take(&mut doubtful);
    }
    let mut survey = Survey { config, adjusted, both, instead: None };
    let mut displaced: Vec<usize> = Vec::new();
    let undetermined = || Error::NotConverged { steps: adjusted.rig.steps };
    let mut fit = survey.fit().ok_or_else(undetermined)?;
    while 2 < survey.both.len() {
        let Some((worst, t)) = survey.worst(&fit) else { break };
        let degrees_of_freedom = 6 * survey.both.len() - 6;
        if !is_inconsistent(t, 6) && !is_inconsistent(fit.chi2, degrees_of_freedom) {
            break;
        }
        displaced.push(survey.both.remove(worst).0);
        fit = survey.fit().ok_or_else(undetermined)?;
    }
    let degrees_of_freedom = 6 * survey.both.len() - 6;
    if is_inconsistent(fit.chi2, degrees_of_freedom) {
        // Two that contradict each other: which is right, nothing says.
        displaced.extend(survey.both.iter().map(|(k, _)| *k));
    }
    // What is known decides between two poses of a target.
    let (mut decided, mut walked) = (Vec::new(), chosen.to_vec());
    let mut agreeing = Vec::new();
    for one @ (k, place) in doubtful {
        let other = second[place].map(|(other, _)| (place, other));
        let target = config.known[k].target;
        match (survey.agrees(&fit, one, None), survey.agrees(&fit, one, other)) {
            (true, other) => {
                agreeing.push(one);
                decided.extend((!other).then_some(target));
            }
            (false, true) => {
                walked[target] = None;
                decided.push(target);
            }
            (false, false) => displaced.push(k),
        }
    }
    let scale = survey.scale(&fit);
    survey.both.extend(agreeing);
    let fault = |k: usize| {
        let KnownTarget { target, world_from_target: known } = config.known[k];
        let place = chosen[target]?;
        let found = fit.world_from_map * adjusted.rig.targets[place].body_from_target;
        let distance_m = (found.translation - known.translation).norm();
        Some((target, TargetFault::Displaced { distance_m, rotation_rad: found.angle_to_rad(&known) }))
    };
    let faults = displaced.iter().filter_map(|k| fault(*k)).collect();
    let gauge = Gauge::Known {
        targets: survey.both.iter().map(|(k, _)| config.known[*k].target).collect(),
        chi2: fit.chi2,
        degrees_of_freedom,
        scale,
    };
    let Merged { placed, mut joint } =
        survey.merged(&fit.world_from_map, &walked, problem.n_targets).ok_or_else(undetermined)?;
    joint *= noise_scale(fit.chi2, degrees_of_freedom);
    Ok(World { world_from_map: fit.world_from_map, gauge, placed, joint, displaced: faults, decided })
}

impl Survey<'_> {
    fn known(&self, k: usize) -> &Pose {
        &self.config.known[k].world_from_target
    }

    fn prior(&self, k: usize, l: usize) -> Matrix6 {
        self.config.known_covariance.map_or(Matrix6::zeros(), |p| p.fixed_view::<6, 6>(6 * k, 6 * l).into())
    }

    fn map_from_target(&self, place: usize) -> &Pose {
        match &self.instead {
            Some((other, pose)) if *other == place => pose,
            _ => &self.adjusted.rig.targets[place].body_from_target,
        }
    }

    /// Returns whether a known target that took no part in a fit agrees with it, with another pose of its place if one is given: eq. (6).
    fn agrees(&mut self, fit: &Fit, one: (usize, usize), instead: Option<(usize, Pose)>) -> bool {
        self.both.push(one);
        self.instead = instead;
        let with = self.fit();
        self.both.pop();
        self.instead = None;
        with.is_some_and(|with| !is_inconsistent(with.chi2 - fit.chi2, 6))
    }

    /// Returns C, eq. (5).
    fn noise(&self, world_from_map: &Pose) -> Option<Cholesky<f64, Dyn>> {
        let ad = world_from_map.adjoint();
        let c = blocks(self.both.len(), |i, j| {
            let ((k, a), (l, b)) = (self.both[i], self.both[j]);
            ad * self.adjusted.joint(a, b) * ad.transpose() + self.prior(k, l)
        });
        merge::factor(&c)
    }

    /// Returns d, eq. (4).
    fn left(&self, world_from_map: &Pose) -> DVector<f64> {
        let mut d = DVector::zeros(6 * self.both.len());
        for (i, (k, place)) in self.both.iter().enumerate() {
            let found = *world_from_map * *self.map_from_target(*place);
            d.fixed_rows_mut::<6>(6 * i).copy_from(&(*self.known(*k) * found.inverse()).log());
        }
        d
    }

    /// Returns the columns [I; I; …].
    fn columns(&self) -> DMatrix<f64> {
        merge::columns(self.both.len())
    }

    fn fit(&self) -> Option<Fit> {
        // A wrong one of the known targets must not decide the start: that with the least median displacement does.
        let start = |(k, place): &(usize, usize)| *self.known(*k) * self.map_from_target(*place).inverse();
        let spread = |world_from_map: &Pose| {
            let factor = self.noise(world_from_map)?;
            let whitened = factor.l().solve_lower_triangular(&self.left(world_from_map))?;
            let mut each: Vec<f64> =
                (0..self.both.len()).map(|i| whitened.rows(6 * i, 6).norm_squared()).collect();
            let middle = each.len() / 2;
            Some(*each.select_nth_unstable_by(middle, f64::total_cmp).1)
        };
        let starts = self.both.iter().map(start).filter_map(|pose| Some((spread(&pose)?, pose)));
        let mut world_from_map = starts.min_by(|a, b| a.0.total_cmp(&b.0))?.1;
        for _ in 0..2 {
            let factor = self.noise(&world_from_map)?;
            let columns = factor.l().solve_lower_triangular(&self.columns())?;
            let evaluate = |pose: &Pose| {
                let whitened = factor.l().solve_lower_triangular(&self.left(pose))?;
                Some(DenseEquations {
                    chi2: whitened.norm_squared(),
                    gradient: columns.tr_mul(&whitened),
                    information: columns.tr_mul(&columns),
                })
            };
            let moved = |pose: &Pose, step: &DVector<f64>| {
                Some(pose.moved(&Vector6::from_column_slice(step.as_slice())))
            };
            world_from_map = minimize_dense(world_from_map, evaluate, moved)?.state;
        }
        let factor = self.noise(&world_from_map)?;
        let left = self.left(&world_from_map);
        let columns = self.columns();
        let covariance = columns.tr_mul(&factor.solve(&columns)).cholesky()?.inverse();
        let chi2 = left.dot(&factor.solve(&left));
        let covariance = Matrix6::from_column_slice(covariance.as_slice());
        chi2.is_finite().then_some(Fit { world_from_map, factor, left, covariance, chi2 })
    }

    /// Returns the known target without which χ² falls most, and by how much: eq. (6).
    fn worst(&self, fit: &Fit) -> Option<(usize, f64)> {
        let inverse = fit.factor.inverse();
        let columns = &inverse * self.columns();
        let q = &inverse - &columns * fit.covariance * columns.transpose();
        let u = &inverse * &fit.left;
        let of = |i: usize| {
            let own: Matrix6 = q.fixed_view::<6, 6>(6 * i, 6 * i).into();
            let u: Vector6 = u.fixed_rows::<6>(6 * i).into();
            Some((i, u.dot(&own.cholesky()?.solve(&u))))
        };
        (0..self.both.len()).filter_map(of).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns lengths in the world over lengths in the map, with the standard deviation: eq. (7).
    fn scale(&self, fit: &Fit) -> Option<[f64; 2]> {
        if self.both.len() < 2 {
            return None;
        }
        let ad = fit.world_from_map.adjoint();
        let mut columns = self.columns().insert_column(6, 0.0);
        for (i, (_, place)) in self.both.iter().enumerate() {
            let t = self.map_from_target(*place).translation;
            let grown = ad * Vector6::new(0.0, 0.0, 0.0, t.x, t.y, t.z);
            columns.fixed_view_mut::<6, 1>(6 * i, 6).copy_from(&grown);
        }
        let solved = fit.factor.solve(&columns);
        let inverse = columns.tr_mul(&solved).cholesky()?.inverse();
        let ratio = (&inverse * solved.tr_mul(&fit.left))[6];
        Some([1.0 + ratio, inverse[(6, 6)].sqrt()]).filter(|s| s.iter().all(|x| x.is_finite()))
    }

    /// Returns the poses of all targets by what is known and by the walk, eq. (9); those that are not where they were known to be by the walk
    /// alone.
    fn merged(&self, world_from_map: &Pose, chosen: &[Option<usize>], n_targets: usize) -> Option<Merged> {
        let is_kept = |k: &usize| {
            chosen[self.config.known[*k].target].is_none() || self.both.iter().any(|(both, _)| both == k)
        };
        let kept: Vec<usize> = (0..self.config.known.len()).filter(is_kept).collect();
        let walked: Vec<(usize, usize)> = (0..n_targets).filter_map(|t| Some((t, chosen[t]?))).collect();
        let as_known = kept.iter().map(|k| (self.config.known[*k].target, *self.known(*k)));
        let by_walk = walked.iter().map(|(target, place)| (*target, *self.map_from_target(*place)));
        let prior = blocks(kept.len(), |i, j| self.prior(kept[i], kept[j]));
        let of_walk = blocks(walked.len(), |i, j| self.adjusted.joint(walked[i].1, walked[j].1));
        merge::merged(as_known.collect(), &prior, by_walk.collect(), &of_walk, world_from_map)
    }
}

fn blocks(n: usize, of: impl Fn(usize, usize) -> Matrix6) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(6 * n, 6 * n);
    for i in 0..n {
        for j in 0..n {
            all.fixed_view_mut::<6, 6>(6 * i, 6 * j).copy_from(&of(i, j));
        }
    }
    all
}
