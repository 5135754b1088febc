//! The references of cameras before their session begins.

use super::look::{CameraWatcher, CameraWatcherError};
use super::{LiveCamera, LiveConfig, StateFile};
use resight_core::temporal::monitor::Reference;

/// Returns the reference for each target, where it is known when the session begins: from the camera's settings, or from the state of an earlier
/// session that is continued.
///
/// # Errors
/// A camera that cannot be watched.
pub fn references(
    camera: &LiveCamera,
    config: &LiveConfig,
    state: Option<&StateFile>,
) -> Result<Vec<Option<Reference>>, CameraWatcherError> {
    let mut look = CameraWatcher::new(camera, config)?;
    let own = state.filter(|_| config.rig.is_none());
    if let Some(record) = own.and_then(|state| state.of(&camera.name)) {
        look.restore(&record, |_, _| ()); // Why a state is not gone on from, the session says.
    }
    Ok(look.references().collect())
}
