//! The status of a network: whether its answers can be trusted. docs/math/survey.md, section 6.

use super::{ALTERNATIVE_GATE_CHI2, Adjusted};

/// The status of a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NetworkStatus {
    /// All constraints agree, and only one arrangement fits them.
    Ok,
    /// Another arrangement of photographs and control points fits about as well.
    Ambiguous,
    /// Constraints contradict each other, or one was left out because it contradicts the rest.
    Inconsistent,
    /// The control points are on one line, or a control point was left out together with the constraints on it.
    Degenerate,
}

impl NetworkStatus {
    /// Returns the name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            NetworkStatus::Ok => "ok",
            NetworkStatus::Ambiguous => "ambiguous",
            NetworkStatus::Inconsistent => "inconsistent",
            NetworkStatus::Degenerate => "degenerate",
        }
    }
}

impl Adjusted {
    /// Returns the status of the whole network, which is also that of each of its answers unless the answer has no value.
    pub fn status(&self) -> NetworkStatus {
        if self.on_line.is_some() {
            NetworkStatus::Degenerate
        } else if self.is_inconsistent || !self.suspects.is_empty() {
            NetworkStatus::Inconsistent
        } else if self.has_lost_control_points {
            NetworkStatus::Degenerate
        } else if self.alternative_delta_chi2.is_some_and(|d| d < ALTERNATIVE_GATE_CHI2) {
            NetworkStatus::Ambiguous
        } else {
            NetworkStatus::Ok
        }
    }

    /// Returns the second best arrangement, where it fits about as well.
    pub fn second_solution(&self) -> Option<&Adjusted> {
        let is_near = self.alternative_delta_chi2.is_some_and(|d| d < ALTERNATIVE_GATE_CHI2);
        self.alternative.as_deref().filter(|_| is_near)
    }
}
