//! The initial poses: from the reference camera outwards, each camera and target gets the pose on which the most views agree.
//!
//! With rig_from_body known in a view through a placed camera and target, an observation of a placed target by a new camera gives cam_from_rig,
//! the paper's (13), (14) chained (docs/math/rig.md eq. (9)), and an observation of a new target by a placed camera gives body_from_target. The
//! camera or target that the views determine best is placed next, so that a tree grows along its best links.

use super::layout::Layout;
use super::sighted::{Hypothesis, LocatedViews};
use super::views::Groups;
use super::votes::{Vote, agreed};
use crate::least_squares::PivotedPose;
use crate::least_squares::rig::RigPoses;
use crate::locate::loss::Loss;
use crate::locate::refine::whitened_residual;
use crate::{Error, Matrix6, Pose};

/// Poses found so far; those of a body's targets are in the frame of the target found first.
struct Grown {
    cam_from_rig: Vec<Option<Pose>>,
    anchor_from_target: Vec<Option<Pose>>,
    /// Best observation of each body in a view whose camera and target are both placed.
    known: Vec<Option<usize>>,
}

/// A camera or target that has no pose yet.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Node {
    Camera(usize),
    Target(usize),
}

/// # Errors
/// `CameraNotObserved`, `CamerasUnconnected`, `TargetUnconnected`.
pub(super) fn start(layout: &Layout, located_views: &LocatedViews) -> Result<RigPoses, Error> {
    check_connected(layout, located_views)?;
    let mut grown = Grown::new(layout);
    loop {
        grown.look_again(layout, located_views);
        let Some(node) = grown.best_node(layout, located_views) else { break };
        let pose = agreed(&grown.votes(node, layout, located_views));
        match (node, pose) {
            (Node::Camera(c), Some(pose)) => grown.cam_from_rig[c] = Some(pose),
            (Node::Target(t), Some(pose)) => grown.anchor_from_target[t] = Some(pose),
            (_, None) => break,
        }
    }
    grown.check_complete(layout, located_views)?;
    Ok(grown.places(layout, located_views))
}

/// Checks that every camera has an observation with a pose, and that chains of bodies in views join all cameras.
fn check_connected(layout: &Layout, located_views: &LocatedViews) -> Result<(), Error> {
    let n = layout.problem.cameras.len();
    for camera in 0..n {
        let own = || (0..located_views.len()).filter(|i| layout.observations[*i].camera == camera);
        if !own().any(|i| located_views[i].is_ok()) {
            return Err(Error::CameraNotObserved { camera, n_observations: own().count() });
        }
    }
    check_joined(layout, |i| located_views[i].is_ok())
}

/// Checks whether the observations that take part join all cameras.
///
/// # Errors
/// `CamerasUnconnected`, with the reference's group first.
pub(super) fn check_joined(layout: &Layout, takes_part: impl Fn(usize) -> bool) -> Result<(), Error> {
    let n = layout.problem.cameras.len();
    let mut groups = Groups::new(n);
    let mut n_rejected = 0;
    for range in layout.ranges() {
        let parts: Vec<usize> = range.clone().filter(|i| takes_part(*i)).collect();
        n_rejected += range.len() - parts.len();
        parts
            .windows(2)
            .for_each(|w| groups.join(layout.observations[w[0]].camera, layout.observations[w[1]].camera));
    }
    let root = groups.root(layout.reference);
    let (first, second): (Vec<usize>, Vec<usize>) = (0..n).partition(|c| groups.root(*c) == root);
    if second.is_empty() {
        return Ok(());
    }
    Err(Error::CamerasUnconnected { first, second, n_rejected, needed: SHARED_VIEW })
}

const SHARED_VIEW: &str = "add a view in which a camera of each group sees the same body at the same time";
const SHARED_TARGETS: &str = "they see different targets of a body; add a view in which one camera sees two of these targets at the same time";

impl Grown {
    fn new(layout: &Layout) -> Self {
        let mut cam_from_rig = vec![None; layout.problem.cameras.len()];
        cam_from_rig[layout.reference] = Some(Pose::identity());
        let anchor_from_target = vec![None; layout.first_target.len()];
        Grown { cam_from_rig, anchor_from_target, known: vec![None; layout.bodies.len()] }
    }

    /// Gives every body observed by a placed camera a frame, and every body in a view its best placed observation.
    fn look_again(&mut self, layout: &Layout, located_views: &LocatedViews) {
        let mut counts = vec![0usize; self.anchor_from_target.len()];
        for (i, s) in layout.observations.iter().enumerate() {
            counts[s.target] +=
                usize::from(self.cam_from_rig[s.camera].is_some() && located_views[i].is_ok());
        }
        for first in 0..counts.len() {
            let own: Vec<usize> =
                (first..counts.len()).filter(|t| layout.first_target[*t] == first).collect();
            if own.iter().all(|t| self.anchor_from_target[*t].is_none()) {
                // The target with the most observations; of equal ones the lowest.
                let most = own
                    .iter()
                    .copied()
                    .filter(|t| 0 < counts[*t])
                    .min_by_key(|t| (usize::MAX - counts[*t], *t));
                most.into_iter().for_each(|t| self.anchor_from_target[t] = Some(Pose::identity()));
            }
        }
        for (i, s) in layout.observations.iter().enumerate() {
            let body = layout.graph.links[i].body;
            let placed = self.cam_from_rig[s.camera].is_some() && self.anchor_from_target[s.target].is_some();
            let (true, Some(h)) = (placed, first(located_views, i)) else { continue };
            let best = self.known[body].and_then(|k| first(located_views, k));
            if best.is_none_or(|b| h.size < b.size) {
                self.known[body] = Some(i);
            }
        }
    }

    /// Returns the camera or target that the views determine best.
    fn best_node(&self, layout: &Layout, located_views: &LocatedViews) -> Option<Node> {
        let mut of_camera = vec![0.0; self.cam_from_rig.len()];
        let mut of_target = vec![0.0; self.anchor_from_target.len()];
        for (i, s) in layout.observations.iter().enumerate() {
            let Some(known) = self.known[layout.graph.links[i].body].and_then(|k| first(located_views, k))
            else {
                continue;
            };
            let Some(own) = first(located_views, i) else { continue };
            // Σ₁ + Σ₂|^(1/6) is approximately the sum of both sizes; its inverse measures the information of a link.
            let gain = 1.0 / (known.size + own.size);
            match (self.cam_from_rig[s.camera], self.anchor_from_target[s.target]) {
                (None, Some(_)) => of_camera[s.camera] += gain,
                (Some(_), None) => of_target[s.target] += gain,
                _ => {}
            }
        }
        let cameras = of_camera.into_iter().enumerate().map(|(c, gain)| (gain, Node::Camera(c)));
        let targets = of_target.into_iter().enumerate().map(|(t, gain)| (gain, Node::Target(t)));
        let best = cameras
            .chain(targets)
            .fold((0.0, None), |best, (gain, node)| if best.0 < gain { (gain, Some(node)) } else { best });
        best.1
    }

    /// Returns the pose of a new camera or target by each view.
    fn votes(&self, node: Node, layout: &Layout, located_views: &LocatedViews) -> Vec<Vote> {
        let is_of_node = |i: usize| match node {
            Node::Camera(c) => c == layout.observations[i].camera,
            Node::Target(t) => t == layout.observations[i].target,
        };
        let mut votes = Vec::new();
        for i in (0..layout.observations.len()).filter(|i| is_of_node(*i)) {
            let group = layout.graph.links[i].body;
            let Some(k) = self.known[group].filter(|k| *k != i) else { continue };
            let (Ok(known), Ok(own)) = (&located_views[k], &located_views[i]) else { continue };
            let pairs = known.iter().flat_map(|known| own.iter().map(move |own| (known, own)));
            votes.extend(pairs.filter_map(|(known, own)| self.vote(group, [k, i], [known, own], layout)));
        }
        votes
    }

    /// Returns the vote of a known observation and one of a new camera or target, each with one of its poses.
    fn vote(
        &self,
        group: usize,
        [k, i]: [usize; 2],
        [known, own]: [&Hypothesis; 2],
        layout: &Layout,
    ) -> Option<Vote> {
        let (placed, new) = (layout.observations[k], layout.observations[i]);
        let placed_cam_from_rig = self.cam_from_rig[placed.camera]?;
        let anchor_from_placed_cam =
            self.anchor_from_target[placed.target]? * known.cam_from_target.inverse();
        let (b_from_a, b_from_own, b_from_known) =
            match (self.cam_from_rig[new.camera], self.anchor_from_target[new.target]) {
                (None, Some(anchor_from_target)) => {
                    let cam_from_anchor = own.cam_from_target * anchor_from_target.inverse();
                    let cam_from_placed_cam = cam_from_anchor * anchor_from_placed_cam;
                    (cam_from_placed_cam * placed_cam_from_rig, Pose::identity(), cam_from_placed_cam)
                }
                (Some(cam_from_rig), None) => {
                    let anchor_from_cam =
                        anchor_from_placed_cam * placed_cam_from_rig * cam_from_rig.inverse();
                    (anchor_from_cam * own.cam_from_target, anchor_from_cam, anchor_from_placed_cam)
                }
                _ => return None,
            };
        let of_own = b_from_own.product_covariance(&Matrix6::zeros(), &own.covariance);
        let covariance = b_from_known.product_covariance(&of_own, &known.covariance);
        Some(Vote { group, b_from_a, covariance, probability: known.probability * own.probability })
    }

    fn check_complete(&self, layout: &Layout, located_views: &LocatedViews) -> Result<(), Error> {
        let n = self.cam_from_rig.len();
        let (first, second): (Vec<usize>, Vec<usize>) = (0..n).partition(|c| self.cam_from_rig[*c].is_some());
        if !second.is_empty() {
            let n_rejected = located_views.iter().filter(|s| s.is_err()).count();
            return Err(Error::CamerasUnconnected { first, second, n_rejected, needed: SHARED_TARGETS });
        }
        let is_several =
            |t: usize| layout.first_target.iter().filter(|f| **f == layout.first_target[t]).count() > 1;
        let is_seen = |t: usize| layout.observations.iter().any(|s| s.target == t);
        for target in 0..self.anchor_from_target.len() {
            if self.anchor_from_target[target].is_none() && is_several(target) && is_seen(target) {
                return Err(Error::TargetUnconnected { target, body: layout.problem.body_of_target[target] });
            }
        }
        Ok(())
    }

    /// Returns all poses, bodies in the frame of their first target; in each view a body has the pose that fits all its observations best.
    fn places(&self, layout: &Layout, located_views: &LocatedViews) -> RigPoses {
        let cam_from_rig: Vec<Pose> =
            self.cam_from_rig.iter().map(|p| p.unwrap_or_else(Pose::identity)).collect();
        let anchor = |t: usize| self.anchor_from_target[t].unwrap_or_else(Pose::identity);
        let body_from_target: Vec<Pose> = (0..layout.first_target.len())
            .map(|t| match layout.first_target[t] {
                first if first == t => Pose::identity(),
                first => anchor(first).inverse() * anchor(t),
            })
            .collect();
        let graph = &layout.graph;
        let rig_from_body = layout.ranges().into_iter().enumerate().map(|(body, range)| {
            let found = best_of_body(range, layout, located_views, &cam_from_rig, &body_from_target, None);
            PivotedPose::new(&found.unwrap_or_else(Pose::identity), &graph.pivot_in_body[body])
        });
        let rig_from_body = rig_from_body.collect();
        let pivots = layout.pivot_in_target.iter();
        let body_from_target =
            body_from_target.iter().zip(pivots).map(|(p, x)| PivotedPose::new(p, x)).collect();
        RigPoses { cam_from_rig, body_from_target, rig_from_body }
    }
}

/// Returns the most probable pose of an observation.
fn first(located_views: &LocatedViews, i: usize) -> Option<&Hypothesis> {
    located_views[i].as_ref().ok()?.first()
}

/// Number of points of each observation by which the poses of a body are compared.
const COMPARED_POINTS: usize = 8;
/// Loss of the comparison: wide, because the initial poses are rough.
const COMPARED_LOSS: Loss = Loss::Cauchy { sigmas: 5.0 };

/// Returns the pose of a body in a view that fits all its observations best, among those that the observations suggest and its present one.
pub(super) fn best_of_body(
    range: core::ops::Range<usize>,
    layout: &Layout,
    located_views: &LocatedViews,
    cam_from_rig: &[Pose],
    body_from_target: &[Pose],
    present: Option<Pose>,
) -> Option<Pose> {
    let suggested = range.clone().flat_map(|i| {
        let s = layout.observations[i];
        let rig_from_cam = cam_from_rig[s.camera].inverse();
        let target_from_body = body_from_target[s.target].inverse();
        let poses = located_views[i].as_deref().unwrap_or_default();
        poses.iter().map(move |h| rig_from_cam * h.cam_from_target * target_from_body)
    });
    let suggested: Vec<Pose> = present.into_iter().chain(suggested).collect();
    if suggested.len() < 2 {
        return suggested.first().copied();
    }
    let cost = |rig_from_body: &Pose| -> f64 {
        let of_observation = |i: usize| -> f64 {
            let s = layout.observations[i];
            let cam_from_target = cam_from_rig[s.camera] * *rig_from_body * body_from_target[s.target];
            let stride = s.seen.len().div_ceil(COMPARED_POINTS);
            let points = s.seen.iter().step_by(stride);
            let squared =
                |c| whitened_residual(&cam_from_target, c, layout.camera(i)).map_or(UNOBSERVED_CHI2, |r| r.2);
            points.map(|c| COMPARED_LOSS.at(squared(c).min(UNOBSERVED_CHI2)).0).sum()
        };
        range.clone().map(of_observation).sum()
    };
    let best = suggested.iter().map(|p| (cost(p), p)).fold((f64::INFINITY, None), |best, next| {
        if next.0 < best.0 { (next.0, Some(next.1)) } else { best }
    });
    best.1.copied()
}

/// Number of observations by which the poses of a target are suggested, and by which they are compared.
const COMPARED_OBSERVATIONS: usize = 16;

/// Returns the pose of a target on its body that fits its observations best, among those that they suggest and its present one. The observations
/// come with the poses cam_from_body.
pub(super) fn best_of_target(
    cam_from_body: &[(usize, Pose)],
    layout: &Layout,
    located_views: &LocatedViews,
    present: Pose,
) -> Pose {
    let stride = cam_from_body.len().div_ceil(COMPARED_OBSERVATIONS).max(1);
    let compared: Vec<&(usize, Pose)> = cam_from_body.iter().step_by(stride).collect();
    let cost = |body_from_target: &Pose| -> f64 {
        let of_observation = |(i, cam_from_body): &&(usize, Pose)| -> f64 {
            let seen = &layout.observations[*i].seen;
            let cam_from_target = *cam_from_body * *body_from_target;
            let squared = |c| {
                whitened_residual(&cam_from_target, c, layout.camera(*i)).map_or(UNOBSERVED_CHI2, |r| r.2)
            };
            let points = seen.iter().step_by(seen.len().div_ceil(COMPARED_POINTS));
            points.map(|c| COMPARED_LOSS.at(squared(c).min(UNOBSERVED_CHI2)).0).sum()
        };
        compared.iter().map(of_observation).sum()
    };
    let suggested = compared.iter().flat_map(|(i, cam_from_body)| {
        let poses = located_views[*i].as_deref().unwrap_or_default();
        poses.iter().map(|h| cam_from_body.inverse() * h.cam_from_target)
    });
    // Another pose has to be clearly better, or noise would turn targets for ever.
    let first = (CLEARLY * cost(&present), present);
    suggested.map(|p| (cost(&p), p)).fold(first, |best, next| if next.0 < best.0 { next } else { best }).1
}

/// Another pose of a target is taken where it costs less than this share.
const CLEARLY: f64 = 0.8;

/// Checks whether the observations that take part join every target to the first one of its body.
///
/// # Errors
/// `TargetUnconnected`.
pub(super) fn check_targets_joined(layout: &Layout, takes_part: impl Fn(usize) -> bool) -> Result<(), Error> {
    let n_targets = layout.first_target.len();
    // A body in a view joins the targets seen on it.
    let mut groups = Groups::new(n_targets + layout.bodies.len());
    for (_, link) in layout.graph.links.iter().enumerate().filter(|(i, _)| takes_part(*i)) {
        groups.join(link.target, n_targets + link.body);
    }
    for target in (0..n_targets).filter(|t| layout.graph.block_of_target[*t].is_some()) {
        let first = layout.first_target[target];
        if groups.root(target) != groups.root(first) {
            return Err(Error::TargetUnconnected { target, body: layout.problem.body_of_target[target] });
        }
    }
    Ok(())
}

/// Squared residual assigned to a point that cannot be projected: ten thousand standard deviations off.
pub(super) const UNOBSERVED_CHI2: f64 = 1e8;
