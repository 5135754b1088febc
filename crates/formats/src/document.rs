//! A file as a tree of values that know their line, whatever its syntax (TOML, YAML, JSON, XML, Python literal).
//!
//! Every format reads the same tree through `Entry`, so each refusal names file, line and key in one way.

use super::entry::Entry;
pub(super) use super::tree::{Fault, Node, Value};
use std::path::PathBuf;

/// How a file is written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Syntax {
    Toml,
    Yaml,
    Json,
    Python,
    Xml,
    /// ROS's INI of a camera (names on lines of their own, numbers below), or sections of `key = value`.
    Ini,
    Lines,
    /// A table with a header that names poses or lenses, as records.
    Records,
    /// What MATLAB displays of a camera.
    Display,
    /// A launch file or script that runs `static_transform_publisher`.
    Launch,
    /// A recording, of which only the intrinsics are read.
    #[cfg(feature = "recordings")]
    Mcap,
}

/// A file, read and parsed.
#[derive(Debug)]
pub(super) struct Document {
    pub path: PathBuf,
    pub syntax: Syntax,
    pub text: String,
    /// `Value::Null` for `Syntax::Lines` and `Syntax::Launch`; of a recording, its cameras by topic.
    pub root: Node,
}

impl Document {
    /// The whole file as an entry.
    pub fn entry(&self) -> Entry<'_> {
        Entry::called("", &self.root)
    }

    /// File name without its extension, for formats that do not name their camera.
    pub fn stem(&self) -> String {
        self.path.file_stem().map_or_else(|| "camera".into(), |s| s.to_string_lossy().into_owned())
    }
}
