//! Asks a session that runs to learn a camera's references anew: the camera was put somewhere else on purpose.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Requests that are not done yet. Copies share them: one stays with the requester, one goes with the session.
#[derive(Debug, Clone, Default)]
pub struct Relearn(Arc<Mutex<BTreeSet<usize>>>);

impl Relearn {
    /// From its next frame on this camera learns where it is. What it was compared with is forgotten; files that held it are kept
    /// (`Request::save_references`).
    pub fn ask(&self, camera: usize) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(camera);
    }

    /// Whether it was asked of this camera; once.
    pub(super) fn take(&self, camera: usize) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&camera)
    }
}
