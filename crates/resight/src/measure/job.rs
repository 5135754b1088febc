//! The job that answers every query of a scene.

use super::Answers;
use super::answers::{Refusal, solve, solve_provisionally};
use super::scene::NamedScene;
use crate::answer::MeasureAnswer;

/// Answers every query of a scene. The status of the answer states what cannot be solved.
///
/// # Errors
/// A scene that is invalid in itself: no length, an impossible camera or constraint.
pub fn measure(scene: &NamedScene) -> Result<MeasureAnswer, crate::Error> {
    match solve(scene, None) {
        Ok(answers) => Ok(MeasureAnswer::solved(scene, answers)),
        Err(Refusal { status: Some(status), reason }) => Ok(MeasureAnswer::refused(scene, status, &reason)),
        Err(Refusal { status: None, reason }) => Err(crate::Error::request(reason)),
    }
}

/// Returns the solution of [`measure`] after an earlier scene was measured: answers that do not depend on the differences between the scenes are
/// reused. Points and photographs, whose budgets cost a sixth of the whole, are not reported.
///
/// # Errors
/// The errors of [`measure`], and a scene that cannot be solved.
pub fn measure_after(
    scene: &NamedScene,
    before: Option<(&NamedScene, &Answers)>,
) -> Result<Answers, crate::Error> {
    solve(scene, before).map_err(|refusal| crate::Error::request(refusal.reason))
}

/// Returns answers that the next ones replace within a moment, such as while a point is dragged, in a fraction of the time of [`measure_after`]: the
/// intervals are value ± 1.96 σ, only the first arrangement of photographs and control points is solved, and neither the cause of a contradiction nor
/// reliability, budgets and remarks are sought.
///
/// # Errors
/// Those of [`measure_after`].
pub fn measure_provisionally(scene: &NamedScene) -> Result<Answers, crate::Error> {
    solve_provisionally(scene).map_err(|refusal| crate::Error::request(refusal.reason))
}
