//! One word for a survey: which of its answers can be believed. docs/math/survey.md, section 6.

use super::{Adjusted, RIVAL_GATE_CHI2};

/// What a survey's answers are worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurveyStatus {
    /// Everything known agrees, and only one arrangement fits it.
    Ok,
    /// Another arrangement of photographs and marks fits about as well.
    Ambiguous,
    /// Facts contradict each other, or one was left out because it contradicts the rest.
    Inconsistent,
    /// The marks stand on one line, or a mark was left out, and what is known of it with it.
    Degenerate,
}

impl SurveyStatus {
    /// As in JSON.
    pub fn name(self) -> &'static str {
        match self {
            SurveyStatus::Ok => "ok",
            SurveyStatus::Ambiguous => "ambiguous",
            SurveyStatus::Inconsistent => "inconsistent",
            SurveyStatus::Degenerate => "degenerate",
        }
    }
}

impl Adjusted {
    /// The word for the whole survey; that of each of its answers unless the answer has no value.
    pub fn status(&self) -> SurveyStatus {
        if self.on_line.is_some() {
            SurveyStatus::Degenerate
        } else if self.is_inconsistent || !self.suspects.is_empty() {
            SurveyStatus::Inconsistent
        } else if self.has_lost_marks {
            SurveyStatus::Degenerate
        } else if self.rival_delta_chi2.is_some_and(|d| d < RIVAL_GATE_CHI2) {
            SurveyStatus::Ambiguous
        } else {
            SurveyStatus::Ok
        }
    }

    /// The second best arrangement, where it fits about as well.
    pub fn second_solution(&self) -> Option<&Adjusted> {
        let is_near = self.rival_delta_chi2.is_some_and(|d| d < RIVAL_GATE_CHI2);
        self.rival.as_deref().filter(|_| is_near)
    }
}
