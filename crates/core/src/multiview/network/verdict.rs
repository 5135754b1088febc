//! The status of a network: whether its answers can be trusted. docs/math/survey.md, section 6.

use super::{ALTERNATIVE_GATE_CHI2, Adjusted, Frame};
use crate::budget::{Accounted, ErrorSource, Warning};

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

/// Something that is said against the answers of a network.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NetworkWarning {
    /// All control points are on one line.
    OnLine,
    /// Labels, columns or axes look exchanged.
    Exchanged,
    /// Constraints contradict the others.
    Suspects,
    /// The constraints disagree, and no single one explains it.
    Contradiction,
    /// Residuals exceed the stated noise by this factor of standard deviations.
    Residuals(f64),
    /// Another arrangement fits about as well; χ² above the best.
    SecondSolution(f64),
    /// A control point that was clicked has no place.
    LostControlPoints,
    /// Nothing is left over to check anything with.
    NothingChecks,
    /// A rotation or a shift of everything is held: positions are right relative to each other only.
    Held,
    /// A point, photograph or plane took no part.
    LeftOut(usize),
}

impl Warning for NetworkWarning {
    fn accounted(&self) -> Accounted {
        match self {
            NetworkWarning::OnLine
            | NetworkWarning::Exchanged
            | NetworkWarning::Suspects
            | NetworkWarning::Contradiction
            | NetworkWarning::SecondSolution(_)
            | NetworkWarning::LostControlPoints => Accounted::Status,
            NetworkWarning::Residuals(_) => Accounted::Parts(&[ErrorSource::Residuals]),
            NetworkWarning::NothingChecks | NetworkWarning::Held | NetworkWarning::LeftOut(_) => {
                Accounted::Nothing
            }
        }
    }
}

impl Adjusted {
    /// Returns what is said against the answers: first what is to be read before any number.
    pub fn warnings(&self) -> Vec<NetworkWarning> {
        let mut warnings = Vec::new();
        warnings.extend(self.on_line.map(|_| NetworkWarning::OnLine));
        warnings.extend(match (self.exchanged.is_empty(), self.suspects.is_empty(), self.is_inconsistent) {
            (false, ..) => Some(NetworkWarning::Exchanged),
            (true, false, _) => Some(NetworkWarning::Suspects),
            (true, true, true) => Some(NetworkWarning::Contradiction),
            (true, true, false) => None,
        });
        warnings.extend((1.0 < self.noise_scale).then(|| NetworkWarning::Residuals(self.noise_scale.sqrt())));
        let second = self.alternative_delta_chi2.filter(|delta| *delta < ALTERNATIVE_GATE_CHI2);
        warnings.extend(second.map(NetworkWarning::SecondSolution));
        warnings.extend(self.has_lost_control_points.then_some(NetworkWarning::LostControlPoints));
        warnings.extend((self.degrees_of_freedom == 0).then_some(NetworkWarning::NothingChecks));
        warnings.extend((self.frame == Frame::Held).then_some(NetworkWarning::Held));
        warnings.extend((0..self.undetermined.len()).map(NetworkWarning::LeftOut));
        warnings
    }

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
