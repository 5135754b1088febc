//! The records of an MCAP file that matter here (mcap.dev/spec): schemas, channels, messages, and the chunks that hold them.
//!
//! The crate `mcap` frames records and unpacks chunks; these four kinds are taken apart here. Its own parser slices attachments
//! without looking at their length, and a record that claims more than its chunk would count below zero: each chunk is therefore
//! unpacked alone, by a reader that is given nothing else.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Longest record or chunk accepted, bytes: 64 Mpx of four channels.
pub(super) const MAX_RECORD_BYTES: usize = 4 * 64_000_000 + (1 << 20);

/// A topic as the recording has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Name of the topic.
    pub topic: String,
    /// Name of the type of its messages; empty where it is not reported.
    pub kind: String,
    /// The format of the definition: `ros2msg`, `protobuf`, …
    pub definition_encoding: String,
    /// The definition of the type.
    pub definition: Vec<u8>,
    /// The encoding of the messages: `cdr`, `ros1`, `json`, …
    pub message_encoding: String,
}

/// A message of a topic that is wanted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// The channel of the message.
    pub channel: Arc<Channel>,
    /// When it was recorded, nanoseconds.
    pub log_time_ns: u64,
    /// The bytes of the message.
    pub data: Vec<u8>,
}

struct Schema {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

/// The data read so far.
pub(super) struct Contents {
    is_wanted: Box<dyn Fn(&Channel) -> bool + Send>,
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, (Arc<Channel>, bool)>,
    /// Messages by the number of their channel, wanted or not.
    pub counts: BTreeMap<u16, u64>,
    /// Messages that are wanted and were not given yet: at most a chunk of them.
    pub waiting: VecDeque<Message>,
}

impl Contents {
    pub fn new(is_wanted: Box<dyn Fn(&Channel) -> bool + Send>) -> Self {
        let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
        Contents { is_wanted, schemas, channels, counts: BTreeMap::new(), waiting: VecDeque::new() }
    }

    /// Resets to the state at the start.
    pub fn forget(&mut self) {
        self.schemas.clear();
        self.channels.clear();
        self.counts.clear();
        self.waiting.clear();
    }

    pub fn channels(&self) -> impl Iterator<Item = (u16, &Arc<Channel>)> {
        self.channels.iter().map(|(id, (channel, _))| (*id, channel))
    }

    /// A record of the file.
    pub fn take(&mut self, opcode: u8, record: &[u8]) -> Result<(), String> {
        match opcode {
            op::CHUNK => self.chunk(record, false),
            _ => self.small(opcode, record),
        }
    }

    /// A record that holds no others.
    fn small(&mut self, opcode: u8, record: &[u8]) -> Result<(), String> {
        let mut fields = Fields(record);
        match opcode {
            op::SCHEMA => {
                let id = fields.u16()?;
                let (name, encoding) = (fields.text()?, fields.text()?);
                let length = fields.u32()?;
                let data = fields.take(length as usize)?.to_vec();
                self.schemas.insert(id, Schema { name, encoding, data });
            }
            op::CHANNEL => self.channel(&mut fields)?,
            op::MESSAGE => {
                let (id, _sequence, log_time_ns, _published_ns) =
                    (fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?);
                *self.counts.entry(id).or_default() += 1;
                if let Some((channel, true)) = self.channels.get(&id) {
                    let (channel, data) = (Arc::clone(channel), fields.0.to_vec());
                    self.waiting.push_back(Message { channel, log_time_ns, data });
                }
            }
            op::STATISTICS => {
                fields.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8)?;
                let mut pairs = Fields(fields.sized()?);
                while !pairs.0.is_empty() {
                    let (id, count) = (pairs.u16()?, pairs.u64()?);
                    self.counts.insert(id, count);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn channel(&mut self, fields: &mut Fields<'_>) -> Result<(), String> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        if self.channels.contains_key(&id) {
            return Ok(()); // Chunks repeat it.
        }
        let (topic, message_encoding) = (fields.text()?, fields.text()?);
        let (kind, definition_encoding, definition) = match self.schemas.get(&schema) {
            Some(schema) => (schema.name.clone(), schema.encoding.clone(), schema.data.clone()),
            None => (String::new(), String::new(), Vec::new()),
        };
        let channel = Channel { topic, kind, definition_encoding, definition, message_encoding };
        let is_wanted = (self.is_wanted)(&channel);
        self.channels.insert(id, (Arc::new(channel), is_wanted));
        Ok(())
    }

    /// Decodes all messages of a chunk, or none where its checksum is wrong. Of a truncated one (`is_torn`: the file ends in it), which has no
    /// checksum yet and perhaps no sizes, it decodes the complete ones.
    pub fn chunk(&mut self, chunk: &[u8], is_torn: bool) -> Result<(), String> {
        let ChunkHead { compressed, uncompressed, records } = ChunkHead::read(chunk)?;
        let there = records.len() as u64;
        let is_open = is_torn && is_open(chunk);
        let is_short = compressed != there && !is_torn;
        if !is_open && (is_short || MAX_RECORD_BYTES as u64 <= uncompressed) {
            return Err(format!(
                "a chunk of {compressed} bytes, {uncompressed} unpacked, where {there} are; at most {MAX_RECORD_BYTES} are read"
            ));
        }
        let mut head = chunk[..chunk.len() - records.len()].to_vec();
        if is_open {
            ChunkHead::fill(&mut head, there);
        }
        // What the record claims, so that a torn one is read as far as it goes; never more than it claims: the reader counts down.
        let compressed = if is_open { there } else { compressed };
        let records = &records[..compressed.min(there) as usize];
        let length = (head.len() as u64).saturating_add(compressed).to_le_bytes();
        let start = [&[op::CHUNK][..], &length, &head].concat();
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(!is_torn)
            .with_record_length_limit(MAX_RECORD_BYTES);
        self.unpack(LinearReader::new_with_options(options), [&start, records], is_torn)
    }

    fn unpack(&mut self, mut reader: LinearReader, parts: [&[u8]; 2], is_torn: bool) -> Result<(), String> {
        let mut parts = parts.into_iter();
        let mut rest: &[u8] = &[];
        loop {
            match reader.next_event() {
                None => return Ok(()),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    if rest.is_empty() {
                        rest = parts.next().unwrap_or_default();
                    }
                    let (now, later) = rest.split_at(wanted.min(rest.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    rest = later;
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => self.small(opcode, data)?,
                Some(Err(McapError::UnexpectedEof)) if is_torn => return Ok(()),
                Some(Err(reason)) => return Err(format!("a damaged chunk: {reason}")),
            }
        }
    }
}

/// The fields before the records of a chunk: two times of 8 bytes, the uncompressed size (8), a checksum (4), the name of the compression, the
/// compressed size (8).
struct ChunkHead<'a> {
    compressed: u64,
    uncompressed: u64,
    records: &'a [u8],
}

/// The value that some writers (the crate `mcap` by default) store for the length and the sizes of a chunk until it is complete.
pub(super) const NOT_YET: u64 = u64::MAX;

impl<'a> ChunkHead<'a> {
    fn read(chunk: &'a [u8]) -> Result<Self, String> {
        let mut fields = Fields(chunk);
        fields.take(8 + 8)?;
        let (uncompressed, _crc) = (fields.u64()?, fields.u32()?);
        fields.text()?;
        let compressed = fields.u64()?;
        Ok(ChunkHead { compressed, uncompressed, records: fields.0 })
    }

    /// Replaces sizes that are not stored yet: by the number of bytes in the file, and by the largest number that is read.
    fn fill(head: &mut [u8], there: u64) {
        let at = head.len() - 8;
        head[16..24].copy_from_slice(&(MAX_RECORD_BYTES as u64 - 1).to_le_bytes());
        head[at..].copy_from_slice(&there.to_le_bytes());
    }
}

/// Returns whether a chunk is still being written, so that its sizes are not stored yet.
pub(super) fn is_open(chunk: &[u8]) -> bool {
    ChunkHead::read(chunk).is_ok_and(|head| head.compressed == NOT_YET || head.uncompressed == NOT_YET)
}

/// The fields of a record, little end first.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let left = self.0.len();
        let (taken, rest) = self
            .0
            .split_at_checked(n)
            .ok_or_else(|| format!("a record with {left} bytes where {n} are needed"))?;
        self.0 = rest;
        Ok(taken)
    }

    fn number(&mut self, n: usize) -> Result<u64, String> {
        Ok(self.take(n)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    fn u16(&mut self) -> Result<u16, String> {
        Ok(self.number(2)? as u16)
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(self.number(4)? as u32)
    }

    fn u64(&mut self) -> Result<u64, String> {
        self.number(8)
    }

    fn sized(&mut self) -> Result<&'a [u8], String> {
        let length = self.u32()?;
        self.take(length as usize)
    }

    fn text(&mut self) -> Result<String, String> {
        Ok(String::from_utf8_lossy(self.sized()?).into_owned())
    }
}
