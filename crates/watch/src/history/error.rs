//! Why a history cannot be read or written, and whether a retry may succeed.

use rusqlite::ErrorCode;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a history cannot be read or written.
#[derive(Debug, Error)]
pub enum HistoryError {
    /// The disk is full, slow or failing, or another program holds the file: the same may work later.
    #[error("{}: {reason}", path.display())]
    NotNow {
        /// The file.
        path: PathBuf,
        /// The message of SQLite.
        reason: String,
    },
    /// The file or folder does not exist, or must not be written.
    #[error("{}: {reason}; give a file in a folder that exists and can be written", path.display())]
    NoAccess {
        /// The file.
        path: PathBuf,
        /// The message of SQLite.
        reason: String,
    },
    /// The file is damaged, or no database.
    #[error("{}: the history is damaged ({reason})", path.display())]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// The message of SQLite.
        reason: String,
    },
    /// A database of another program.
    #[error("{}: a database, but no history of Resight; give another file", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Written by a later version.
    #[error("{}: schema version {seen}, this program knows {known}; use the newer program or another file", path.display())]
    Newer {
        /// The file.
        path: PathBuf,
        /// The version of the file.
        seen: i64,
        /// The last one known here.
        known: i64,
    },
}

impl HistoryError {
    /// Returns whether a retry may succeed later, without any change to this file.
    pub fn may_pass(&self) -> bool {
        matches!(self, HistoryError::NotNow { .. })
    }

    /// Converts an error of SQLite for a file.
    pub(super) fn of(path: &Path, error: &rusqlite::Error) -> Self {
        let (path, reason) = (path.to_path_buf(), error.to_string());
        match error.sqlite_error_code() {
            Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => {
                HistoryError::Corrupt { path, reason }
            }
            Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly | ErrorCode::PermissionDenied) => {
                HistoryError::NoAccess { path, reason }
            }
            _ => HistoryError::NotNow { path, reason },
        }
    }
}
