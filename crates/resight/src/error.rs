//! What can go wrong at the front door.

use crate::detect::DetectError;
use crate::formats::WriteError;
pub use resight_formats::FileError;
use thiserror::Error;

/// Why a job could not begin. What goes wrong with a single image is in its answer.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read, or says what cannot be.
    #[error(transparent)]
    File(#[from] FileError),
    /// A target that cannot be detected.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// Numbers that no mathematics can be done with.
    #[error(transparent)]
    Math(#[from] resight_core::Error),
    /// Cameras that a file format cannot hold.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Standard deviations that do not fit the camera.
    #[error("{reason}")]
    Intrinsics {
        /// What is wrong, and what is needed.
        reason: String,
    },
    /// A request that names what is not there, contradicts itself or lacks something.
    #[error("{reason}")]
    Request {
        /// What is wrong, and what is needed.
        reason: String,
    },
}

impl Error {
    /// What is wrong with a request.
    pub fn request(reason: impl Into<String>) -> Self {
        Error::Request { reason: reason.into() }
    }
}
