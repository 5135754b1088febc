//! MCAP, the container of timed messages: its uncompressed subset, with the indexes that make a file seekable.
//!
//! Format: mcap.dev/spec. Magic, header, chunks each followed by its message indexes, end of data; then the summary (schemas and
//! channels again, statistics, chunk indexes), where each group of it starts, footer, magic.

use std::collections::BTreeMap;

const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', b'0', b'\r', b'\n'];
/// A reader holds one chunk in memory at a time.
const CHUNK_BYTES: usize = 1 << 18;

const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const METADATA: u8 = 0x0c;
const METADATA_INDEX: u8 = 0x0d;
const SUMMARY_OFFSET: u8 = 0x0e;
const DATA_END: u8 = 0x0f;

/// A file being written. Messages must come in order of time.
#[derive(Debug)]
pub(super) struct Writer {
    file: Vec<u8>,
    schemas: Vec<Vec<u8>>,
    channels: Vec<Vec<u8>>,
    chunk: Chunk,
    chunk_indexes: Vec<Vec<u8>>,
    metadata_indexes: Vec<Vec<u8>>,
    messages_of: BTreeMap<u16, u64>,
    times_ns: Option<(u64, u64)>,
}

#[derive(Debug, Default)]
struct Chunk {
    records: Vec<u8>,
    times_ns: Option<(u64, u64)>,
    entries: BTreeMap<u16, Vec<(u64, u64)>>,
}

impl Writer {
    /// Starts a file; `library` says who wrote it.
    pub fn new(library: &str) -> Self {
        let mut file = MAGIC.to_vec();
        file.extend(record(HEADER, Content::new().text("").text(library)));
        Writer {
            file,
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk: Chunk::default(),
            chunk_indexes: Vec::new(),
            metadata_indexes: Vec::new(),
            messages_of: BTreeMap::new(),
            times_ns: None,
        }
    }

    /// A Protocol Buffers schema by its full name and its `FileDescriptorSet`; returns its number.
    pub fn schema(&mut self, name: &str, descriptor_set: &[u8]) -> u16 {
        let id = self.schemas.len() as u16 + 1;
        let content = Content::new().u16(id).text(name).text("protobuf").sized(descriptor_set);
        self.schemas.push(record(SCHEMA, content));
        self.chunk.records.extend(&self.schemas[id as usize - 1]);
        id
    }

    /// A topic whose messages follow a schema; returns its number.
    pub fn channel(&mut self, schema: u16, topic: &str) -> u16 {
        let id = self.channels.len() as u16;
        let content = Content::new().u16(id).u16(schema).text(topic).text("protobuf").sized(&[]);
        self.channels.push(record(CHANNEL, content));
        self.chunk.records.extend(&self.channels[id as usize]);
        id
    }

    /// A message on a topic at a time.
    pub fn message(&mut self, channel: u16, time_ns: u64, data: &[u8]) {
        let count = self.messages_of.entry(channel).or_default();
        let content = Content::new().u16(channel).u32(*count as u32).u64(time_ns).u64(time_ns).raw(data);
        *count += 1;
        let offset = self.chunk.records.len() as u64;
        self.chunk.entries.entry(channel).or_default().push((time_ns, offset));
        self.chunk.records.extend(record(MESSAGE, content));
        self.chunk.times_ns = Some(widened(self.chunk.times_ns, time_ns));
        self.times_ns = Some(widened(self.times_ns, time_ns));
        if CHUNK_BYTES < self.chunk.records.len() {
            self.end_chunk();
        }
    }

    /// Named texts that belong to the whole file.
    pub fn metadata(&mut self, name: &str, texts: &[(String, String)]) {
        self.end_chunk();
        let map = texts.iter().fold(Content::new(), |map, (key, value)| map.text(key).text(value));
        let offset = self.file.len() as u64;
        let metadata = record(METADATA, Content::new().text(name).sized(&map.bytes));
        let index = Content::new().u64(offset).u64(metadata.len() as u64).text(name);
        self.metadata_indexes.push(record(METADATA_INDEX, index));
        self.file.extend(metadata);
    }

    fn end_chunk(&mut self) {
        let chunk = std::mem::take(&mut self.chunk);
        if chunk.records.is_empty() {
            return;
        }
        let (from_ns, to_ns) = chunk.times_ns.unwrap_or_default();
        let size = chunk.records.len() as u64;
        let start = self.file.len() as u64;
        let content = Content::new().u64(from_ns).u64(to_ns).u64(size).u32(crc32(&chunk.records)).text("");
        self.file.extend(record(CHUNK, content.u64(size).raw(&chunk.records)));
        let indexes_at = self.file.len() as u64;
        let offsets = self.message_indexes(&chunk.entries);
        let indexes_length = self.file.len() as u64 - indexes_at;
        let index =
            Content::new().u64(from_ns).u64(to_ns).u64(start).u64(indexes_at - start).sized(&offsets.bytes);
        let index = index.u64(indexes_length).text("").u64(size).u64(size);
        self.chunk_indexes.push(record(CHUNK_INDEX, index));
    }

    /// Writes one index a channel; returns where each lies.
    fn message_indexes(&mut self, entries: &BTreeMap<u16, Vec<(u64, u64)>>) -> Content {
        entries.iter().fold(Content::new(), |offsets, (&channel, entries)| {
            let list =
                entries.iter().fold(Content::new(), |list, (time, offset)| list.u64(*time).u64(*offset));
            let offsets = offsets.u16(channel).u64(self.file.len() as u64);
            self.file.extend(record(MESSAGE_INDEX, Content::new().u16(channel).sized(&list.bytes)));
            offsets
        })
    }

    /// The whole file.
    pub fn finish(mut self) -> Vec<u8> {
        self.end_chunk();
        let end = Content::new().u32(crc32(&self.file));
        self.file.extend(record(DATA_END, end));
        let summary_start = self.file.len();
        let statistics = vec![self.statistics()];
        let groups = [
            (SCHEMA, &self.schemas),
            (CHANNEL, &self.channels),
            (STATISTICS, &statistics),
            (CHUNK_INDEX, &self.chunk_indexes),
            (METADATA_INDEX, &self.metadata_indexes),
        ];
        let mut offsets = Vec::new();
        for (opcode, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            let start = self.file.len() as u64;
            self.file.extend(records.concat());
            let content = Content::new().u8(opcode).u64(start).u64(self.file.len() as u64 - start);
            offsets.extend(record(SUMMARY_OFFSET, content));
        }
        let offsets_start = self.file.len();
        self.file.extend(offsets);
        self.footer(summary_start, offsets_start);
        self.file
    }

    fn statistics(&self) -> Vec<u8> {
        let (from_ns, to_ns) = self.times_ns.unwrap_or_default();
        let counts = self.messages_of.iter().fold(Content::new(), |map, (&id, &n)| map.u16(id).u64(n));
        let content = Content::new()
            .u64(self.messages_of.values().sum())
            .u16(self.schemas.len() as u16)
            .u32(self.channels.len() as u32)
            .u32(0)
            .u32(self.metadata_indexes.len() as u32)
            .u32(self.chunk_indexes.len() as u32)
            .u64(from_ns)
            .u64(to_ns)
            .sized(&counts.bytes);
        record(STATISTICS, content)
    }

    /// The checksum covers the summary and the footer up to itself.
    fn footer(&mut self, summary_start: usize, offsets_start: usize) {
        let content = Content::new().u64(summary_start as u64).u64(offsets_start as u64).u32(0);
        self.file.extend(record(FOOTER, content));
        self.file.truncate(self.file.len() - 4);
        let crc = crc32(&self.file[summary_start..]);
        self.file.extend(crc.to_le_bytes());
        self.file.extend(MAGIC);
    }
}

fn widened(times_ns: Option<(u64, u64)>, time_ns: u64) -> (u64, u64) {
    let (from, to) = times_ns.unwrap_or((time_ns, time_ns));
    (from.min(time_ns), to.max(time_ns))
}

fn record(opcode: u8, content: Content) -> Vec<u8> {
    let mut bytes = vec![opcode];
    bytes.extend((content.bytes.len() as u64).to_le_bytes());
    bytes.extend(content.bytes);
    bytes
}

/// The fields of a record, little end first.
#[derive(Debug, Default)]
struct Content {
    bytes: Vec<u8>,
}

impl Content {
    fn new() -> Self {
        Content::default()
    }

    fn raw(mut self, bytes: &[u8]) -> Self {
        self.bytes.extend(bytes);
        self
    }

    fn u8(self, value: u8) -> Self {
        self.raw(&[value])
    }

    fn u16(self, value: u16) -> Self {
        self.raw(&value.to_le_bytes())
    }

    fn u32(self, value: u32) -> Self {
        self.raw(&value.to_le_bytes())
    }

    fn u64(self, value: u64) -> Self {
        self.raw(&value.to_le_bytes())
    }

    /// Length in four bytes, then the bytes: how arrays and maps are written.
    fn sized(self, bytes: &[u8]) -> Self {
        self.u32(bytes.len() as u32).raw(bytes)
    }

    fn text(self, text: &str) -> Self {
        self.sized(text.as_bytes())
    }
}

/// CRC-32 of ISO-HDLC (zlib's), a byte at a time.
fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = crc_table();
    !bytes.iter().fold(!0, |crc, byte| TABLE[((crc ^ u32::from(*byte)) & 0xff) as usize] ^ crc >> 8)
}

const fn crc_table() -> [u32; 256] {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let (mut crc, mut bit) = (i as u32, 0);
        while bit < 8 {
            crc = if crc & 1 == 1 { 0xedb8_8320 ^ crc >> 1 } else { crc >> 1 };
            bit += 1;
        }
        table[i] = crc;
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of the catalogue of CRCs: "123456789" gives cbf43926.
    #[test]
    fn checksum_has_the_catalogue_s_check_value() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn magic_at_both_ends_and_an_empty_file_is_one() {
        let file = Writer::new("x").finish();
        assert!(file.starts_with(&MAGIC) && file.ends_with(&MAGIC));
    }
}
