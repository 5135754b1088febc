//! What is wrong with a file: a reason with a path and a line.

use std::path::PathBuf;
use thiserror::Error;

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
