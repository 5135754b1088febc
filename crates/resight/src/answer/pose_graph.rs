//! The answer of the job that makes a rig of relative poses, and the JSON object that it becomes.

mod file;

use super::budget::{BudgetPartObject, parts};
use super::placed::{JointObject, PlacedObject};
use super::{SchemaNumber, Status, Unsolved};
use crate::core::budget::{Budget, ErrorSource};
use crate::core::multiview::pose_graph::{
    GraphFault, GraphWarning, PairResult, PoseGraphSolution, RelativePose,
};
use crate::core::{Matrix6, Pose};
use crate::report::words::{degrees, length};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// The cameras in one frame, or why they cannot be placed. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum PoseGraphAnswer {
    /// The cameras; the status says whether their poses can be believed.
    Solved(Box<SolvedPoseGraph>),
    /// Why there are none.
    Unsolved(Unsolved),
}

/// Cameras placed by relative poses of pairs, with everything needed to report them.
#[derive(Debug, Clone)]
pub struct SolvedPoseGraph {
    /// The cameras' names.
    pub cameras: Vec<String>,
    /// The pairs given.
    pub pairs: Vec<RelativePose>,
    /// Index of the camera whose frame is the frame of the rig.
    pub reference: usize,
    /// The pose of each camera, and the covariance of its small left motion where the pairs determine it.
    pub cam_from_rig: Vec<(Pose, Option<Matrix6>)>,
    /// For chains: the cameras on the path from the reference to each camera.
    pub paths: Option<Vec<Vec<usize>>>,
    /// The joint solution of all pairs; `None` for chains.
    pub solution: Option<PoseGraphSolution>,
    /// Whether the JSON object holds the covariance of all cameras together.
    pub joint_covariance: bool,
}

/// How well one pair agrees with all.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PairAgreement {
    /// Name of the camera that the pair leads from.
    pub a: String,
    /// Name of the camera that it leads to.
    pub b: String,
    /// Rotation between the pair's pose and the cameras', rad.
    pub residual_rad: f64,
    /// Translation between them, metres.
    pub residual_m: f64,
    /// The share of the pair that other pairs check, 0 to 1; of chains none.
    pub redundancy: Option<f64>,
    /// How far it is from what the others say, in standard deviations, where they say it.
    pub disagreement_sigma: Option<f64>,
    /// Whether it took part.
    pub is_used: bool,
    /// Whether it contradicts the others.
    pub is_suspicious: bool,
}

impl PoseGraphAnswer {
    /// Returns whether the answer may be relied on.
    pub fn status(&self) -> Status {
        match self {
            PoseGraphAnswer::Solved(solved) => solved.status(),
            PoseGraphAnswer::Unsolved(unsolved) => unsolved.status,
        }
    }

    /// Returns the cameras, where there are any.
    pub fn solved(&self) -> Option<&SolvedPoseGraph> {
        match self {
            PoseGraphAnswer::Solved(solved) => Some(solved),
            PoseGraphAnswer::Unsolved(_) => None,
        }
    }
}

impl SolvedPoseGraph {
    /// Returns whether the poses may be relied on.
    pub fn status(&self) -> Status {
        if self.contradiction().is_some() { Status::Inconsistent } else { Status::Ok }
    }

    /// Explains why the pairs cannot all be right, and names the worst camera and pair; `None` for a chain, which checks nothing.
    pub fn contradiction(&self) -> Option<String> {
        let s = self.solution.as_ref()?;
        let fault = s.verdict.fault?;
        let n_suspicious = s.pairs.iter().filter(|pair| pair.is_suspicious).count();
        let what = match fault {
            GraphFault::Noise => format!(
                "the pairs differ by {:.1} times what their stated sigmas say",
                (s.chi2 / s.degrees_of_freedom.max(1) as f64).sqrt()
            ),
            GraphFault::Pairs => format!("{n_suspicious} of {} pairs contradict the others", s.pairs.len()),
            GraphFault::Camera => "pairs of a camera contradict the others".to_string(),
            _ => {
                let sigma = s.median_sigma?;
                format!(
                    "loops of pairs do not close: the pairs differ by about {} and {}",
                    degrees(sigma.sigma_rad),
                    length(sigma.sigma_m)
                )
            }
        };
        let camera = s
            .verdict
            .worst_camera
            .map_or(String::new(), |c| format!("; camera {} disagrees most", self.cameras[c]));
        let pair = s.verdict.worst_pair.map(|i| &self.pairs[i]);
        let pair =
            pair.map_or(String::new(), |p| format!(", in pair {}-{}", self.cameras[p.a], self.cameras[p.b]));
        Some(format!(
            "{what}{camera}{pair}; poses the wrong way round, cameras exchanged, a unit or a wrong lens file are the likely cause"
        ))
    }

    /// Returns how well each pair agrees with the solution, in the order given.
    pub fn agreements(&self) -> Vec<PairAgreement> {
        let object = |(i, pair): (usize, &RelativePose)| {
            let predicted = self.cam_from_rig[pair.b].0 * self.cam_from_rig[pair.a].0.inverse();
            let residual = (pair.b_from_a * predicted.inverse()).log();
            let result: Option<&PairResult> = self.solution.as_ref().map(|s| &s.pairs[i]);
            PairAgreement {
                a: self.cameras[pair.a].clone(),
                b: self.cameras[pair.b].clone(),
                residual_rad: residual.fixed_rows::<3>(0).norm(),
                residual_m: residual.fixed_rows::<3>(3).norm(),
                redundancy: result.map(|r| r.redundancy),
                disagreement_sigma: result.and_then(|r| r.disagreement_sigma),
                is_used: result.is_none_or(|r| r.is_used),
                is_suspicious: result.is_some_and(|r| r.is_suspicious),
            }
        };
        self.pairs.iter().enumerate().map(object).collect()
    }

    /// Returns one line: the numbers of cameras and pairs, and the pairs that contradict others.
    pub fn message(&self) -> String {
        let (n, m) = (self.cameras.len(), self.pairs.len());
        let how = match &self.solution {
            None => "each camera by its best chain of pairs".to_string(),
            Some(s) => format!("all pairs together, {} degrees of freedom", s.degrees_of_freedom),
        };
        let contradicting = match &self.suspicious()[..] {
            [] => String::new(),
            several => format!("; pairs that contradict others: {}", several.join(", ")),
        };
        let doubts = self.solution.iter().flat_map(PoseGraphSolution::warnings);
        let is_undecided = doubts.into_iter().any(|doubt| match doubt {
            GraphWarning::Undecided(_) => true,
            // Named with the contradiction, and among the pairs that contradict others.
            GraphWarning::Fault(_) | GraphWarning::LeftOut(_) => false,
        });
        let undecided =
            if is_undecided { " (any one of a loop may be wrong, and every ± holds that)" } else { "" };
        format!("{n} cameras from {m} pairs, {how}{contradicting}{undecided}")
    }

    /// Returns the pairs that contradict others, as `a-b`.
    fn suspicious(&self) -> Vec<String> {
        let pairs = self.agreements().into_iter().filter(|pair| pair.is_suspicious);
        pairs.map(|pair| format!("{}-{}", pair.a, pair.b)).collect()
    }

    /// Returns the joint solution, where loops or stated sigmas determine its covariance.
    fn known(&self) -> Option<&PoseGraphSolution> {
        self.solution.as_ref().filter(|s| s.noise_degrees_of_freedom != Some(0))
    }

    /// Returns the parts of a camera's covariance by their sources; `None` where nothing is known of it. A chain has its pairs alone.
    pub fn budget(&self, camera: usize) -> Option<Budget> {
        let covariance = self.cam_from_rig.get(camera)?.1?;
        match &self.solution {
            Some(solution) => solution.budgets.get(camera).cloned(),
            None => {
                let mut budget = Budget::default();
                budget.add(ErrorSource::CameraPoses, &covariance);
                Some(budget)
            }
        }
    }

    fn camera(&self, i: usize) -> CameraObject {
        let (cam_from_rig, covariance) = &self.cam_from_rig[i];
        let name = |i: &usize| self.cameras[*i].clone();
        let path = self.paths.as_ref().map(|paths| paths[i].iter().map(name).collect());
        let verdict = self.solution.as_ref().map(|s| &s.verdict);
        let is_contradicted =
            verdict.is_some_and(|v| v.is_contradicted[i] || (v.fault.is_some() && v.worst_camera == Some(i)));
        let status = if is_contradicted { Status::Inconsistent } else { Status::Ok };
        let budget = self.budget(i).as_ref().map(parts).unwrap_or_default();
        CameraObject {
            status,
            cam_from_rig: PlacedObject::of(cam_from_rig, covariance.as_ref()),
            budget,
            path,
        }
    }

    fn json(&self) -> GraphObject {
        let s = self.solution.as_ref();
        let sigma = s.and_then(|s| s.median_sigma);
        let joint = self.known().filter(|_| self.joint_covariance).map(|s| &s.joint_covariance);
        let cameras = self.cameras.iter().enumerate().map(|(i, name)| (name.clone(), self.camera(i)));
        GraphObject {
            schema: SchemaNumber,
            status: self.status(),
            contradiction: self.contradiction(),
            method: if s.is_some() { "joint" } else { "chain" },
            reference: self.cameras[self.reference].clone(),
            cameras: cameras.collect(),
            message: self.message(),
            pairs: self.agreements(),
            suspicious: self.suspicious(),
            chi2: s.map(|s| s.chi2),
            degrees_of_freedom: s.map(|s| s.degrees_of_freedom),
            noise_scale: s.map(|s| s.noise_scale),
            median_sigma_rad: sigma.map(|s| s.sigma_rad),
            median_sigma_m: sigma.map(|s| s.sigma_m),
            noise_degrees_of_freedom: s.and_then(|s| s.noise_degrees_of_freedom),
            joint_covariance: joint.map(|matrix| JointObject::of(self.cameras.clone(), matrix)),
        }
    }
}

impl Serialize for SolvedPoseGraph {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.json().serialize(serializer)
    }
}

#[derive(Serialize, JsonSchema)]
pub(super) struct GraphObject {
    schema: SchemaNumber,
    status: Status,
    /// What contradicts, and the likely cause; null where nothing does.
    contradiction: Option<String>,
    method: &'static str,
    reference: String,
    cameras: BTreeMap<String, CameraObject>,
    pairs: Vec<PairAgreement>,
    /// Pairs that contradict the others, as `a-b`.
    suspicious: Vec<String>,
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    noise_scale: Option<f64>,
    median_sigma_rad: Option<f64>,
    median_sigma_m: Option<f64>,
    /// Of each of the two, where they were estimated; null where they were given.
    noise_degrees_of_freedom: Option<usize>,
    /// With --joint-covariance; a chain has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointObject>,
    message: String,
}

#[derive(Serialize, JsonSchema)]
struct CameraObject {
    status: Status,
    #[serde(flatten)]
    cam_from_rig: PlacedObject,
    /// The parts of `covariance` by the sources of the errors, where it is known.
    budget: Vec<BudgetPartObject>,
    /// The cameras on the way from the reference, for a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<Vec<String>>,
}
