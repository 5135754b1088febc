//! The job: a scene in, every question answered.

use super::Answers;
use super::answers::{Refusal, solve};
use super::scene::NamedScene;
use crate::answer::MeasureAnswer;

/// Every query of a scene with its answer. The answer's status states what cannot be solved.
///
/// # Errors
/// A scene that is wrong in itself: no length, an impossible camera or statement.
pub fn measure(scene: &NamedScene) -> Result<MeasureAnswer, crate::Error> {
    measure_after(scene, None)
}

/// The same after another scene was measured: an answer that depends on nothing in which the scenes differ is taken over. What is answered is what
/// [`measure`] answers.
///
/// # Errors
/// As of [`measure`].
pub fn measure_after(
    scene: &NamedScene,
    before: Option<(&NamedScene, &Answers)>,
) -> Result<MeasureAnswer, crate::Error> {
    match solve(scene, before) {
        Ok(answers) => Ok(MeasureAnswer::solved(scene, answers)),
        Err(Refusal { status: Some(status), reason }) => Ok(MeasureAnswer::refused(scene, status, &reason)),
        Err(Refusal { status: None, reason }) => Err(crate::Error::request(reason)),
    }
}
