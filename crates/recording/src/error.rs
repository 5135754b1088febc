//! Why a recording cannot be read or written.

/// Why a recording cannot be read or written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RecordingError(pub String);

impl From<mcap::McapError> for RecordingError {
    fn from(error: mcap::McapError) -> Self {
        RecordingError(match error {
            mcap::McapError::Io(reason) => reason.to_string(),
            other => other.to_string(),
        })
    }
}
