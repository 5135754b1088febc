//! Lines that all end in the same way.

use std::io::Read;

/// A text whose lines end in `\n` alone, the last one too, whatever they end in in the file, so that counting them is counting its lines.
#[derive(Debug)]
pub(super) struct Newlines<R> {
    inner: R,
    /// A `\r` at the end of what was read, whose successor is not known yet.
    is_return_held: bool,
    last: u8,
}

impl<R: Read> Newlines<R> {
    pub fn new(inner: R) -> Self {
        Newlines { inner, is_return_held: false, last: b'\n' }
    }

    /// Lays the bytes together without each `\r` before a `\n`; of the last byte nothing is known yet.
    fn joined(&mut self, bytes: &mut [u8], is_end: bool) -> usize {
        let mut kept = 0;
        for i in 0..bytes.len() {
            let is_return = bytes[i] == b'\r';
            match bytes.get(i + 1) {
                Some(b'\n') if is_return => continue,
                None if is_return && !is_end => {
                    self.is_return_held = true;
                    continue;
                }
                _ => {}
            }
            bytes[kept] = bytes[i];
            kept += 1;
        }
        kept
    }
}

impl<R: Read> Read for Newlines<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        if into.len() < 2 {
            // A caller that reads byte by byte gets them unchanged.
            if std::mem::take(&mut self.is_return_held) && !into.is_empty() {
                into[0] = b'\r';
                return Ok(1);
            }
            return self.inner.read(into);
        }
        loop {
            let held = usize::from(std::mem::take(&mut self.is_return_held));
            into[..held].fill(b'\r');
            let n = self.inner.read(&mut into[held..])?;
            let kept = self.joined(&mut into[..held + n], n == 0);
            if n == 0 && kept == 0 && self.last != b'\n' {
                (into[0], self.last) = (b'\n', b'\n');
                return Ok(1);
            }
            if n == 0 || 0 < kept {
                self.last = if kept == 0 { self.last } else { into[kept - 1] };
                return Ok(kept);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever pieces the bytes come in.
    #[test]
    fn every_line_ends_alike() {
        struct Pieces<'a>(&'a [u8], usize);
        impl Read for Pieces<'_> {
            fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
                let n = self.1.min(self.0.len()).min(into.len());
                into[..n].copy_from_slice(&self.0[..n]);
                self.0 = &self.0[n..];
                Ok(n)
            }
        }
        for piece in 1..12 {
            for (given, expected) in [
                ("a,b\r\n1,2\r\n\r\n3,4", "a,b\n1,2\n\n3,4\n"),
                ("a\rb\r\r\nc\r", "a\rb\r\nc\r\n"),
                ("", ""),
                ("a\n", "a\n"),
            ] {
                let mut lines = Newlines::new(Pieces(given.as_bytes(), piece));
                let (mut text, mut buffer) = (Vec::new(), [0; 16]);
                while let Ok(n @ 1..) = lines.read(&mut buffer) {
                    text.extend_from_slice(&buffer[..n]);
                }
                assert_eq!(String::from_utf8_lossy(&text), expected, "in pieces of {piece}");
            }
        }
    }
}
