//! The tags of the first image of a TIFF or BigTIFF file, without its pixels: files of many gigabytes are read by a few hundred bytes.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Entries that a list, and numbers that a value, may have.
const MOST_ENTRIES: u64 = 4096;
const MOST_NUMBERS: u64 = 65_536;
/// Types of values.
const SHORT: u16 = 3;
const LONG: u16 = 4;
const DOUBLE: u16 = 12;
const LONG8: u16 = 16;

/// The list of the first image.
pub struct TiffTags {
    file: File,
    is_little_endian: bool,
    entries: Vec<Entry>,
}

struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    /// The value, or where it is.
    value: Vec<u8>,
}

impl TiffTags {
    /// Reads the list; `None` for a file that is no TIFF.
    ///
    /// # Errors
    /// A file that ends early or has more entries than any image.
    pub fn read(mut file: File) -> std::io::Result<Option<Self>> {
        let mut head = Vec::new();
        (&mut file).take(16).read_to_end(&mut head)?;
        // In a BigTIFF offsets and counts have eight bytes.
        let (is_little_endian, is_big) = match head.get(..4) {
            Some(b"II*\0") => (true, false),
            Some(b"MM\0*") => (false, false),
            Some(b"II+\0") => (true, true),
            Some(b"MM\0+") => (false, true),
            _ => return Ok(None),
        };
        let mut tags = TiffTags { file, is_little_endian, entries: Vec::new() };
        let first = if is_big { head.get(8..16) } else { head.get(4..8) };
        let first = first.map(|bytes| tags.whole(bytes)).ok_or_else(damaged)?;
        tags.file.seek(SeekFrom::Start(first))?;
        let (count_bytes, entry_bytes) = if is_big { (8, 20) } else { (2, 12) };
        let count = tags.bytes(count_bytes)?;
        let count = tags.whole(&count);
        if MOST_ENTRIES < count {
            return Err(damaged());
        }
        for _ in 0..count {
            let entry = tags.bytes(entry_bytes)?;
            let [tag, kind] = [&entry[..2], &entry[2..4]].map(|bytes| tags.whole(bytes) as u16);
            let (count, value) = entry[4..].split_at(if is_big { 8 } else { 4 });
            tags.entries.push(Entry { tag, kind, count: tags.whole(count), value: value.to_vec() });
        }
        Ok(Some(tags))
    }

    /// Returns the numbers of a tag; `None` where it is not there.
    ///
    /// # Errors
    /// A value outside the file, of another type than numbers, or longer than any of a map.
    pub fn numbers(&mut self, tag: u16) -> std::io::Result<Option<Vec<f64>>> {
        let Some(entry) = self.entries.iter().find(|entry| entry.tag == tag) else { return Ok(None) };
        let (kind, count) = (entry.kind, entry.count);
        let size = match kind {
            SHORT => 2,
            LONG => 4,
            DOUBLE | LONG8 => 8,
            _ => return Err(damaged()),
        };
        if MOST_NUMBERS < count {
            return Err(damaged());
        }
        let n_bytes = count as usize * size;
        let value = entry.value.clone();
        let bytes = match value.get(..n_bytes) {
            Some(inline) => inline.to_vec(),
            None => {
                self.file.seek(SeekFrom::Start(self.whole(&value)))?;
                self.bytes(n_bytes)?
            }
        };
        let number = |bytes: &[u8]| match kind {
            DOUBLE => f64::from_bits(self.whole(bytes)),
            _ => self.whole(bytes) as f64,
        };
        Ok(Some(bytes.chunks_exact(size).map(number).collect()))
    }

    fn bytes(&mut self, n: usize) -> std::io::Result<Vec<u8>> {
        let mut bytes = vec![0; n];
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// A whole number of up to eight bytes.
    fn whole(&self, bytes: &[u8]) -> u64 {
        let joined = |all: u64, byte: &u8| (all << 8) | u64::from(*byte);
        match self.is_little_endian {
            true => bytes.iter().rev().fold(0, joined),
            false => bytes.iter().fold(0, joined),
        }
    }
}

fn damaged() -> std::io::Error {
    std::io::Error::new(std::io::ErrorKind::InvalidData, "its list of tags is damaged")
}
