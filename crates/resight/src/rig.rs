//! A rig with names: the jobs that solve for it, and the names of cameras, views and targets in files and reports.

mod detections;
pub mod digest;
mod frame_sets;
pub mod gather;
mod hand_eye;
mod images;
mod job;
mod lenses;
pub mod names;
mod observed;
pub mod pairs;
pub mod places;
mod pose_graph;
pub mod relative;
mod request;
mod robot_poses;
pub mod synchronise;
pub(crate) mod uncertain_lens;

pub(crate) use detections::{collect as collect_detections, table::camera_names};
pub(crate) use images::{FoundTargets, OTHER_SIZE, Orientations, collect as collect_images, search_image};
pub(crate) use observed::Collected;

pub use detections::{DetectionRow, DetectionSource, Detections};
pub use hand_eye::{HandEyeRequest, HandEyeViews, hand_eye};
pub use images::{CameraImage, FrameTimes, ImageOptions, KeptDetections};
pub use job::{ObservedRig, rig_from_detections, rig_from_images};
pub use lenses::LensChange;
pub use observed::LeftOut;
pub use pose_graph::{PoseGraphMethod, PoseGraphRequest, pose_graph};
pub use request::{CameraDistance, RigRequest};
pub use robot_poses::{RobotFile, RobotPose, ViewPoses, read_robot_file, read_view_poses};

use crate::core::multiview::rig::{Observation, RigProblem, RigSolution, TimeOffsets};
use crate::core::{Camera, Target};
use crate::formats::{NamedCamera, Placement, plausible};

/// The name, in files, of the frame in which the cameras of a rig are placed: that of the reference camera.
pub const RIG_FRAME: &str = "rig";

/// A target of a request.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedTarget {
    /// Its name.
    pub name: String,
    /// Its points; `None` when they are part of the detections.
    pub target: Option<Target>,
    /// Index of the body to which it is fixed.
    pub body: usize,
}

/// Cameras, views, targets and observations in canonical order: sorted by name, so that the order of files does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedRig {
    /// The cameras, sorted by name.
    pub cameras: Vec<NamedCamera>,
    /// Their lenses, in the same order: input of `RigProblem`.
    pub lenses: Vec<Camera>,
    /// View names, in order.
    pub views: Vec<String>,
    /// The targets, sorted by name.
    pub targets: Vec<NamedTarget>,
    /// Body of each target, in the same order: input of `RigProblem`.
    pub body_of_target: Vec<usize>,
    /// The observations, sorted by view, camera, target.
    pub observations: Vec<Observation>,
}

impl NamedRig {
    /// Returns the input of the solver.
    pub fn problem(&self) -> RigProblem<'_> {
        RigProblem {
            cameras: &self.lenses,
            body_of_target: &self.body_of_target,
            n_views: self.views.len(),
            observations: &self.observations,
        }
    }

    /// Returns remarks on what is implausible in metres: sizes of the targets, and positions of points that the detections state.
    pub fn size_remarks(&self) -> Vec<String> {
        let stated = |target: usize| {
            let seen = self.observations.iter().filter(move |s| s.target == target).flat_map(|s| &s.seen);
            plausible::of_uncertain_points(seen.map(|c| (c.x_in_target, c.sigma_m)))
        };
        let remarks = |(i, named): (usize, &NamedTarget)| {
            let found = match &named.target {
                Some(target) => plausible::of_target(target),
                None => stated(i).into_iter().collect(),
            };
            found.into_iter().map(|remark| format!("target {}: {remark}", named.name)).collect::<Vec<_>>()
        };
        self.targets.iter().enumerate().flat_map(remarks).collect()
    }

    /// Returns the index of the camera with this name.
    pub fn camera(&self, name: &str) -> Option<usize> {
        self.cameras.iter().position(|camera| camera.name == name)
    }
}

/// A file on which an answer depends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputFile {
    /// Path as given.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// An answer with everything needed to report it.
#[derive(Debug, Clone, PartialEq)]
pub struct RigRun {
    /// The input.
    pub rig: NamedRig,
    /// The solution.
    pub solution: RigSolution,
    /// For each camera what became of its lens, where all were adjusted with the rig; empty where the files were taken as they are.
    pub lenses: Vec<LensChange>,
    /// When the cameras exposed, by their time stamps and a target that moved; none where stamps or motion are missing.
    pub times: Option<TimeOffsets>,
    /// The files read.
    pub inputs: Vec<InputFile>,
    /// The exact command line, if the job was run from one.
    pub command: Option<String>,
}

impl RigRun {
    /// Returns the cameras with their poses, as input of `formats::write_cameras`: `cam_from_rig` with its covariance, where frame b is named
    /// after the camera and frame a is [`RIG_FRAME`].
    pub fn placed_cameras(&self) -> Vec<NamedCamera> {
        let placed = |(camera, found): (&NamedCamera, &crate::core::multiview::rig::CameraInRig)| {
            let placement = Placement {
                b: camera.name.clone(),
                a: RIG_FRAME.to_string(),
                b_from_a: found.cam_from_rig,
                covariance: Some(found.covariance),
            };
            NamedCamera { placement: Some(placement), ..camera.clone() }
        };
        self.rig.cameras.iter().zip(&self.solution.cameras).map(placed).collect()
    }
}
