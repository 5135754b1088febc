//! What is said against a pose, and where it is in its numbers.

use super::PoseEstimate;
use super::choose::Ambiguity;
use super::consistency::Consistency;
use super::method::Method;
use crate::budget::{Accounted, ErrorSource, Warning};
use arrayvec::ArrayVec;

/// Something that is said against a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseWarning {
    /// The residuals are far above the stated noise.
    Contradiction,
    /// Another pose fits about as well.
    SecondSolution,
    /// Neighbouring points are displaced together by this many pixels.
    SharedError(f64),
    /// Nothing is left over to check the residual with.
    NothingChecks,
    /// The pose is that of the printed procedure, without refinement or search for a second one.
    Unrefined,
}

/// The most that can be said against one pose.
const MOST: usize = 5;

impl Warning for PoseWarning {
    fn accounted(&self) -> Accounted {
        match self {
            PoseWarning::Contradiction | PoseWarning::SecondSolution => Accounted::Status,
            PoseWarning::SharedError(_) => Accounted::Parts(&[ErrorSource::SharedInView]),
            PoseWarning::NothingChecks | PoseWarning::Unrefined => Accounted::Nothing,
        }
    }
}

impl PoseEstimate {
    /// Returns what is said against the pose.
    pub fn warnings(&self) -> ArrayVec<PoseWarning, MOST> {
        let is_contradiction = matches!(self.consistency, Consistency::Inconsistent { .. });
        let is_ambiguous = matches!(self.ambiguity, Ambiguity::Ambiguous { .. });
        let all = [
            is_contradiction.then_some(PoseWarning::Contradiction),
            is_ambiguous.then_some(PoseWarning::SecondSolution),
            (0.0 < self.shared_error_px).then_some(PoseWarning::SharedError(self.shared_error_px)),
            (self.degrees_of_freedom == 0).then_some(PoseWarning::NothingChecks),
            (self.method == Method::Wang2004).then_some(PoseWarning::Unrefined),
        ];
        all.into_iter().flatten().collect()
    }
}
