//! The closed forms: points and bearings in, at most four candidate poses out. No refinement, no choice.
//!
//! | solver | points | candidates | source |
//! | --- | --- | --- | --- |

pub mod line_plus_one;
pub mod wang2004;

use crate::Pose;
use arrayvec::ArrayVec;

/// Candidate poses `cam_from_target`, on the stack; no order promised.
pub type Candidates = ArrayVec<Pose, 4>;
