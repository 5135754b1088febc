//! Writing: uncompressed chunks with all indexes, each chunk handed on whole.

use super::RecordingError;
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// A recording being written.
pub struct Writer<W: Write + Seek> {
    inner: mcap::Writer<W>,
    sequences: BTreeMap<u16, u32>,
}

impl<W: Write + Seek> Writer<W> {
    /// Starts a recording of a profile (`ros2`, or none), in chunks of about so many bytes.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn new(to: W, profile: &str, chunk_bytes: u64) -> Result<Self, RecordingError> {
        let options = mcap::WriteOptions::new()
            .profile(profile)
            .library(concat!("resight ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .chunk_size(Some(chunk_bytes))
            // A chunk whose length is filled in later is none if the program dies in between.
            .disable_seeking(true);
        Ok(Writer { inner: options.create(to)?, sequences: BTreeMap::new() })
    }

    /// A schema; returns its number.
    ///
    /// # Errors
    /// More than the format has numbers for; also below.
    pub fn schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> Result<u16, RecordingError> {
        Ok(self.inner.add_schema(name, encoding, data)?)
    }

    /// A topic; returns its number.
    ///
    /// # Errors
    /// As `schema`.
    pub fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<u16, RecordingError> {
        Ok(self.inner.add_channel(schema, topic, encoding, metadata)?)
    }

    /// A message on a topic at a time.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn message(&mut self, channel: u16, time_ns: u64, data: &[u8]) -> Result<(), RecordingError> {
        let sequence = self.sequences.entry(channel).or_default();
        let header = MessageHeader {
            channel_id: channel,
            sequence: *sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        *sequence = sequence.wrapping_add(1);
        Ok(self.inner.write_to_known_channel(&header, data)?)
    }

    /// Named texts that belong to the whole file.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn metadata(&mut self, name: &str, texts: BTreeMap<String, String>) -> Result<(), RecordingError> {
        Ok(self.inner.write_metadata(&Metadata { name: name.to_string(), metadata: texts })?)
    }

    /// Ends the chunk and hands all on.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(self.inner.flush()?)
    }

    /// Writes the summary; returns the medium.
    ///
    /// # Errors
    /// What the medium says.
    pub fn finish(mut self) -> Result<W, RecordingError> {
        self.inner.finish()?;
        Ok(self.inner.into_inner())
    }
}
