//! Writes uncompressed chunks with all indexes, each chunk in one piece.

use super::RecordingError;
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Opcode, length, channel, sequence and two times before each message.
const MESSAGE_HEAD_BYTES: u64 = 9 + 22;

/// A recording being written.
pub struct Writer<W: Write + Seek> {
    inner: mcap::Writer<W>,
    sequences: BTreeMap<u16, u32>,
    chunk_bytes: u64,
    /// Chunks that were ended, and bytes of messages in the one that is open.
    ended: u64,
    open_bytes: u64,
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
        let inner = options.create(to)?;
        Ok(Writer { inner, sequences: BTreeMap::new(), chunk_bytes, ended: 0, open_bytes: 0 })
    }

    /// A schema; returns its number.
    ///
    /// # Errors
    /// More than the format has numbers for; also below.
    pub fn schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> Result<u16, RecordingError> {
        Ok(self.inner.add_schema(name, encoding, data)?)
    }

    /// Adds a topic; returns its number.
    ///
    /// # Errors
    /// The errors of `schema`.
    pub fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<u16, RecordingError> {
        Ok(self.inner.add_channel(schema, topic, encoding, metadata)?)
    }

    /// Writes a message on a topic at a time.
    ///
    /// # Errors
    /// An error of the medium; so also below.
    pub fn message(&mut self, channel: u16, time_ns: u64, data: &[u8]) -> Result<(), RecordingError> {
        let sequence = self.sequences.entry(channel).or_default();
        let header = MessageHeader {
            channel_id: channel,
            sequence: *sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        *sequence = sequence.wrapping_add(1);
        self.inner.write_to_known_channel(&header, data)?;
        self.open_bytes += MESSAGE_HEAD_BYTES + data.len() as u64;
        if self.chunk_bytes < self.open_bytes {
            self.count_chunk();
        }
        Ok(())
    }

    /// Writes named texts that apply to the whole file.
    ///
    /// # Errors
    /// An error of the medium; so also below.
    pub fn metadata(&mut self, name: &str, texts: BTreeMap<String, String>) -> Result<(), RecordingError> {
        Ok(self.inner.write_metadata(&Metadata { name: name.to_string(), metadata: texts })?)
    }

    /// Ends the chunk and hands all on.
    ///
    /// # Errors
    /// What the medium says; also below.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.inner.flush()?;
        self.count_chunk();
        Ok(())
    }

    fn count_chunk(&mut self) {
        self.ended += u64::from(0 < self.open_bytes);
        self.open_bytes = 0;
    }

    /// Returns the approximate number of chunks. Each needs about 250 bytes of memory until `finish`, where the index of all is written: callers
    /// that flush for ever should start a new file from time to time.
    pub fn chunks(&self) -> u64 {
        self.ended
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Next, Recording};
    use std::io::Cursor;

    /// As many as the file holds: by flushes, by size, and none for a flush of nothing.
    #[test]
    fn chunks_are_counted() {
        let mut out = Writer::new(Cursor::new(Vec::new()), "", 1000).expect("a recording");
        let schema = out.schema("x", "ros2msg", b"").expect("a schema");
        let channel = out.channel(schema, "/x", "cdr", &BTreeMap::new()).expect("a topic");
        for i in 0..20 {
            out.message(channel, i, &[0; 300]).expect("written");
            if i < 5 {
                out.flush().expect("flushed");
                out.flush().expect("flushed");
            }
        }
        out.flush().expect("flushed");
        let counted = out.chunks();
        let bytes = out.finish().expect("closed").into_inner();
        let summary = mcap::Summary::read(&bytes).expect("a summary").expect("one");
        assert_eq!(counted, summary.chunk_indexes.len() as u64);
        assert!(7 < counted && counted < 20, "{counted}");
        let mut recording = Recording::new(Cursor::new(&bytes), |_| true);
        let mut n = 0;
        while let Ok(next) = recording.read_next() {
            match next {
                Next::Message(_) => n += 1,
                Next::End => break,
                _ => {}
            }
        }
        assert_eq!(n, 20);
    }
}
