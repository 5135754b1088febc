//! Why a session cannot begin, or ended early.

use crate::live::CameraWatcherError;
use resight::FileError;

/// Why a session cannot begin, or ended early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A camera that cannot be watched.
    #[error("camera {name}")]
    Camera {
        /// Index of the camera.
        camera: usize,
        /// Its name.
        name: String,
        /// The reason.
        source: CameraWatcherError,
    },
    /// A camera that cannot be watched, found at the start of the session.
    #[error(transparent)]
    CameraWatcher(#[from] CameraWatcherError),
    /// A file of the session.
    #[error(transparent)]
    File(#[from] FileError),
    /// The receiver of the events failed.
    #[error(transparent)]
    Listener(#[from] std::io::Error),
    /// An output: an address, a file, a port, a terminal that cannot be used.
    #[error(transparent)]
    Output(#[from] anyhow::Error),
}
