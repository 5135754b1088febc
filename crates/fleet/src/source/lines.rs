//! Lines of limited length.

use std::io::{Error, ErrorKind, Read};

/// Longest line, bytes.
const MOST: usize = 1 << 24;

/// Bytes of a text file; a line without an end is a read error, instead of filling the memory.
pub(super) struct Lines<R> {
    inner: R,
    since: usize,
}

impl<R: Read> Lines<R> {
    pub fn new(inner: R) -> Self {
        Lines { inner, since: 0 }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let n = self.inner.read(into)?;
        self.since = match into[..n].iter().rposition(|byte| *byte == b'\n') {
            Some(last) => n - last,
            None => self.since + n,
        };
        match self.since <= MOST {
            true => Ok(n),
            false => Err(Error::new(ErrorKind::InvalidData, "a line of more than 16 MiB; is this a table?")),
        }
    }
}
