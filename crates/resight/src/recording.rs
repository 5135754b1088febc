//! Recordings: MCAP files, read message by message whatever their size, and written.

mod records;
mod read;
mod topics;
mod write;

pub use read::{Next, Recording};
pub use records::{Channel, Message};
pub use topics::{Topic, topics};
pub use write::Writer;

use std::path::Path;

/// Longest record or chunk accepted, bytes: 64 Mpx of four channels.
const MAX_RECORD_BYTES: usize = 4 * 64_000_000 + (1 << 20);

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

/// Whether a file begins as MCAP files do.
pub fn is_recording(path: &Path) -> bool {
    use std::io::Read;
    let mut head = [0; 8];
    std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok() && begins_one(&head)
}

/// Whether bytes begin as those of MCAP files do.
pub fn begins_one(bytes: &[u8]) -> bool {
    bytes.starts_with(mcap::MAGIC)
}
