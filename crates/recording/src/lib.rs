//! Recordings: reads MCAP files message by message, whatever their size, and writes them; reads the messages of ROS in them without ROS.
//!
//! This is a separate crate because the chunks of recordings are compressed by C libraries (zstd, lz4): programs that only read calibration
//! files do not build these. Observations of a camera are extracted from messages where images and detectors are (`resight-watch`).
//!
//! Write a recording, and read it back:
//!
//! ```
//! use resight_recording::{Next, Recording, Writer, topics};
//! use std::collections::BTreeMap;
//! use std::io::Cursor;
//!
//! # fn main() -> Result<(), resight_recording::RecordingError> {
//! let mut file = Writer::new(Cursor::new(Vec::new()), "", 1 << 16)?;
//! let schema = file.schema("note", "jsonschema", b"{}")?;
//! let channel = file.channel(schema, "/notes", "json", &BTreeMap::new())?;
//! file.message(channel, 1_000_000_000, br#"{"text": "the rig was moved"}"#)?;
//! let mut bytes = Cursor::new(file.finish()?.into_inner());
//!
//! assert_eq!(topics(&mut bytes)?[0].messages, 1);
//! let mut recording = Recording::new(bytes, |channel| channel.topic == "/notes");
//! let mut notes = Vec::new();
//! loop {
//!     match recording.read_next()? {
//!         Next::Message(message) => notes.push(message),
//!         Next::End => break,
//!         _ => {} // A record without a message.
//!     }
//! }
//! assert_eq!((notes.len(), notes[0].log_time_ns), (1, 1_000_000_000));
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod ros;
mod error;
mod records;
mod summary;
mod read;
mod topics;
mod write;

pub use error::RecordingError;
pub use read::{Next, Recording};
pub use records::{Channel, Message};
pub use topics::{Topic, topics};
pub use write::Writer;

use std::path::Path;

/// Returns whether a file begins like an MCAP file.
pub fn is_recording(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    use std::io::Read;
    let mut head = [0; 8];
    std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok() && begins_one(&head)
}

/// Returns whether bytes begin like an MCAP file.
pub fn begins_one(bytes: &[u8]) -> bool {
    bytes.starts_with(mcap::MAGIC)
}
