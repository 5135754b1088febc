//! The poses of targets at rest, such as the tags of a building, from one camera that was carried past them.
//!
//! ```text
//! observations → places → one adjustment (a rig of one camera and one body) → revise: places of one target that agree become one,
//! observations that contradict theirs a place of their own, sizes that do not fit are measured → a second pose? → world
//! ```
//! Derivation: docs/math/map.md.

mod places;
mod size;
mod revise;
mod second;
mod merge;
mod world;

use super::rig::{
    Observation, RejectedObservation, RigConfig, RigProblem, RigSolution, RigVerdict, TargetScale, solve_rig,
};
use crate::{Camera, Correspondence, Error, Matrix6, Pose};
use nalgebra::DMatrix;
use places::Place;

/// The observation of one target in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct MapObservation {
    /// The view; views are numbered in the order in which they were taken.
    pub view: usize,
    /// The target. A target that a view shows more than once is there more than once.
    pub target: usize,
    /// Known points of that target with their pixels.
    pub seen: Vec<Correspondence>,
}

/// What a camera saw on its way.
#[derive(Debug, Clone, Copy)]
pub struct MapProblem<'a> {
    /// Intrinsics, held fixed.
    pub camera: &'a Camera,
    /// Number of views.
    pub n_views: usize,
    /// Number of targets, seen or not.
    pub n_targets: usize,
    /// The observations, in any order; the answer does not depend on the order.
    pub observations: &'a [MapObservation],
}

/// A target whose pose in the world is known before: from a survey or an earlier map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownTarget {
    /// The target, an index below `MapProblem::n_targets`; it may be unseen.
    pub target: usize,
    /// x_in_world = world_from_target · x_in_target.
    pub world_from_target: Pose,
}

/// Settings of [`solve_map`].
#[derive(Debug, Clone, Default)]
pub struct MapConfig<'a> {
    /// The target whose frame is the world where nothing is known before; by default the first that is connected to most others.
    pub reference: Option<usize>,
    /// Targets with known poses, each once. They determine the world.
    pub known: &'a [KnownTarget],
    /// Covariance of their small left motions `[rotation_rad; translation_m]` together, world frame, 6 rows for each of `known`.
    pub known_covariance: Option<&'a DMatrix<f64>>,
    /// Covariance of the camera's intrinsics in the order of `Camera::parameters`; none where they are exact.
    pub intrinsics: Option<&'a DMatrix<f64>>,
    /// Relative standard deviation of the size of all targets together, as of a printed scale.
    pub scale_sigma: f64,
}

/// Why a target has no pose, or its pose is not to be used.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TargetFault {
    /// No view shows it.
    NotSeen,
    /// Views show it, and never another target with it.
    Alone {
        /// Number of views.
        n_views: usize,
    },
    /// No chain of views joins it to the map; it is in the group of `MapSolution::groups` with this index.
    NotConnected {
        /// Index of the group.
        group: usize,
    },
    /// Another pose explains its pixels as well.
    Ambiguous {
        /// The other pose.
        world_from_target: Pose,
        /// Residual sum of squares of the other pose over this one's.
        ratio: f64,
    },
    /// It stands at another place in some views: it was moved, or there are two with one label.
    Elsewhere {
        /// The other pose.
        world_from_target: Pose,
        /// Distance between the two places, m.
        distance_m: f64,
        /// Rotation between the two poses, rad.
        rotation_rad: f64,
        /// First and last view of the pose in the map.
        views: [usize; 2],
        /// First and last view of the other pose.
        other_views: [usize; 2],
        /// Whether the two were seen in one view or in turns, so that it cannot be one target that was moved once.
        are_two: bool,
    },
    /// Its size is another than the stated one; the map was solved with the measured one.
    Size {
        /// True size over stated size.
        ratio: f64,
        /// Its standard deviation.
        sigma: f64,
    },
    /// Too many of its observations contradict the map and agree on no other place.
    Contradicts {
        /// Observations left out.
        n_lost: usize,
        /// All of them.
        n_observations: usize,
    },
    /// It is not where it was known to be, and took no part in placing the world.
    Displaced {
        /// How far it is from there, m.
        distance_m: f64,
        /// By how much it is rotated from there, rad.
        rotation_rad: f64,
    },
}

/// A target of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetInMap {
    /// x_in_world = world_from_target · x_in_target; none where it could not be placed.
    pub world_from_target: Option<Pose>,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, world frame; zero without a pose, and for the reference.
    pub covariance: Matrix6,
    /// Number of views in which it took part.
    pub n_used: usize,
    /// Number of its observations that contradict the map.
    pub n_rejected: usize,
    /// Root mean square reprojection error over the points used, px; zero where it was known before and not seen.
    pub rms_px: f64,
    /// The test of its stated size against all others.
    pub scale: Option<TargetScale>,
    /// What is wrong with it; empty where nothing is.
    pub faults: Vec<TargetFault>,
}

/// What determines the world.
#[derive(Debug, Clone, PartialEq)]
pub enum Gauge {
    /// The frame of this target.
    Reference {
        /// The target.
        target: usize,
    },
    /// Targets known before.
    Known {
        /// Those that took part.
        targets: Vec<usize>,
        /// Sum of their squared normalised displacements.
        chi2: f64,
        /// Of that sum.
        degrees_of_freedom: usize,
        /// Lengths in the world over lengths in the map, with the standard deviation; none with fewer than two known targets.
        scale: Option<[f64; 2]>,
    },
}

/// The map: poses with covariances, and the verdict of the adjustment.
#[derive(Debug, Clone, PartialEq)]
pub struct MapSolution {
    /// One entry for each target, in the order given.
    pub targets: Vec<TargetInMap>,
    /// What determines the world.
    pub gauge: Gauge,
    /// The targets with a pose, ascending.
    pub placed: Vec<usize>,
    /// Covariance of their left motions together, world frame, 6 rows for each of `placed`.
    pub joint_covariance: DMatrix<f64>,
    /// Groups of targets, joined by chains of views, that no view joins to the map, the largest first.
    pub groups: Vec<Vec<usize>>,
    /// Targets that alone join two parts of the map: if there are two with such a label, the parts are misplaced, and nothing shows it.
    pub bridges: Vec<usize>,
    /// Root mean square reprojection error over the points used, px.
    pub rms_px: f64,
    /// Sum of squared residuals of the points used over their variances.
    pub chi2: f64,
    /// Number of residuals used less number of unknowns.
    pub degrees_of_freedom: usize,
    /// Factor by which every covariance was widened because the residuals are larger than the stated sigmas.
    pub noise_scale: f64,
    /// Factor beyond it, because views contradict each other.
    pub view_scale: f64,
    /// Number of views that took part.
    pub n_views: usize,
    /// Number of points observed in these.
    pub n_seen: usize,
    /// Number of points that took part.
    pub n_used: usize,
    /// Views that lose too many of their observations, such as images of another place.
    pub contradicting_views: Vec<usize>,
    /// The verdict of the adjustment; no pose may be used where it is inconsistent.
    pub verdict: RigVerdict,
}

/// Solves for the pose of every target, with covariances, faults and a verdict.
///
/// # Errors
/// `NoSuchIndex`, `InvalidSetting` and `InvalidObservation` for bad input; `EmptyMap` where no view shows two targets; those of the adjustment.
pub fn solve_map(problem: &MapProblem, config: &MapConfig) -> Result<MapSolution, Error> {
    check(problem, config)?;
    let connected = places::connected(problem, config);
    if connected.places.is_empty() {
        return Err(Error::EmptyMap { n_views: problem.n_views, n_observations: problem.observations.len() });
    }
    let adjusted = revise::revised(problem, config, &connected)?;
    let ambiguous = second::poses(problem, &adjusted);
    world::placed(problem, config, connected, adjusted, ambiguous)
}

fn check(problem: &MapProblem, config: &MapConfig) -> Result<(), Error> {
    for (observation, s) in problem.observations.iter().enumerate() {
        for (what, seen, n) in [("view", s.view, problem.n_views), ("target", s.target, problem.n_targets)] {
            if n <= seen {
                return Err(Error::NoSuchIndex { observation, what, seen, n });
            }
        }
    }
    let refused =
        |setting, seen: usize, needed| Err(Error::InvalidSetting { setting, seen: seen as f64, needed });
    if let Some(reference) = config.reference.filter(|r| problem.n_targets <= *r) {
        return refused("reference", reference, "it must be the index of a target, counted from 0");
    }
    let mut targets: Vec<usize> = config.known.iter().map(|k| k.target).collect();
    targets.sort_unstable();
    if let Some(last) = targets.last().filter(|t| problem.n_targets <= **t) {
        return refused("known", *last, "it must be the index of a target, counted from 0");
    }
    if let Some(pair) = targets.windows(2).find(|pair| pair[0] == pair[1]) {
        return refused("known", pair[0], "each target can be known once");
    }
    let n = 6 * config.known.len();
    match config.known_covariance {
        Some(c) if c.shape() != (n, n) => {
            refused("known_covariance", c.nrows(), "six rows and columns for each known target")
        }
        Some(c) if !crate::covariance::is_covariance(c) => {
            refused("known_covariance", c.nrows(), "it must be a covariance")
        }
        _ => Ok(()),
    }
}

/// An adjustment of some places.
#[derive(Debug, Clone)]
struct Adjusted {
    places: Vec<Place>,
    /// For each target: the size with which it was solved over the stated one.
    sizes: Vec<f64>,
    rig: RigSolution,
    /// For each observation of the rig: its place, and its index in the problem.
    taken: Vec<(usize, usize)>,
}

/// Solves for the places; those that no observation with a pose joins to the others are dropped.
fn adjust(
    problem: &MapProblem,
    config: &MapConfig,
    mut places: Vec<Place>,
    sizes: Vec<f64>,
) -> Result<Adjusted, Error> {
    let cameras = std::slice::from_ref(problem.camera);
    let intrinsics = [config.intrinsics.cloned()];
    let config = RigConfig {
        joint_covariance: true,
        lens_errors: true,
        intrinsics: &intrinsics,
        scale_sigma: config.scale_sigma,
        ..RigConfig::default()
    };
    loop {
        let (observations, taken) = observations(problem, &places, &sizes);
        let bodies = vec![0; places.len()];
        let rig = RigProblem {
            cameras,
            body_of_target: &bodies,
            n_views: problem.n_views,
            observations: &observations,
        };
        match solve_rig(&rig, &config) {
            Ok(rig) => return Ok(Adjusted { places, sizes, rig, taken }),
            Err(Error::TargetUnconnected { target, .. }) if 2 < places.len() && target < places.len() => {
                places.remove(target);
            }
            Err(Error::InvalidObservation { view, target, reason, .. }) => {
                let target = places.get(target).map_or(target, |place| place.target);
                return Err(Error::InvalidObservation { camera: 0, view, target, reason });
            }
            Err(reason) => return Err(reason),
        }
    }
}

/// Returns the observations of the places, as those of one camera's targets.
fn observations(
    problem: &MapProblem,
    places: &[Place],
    sizes: &[f64],
) -> (Vec<Observation>, Vec<(usize, usize)>) {
    let (mut observations, mut taken) = (Vec::new(), Vec::new());
    for (target, place) in places.iter().enumerate() {
        for index in &place.observations {
            let MapObservation { view, seen, .. } = &problem.observations[*index];
            let seen = resized(seen, sizes[place.target]);
            observations.push(Observation { camera: 0, view: *view, target, seen });
            taken.push((target, *index));
        }
    }
    (observations, taken)
}

/// Returns the points of a target of another size.
fn resized(seen: &[Correspondence], size: f64) -> Vec<Correspondence> {
    seen.iter().map(|c| Correspondence { x_in_target: c.x_in_target * size, ..*c }).collect()
}

impl Adjusted {
    /// Returns the camera's pose relative to the map, by view; none where the view took no part.
    fn cam_from_map(&self, n_views: usize) -> Vec<Option<Pose>> {
        let mut poses = vec![None; n_views];
        self.rig.bodies.iter().for_each(|body| poses[body.view] = Some(body.rig_from_body));
        poses
    }

    /// Returns the observations of a place that took part, or those that contradict it; indices of the problem.
    fn of_place(&self, place: usize, is_used: bool) -> Vec<usize> {
        let own = self.taken.iter().zip(&self.rig.observations).filter(|((p, _), _)| *p == place);
        let kind = |rejected: &Option<RejectedObservation>| match rejected {
            None => is_used,
            Some(RejectedObservation::Contradicts { .. }) => !is_used,
            Some(_) => false,
        };
        own.filter(|(_, result)| kind(&result.rejected)).map(|((_, index), _)| *index).collect()
    }

    /// Returns the points of a view that took part, in the map's frame, but for those of one place.
    fn seen_in(&self, problem: &MapProblem, view: usize, but: Option<usize>) -> Vec<Correspondence> {
        let mut seen = Vec::new();
        for ((place, i), result) in self.taken.iter().zip(&self.rig.observations) {
            let observation = &problem.observations[*i];
            if observation.view != view || result.rejected.is_some() || Some(*place) == but {
                continue;
            }
            let map_from_target = self.rig.targets[*place].body_from_target;
            let points = resized(&observation.seen, self.sizes[observation.target]);
            let in_map =
                |c: Correspondence| Correspondence { x_in_target: map_from_target * c.x_in_target, ..c };
            seen.extend(points.into_iter().map(in_map));
        }
        seen
    }

    /// Returns the covariance of two places together.
    fn joint(&self, a: usize, b: usize) -> Matrix6 {
        self.rig
            .joint_targets
            .as_ref()
            .map_or(Matrix6::zeros(), |joint| joint.fixed_view::<6, 6>(6 * a, 6 * b).into())
    }
}
