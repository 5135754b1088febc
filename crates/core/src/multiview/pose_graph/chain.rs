//! The chain of pairs with the least sum of errors to each camera: Dijkstra's shortest paths from the reference camera.
//!
//! Paper: E. W. Dijkstra, "A note on two problems in connexion with graphs", Numerische Mathematik 1, 1959.

use super::{PairNoise, PoseGraph, RelativePose, check};
use crate::{Error, Matrix6, Pose};

/// Cameras in chains from a reference camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// The camera whose frame is the rig's.
    pub reference_camera: usize,
    /// One entry for each camera.
    pub cameras: Vec<ChainedCamera>,
}

/// A camera at the end of a chain.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainedCamera {
    /// x_in_cam = cam_from_rig · x_in_rig; identity for the reference camera.
    pub cam_from_rig: Pose,
    /// The cameras along the chain, the reference camera first, this one last.
    pub path: Vec<usize>,
    /// Indices of the pairs along the chain, in the same order.
    pub pairs: Vec<usize>,
    /// Sum of the pairs' errors along the chain; for pairs with covariances, of `cost_of`.
    pub error: f64,
    /// The pairs' covariances propagated along the chain, left motion in the camera frame; none where pairs state errors only.
    pub covariance: Option<Matrix6>,
}

/// Returns the length of a pair in a chain: its error; for a covariance its trace in m², rotations taken at one metre. Variances add along a
/// chain.
fn cost_of(pair: &RelativePose) -> f64 {
    match pair.noise {
        PairNoise::Error(error) => error,
        PairNoise::Covariance(covariance) => covariance.trace(),
    }
}

/// Returns the chain of least summed error to each camera; of equally good chains the one through cameras and pairs with lower indices.
///
/// # Errors
/// `InvalidPose`, `InvalidSetting` or `Disconnected`.
pub fn chain(graph: &PoseGraph, reference_camera: usize) -> Result<Chain, Error> {
    check(graph, reference_camera)?;
    let mut known = vec![None; graph.n_cameras];
    let first = ChainedCamera {
        cam_from_rig: Pose::identity(),
        path: vec![reference_camera],
        pairs: Vec::new(),
        error: 0.0,
        covariance: Some(Matrix6::zeros()),
    };
    known[reference_camera] = Some(first);
    while let Some((camera, reached)) = nearest(graph, &known) {
        known[camera] = Some(reached);
    }
    Ok(Chain { reference_camera, cameras: known.into_iter().flatten().collect() })
}

/// Returns the camera not yet known that a known one reaches with the least error.
fn nearest(graph: &PoseGraph, known: &[Option<ChainedCamera>]) -> Option<(usize, ChainedCamera)> {
    let mut best: Option<(f64, usize, usize, usize)> = None;
    for (index, pair) in graph.pairs.iter().enumerate() {
        for (from, to) in [(pair.a, pair.b), (pair.b, pair.a)] {
            let (Some(start), None) = (&known[from], &known[to]) else { continue };
            let error = start.error + cost_of(pair);
            if best.is_none_or(|best| (error, to, from, index) < best) {
                best = Some((error, to, from, index));
            }
        }
    }
    let (error, to, from, index) = best?;
    Some((to, extended(known[from].as_ref()?, &graph.pairs[index], index, to, error)))
}

fn extended(
    start: &ChainedCamera,
    pair: &RelativePose,
    index: usize,
    to: usize,
    error: f64,
) -> ChainedCamera {
    let forwards = pair.b == to;
    let to_from_start = if forwards { pair.b_from_a } else { pair.b_from_a.inverse() };
    let own = match pair.noise {
        PairNoise::Covariance(own) if forwards => Some(own),
        PairNoise::Covariance(own) => Some(pair.b_from_a.inverse_covariance(&own)),
        PairNoise::Error(_) => None,
    };
    let covariance =
        own.zip(start.covariance).map(|(own, before)| to_from_start.product_covariance(&own, &before));
    let mut reached = start.clone();
    reached.path.push(to);
    reached.pairs.push(index);
    ChainedCamera { cam_from_rig: to_from_start * start.cam_from_rig, error, covariance, ..reached }
}
