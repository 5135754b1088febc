//! The third line of `locate`: the minima that the candidates lead to.

use super::candidates::Start;
use super::choose::Minima;
use super::classify::View;
use super::curvature::{Bends, is_bent};
use super::multi_start::search;
use super::prior_start::{hold, start_from_priors};
use super::problem::Problem;
use crate::Error;
use crate::solve::line_plus_one::Weakness;

/// The minima of a view, and the findings of the search.
#[derive(Default)]
pub(crate) struct Found {
    /// Lowest cost first.
    pub(crate) minima: Minima,
    /// Why the view is weak; none where it is not.
    pub(crate) weakness: Option<Weakness>,
    /// Whether the likelihood is bent at each of the first minima; none where that is not known.
    pub(crate) bends: Bends,
    /// An error that rules out any answer.
    pub(crate) refusal: Option<Error>,
}

/// Refines the closed form's poses to minima, with more starts where the decision is close.
pub(crate) fn refine(view: &View, start: &Start) -> Found {
    let (problem, mut found) = (&view.problem, Found::default());
    match start {
        Start::Answer(minimum) => {
            found.minima.push(*minimum);
            found.bends[0] = Some(false);
        }
        Start::Upright(starts) => found.refusal = starts.refine(problem, &mut found.minima).err(),
        Start::Priors => found.refusal = hold(problem, &mut found.minima).err(),
        Start::Poses(poses, weakness) => {
            found.weakness = *weakness;
            start_from_priors(problem, &mut found.minima);
            if let Some(geometry) = &view.geometry {
                found.bends[0] = search(poses, weakness.is_some(), geometry, problem, &mut found.minima);
            }
        }
    }
    if let Start::Upright(_) | Start::Priors = start {
        found.bends[0] = Some(is_bent_at_the_lowest(problem, &found.minima));
    }
    // Uncertain intrinsics move the minima: what was bent need not be.
    if !view.allowed.common.is_exact() {
        found.bends[0] = None;
    }
    found
}

/// Whether the likelihood is bent at the lowest minimum.
pub(crate) fn is_bent_at_the_lowest(problem: &Problem, minima: &Minima) -> bool {
    minima.first().is_some_and(|m| is_bent(m, &problem.held_at(&m.cam_from_target)))
}
