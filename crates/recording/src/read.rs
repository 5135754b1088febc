//! Reads a recording from its start to its end, record by record.

use super::RecordingError;
use super::records::{Channel, Contents, MAX_RECORD_BYTES, Message, NOT_YET, is_open};
use super::summary::summary;
use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::io::{ErrorKind, Read, Seek, SeekFrom};

/// Number of bytes read at a time: memory grows only with the bytes that exist, whatever length the file states.
const STEP_BYTES: usize = 1 << 20;
const MAGIC_BYTES: u64 = 8;
/// Opcode and length before each record.
const RECORD_HEADER_BYTES: u64 = 9;

/// The result of a read.
#[derive(Debug)]
pub enum Next {
    /// A message of a wanted topic.
    Message(Message),
    /// A record with none.
    Nothing,
    /// The file ends here without being closed: it is still being written, or was cut off.
    Unfinished,
    /// A part that cannot be used, and why; the rest continues.
    Damaged(String),
    /// The file's end.
    End,
}

/// A recording being read.
pub struct Recording<R> {
    from: R,
    reader: LinearReader,
    contents: Contents,
    /// Position of the next record in the file.
    at: u64,
    is_over: bool,
}

impl<R: Read + Seek> Recording<R> {
    /// Reads the messages of the topics that are wanted.
    pub fn new(mut from: R, is_wanted: impl Fn(&Channel) -> bool + Send + 'static) -> Self {
        let mut contents = Contents::new(Box::new(is_wanted));
        // Writers describe a channel in the first chunk and again in the summary, which is needed where the first chunk is damaged.
        summary(&mut from, &mut contents);
        contents.counts.clear();
        // If this fails, reading fails too, and reports the error.
        let _ = from.seek(SeekFrom::Start(0));
        let reader = LinearReader::new_with_options(options());
        Recording { from, reader, contents, at: MAGIC_BYTES, is_over: false }
    }

    pub(super) fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Returns the next message, or the state of the file. After `Unfinished` it may be called again.
    ///
    /// # Errors
    /// An error of the medium; a file that is not an MCAP file, or is damaged so that nothing after it can be found. Reading then ends.
    pub fn read_next(&mut self) -> Result<Next, RecordingError> {
        if let Some(message) = self.contents.waiting.pop_front() {
            return Ok(Next::Message(message));
        }
        while !self.is_over {
            match self.reader.next_event() {
                None => self.is_over = true,
                // The length is there, the sizes behind it are not yet: the writer is at them just now.
                Some(Ok(LinearReadEvent::Record { opcode: op::CHUNK, data })) if is_open(data) => {
                    return self.unfinished();
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    self.at += RECORD_HEADER_BYTES + data.len() as u64;
                    return Ok(match self.contents.take(opcode, data) {
                        Ok(()) => self.contents.waiting.pop_front().map_or(Next::Nothing, Next::Message),
                        Err(reason) => Next::Damaged(reason),
                    });
                }
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    if self.fill(wanted)? == 0 {
                        return Ok(Next::Unfinished);
                    }
                }
                Some(Err(McapError::RecordTooLarge { opcode: op::CHUNK, len: NOT_YET })) => {
                    return self.unfinished();
                }
                Some(Err(reason)) => {
                    self.is_over = true;
                    return Err(broken(&reason, self.at));
                }
            }
        }
        Ok(Next::End)
    }

    /// Handles a chunk whose length is not filled in yet: the next call reads it again.
    fn unfinished(&mut self) -> Result<Next, RecordingError> {
        self.reader = LinearReader::new_with_options(options().with_skip_start_magic(true));
        self.from.seek(SeekFrom::Start(self.at)).map_err(unread)?;
        Ok(Next::Unfinished)
    }

    fn fill(&mut self, wanted: usize) -> Result<usize, RecordingError> {
        let space = self.reader.insert(wanted.min(STEP_BYTES));
        loop {
            match self.from.read(space) {
                Ok(n) => {
                    // Told that there is nothing, the reader would never ask again.
                    if 0 < n {
                        self.reader.notify_read(n);
                    }
                    return Ok(n);
                }
                Err(reason) if reason.kind() == ErrorKind::Interrupted => {}
                Err(reason) => return Err(unread(reason)),
            }
        }
    }

    /// Reads the whole records of a chunk in which a file ends that is no longer written. Returns how the file was cut.
    ///
    /// # Errors
    /// What the medium says.
    pub fn close(&mut self) -> Result<String, RecordingError> {
        self.is_over = true;
        self.from.seek(SeekFrom::Start(self.at)).map_err(unread)?;
        let mut tail = Vec::new();
        let limit = RECORD_HEADER_BYTES + MAX_RECORD_BYTES as u64;
        self.from.by_ref().take(limit).read_to_end(&mut tail).map_err(unread)?;
        let before = self.contents.waiting.len();
        if tail.first() == Some(&op::CHUNK) && RECORD_HEADER_BYTES < tail.len() as u64 {
            // What cannot be read of a torn chunk was never whole.
            let _ = self.contents.chunk(&tail[RECORD_HEADER_BYTES as usize..], true);
        }
        let saved = self.contents.waiting.len() - before;
        let (at, bytes) = (self.at, tail.len());
        Ok(match bytes {
            0 => format!(
                "the recording was not closed: it ends at byte {at}, between two records; all before is read"
            ),
            _ => format!(
                "the recording is cut off: the record at byte {at} ends after {bytes} bytes; all before is read, and {saved} whole \
                 messages of it"
            ),
        })
    }
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(MAX_RECORD_BYTES)
}

fn unread(reason: std::io::Error) -> RecordingError {
    RecordingError(format!("cannot be read: {reason}"))
}

fn broken(reason: &McapError, at: u64) -> RecordingError {
    RecordingError(match reason {
        McapError::BadMagic if at <= MAGIC_BYTES => {
            "is no MCAP file (its first 8 bytes are others)".to_string()
        }
        other => format!(
            "is damaged at byte {at} ({other}): what is behind cannot be found; `mcap recover` may save more"
        ),
    })
}
