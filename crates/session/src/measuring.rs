//! What is measured in the photographs, as a task of its own: it takes the session as it was and nothing of it while it runs.

use crate::network::{self, Scene};
use resight::measure::Answers;
use std::sync::Arc;

/// A scene to be measured, and the one measured before, of which what nothing touched is taken over.
#[derive(Debug, Clone)]
pub struct Measuring {
    pub(crate) scene: Arc<Scene>,
    pub(crate) before: Option<Arc<Measured>>,
}

/// A scene with what was measured in it; a sentence where that is impossible.
#[derive(Debug, Clone)]
pub struct Measured {
    pub(crate) scene: Scene,
    pub(crate) found: Result<Answers, String>,
}

impl Measuring {
    /// Measures.
    pub fn run(self) -> Measured {
        let before = self.before.as_deref().and_then(|m| Some((&m.scene, m.found.as_ref().ok()?)));
        let found = network::measured_after(&self.scene, before);
        Measured { scene: Arc::unwrap_or_clone(self.scene), found }
    }
}
