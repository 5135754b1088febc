//! The poses of the cameras of a rig from the relative poses of pairs of cameras, without images or points.
//!
//! `chain` follows the best chain of pairs from a reference camera. `solve_pose_graph` adjusts all pairs together by maximum likelihood; pairs
//! that contradict the rest are named and left out. Derivation: docs/math/pose_graph.md.

mod chain;
mod equations;
mod noise;
mod snooping;
mod lengths;
mod verdict;

pub use chain::{Chain, chain};
pub use verdict::{GraphFault, GraphVerdict, GraphWarning};

use crate::budget::{Budget, ErrorSource};
use crate::locate::consistency::noise_scale;
use crate::multiview::relative::{check_pose, information_of};
use crate::{Error, Matrix6, Pose, Vector6};
use equations::Adjustment;
use nalgebra::DMatrix;

/// The measured relative pose of two cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativePose {
    /// Index of the camera mapped from.
    pub a: usize,
    /// Index of the camera mapped into.
    pub b: usize,
    /// x_in_b = b_from_a · x_in_a, metres.
    pub b_from_a: Pose,
    /// Its uncertainty.
    pub noise: PairNoise,
}

/// The uncertainty of a pair; one kind for all pairs of a graph.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // A few hundred pairs: copying is simpler than a box each.
pub enum PairNoise {
    /// 6×6 covariance of the small left motion `[rotation_rad; translation_m]` of `b_from_a`, frame b.
    Covariance(Matrix6),
    /// A relative uncertainty: any error measure that grows in proportion to the standard deviations, such as the root mean
    /// square residual of the calibration of that pair; 1 for all where nothing is known. The standard deviations themselves then come from
    /// how well the pairs agree.
    Error(f64),
}

/// A rig as pairs of cameras.
#[derive(Debug, Clone, Copy)]
pub struct PoseGraph<'a> {
    /// Number of cameras.
    pub n_cameras: usize,
    /// The pairs in any order; two cameras may have several.
    pub pairs: &'a [RelativePose],
}

/// Settings of `solve_pose_graph`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseGraphConfig {
    /// The camera whose frame is the rig's.
    pub reference_camera: usize,
    /// For pairs with `PairNoise::Error`: standard deviations of a pair whose error is the median; none: both are estimated.
    pub median_sigma: Option<PairSigma>,
}

/// Standard deviations of a relative pose, the same about and along every axis of its frame b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairSigma {
    /// Standard deviation of each rotation, rad.
    pub sigma_rad: f64,
    /// Standard deviation of each translation, m.
    pub sigma_m: f64,
}

/// A camera's pose.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInGraph {
    /// x_in_cam = cam_from_rig · x_in_rig; identity for the reference camera.
    pub cam_from_rig: Pose,
    /// 6×6 covariance of the small left motion `[rotation_rad; translation_m]`, camera frame; zero for the reference camera.
    pub covariance: Matrix6,
}

/// The result for a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct PairResult {
    /// Log(measured · solved⁻¹), `[rotation_rad; translation_m]`, frame b.
    pub residual: Vector6,
    /// The extent to which the others check the pair: 0 (a bridge, which nothing checks) to 6.
    pub redundancy: f64,
    /// Its distance from the prediction of the *other* pairs, as a standard normal number: it exceeds `SUSPICIOUS` once in ten thousand by
    /// chance. None where the others do not predict it.
    pub disagreement_sigma: Option<f64>,
    /// Whether it took part.
    pub is_used: bool,
    /// Whether it contradicts the others. A suspicious pair that took part nevertheless shares its loops with other suspicious pairs, and any of
    /// them may be the wrong one.
    pub is_suspicious: bool,
}

/// Every camera's pose with its covariance, and the pairs that disagree.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseGraphSolution {
    /// The camera whose frame is the rig's.
    pub reference_camera: usize,
    /// One entry for each camera.
    pub cameras: Vec<CameraInGraph>,
    /// The parts of each camera's covariance by their sources, which add up to it.
    pub budgets: Vec<Budget>,
    /// One entry for each pair, in the order given.
    pub pairs: Vec<PairResult>,
    /// Sum of squared residuals of the pairs used over their variances.
    pub chi2: f64,
    /// 6 (pairs used − cameras + 1).
    pub degrees_of_freedom: usize,
    /// Factor by which every covariance was widened: χ² per degree of freedom, where stated sigmas prove too small; 1 where they agree or
    /// were estimated.
    pub noise_scale: f64,
    /// Standard deviations of a pair of median error, where pairs state errors only: estimated, or as given (not widened).
    pub median_sigma: Option<PairSigma>,
    /// Where those were estimated: the number of redundant equations of each, 3 (pairs used − cameras + 1). With 0 nothing was redundant, and
    /// the covariances are meaningless. None where the noise was given.
    pub noise_degrees_of_freedom: Option<usize>,
    /// Covariance of all cameras together, 6 rows for each camera, zero for the reference camera.
    pub joint_covariance: DMatrix<f64>,
    /// Steps of the last adjustment.
    pub steps: usize,
    /// Whether the answer is consistent.
    pub verdict: GraphVerdict,
}

impl PoseGraphSolution {
    /// Returns the pose from camera a to camera b and its covariance (left, frame b), with their correlation taken into account; none for an
    /// index of no camera. docs/math/pose_graph.md eq. (12).
    pub fn b_from_a(&self, a: usize, b: usize) -> Option<(Pose, Matrix6)> {
        let (pose_a, pose_b) = (self.cameras.get(a)?.cam_from_rig, self.cameras.get(b)?.cam_from_rig);
        let b_from_a = pose_b * pose_a.inverse();
        let ad = b_from_a.adjoint();
        let block = |i: usize, j: usize| -> Matrix6 {
            self.joint_covariance.fixed_view::<6, 6>(6 * i, 6 * j).into_owned()
        };
        let cross = ad * block(a, b);
        let covariance = block(b, b) + ad * block(a, a) * ad.transpose() - cross - cross.transpose();
        Some((b_from_a, crate::pose::symmetric(&covariance)))
    }
}

/// A pair with a larger disagreement is suspicious: once in ten thousand by chance (standard normal quantile).
pub const SUSPICIOUS: f64 = 3.719;

/// Returns the groups of cameras joined by chains of pairs, the largest first, then by the first camera; cameras in order.
pub fn groups(graph: &PoseGraph) -> Vec<Vec<usize>> {
    let mut group_of: Vec<usize> = (0..graph.n_cameras).collect();
    for pair in graph.pairs.iter().filter(|p| p.a < graph.n_cameras && p.b < graph.n_cameras) {
        let (from, to) = (group_of[pair.a], group_of[pair.b]);
        for group in group_of.iter_mut().filter(|group| **group == from.max(to)) {
            *group = from.min(to);
        }
    }
    let members = |group: usize| (0..graph.n_cameras).filter(|i| group_of[*i] == group).collect::<Vec<_>>();
    let mut groups: Vec<_> = (0..graph.n_cameras).map(members).filter(|g| !g.is_empty()).collect();
    groups.sort_by_key(|group| (usize::MAX - group.len(), group[0]));
    groups
}

/// Adjusts all pairs together, by maximum likelihood for independent Gaussian errors of the pairs.
///
/// # Errors
/// `InvalidPose` and `InvalidSetting` name a number that cannot be right; `Disconnected` when no chain of pairs joins all cameras;
/// `NotConverged` when no minimum is reached.
pub fn solve_pose_graph(graph: &PoseGraph, config: &PoseGraphConfig) -> Result<PoseGraphSolution, Error> {
    check(graph, config.reference_camera)?;
    let start = chain(graph, config.reference_camera)?;
    let poses: Vec<Pose> = start.cameras.iter().map(|camera| camera.cam_from_rig).collect();
    let noise = noise::Noise::of(graph, config.median_sigma, &poses)?;
    let settled = snooping::settle(graph, config.reference_camera, poses, noise)?;
    Ok(answer(graph, config.reference_camera, settled))
}

fn answer(graph: &PoseGraph, reference_camera: usize, settled: snooping::Settled) -> PoseGraphSolution {
    let snooping::Settled { adjustment, noise, pairs, undecided } = settled;
    let Adjustment { poses, covariance, chi2, steps } = adjustment;
    let used = pairs.iter().filter(|pair| pair.is_used).count();
    let degrees_of_freedom = 6 * (used + 1).saturating_sub(graph.n_cameras);
    let noise_degrees_of_freedom = noise.is_estimated().then_some(degrees_of_freedom / 2);
    let noise_scale = if noise.is_estimated() { 1.0 } else { noise_scale(chi2, degrees_of_freedom) };
    let beyond = &covariance * (noise_scale - 1.0) + undecided;
    let n_rows = covariance.nrows();
    let lengths = lengths::shared(graph, &poses, (&pairs, &noise))
        .map_or_else(|| DMatrix::zeros(n_rows, n_rows), |shared| &shared * shared.transpose());
    let joint_covariance = &covariance + &beyond + &lengths;
    let of_camera = |joint: &DMatrix<f64>, i: usize| -> Matrix6 {
        crate::pose::symmetric(&joint.fixed_view::<6, 6>(6 * i, 6 * i).into())
    };
    let budget = |i: usize| {
        let mut budget = Budget::default();
        budget.add(ErrorSource::CameraPoses, &of_camera(&covariance, i));
        budget.add(ErrorSource::Residuals, &of_camera(&beyond, i));
        budget.add(ErrorSource::Target, &of_camera(&lengths, i));
        budget
    };
    let budgets = (0..poses.len()).map(budget).collect();
    let camera = |(i, cam_from_rig): (usize, Pose)| CameraInGraph {
        cam_from_rig,
        covariance: of_camera(&joint_covariance, i),
    };
    let cameras = poses.into_iter().enumerate().map(camera).collect();
    let median_sigma = noise.median_sigma();
    let verdict = verdict::verdict(graph, &pairs, &noise, (chi2, degrees_of_freedom));
    PoseGraphSolution {
        reference_camera,
        cameras,
        budgets,
        pairs,
        chi2,
        degrees_of_freedom,
        noise_scale,
        median_sigma,
        noise_degrees_of_freedom,
        joint_covariance,
        steps,
        verdict,
    }
}

/// Checks every number of the graph.
fn check(graph: &PoseGraph, reference_camera: usize) -> Result<(), Error> {
    if graph.n_cameras <= reference_camera {
        let needed = "it must be one of the cameras, counted from 0";
        return Err(Error::InvalidSetting {
            setting: "the reference camera camera",
            seen: reference_camera as f64,
            needed,
        });
    }
    for (index, pair) in graph.pairs.iter().enumerate() {
        let invalid =
            |what, seen, needed| Err(Error::InvalidPose { item: "pair", index, what, seen, needed });
        if graph.n_cameras <= pair.a.max(pair.b) {
            return invalid("camera", pair.a.max(pair.b) as f64, "it must be one of the cameras");
        }
        if pair.a == pair.b {
            return invalid("camera", pair.a as f64, "a pair joins two different cameras");
        }
        check_pose("pair", index, &pair.b_from_a)?;
        match pair.noise {
            PairNoise::Covariance(covariance) => information_of("pair", index, &covariance).map(|_| ())?,
            PairNoise::Error(error) if 0.0 < error && error.is_finite() => {}
            PairNoise::Error(error) => return invalid("the error", error, "it must be positive and finite"),
        }
        let is_covariance = |pair: &RelativePose| matches!(pair.noise, PairNoise::Covariance(_));
        if is_covariance(pair) != is_covariance(&graph.pairs[0]) {
            let needed = "state a covariance for every pair, or an error for every pair";
            return invalid("the kind of noise", f64::from(u8::from(is_covariance(pair))), needed);
        }
    }
    match &groups(graph)[..] {
        [_] => Ok(()),
        [first, second, ..] => {
            Err(Error::Disconnected { groups: groups(graph).len(), a: first[0], b: second[0] })
        }
        [] => Ok(()),
    }
}
