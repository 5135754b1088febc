//! Requests to a running session to learn a camera's references again, because the camera was moved on purpose.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Pending requests. Copies share them: one belongs to the requester, one to the session.
#[derive(Debug, Clone, Default)]
pub struct Relearn(Arc<Mutex<BTreeSet<usize>>>);

impl Relearn {
    /// Requests that this camera learns its pose from its next frame on. The old reference is discarded; files that held it are kept
    /// (`Request::save_references`).
    pub fn ask(&self, camera: usize) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(camera);
    }

    /// Returns once whether it was requested for this camera.
    pub(super) fn take(&self, camera: usize) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).remove(&camera)
    }
}
