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
}

/// A scene with what was measured in it; a sentence where that is impossible.
#[derive(Debug, Clone)]
pub struct Measured {
    pub(crate) scene: Numbered,
    pub(crate) found: Result<Answers, String>,
}

impl Measuring {
    /// Measures.
    pub fn run(self) -> Measured {
        let before = self.before.as_deref().and_then(|m| Some((&*m.scene.scene, m.found.as_ref().ok()?)));
        let found = network::measured_after(&self.scene.scene, before);
        Measured { scene: self.scene, found }
    }
}
