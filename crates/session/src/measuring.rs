//! Measuring in the photographs, as a separate task: it works on a copy of the session, and uses nothing of the session while it runs.

use crate::network::{self, Scene};
use resight::measure::Answers;
use std::sync::Arc;

/// A scene with its number among those of the session: what was measured belongs to the scene of that number. Scenes are not compared by their
/// values for that, of which one that is no number differs from itself.
#[derive(Debug, Clone)]
pub(crate) struct Numbered {
    pub number: u64,
    pub scene: Arc<Scene>,
}

/// A scene to be measured, and the previous one, of which unaffected answers are reused.
#[derive(Debug, Clone)]
pub struct Measuring {
    pub(crate) scene: Numbered,
    pub(crate) before: Option<Arc<Measured>>,
    pub(crate) is_provisional: bool,
}

/// A scene with what was measured in it; a sentence where that is impossible.
#[derive(Debug, Clone)]
pub struct Measured {
    pub(crate) scene: Numbered,
    pub(crate) found: Result<Answers, String>,
    /// Whether it is to be measured again, with everything that belongs to an answer.
    pub(crate) is_provisional: bool,
}

impl Measuring {
    /// Measures.
    pub fn run(self) -> Measured {
        let Measuring { scene, before, is_provisional } = self;
        let before = before.as_deref().filter(|m| !m.is_provisional);
        let before = before.and_then(|m| Some((&*m.scene.scene, m.found.as_ref().ok()?)));
        let found = match is_provisional {
            true => network::measured_provisionally(&scene.scene),
            false => network::measured_after(&scene.scene, before),
        };
        Measured { scene, found, is_provisional }
    }
}
