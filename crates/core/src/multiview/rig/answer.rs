//! From the minimum to the solution: covariances, counts, the weakest link.

use super::adjust::{Adjusted, keeps_minimum};
use super::blocks;
use super::budget::Budgets;
use super::classify::rms_px;
use super::explain::Shown;
use super::layout::Layout;
use super::lens_doubt::LensDoubts;
use super::lens_score::scores;
use super::neighbours::Neighbours;
use super::scale::scales;
use super::sighted::LocatedViews;
use super::timing::by_times;
use super::uncertain_lens::{Free, UncertainParameters};
use super::verdict::Evidence;
use super::views::{Groups, shared_views};
use super::{BodyInView, CameraInRig, ObservationResult, RigConfig, RigSolution, TargetOnBody, WeakestLink};
use crate::budget::ErrorSource;
use crate::covariance::is_covariance;
use crate::least_squares::PivotedPose;
use crate::least_squares::clustered::{Cluster, Clustered, clustered};
use crate::least_squares::rig::Eliminated;
use crate::locate::consistency::{measured_scale, noise_scale};
use crate::locate::loss::Loss;
use crate::locate::refine::OVERFLOW;
use crate::locate::sandwich::widening;
use crate::pose::symmetric;
use crate::{Error, Matrix6, Point, Pose};
use nalgebra::{DMatrix, Matrix3};

/// Sums over points that took part.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    n_used: usize,
    squared_px2: f64,
    chi2: f64,
}

pub(super) fn answer(
    layout: &Layout,
    located_views: &LocatedViews,
    adjusted: Adjusted,
    config: &RigConfig,
    free: Option<&Free>,
) -> Result<RigSolution, Error> {
    let undetermined = || Error::NotConverged { steps: adjusted.steps };
    let eliminated = adjusted.equations.eliminated(0.0).ok_or_else(undetermined)?;
    let tallies = tallies(&adjusted);
    let total = sum(tallies.iter());
    let of_lenses = free.map_or(0, |free| free.n_determined);
    let degrees_of_freedom = degrees_of_freedom(layout, &adjusted, &total, config).saturating_sub(of_lenses);
    let Noise { chi2, scale: noise_scale, measured } = noise(&adjusted, &total, degrees_of_freedom, config);
    let neighbours = Neighbours::new(layout, &adjusted);
    let measured = measured * neighbours.of_lenses;
    let of_loss = loss_widening(config.loss);
    let of_noise = noise_scale * of_loss;
    let widened = of_noise * neighbours.of_poses;
    let inverse = eliminated.reduced.inverse();
    let clusters = if config.shared_errors { clusters(layout, &adjusted, &eliminated) } else { Vec::new() };
    let of_views = clustered(&inverse, &clusters, widened);
    let of_blocks = blocks::factor(&clusters);
    let held =
        Clustered { covariance: &of_views.covariance * of_blocks, within: of_views.within * of_blocks };
    let lenses = scores(layout, &adjusted, &eliminated, config.lens_errors);
    let doubts = match keeps_minimum(config.loss) {
        true => LensDoubts::new(&lenses, measured),
        false => LensDoubts::none(),
    };
    let mut of_bodies = adjusted.equations.body_covariances(&eliminated, &(&held.covariance / held.within));
    let uncertain = UncertainParameters::of_lenses(config.intrinsics, free, (layout, &adjusted, &eliminated));
    let scales = scales(layout, &adjusted, &eliminated, held.within, !config.known_distances.is_empty());
    let of_targets = UncertainParameters::of_sizes(&scales, layout, &adjusted, &eliminated).with_tags(
        config.displaced_tags,
        layout,
        &adjusted,
        &eliminated,
    );
    let of_times =
        config.time_offsets.map(|offsets| (&offsets.covariance, by_times(offsets, layout, &adjusted)));
    let of_times = UncertainParameters::of_common(of_times, &adjusted, &eliminated);
    for (body, covariance) in of_bodies.iter_mut().enumerate() {
        *covariance *= held.within;
        of_times.add_to_body(covariance, body);
        uncertain.add_to_body(covariance, body);
        of_targets.add_to_body(covariance, body);
        if config.lens_errors {
            doubts.add_to_body(covariance, body);
        }
    }
    let bodies = bodies(layout, &adjusted, &tallies, &of_bodies);
    let mut budgets = Budgets::new(layout);
    budgets.add_observations(&adjusted, &eliminated, &inverse, config);
    budgets.scale(of_loss);
    budgets.add(ErrorSource::Residuals, &(&inverse * (of_noise - of_loss)));
    budgets.add_excess(ErrorSource::SharedInView, &of_views.covariance, &(&inverse * of_noise));
    budgets.add(ErrorSource::SharedInBlock, &(&of_views.covariance * (of_blocks - 1.0)));
    let mut of_lenses = DMatrix::zeros(inverse.nrows(), inverse.ncols());
    uncertain.add_to_shared(&mut of_lenses);
    if config.lens_errors {
        doubts.add_to_shared(&mut of_lenses);
    }
    budgets.add(ErrorSource::Lens, &of_lenses);
    let mut by_targets = DMatrix::zeros(inverse.nrows(), inverse.ncols());
    of_targets.add_to_shared(&mut by_targets);
    budgets.add(ErrorSource::Target, &by_targets);
    let mut by_times = DMatrix::zeros(inverse.nrows(), inverse.ncols());
    of_times.add_to_shared(&mut by_times);
    budgets.add(ErrorSource::TimeOffsets, &by_times);
    let (mut of_shared, within) = (held.covariance, held.within);
    uncertain.add_to_shared(&mut of_shared);
    of_shared += by_times;
    let unexplained = of_shared.clone();
    of_shared += by_targets;
    let mut with_lenses = of_shared.clone();
    doubts.add_to_shared(&mut with_lenses);
    let lens_sigma_m =
        (!doubts.is_empty()).then(|| largest_sigma_m(&cameras(layout, &adjusted, &tallies, &with_lenses)));
    let shared = if config.lens_errors { with_lenses } else { of_shared };
    let cameras = cameras(layout, &adjusted, &tallies, &shared);
    let shared_views = shared_views(layout.problem);
    let shown = Shown {
        layout,
        adjusted: &adjusted,
        eliminated: &eliminated,
        lenses: &lenses,
        scales: &scales,
        noise: measured,
        config,
    };
    let explanations = shown.explanations();
    let evidence = Evidence {
        layout,
        located_views,
        adjusted: &adjusted,
        lenses: &lenses,
        config,
        scales: &scales,
        chi2,
        degrees_of_freedom,
        noise_scale,
        measured_noise: measured,
        view_scale: of_views.within / widened,
        explanations: &explanations,
        unexplained: &unexplained,
    };
    let verdict = evidence.verdict();
    let mut solution = RigSolution {
        reference: layout.reference,
        weakest_link: weakest_link(layout, &cameras, &verdict.used_views, &shared),
        cameras,
        budgets: budgets.finish(),
        targets: targets(layout, &adjusted, &shared),
        bodies,
        observations: observations(layout, &adjusted),
        shared: shared_views,
        scales,
        rms_px: total.rms_px(),
        chi2,
        degrees_of_freedom,
        n_seen: layout.observations.iter().map(|s| s.seen.len()).sum(),
        n_used: total.n_used,
        joint_covariance: config.joint_covariance.then(|| joint(layout, &shared)),
        joint_targets: config.joint_covariance.then(|| joint_targets(layout, &adjusted, &shared)),
        noise_scale,
        view_scale: neighbours.of_poses * within / widened,
        lens_sigma_m,
        steps: adjusted.steps,
        explanations,
        verdict,
    };
    // A measured distance between cameras determines the scale, whatever the size of the targets.
    if 0.0 < config.scale_sigma && config.known_distances.is_empty() {
        solution.add_scale(config.scale_sigma);
    }
    let covariances = solution.cameras.iter().map(|camera| &camera.covariance);
    let is_finite = (solution.rms_px + solution.chi2 + solution.noise_scale).is_finite();
    if is_finite && covariances.into_iter().all(is_covariance) { Ok(solution) } else { Err(OVERFLOW) }
}

/// Returns the largest standard deviation of a camera's position along an axis of the rig.
fn largest_sigma_m(cameras: &[CameraInRig]) -> f64 {
    let of_camera = |c: &CameraInRig| {
        // A small left motion moves the centre by −Rᵀν.
        let (r, moved) = (&c.cam_from_rig.rotation, c.covariance.fixed_view::<3, 3>(3, 3));
        (r.transpose() * moved * r).diagonal().max()
    };
    cameras.iter().map(of_camera).fold(0.0, f64::max).sqrt()
}

impl Tally {
    fn rms_px(&self) -> f64 {
        (self.squared_px2 / self.n_used.max(1) as f64).sqrt()
    }
}

fn sum<'a>(tallies: impl Iterator<Item = &'a Tally>) -> Tally {
    tallies.fold(Tally::default(), |s, t| Tally {
        n_used: s.n_used + t.n_used,
        squared_px2: s.squared_px2 + t.squared_px2,
        chi2: s.chi2 + t.chi2,
    })
}

/// Returns one cluster for each view.
fn clusters(layout: &Layout, adjusted: &Adjusted, eliminated: &Eliminated) -> Vec<Cluster> {
    let views: Vec<usize> = layout.bodies.iter().map(|(view, _)| *view).collect();
    adjusted.equations.clusters(eliminated, &adjusted.places, &adjusted.graph, &views)
}

/// Returns one tally for each observation.
fn tallies(adjusted: &Adjusted) -> Vec<Tally> {
    let of_observation = |(r, used): (&super::classify::Residuals, &Vec<bool>)| {
        let points = r.points.iter().zip(used).filter(|(_, u)| **u).filter_map(|(p, _)| p.as_ref());
        points.fold(Tally::default(), |t, (e, squared)| Tally {
            n_used: t.n_used + 1,
            squared_px2: t.squared_px2 + e.norm_squared(),
            chi2: t.chi2 + squared,
        })
    };
    adjusted.residuals.iter().zip(&adjusted.parts.is_used).map(of_observation).collect()
}

fn degrees_of_freedom(layout: &Layout, adjusted: &Adjusted, total: &Tally, config: &RigConfig) -> usize {
    let n_bodies = adjusted.graph.is_active.iter().filter(|a| **a).count();
    let unknown = 6 * (layout.graph.n_blocks + n_bodies);
    (2 * total.n_used + config.known_distances.len()).saturating_sub(unknown)
}

/// What the points that took part show of the noise.
struct Noise {
    chi2: f64,
    /// The variance by which χ² proves the sigmas too small.
    scale: f64,
    /// The same, below 1 where it proves them too large.
    measured: f64,
}

/// Under a robust loss wrong points are expected: those past the gate are not counted.
fn noise(adjusted: &Adjusted, total: &Tally, degrees_of_freedom: usize, config: &RigConfig) -> Noise {
    let chi2 = total.chi2;
    if keeps_minimum(config.loss) {
        let whole = chi2 / truncation(config.loss);
        let (scale, measured) =
            (noise_scale(whole, degrees_of_freedom), measured_scale(whole, degrees_of_freedom));
        return Noise { chi2, scale, measured };
    }
    let gate_chi2 = super::GATE_SIGMAS * super::GATE_SIGMAS * adjusted.variance;
    let (good, n_wrong) = adjusted
        .residuals
        .iter()
        .flat_map(|r| r.points.iter().flatten())
        .fold((0.0, 0), |s, p| if p.1 <= gate_chi2 { (s.0 + p.1, s.1) } else { (s.0, s.1 + 1) });
    let scale = noise_scale(good, degrees_of_freedom.saturating_sub(2 * n_wrong));
    Noise { chi2, scale, measured: scale }
}

/// Returns the share of the good points' χ² below the gate, relative to their number: docs/math/rig.md eq. (13).
fn truncation(loss: Loss) -> f64 {
    let Loss::Truncated { sigmas } = loss else { return 1.0 };
    let half = 0.5 * sigmas * sigmas;
    let beyond = (-half).exp();
    (1.0 - beyond * (1.0 + half)) / (1.0 - beyond)
}

/// Returns the factor that a gate or a robust loss puts on the inverse information.
fn loss_widening(loss: Loss) -> f64 {
    match loss {
        Loss::Truncated { .. } => 1.0 / truncation(loss),
        _ => widening(loss),
    }
}

fn block(shared: &DMatrix<f64>, row: usize, column: usize) -> Matrix6 {
    shared.fixed_view::<6, 6>(6 * row, 6 * column).into()
}

/// Converts the covariance of a motion about a pivot to that of the left motion about the frame's origin: ν_left = ν + c × ω.
fn about_origin(covariance: &Matrix6, pivot_in_b: &Point) -> Matrix6 {
    let mut transport = Matrix6::identity();
    transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&pivot_in_b.cross_matrix());
    symmetric(&(transport * covariance * transport.transpose()))
}

fn cameras(
    layout: &Layout,
    adjusted: &Adjusted,
    tallies: &[Tally],
    shared: &DMatrix<f64>,
) -> Vec<CameraInRig> {
    let camera = |c: usize| {
        let own = || (0..tallies.len()).filter(move |i| layout.observations[*i].camera == c);
        let total = sum(own().map(|i| &tallies[i]));
        let mut views: Vec<usize> =
            own().filter(|i| 0 < tallies[*i].n_used).map(|i| layout.observations[i].view).collect();
        views.dedup();
        let covariance =
            layout.graph.block_of_camera[c].map_or(Matrix6::zeros(), |b| symmetric(&block(shared, b, b)));
        CameraInRig {
            cam_from_rig: adjusted.places.cam_from_rig[c],
            covariance,
            n_views: views.len(),
            n_seen: own().map(|i| layout.observations[i].seen.len()).sum(),
            n_used: total.n_used,
            rms_px: total.rms_px(),
        }
    };
    (0..layout.problem.cameras.len()).map(camera).collect()
}

fn targets(layout: &Layout, adjusted: &Adjusted, shared: &DMatrix<f64>) -> Vec<TargetOnBody> {
    let target = |t: usize| {
        let place = &adjusted.places.body_from_target[t];
        let Some(b) = layout.graph.block_of_target[t] else {
            return TargetOnBody { body_from_target: Pose::identity(), covariance: Matrix6::zeros() };
        };
        let covariance = about_origin(&block(shared, b, b), &place.pivot_in_cam);
        TargetOnBody { body_from_target: place.pose(&layout.pivot_in_target[t]), covariance }
    };
    (0..layout.first_target.len()).map(target).collect()
}

fn bodies(
    layout: &Layout,
    adjusted: &Adjusted,
    tallies: &[Tally],
    covariances: &[Matrix6],
) -> Vec<BodyInView> {
    let mut bodies = Vec::with_capacity(layout.bodies.len());
    for (i, range) in layout.ranges().into_iter().enumerate() {
        if !adjusted.graph.is_active[i] {
            continue;
        }
        let (view, body) = layout.bodies[i];
        let total = sum(tallies[range].iter());
        let place: &PivotedPose = &adjusted.places.rig_from_body[i];
        bodies.push(BodyInView {
            view,
            body,
            rig_from_body: place.pose(&layout.graph.pivot_in_body[i]),
            covariance: about_origin(&covariances[i], &place.pivot_in_cam),
            n_used: total.n_used,
            rms_px: total.rms_px(),
        });
    }
    bodies
}

/// Returns the results in the order given; observations without points have an empty one.
fn observations(layout: &Layout, adjusted: &Adjusted) -> Vec<ObservationResult> {
    let empty = ObservationResult { residuals_px: Vec::new(), rejected: None };
    let mut results = vec![empty; layout.problem.observations.len()];
    for (i, r) in adjusted.residuals.iter().enumerate() {
        let used = &adjusted.parts.is_used[i];
        let residuals_px = r.points.iter().zip(used).map(|(p, u)| p.as_ref().map(|p| (p.0, *u))).collect();
        let rejected = adjusted.parts.rejected[i].clone();
        results[layout.given_at[i]] = ObservationResult { residuals_px, rejected };
    }
    results
}

fn joint(layout: &Layout, shared: &DMatrix<f64>) -> DMatrix<f64> {
    let n = layout.problem.cameras.len();
    let mut joint = DMatrix::zeros(6 * n, 6 * n);
    for a in 0..n {
        for b in 0..n {
            if let (Some(i), Some(j)) = (layout.graph.block_of_camera[a], layout.graph.block_of_camera[b]) {
                let both = (block(shared, i, j) + block(shared, j, i).transpose()) * 0.5;
                joint.fixed_view_mut::<6, 6>(6 * a, 6 * b).copy_from(&both);
            }
        }
    }
    joint
}

/// Returns the covariance of the left motions of all targets about their bodies' origins.
fn joint_targets(layout: &Layout, adjusted: &Adjusted, shared: &DMatrix<f64>) -> DMatrix<f64> {
    let n = layout.first_target.len();
    let mut joint = DMatrix::zeros(6 * n, 6 * n);
    let about_origin = |t: usize| {
        let mut transport = Matrix6::identity();
        let pivot = adjusted.places.body_from_target[t].pivot_in_cam;
        transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&pivot.cross_matrix());
        Some((layout.graph.block_of_target[t]?, transport))
    };
    let blocks: Vec<Option<(usize, Matrix6)>> = (0..n).map(about_origin).collect();
    for (a, of_a) in blocks.iter().enumerate() {
        for (b, of_b) in blocks.iter().enumerate() {
            let (Some((i, by_a)), Some((j, by_b))) = (of_a, of_b) else { continue };
            let both = (block(shared, *i, *j) + block(shared, *j, *i).transpose()) * 0.5;
            joint.fixed_view_mut::<6, 6>(6 * a, 6 * b).copy_from(&(by_a * both * by_b.transpose()));
        }
    }
    joint
}

/// Returns cam_b_from_cam_a and the covariance of its small left motion, from the covariance of all cameras together (6 rows for each camera).
pub(super) fn relative(cameras: &[CameraInRig], joint: &DMatrix<f64>, a: usize, b: usize) -> (Pose, Matrix6) {
    let cam_b_from_cam_a = cameras[b].cam_from_rig * cameras[a].cam_from_rig.inverse();
    let ad = cam_b_from_cam_a.adjoint();
    let cross = block(joint, b, a) * ad.transpose();
    let covariance =
        block(joint, b, b) - cross - cross.transpose() + ad * block(joint, a, a) * ad.transpose();
    (cam_b_from_cam_a, symmetric(&covariance))
}

/// Returns the weakest link: cameras are joined by their best known relative poses first, and the last join needed is the weakest.
fn weakest_link(
    layout: &Layout,
    cameras: &[CameraInRig],
    used_views: &[Vec<usize>],
    shared: &DMatrix<f64>,
) -> Option<WeakestLink> {
    let n = cameras.len();
    let joint = joint(layout, shared);
    let mut links: Vec<(f64, WeakestLink)> = Vec::new();
    for a in 0..n {
        for b in a + 1..n {
            if 0 < used_views[a][b] {
                links.push(link(cameras, &joint, a, b, used_views[a][b]));
            }
        }
    }
    links.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut groups = Groups::new(n);
    let mut weakest = None;
    for (_, link) in links {
        let (a, b) = (groups.root(link.camera), groups.root(link.with));
        if a != b {
            let size = |root: usize, groups: &mut Groups| (0..n).filter(|c| groups.root(*c) == root).count();
            // The link is attributed to the smaller side; of equal ones to that without the reference.
            let key = |root: usize, groups: &mut Groups| {
                (size(root, groups), groups.root(layout.reference) == root)
            };
            let first_hangs = key(a, &mut groups) < key(b, &mut groups);
            let (camera, with) =
                if first_hangs { (link.camera, link.with) } else { (link.with, link.camera) };
            weakest = Some(WeakestLink { camera, with, ..link });
            groups.join(a, b);
        }
    }
    weakest
}

/// Returns the link of two cameras, ranked by the uncertainty of a point at the distance of the two (or 1 m).
fn link(
    cameras: &[CameraInRig],
    joint: &DMatrix<f64>,
    a: usize,
    b: usize,
    n_shared_views: usize,
) -> (f64, WeakestLink) {
    let (cam_b_from_cam_a, covariance) = relative(cameras, joint, a, b);
    let largest = |at: usize| {
        let part: Matrix3<f64> = covariance.fixed_view::<3, 3>(at, at).into();
        part.symmetric_eigenvalues().max().max(0.0).sqrt()
    };
    let (sigma_rad, sigma_m) = (largest(0), largest(3));
    let reach_m = cam_b_from_cam_a.translation.norm();
    let rank = sigma_m.hypot(sigma_rad * reach_m);
    (rank, WeakestLink { camera: b, with: a, n_shared_views, sigma_rad, sigma_m })
}

impl RigSolution {
    /// Returns cam_b_from_cam_a, the pose of camera b relative to camera a, with the covariance of its small left motion (frame of camera b);
    /// none without the joint covariance.
    pub fn cam_b_from_cam_a(&self, b: usize, a: usize) -> Option<(Pose, Matrix6)> {
        let n = self.cameras.len();
        let joint = self.joint_covariance.as_ref().filter(|_| a < n && b < n)?;
        Some(relative(&self.cameras, joint, a, b))
    }

    /// Returns the root mean square of all residuals of an observation that can be projected, used or not, px.
    pub fn observation_rms_px(&self, observation: usize) -> Option<f64> {
        let points = self.observations.get(observation)?.residuals_px.iter();
        let points = points.map(|p| p.map(|p| (p.0, 0.0))).collect();
        Some(rms_px(&super::classify::Residuals { points }))
    }
}
