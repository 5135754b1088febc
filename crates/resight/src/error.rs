//! The errors of all jobs.

use crate::detect::DetectError;
use crate::formats::WriteError;
pub use resight_formats::FileError;
use thiserror::Error;

/// Why a job could not begin. Errors with a single image are reported in its answer.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read, or has invalid contents.
    #[error(transparent)]
    File(#[from] FileError),
    /// A target that cannot be detected.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// Numbers with which the mathematics cannot work.
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
    /// A request that names something that does not exist, contradicts itself or is incomplete.
    #[error("{reason}")]
    Request {
        /// What is wrong, and what is needed.
        reason: String,
    },
}

impl Error {
    /// Builds an error from a description of what is wrong with a request.
    pub fn request(reason: impl Into<String>) -> Self {
        Error::Request { reason: reason.into() }
    }
}
