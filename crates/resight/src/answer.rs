//! What jobs answer: typed, with a status, and serialised to the JSON of the command line.

pub mod consensus;
pub mod hand_eye;
mod placed;
pub mod pose;
pub mod pose_graph;
pub mod rig;
mod unsolved;

pub use crate::report::verdict::{Status, Verdict};
pub use consensus::Agreement;
pub use hand_eye::{HandEyeAnswer, SolvedHandEye};
pub use pose::{PoseAnswer, PoseObject, TransformObject};
pub use pose_graph::{PoseGraphAnswer, SolvedPoseGraph};
pub use rig::{RigAnswer, SolvedRig};
pub use unsolved::Unsolved;

use pose::rows;
