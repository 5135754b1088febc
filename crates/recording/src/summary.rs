//! The summary at the end of a recording: its channels and how many messages each has.

use super::records::{Contents, MAX_RECORD_BYTES};
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::io::{Read, Seek, SeekFrom};

/// The footer's record and the magic behind it.
const FOOTER_BYTES: i64 = 9 + 20 + 8;
/// A longer summary is read as if there were none: from the messages.
const MAX_SUMMARY_BYTES: u64 = 64 << 20;

/// Adds what the summary says of channels and counts; false, and nothing added, where there is none that can be read.
pub(super) fn summary<R: Read + Seek>(from: &mut R, contents: &mut Contents) -> bool {
    let is_read = summary_bytes(from).and_then(|bytes| fill(&bytes, contents)).is_some();
    if !is_read {
        contents.forget();
    }
    is_read
}

fn summary_bytes<R: Read + Seek>(from: &mut R) -> Option<Vec<u8>> {
    let end = from.seek(SeekFrom::End(-FOOTER_BYTES)).ok()?;
    let mut footer = [0; FOOTER_BYTES as usize];
    from.read_exact(&mut footer).ok()?;
    if footer[0] != op::FOOTER || !footer.ends_with(mcap::MAGIC) {
        return None;
    }
    let start = u64::from_le_bytes(footer[9..17].try_into().ok()?);
    let length = end.checked_sub(start).filter(|n| start != 0 && *n <= MAX_SUMMARY_BYTES)?;
    from.seek(SeekFrom::Start(start)).ok()?;
    let mut bytes = Vec::new();
    from.by_ref().take(length).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

fn fill(mut summary: &[u8], contents: &mut Contents) -> Option<()> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_emit_chunks(true)
        .with_record_length_limit(MAX_RECORD_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::Record { opcode: op::CHUNK | op::MESSAGE, .. } => return None,
            LinearReadEvent::Record { opcode, data } => contents.take(opcode, data).ok()?,
            LinearReadEvent::ReadRequest(wanted) => {
                let n = wanted.min(summary.len());
                let (now, later) = summary.split_at(n);
                reader.insert(n).copy_from_slice(now);
                reader.notify_read(n);
                summary = later;
            }
        }
    }
    Some(())
}
