//! The combinations of parameters that a record does not determine.

use super::Object;
use super::parameters::{Covariance, Parameter, Priors};
use nalgebra::{DMatrix, SymmetricEigen};

/// A combination of parameters that the record does not determine.
#[derive(Debug, Clone, PartialEq)]
pub struct Undetermined {
    /// Its parameters, each with its share in units of its prior standard deviation; squares sum to about 1, the largest first.
    pub combination: Vec<(Parameter, f64)>,
    /// Its standard deviation after the record over that before, 0.5 to 1.
    pub left: f64,
    /// The reason, and the data that would determine it.
    pub reason: &'static str,
}

/// A combination is open where the record leaves more than this of its prior standard deviation.
const OPEN: f64 = 0.5;
/// Parameters with a smaller share are not named.
const NAMED: f64 = 0.2;

/// The open combinations of a fit, the openest first: eigenvectors of D⁻¹ C D⁻¹, D the prior's standard deviations.
/// docs/math/whisker_calibrate.md eq. (15).
pub fn undetermined(covariance: &Covariance, priors: &Priors, object: &Object) -> Vec<Undetermined> {
    let free = priors.free();
    let relative = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let (a, b) = (free[i], free[j]);
        covariance[(a.index(), b.index())] / (priors.sigma(a) * priors.sigma(b))
    });
    let eigen = SymmetricEigen::new(relative);
    let mut open: Vec<Undetermined> = (0..free.len())
        .filter(|i| OPEN * OPEN < eigen.eigenvalues[*i])
        .map(|i| {
            let mut combination: Vec<(Parameter, f64)> =
                free.iter().copied().zip(eigen.eigenvectors.column(i).iter().copied()).collect();
            combination.retain(|(_, share)| NAMED <= share.abs());
            combination.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            let reason = reason(&combination, object);
            Undetermined { combination, left: eigen.eigenvalues[i].clamp(0.0, 1.0).sqrt(), reason }
        })
        .collect();
    open.sort_by(|a, b| b.left.total_cmp(&a.left));
    open
}

fn reason(combination: &[(Parameter, f64)], object: &Object) -> &'static str {
    let has = |wanted: &[Parameter]| combination.iter().any(|(p, _)| wanted.contains(p));
    let is_placed = matches!(object, Object::Known(_));
    if has(&[Parameter::HubX, Parameter::HubY]) && !is_placed {
        return "moving clamp and object together changes no reading; give an object whose place is known";
    }
    if has(&[Parameter::HubAngle]) && !is_placed {
        return "turning clamp and object together changes hardly a reading; give an object whose place is known";
    }
    if has(&[Parameter::ForceXZero, Parameter::ForceYZero, Parameter::TorqueZero]) {
        return "too few free samples; record the whisker in free air";
    }
    if has(&[Parameter::Weight]) {
        return "the weight shows at different hub angles only; record free air at two of them";
    }
    if has(&[Parameter::Stiffness]) && has(&[Parameter::ForceGain, Parameter::TorqueGain]) {
        return "a common factor of forces, torque and stiffness changes no contact; hold the force gain or the stiffness";
    }
    "the contacts are too few or too much alike; sweep further, from both sides, and down to the tip"
}
