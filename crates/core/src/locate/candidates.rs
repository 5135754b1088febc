//! The second line of `locate`: the poses that a closed form gives.

use super::choose::Minimum;
use super::classify::View;
use super::method::Method;
use super::multi_start::of_method;
use super::upright::{Upright, upright};
use super::wang_covariance::literal;
use crate::Error;
use crate::solve::Candidates;
use crate::solve::line_plus_one::Weakness;

/// Where the refinement starts.
#[allow(clippy::large_enum_variant)] // On the stack, as all of the single-pose path.
pub(crate) enum Start {
    /// The closed form's poses, and what makes the view weak.
    Poses(Candidates, Option<Weakness>),
    /// Poses from two points and the vertical.
    Upright(Upright),
    /// The priors' own poses: the points have no closed form.
    Priors,
    /// An answer that is not refined.
    Answer(Minimum),
}

/// The closed form's poses.
///
/// # Errors
/// Those of the method.
pub(crate) fn closed_form(view: &View) -> Result<Start, Error> {
    Ok(match view.method {
        Method::Wang2004 => Start::Answer(literal(&view.configuration(), &view.problem)?),
        Method::Upright => Start::Upright(upright(&view.problem)?),
        Method::Priors => Start::Priors,
        method => {
            let (poses, weakness) = of_method(method, &view.configuration(), &view.problem);
            Start::Poses(poses, weakness)
        }
    })
}
