//! Why a command was refused, with the step of the page that it concerns.

use crate::view::StepText;

/// The step of the page that a sentence concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The photograph.
    Photograph,
    /// The lens.
    Lens,
    /// Points and distances.
    Points,
    /// Measuring.
    Measure,
}

impl Step {
    /// The word in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Step::Photograph => "photograph",
            Step::Lens => "lens",
            Step::Points => "marks",
            Step::Measure => "measure",
        }
    }
}

/// Why a command was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{text}")]
pub struct Refusal {
    /// The step.
    pub step: Step,
    /// A sentence with the way out.
    pub text: String,
}

impl Refusal {
    pub(crate) fn of(step: Step, text: impl Into<String>) -> Self {
        Refusal { step, text: text.into() }
    }

    pub(crate) fn view(&self) -> StepText {
        StepText { step: self.step.name(), text: self.text.clone() }
    }
}
