//! The answers of the jobs: typed, with a status, and serialised to the JSON of the command line.

pub mod advise;
pub(crate) mod budget;
pub mod compare;
pub mod consensus;
pub mod detection;
pub mod files;
pub mod hand_eye;
pub mod intrinsics;
pub mod capture;
pub mod landmarks;
pub mod measure;
mod placed;
pub mod pose;
pub mod pose_graph;
pub mod print;
pub mod rig;
pub mod rig_pose;
pub mod rig_view;
pub mod scene_view;
pub mod schema;
pub mod focal;
mod every;
mod unsolved;

pub use crate::report::verdict::{Status, Verdict};
pub use budget::NumbersPartObject;
pub use capture::CaptureAnswer;
pub use compare::CompareAnswer;
pub use consensus::Agreement;
pub use detection::DetectionAnswer;
pub use every::{Generate, json_schema};
pub use files::{ConvertAnswer, Explanation};
pub use focal::EstimatedFocal;
pub use hand_eye::{HandEyeAnswer, SolvedHandEye};
pub use intrinsics::{IntrinsicsAnswer, IntrinsicsCheckAnswer};
pub use measure::MeasureAnswer;
pub use pose::{PoseAnswer, PoseObject, TransformObject};
pub use pose_graph::{PoseGraphAnswer, SolvedPoseGraph};
pub use print::PrintAnswer;
pub use rig::{RigAnswer, SolvedRig};
pub use rig_pose::RigPoseAnswer;
pub use rig_view::{RigView, rig_view};
pub use scene_view::SceneViewAnswer;
pub use schema::{SCHEMA, SchemaNumber};
pub use unsolved::Unsolved;

pub(crate) use pose::rows;
