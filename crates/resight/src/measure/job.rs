//! The job: a scene in, every question answered.

use super::answers::{Refusal, solve};
use super::scene::NamedScene;
use crate::answer::MeasureAnswer;

/// Every query of a scene with its answer. The answer's status states what cannot be solved.
///
/// # Errors
/// A scene that is wrong in itself: no length, an impossible camera or statement.
pub fn measure(scene: &NamedScene) -> Result<MeasureAnswer, crate::Error> {
    match solve(scene) {
        Ok(answers) => Ok(MeasureAnswer::solved(scene, answers)),
        Err(Refusal { status: Some(status), reason }) => Ok(MeasureAnswer::refused(scene, status, &reason)),
        Err(Refusal { status: None, reason }) => Err(crate::Error::request(reason)),
    }
}
