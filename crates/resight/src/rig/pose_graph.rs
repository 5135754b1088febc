//! Solves for a rig from relative poses of pairs of cameras: the job of `resight pose-graph`.

use super::pairs::PairFile;
use super::request::number_of;
use crate::answer::{PoseGraphAnswer, SolvedPoseGraph, Status, Unsolved};
use crate::core::Error as MathError;
use crate::core::multiview::pose_graph::{
    Chain, PairSigma, PoseGraph, PoseGraphConfig, chain, groups, solve_pose_graph,
};
use crate::error::Error;

/// How the cameras' poses are computed from pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PoseGraphMethod {
    /// All pairs are adjusted together; pairs that contradict the others are named.
    #[default]
    Joint,
    /// Every camera is placed by the chain of pairs with the smallest sum of errors; nothing is checked.
    Chain,
}

/// Relative poses of pairs of cameras, and how they are combined.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseGraphRequest {
    /// The cameras' names and their pairs, as [`super::pairs::read_pairs`] reads them.
    pub pairs: PairFile,
    /// The camera whose frame is the frame of the rig; by default the first.
    pub reference: Option<String>,
    /// How the pairs are combined.
    pub method: PoseGraphMethod,
    /// Standard deviations of a pair of median error; by default estimated from the closure errors of loops.
    pub median_sigma: Option<PairSigma>,
    /// Whether the answer's JSON holds the covariance of all cameras together, which grows with the square of their number.
    pub joint_covariance: bool,
}

impl PoseGraphRequest {
    /// Creates a request for the joint adjustment of all pairs, with the first camera as the reference.
    pub fn new(pairs: PairFile) -> Self {
        PoseGraphRequest {
            pairs,
            reference: None,
            method: PoseGraphMethod::Joint,
            median_sigma: None,
            joint_covariance: false,
        }
    }

    fn check(&self) -> Result<(), Error> {
        let n = self.pairs.cameras.len();
        if self.pairs.pairs.is_empty() {
            return Err(Error::request("no pair of cameras is given"));
        }
        if let Some(pair) = self.pairs.pairs.iter().find(|pair| n <= pair.a.max(pair.b)) {
            let (a, b) = (pair.a, pair.b);
            return Err(Error::request(format!("a pair joins cameras {a} and {b}, of which there are {n}")));
        }
        match self.median_sigma {
            Some(PairSigma { sigma_rad, sigma_m })
                if ![sigma_rad, sigma_m].iter().all(|sigma| 0.0 < *sigma && sigma.is_finite()) =>
            {
                Err(Error::request(format!(
                    "the standard deviations of a pair are {sigma_rad} rad and {sigma_m} m; positive numbers are needed"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Solves for the poses of several cameras in one frame, from relative poses of pairs.
///
/// ```
/// use resight::core::multiview::pose_graph::{PairNoise, RelativePose};
/// use resight::core::{Point, Pose};
/// use resight::rig::{PoseGraphRequest, pairs::PairFile};
/// let cameras = ["left", "middle", "right"].map(String::from).to_vec();
/// let shift = |x_m| Pose { translation: Point::new(x_m, 0.0, 0.0), ..Pose::identity() };
/// let pair = |a, b, x_m| RelativePose { a, b, b_from_a: shift(x_m), noise: PairNoise::Error(1.0) };
/// let pairs = vec![pair(0, 1, -0.1), pair(1, 2, -0.1), pair(0, 2, -0.2001)];
/// let answer = resight::pose_graph(&PoseGraphRequest::new(PairFile { cameras, pairs }))?;
/// assert_eq!(answer.status(), resight::Status::Ok);
/// # Ok::<(), resight::Error>(())
/// ```
///
/// An answer without poses has a status: `NotConnected` where no chain of pairs connects the cameras, `Error` where the pairs do not determine
/// them.
///
/// # Errors
/// A request that names something unknown or has no usable number.
pub fn pose_graph(request: &PoseGraphRequest) -> Result<PoseGraphAnswer, Error> {
    request.check()?;
    let PairFile { cameras, pairs } = &request.pairs;
    let reference = number_of(request.reference.as_deref(), cameras)?;
    let graph = PoseGraph { n_cameras: cameras.len(), pairs };
    let groups = groups(&graph);
    if 1 < groups.len() {
        return Ok(PoseGraphAnswer::Unsolved(not_connected(&groups, cameras)));
    }
    Ok(match solved(request, &graph, reference) {
        Ok(solved) => PoseGraphAnswer::Solved(Box::new(solved)),
        Err(reason) => PoseGraphAnswer::Unsolved(Unsolved::new(Status::Error, reason.to_string())),
    })
}

/// Returns the answer for groups of cameras that no chain of pairs connects.
fn not_connected(groups: &[Vec<usize>], cameras: &[String]) -> Unsolved {
    let name = |i: &usize| cameras[*i].clone();
    let groups: Vec<Vec<String>> = groups.iter().map(|group| group.iter().map(name).collect()).collect();
    let listed: Vec<String> = groups.iter().map(|group| format!("[{}]", group.join(", "))).collect();
    let message = format!(
        "no chain of pairs joins the cameras {}; add a pair between a camera of one group and a camera of another",
        listed.join(" and ")
    );
    Unsolved { groups, ..Unsolved::new(Status::NotConnected, message) }
}

fn solved(
    request: &PoseGraphRequest,
    graph: &PoseGraph,
    reference: usize,
) -> Result<SolvedPoseGraph, MathError> {
    let (cam_from_rig, paths, solution) = match request.method {
        PoseGraphMethod::Chain => {
            let Chain { cameras, .. } = chain(graph, reference)?;
            let cam_from_rig = cameras.iter().map(|c| (c.cam_from_rig, c.covariance)).collect();
            (cam_from_rig, Some(cameras.into_iter().map(|c| c.path).collect()), None)
        }
        PoseGraphMethod::Joint => {
            let config = PoseGraphConfig { reference_camera: reference, median_sigma: request.median_sigma };
            let solution = solve_pose_graph(graph, &config)?;
            // Without a loop, the uncertainty of the pairs cannot be estimated.
            let is_known = solution.noise_degrees_of_freedom != Some(0);
            let covariance =
                |c: &crate::core::multiview::pose_graph::CameraInGraph| is_known.then_some(c.covariance);
            let cam_from_rig = solution.cameras.iter().map(|c| (c.cam_from_rig, covariance(c))).collect();
            (cam_from_rig, None, Some(solution))
        }
    };
    Ok(SolvedPoseGraph {
        cameras: request.pairs.cameras.clone(),
        pairs: request.pairs.pairs.clone(),
        reference,
        cam_from_rig,
        paths,
        solution,
        joint_covariance: request.joint_covariance,
    })
}
