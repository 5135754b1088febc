//! Minimises a cost in which uncertain points weigh otherwise at every pose.
//!
//! A point known to σ spreads over more pixels the nearer it is, so that by weights taken at each pose anew χ² falls as the camera runs into
//! the points: it is no likelihood without its log-determinant, and Gauss–Newton's gradient, which holds the weights, is not that of
//! it. Here a descent holds the weights, takes them anew where it ends, and continues until they hold still. Which minimum is the
//! likelier is reported with the log-determinant (`Minimum::log_determinant`). Derivation: docs/math/refine.md section 4.

use crate::least_squares::{Ending, NormalEquations, PivotedPose, PoseMinimum, minimize_pose};
use crate::{Point, Pose};

/// Descents with weights held; the weights change by the part that a step is of the distance, so that three are the rule.
const MAX_DESCENTS: usize = 30;
/// Ends where a step with the weights of its own place promises less than this: 10⁻³ standard deviations.
const SETTLED_CHI2: f64 = 1e-6;

/// The place where the gradient vanishes with the weights of that place; `evaluate` takes the place and the pose whose weights hold. None where a point leaves the field or no place is found;
/// `NotConverged` where the weights do not come to rest.
#[inline(never)]
pub(crate) fn minimize_reweighted(
    start: PivotedPose,
    pivot: &Point,
    evaluate: impl Fn(&PivotedPose, &Pose) -> Option<NormalEquations>,
) -> Option<PoseMinimum> {
    let mut steps = 0;
    let mut place = start;
    for _ in 0..MAX_DESCENTS {
        let at = place.pose(pivot);
        let found = minimize_pose(place, None, |place| evaluate(place, &at))?;
        steps += found.steps;
        place = found.state;
        let at = place.pose(pivot);
        let equations = evaluate(&place, &at)?;
        let settled = equations.promised().is_some_and(|promised| promised < SETTLED_CHI2);
        if settled || !found.is_minimum() {
            return Some(PoseMinimum { state: place, equations, steps, ending: found.ending });
        }
    }
    let (equations, ending) = (NormalEquations::zero(), Ending::NotConverged);
    Some(PoseMinimum { state: place, equations, steps, ending })
}
