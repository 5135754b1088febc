//! What jobs answer: typed, with a status, and serialised to the JSON of the command line.

pub mod consensus;
pub mod pose;

pub use crate::report::verdict::{Status, Verdict};
pub use consensus::Agreement;
pub use pose::{PoseAnswer, PoseObject, TransformObject};
