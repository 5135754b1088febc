//! What keeps a fleet from being worked on: said once, before or instead of an answer. What is wrong with a row is in its status.

use arrow_schema::ArrowError;
use parquet::errors::ParquetError;
use resight::FileError;
use std::path::Path;
use thiserror::Error;

/// What is wrong with a file, a table or a setting as a whole.
#[derive(Debug, Error)]
pub enum FleetError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Columns that are missing, or hold something else than numbers; what there is, what is needed.
    #[error("{0}")]
    Columns(String),
    /// A setting that cannot be.
    #[error("{0}")]
    Setting(String),
    /// The caller stopped the work.
    #[error("stopped; the same job continues where this one was")]
    Stopped,
}

impl FleetError {
    /// A reason with the path of its file.
    pub fn at(path: &Path, reason: impl Into<String>) -> Self {
        FleetError::File(FileError::new(path, reason))
    }

    /// What Parquet says of a file.
    pub fn parquet(path: &Path, reason: &ParquetError) -> Self {
        FleetError::at(path, format!("{reason}; write the file again, or leave it out"))
    }
}

impl From<ArrowError> for FleetError {
    fn from(reason: ArrowError) -> Self {
        FleetError::Columns(reason.to_string())
    }
}
