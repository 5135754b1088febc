//! The files that users hand in: how large each kind may be, checked before a byte is read, and nothing that is no file.
//!
//! A header, an empty disk or a slip of the hand may claim any size; memory is taken only for what could be meant. Named pipes and
//! devices are refused, because opening one may block for ever. Pipes that the shell has opened (`/dev/stdin`, `<(…)`) are read.

mod nearest;
mod newlines;
pub mod table;
mod toml_reason;
pub mod what_is_it;

pub use nearest::{nearest, not_among};
pub use toml_reason::{in_metres, toml_reason};

use crate::FileError;
use newlines::Newlines;
use std::fs::File;
use std::io::{Cursor, Error, ErrorKind, Read};
use std::path::Path;

/// What a file is read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A PNG or JPEG image.
    Image,
    /// A configuration in YAML or XML, whose parsers take many times what they read.
    Text,
    /// A configuration in TOML: a map of a hundred tags with the covariance of all of them together.
    Toml,
    /// JSON, a Python literal or a table of numbers read whole: calibrations that store every observation.
    Literal,
    /// A table that is read row by row.
    Table,
    /// Results of this program, JSON Lines, read whole.
    Results,
    /// A scene of `resight measure` (TOML): thousands of points.
    Scene,
    /// A session that the page of `resight serve` saved: a scene beside its photographs, whose files take a third more as text.
    Session,
    /// The state of a session.
    State,
    /// A password, a token, a certificate.
    Secret,
}

impl Kind {
    /// Every kind, as documented.
    pub const ALL: [Kind; 10] = [
        Kind::Image,
        Kind::Text,
        Kind::Toml,
        Kind::Literal,
        Kind::Table,
        Kind::Results,
        Kind::Scene,
        Kind::Session,
        Kind::State,
        Kind::Secret,
    ];

    /// Most bytes of such a file.
    pub const fn limit_bytes(self) -> u64 {
        match self {
            Kind::Image => 96 << 20,
            Kind::Text => 1 << 20,
            Kind::Toml => 4 << 20,
            Kind::Literal => 16 << 20,
            Kind::Table => 512 << 20,
            Kind::Results => 128 << 20,
            Kind::Scene => 4 << 20,
            Kind::Session => Kind::Image.limit_bytes() / 3 * 4 + (16 << 20),
            Kind::State => 64 << 20,
            Kind::Secret => 1 << 20,
        }
    }

    /// What such a file is called in a message.
    const fn name(self) -> &'static str {
        match self {
            Kind::Image => "an image",
            Kind::Text => "a file of this kind (YAML, XML)",
            Kind::Toml => "a TOML file",
            Kind::Literal => "a file of this kind (JSON, a table)",
            Kind::Table => "a table of rows",
            Kind::Results => "a file of results",
            Kind::Scene => "a scene",
            Kind::Session => "a saved session",
            Kind::State => "the state of a session",
            Kind::Secret => "a secret or certificate",
        }
    }

    const fn way_out(self) -> &'static str {
        match self {
            Kind::Image => "save it with more compression or fewer pixels",
            Kind::Table | Kind::Results => "split it",
            _ => "check that it is the file you mean",
        }
    }

    /// Refuses what is larger than such a file may be.
    ///
    /// # Errors
    /// More bytes than [`Kind::limit_bytes`].
    pub fn must_hold(self, path: &Path, bytes: usize) -> Result<(), FileError> {
        match bytes as u64 <= self.limit_bytes() {
            true => Ok(()),
            false => Err(FileError::new(path, self.too_large(Some(bytes as u64)))),
        }
    }

    fn too_large(self, seen: Option<u64>) -> String {
        let mib = |bytes: u64| format!("{} MiB", bytes.div_ceil(1 << 20));
        let most = mib(self.limit_bytes());
        match seen {
            Some(bytes) => {
                format!("has {}; {} has at most {most}, {}", mib(bytes), self.name(), self.way_out())
            }
            None => format!("larger than {most}, the limit for {}; {}", self.name(), self.way_out()),
        }
    }
}

/// The bytes of a file.
///
/// # Errors
/// No such file, a folder, a named pipe or a device, more bytes than the kind allows (nothing has been read then), a disk that fails.
pub fn read(path: impl AsRef<Path>, kind: Kind) -> Result<Vec<u8>, FileError> {
    let path = path.as_ref();
    let file = open_file(path, kind)?;
    let mut bytes = Vec::new();
    let reported = |e: Error| FileError::of_system(path, &e);
    file.take(kind.limit_bytes() + 1).read_to_end(&mut bytes).map_err(reported)?;
    if kind.limit_bytes() < bytes.len() as u64 {
        return Err(FileError::new(path, kind.too_large(None)));
    }
    Ok(bytes)
}

/// What is wrong with a text in another encoding, and the way out.
pub(crate) const NOT_UTF_8: &str = "not UTF-8 text; save the file as UTF-8";
/// What is wrong with a text that holds a zero byte, and the way out.
pub(crate) const NUL: &str = "a NUL byte: a binary or damaged file, or UTF-16 text; save the file as UTF-8";

/// The text of a file.
///
/// # Errors
/// As of [`read`]; bytes that are no UTF-8.
pub fn read_text(path: impl AsRef<Path>, kind: Kind) -> Result<String, FileError> {
    let path = path.as_ref();
    let bytes = read(path, kind)?;
    match what_is_it::that_is_no_text(&bytes) {
        Some(what) => Err(FileError::new(path, what)),
        None => String::from_utf8(bytes).map_err(|_| FileError::new(path, NOT_UTF_8)),
    }
}

/// A table to be read row by row, in bounded memory: a line that does not end is an error of reading.
///
/// # Errors
/// As of [`read`], without those of the disk.
pub fn open_table(path: impl AsRef<Path>) -> Result<Rows, FileError> {
    let path = path.as_ref();
    let file = open_file(path, Kind::Table)?;
    Ok(Rows::new(Source::File(file)))
}

/// A table in memory, as [`open_table`] opens one of a disk.
fn rows_of_bytes(bytes: &[u8]) -> Rows {
    Rows::new(Source::Memory(Cursor::new(bytes.to_vec())))
}

/// Opens what is a file, or was opened by the shell, and is not too large.
fn open_file(path: &Path, kind: Kind) -> Result<File, FileError> {
    let reported = |e: Error| FileError::of_system(path, &e);
    let found = std::fs::metadata(path).map_err(reported)?;
    must_be_file(path, &found)?;
    let mut file = File::open(path).map_err(reported)?;
    if found.is_file() && kind.limit_bytes() < found.len() {
        let mut head = [0; what_is_it::HEAD_BYTES];
        let n = file.read(&mut head).map_err(reported)?;
        // A film of gigabytes is a film first.
        let other = what_is_it::that_is_no_text(&head[..n]).filter(|_| kind != Kind::Image);
        return Err(FileError::new(path, other.unwrap_or_else(|| kind.too_large(Some(found.len())))));
    }
    Ok(file)
}

/// Refuses named pipes, sockets and devices. Folders and missing files are left to the code that opens them.
///
/// # Errors
/// What it is, and what to give instead.
pub fn must_not_block(path: &Path) -> Result<(), FileError> {
    std::fs::metadata(path).map_or(Ok(()), |found| must_be_file(path, &found))
}

fn must_be_file(path: &Path, found: &std::fs::Metadata) -> Result<(), FileError> {
    if found.is_file() || found.is_dir() || is_opened_by_shell(path) {
        return Ok(());
    }
    let reason = "is a named pipe, a socket or a device; give a file, or pipe into /dev/stdin";
    Err(FileError::new(path, reason))
}

/// Returns whether a path names a file that is open already, so that opening it again does not block.
fn is_opened_by_shell(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd") || path.starts_with("/proc/self/fd")
}

/// A file that ends in time, with lines that do, each of them in `\n`.
#[derive(Debug)]
pub struct Rows(Newlines<Bounded>);

impl Rows {
    fn new(source: Source) -> Self {
        let left = Kind::Table.limit_bytes();
        Rows(Newlines::new(Bounded { source, left, line: 0, is_begun: false }))
    }
}

/// Where a table is.
#[derive(Debug)]
enum Source {
    File(File),
    Memory(Cursor<Vec<u8>>),
}

impl Read for Source {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Source::File(file) => file.read(into),
            Source::Memory(bytes) => bytes.read(into),
        }
    }
}

impl Read for Rows {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(into)
    }
}

/// A file that ends in time, with lines that do.
#[derive(Debug)]
struct Bounded {
    source: Source,
    left: u64,
    line: usize,
    is_begun: bool,
}

/// Longest line of a table, bytes.
const MAX_LINE_BYTES: usize = 1 << 20;

impl Read for Bounded {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let n = self.source.read(into)?;
        if !std::mem::replace(&mut self.is_begun, true)
            && let Some(what) = what_is_it::that_is_no_text(&into[..n])
                .or_else(|| into[..n].contains(&0).then(|| NUL.to_owned()))
        {
            return Err(Error::new(ErrorKind::InvalidData, what));
        }
        self.left = match self.left.checked_sub(n as u64) {
            Some(left) => left,
            None => return Err(Error::new(ErrorKind::InvalidData, Kind::Table.too_large(None))),
        };
        for part in into[..n].split_inclusive(|byte| *byte == b'\n') {
            self.line += part.len();
            if MAX_LINE_BYTES < self.line {
                return Err(Error::new(
                    ErrorKind::InvalidData,
                    "a line of more than 1 MiB; this is no table",
                ));
            }
            if part.ends_with(b"\n") {
                self.line = 0;
            }
        }
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sparse(name: &str, bytes: u64) -> std::path::PathBuf {
        let path = std::env::temp_dir().join(format!("resight-input-{}-{name}", std::process::id()));
        File::create(&path).and_then(|file| file.set_len(bytes)).expect("a sparse file");
        path
    }

    #[test]
    fn a_file_beyond_its_limit_is_refused_unread() {
        for kind in Kind::ALL {
            let path = sparse(&format!("{kind:?}"), kind.limit_bytes() + 1);
            let began = std::time::Instant::now();
            let error = read(&path, kind).expect_err("too large").to_string();
            assert!(began.elapsed().as_millis() < 500, "{kind:?}: {:?}", began.elapsed());
            assert!(error.contains("MiB") && error.contains("at most"), "{error}");
            std::fs::remove_file(&path).expect("removed");
        }
    }

    #[test]
    fn rows_without_an_end_are_no_table() {
        let path = sparse("rows", 0);
        std::fs::write(&path, vec![b'1'; MAX_LINE_BYTES + 1]).expect("written");
        let error = std::io::copy(&mut open_table(&path).expect("not too large"), &mut std::io::sink());
        assert!(error.expect_err("one line").to_string().contains("no table"));
        std::fs::remove_file(&path).expect("removed");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_at_once() {
        let pipe = std::env::temp_dir().join(format!("resight-input-{}-pipe", std::process::id()));
        let _ = std::fs::remove_file(&pipe);
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
        assert!(made.success());
        for path in [pipe.as_path(), Path::new("/dev/zero"), Path::new("/dev/tty")] {
            if !path.exists() {
                continue;
            }
            let error = read(path, Kind::Text).expect_err("no file").to_string();
            assert!(error.contains("pipe"), "{error}");
        }
        std::fs::remove_file(&pipe).expect("removed");
    }
}
