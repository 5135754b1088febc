//! What can go wrong at the front door, and errors of files and images: `resight_core::Error` with a path and a line.

use crate::detect::DetectError;
use crate::formats::WriteError;
use std::path::PathBuf;
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

/// What is wrong with a file, where, and what to do.
#[derive(Debug, Error)]
#[error("{}{}: {reason}", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Line, counted from 1, where one can be named.
    pub line: Option<usize>,
    /// What is wrong, what was seen, what is needed.
    pub reason: String,
}

impl FileError {
    /// With no line.
    pub fn new(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        FileError { path: path.into(), line: None, reason: reason.into() }
    }

    /// At a line, counted from 1.
    pub fn at_line(path: impl Into<PathBuf>, line: usize, reason: impl Into<String>) -> Self {
        FileError { path: path.into(), line: Some(line), reason: reason.into() }
    }
}
