//! A file as a tree of values that know their line, whatever its syntax (TOML, YAML, JSON, XML, Python literal).
//!
//! Every format reads the same tree through `Entry`, so each refusal names file, line and key in one way.

use super::entry::Entry;
use super::{colmap, mcap, syntax, tf_launch};
use crate::FileError;
use crate::input::Kind;
use std::path::{Path, PathBuf};

/// Deepest nesting accepted; calibration files need about eight.
pub(super) const MAX_DEPTH: usize = 48;
/// Largest text accepted where the parser allocates much more than it reads (YAML, TOML, XML).
const MAX_TEXT_BYTES: u64 = Kind::Text.limit_bytes();
/// Largest JSON, Python literal or table: PhotonVision, mrcal and COLMAP store every observation.
const MAX_LITERAL_BYTES: u64 = Kind::Literal.limit_bytes();

/// What is wrong, and on which line (from 1); the path is added when it leaves the module.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub line: Option<usize>,
    pub reason: String,
}

impl Fault {
    pub fn new(reason: impl Into<String>) -> Self {
        Fault { line: None, reason: reason.into() }
    }

    pub fn at(line: usize, reason: impl Into<String>) -> Self {
        Fault { line: (0 < line).then_some(line), reason: reason.into() }
    }

    pub fn in_file(self, path: &Path) -> FileError {
        FileError { path: path.to_path_buf(), line: self.line, reason: self.reason }
    }
}

/// How a file is written down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Syntax {
    Toml,
    Yaml,
    Json,
    Python,
    Xml,
    Lines,
    /// A launch file or script that runs `static_transform_publisher`.
    Launch,
    /// A recording, of which only the intrinsics are read.
    Mcap,
}

impl Syntax {
    /// By content: the first line that is neither blank nor a comment decides.
    pub fn of(text: &str) -> Self {
        if colmap::is_points_table(text) {
            return Syntax::Lines;
        }
        let significant = |line: &&str| !line.is_empty() && !line.starts_with('#');
        let first = text.lines().map(str::trim).find(significant).unwrap_or_default();
        match first.chars().next() {
            Some('<') => Syntax::Xml,
            Some('{') => Syntax::of_braces(text),
            Some('%') => Syntax::Yaml,
            // A table of TOML, or a list of JSON objects.
            Some('[') if text.trim_start()[1..].trim_start().starts_with('{') => Syntax::Json,
            _ if tf_launch::runs_publishers(text) => Syntax::Launch,
            Some('[') => Syntax::Toml,
            _ if colmap::is_table_line(first) => Syntax::Lines,
            _ => match (first.find('='), first.find(':')) {
                (Some(equals), Some(colon)) if equals < colon => Syntax::Toml,
                (Some(_), None) => Syntax::Toml,
                _ => Syntax::Yaml,
            },
        }
    }

    /// mrcal writes comments above and single quotes; JSON knows neither.
    fn of_braces(text: &str) -> Self {
        let commented = text.trim_start().starts_with('#');
        let quote = text.split_once('{').and_then(|(_, rest)| rest.chars().find(|c| matches!(c, '\'' | '"')));
        if commented || quote == Some('\'') { Syntax::Python } else { Syntax::Json }
    }
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
    /// Reads at most 16 MiB (recordings: whatever they hold, in bounded memory) and parses; refuses what is not plain text before any parser sees it.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        crate::input::must_not_block(path)?;
        if crate::recording::is_recording(path) {
            let mut file = std::fs::File::open(path).map_err(|e| FileError::new(path, e.to_string()))?;
            return mcap::document(path, &mut file).map_err(|fault| fault.in_file(path));
        }
        let bytes = crate::input::read(path, Kind::Literal)?;
        Document::parse(path, bytes).map_err(|fault| fault.in_file(path))
    }

    /// Parses bytes already in memory; `path` serves names and messages.
    pub fn parse(path: &Path, bytes: Vec<u8>) -> Result<Self, Fault> {
        if crate::recording::begins_one(&bytes) {
            return mcap::document(path, &mut std::io::Cursor::new(bytes));
        }
        let text = plain_text(bytes)?;
        let syntax = Syntax::of(&text);
        let limit = match syntax {
            Syntax::Json | Syntax::Python | Syntax::Lines => MAX_LITERAL_BYTES,
            _ => MAX_TEXT_BYTES,
        };
        if limit < text.len() as u64 {
            let mib = limit >> 20;
            return Err(Fault::new(format!("larger than {mib} MiB, the limit for this kind of file")));
        }
        let root = match syntax {
            Syntax::Toml => syntax::toml::parse(&text)?,
            Syntax::Yaml => syntax::yaml::parse(&text)?,
            Syntax::Json => syntax::literal::parse_json(&text)?,
            Syntax::Python => syntax::literal::parse_python(&text)?,
            Syntax::Xml => syntax::xml::parse(&text)?,
            Syntax::Lines | Syntax::Launch | Syntax::Mcap => Node { line: 1, value: Value::Null },
        };
        Ok(Document { path: path.to_path_buf(), syntax, text, root })
    }

    /// The whole file as an entry.
    pub fn entry(&self) -> Entry<'_> {
        Entry { path: String::new(), node: &self.root }
    }

    /// File name without its extension, for formats that do not name their camera.
    pub fn stem(&self) -> String {
        self.path.file_stem().map_or_else(|| "camera".into(), |s| s.to_string_lossy().into_owned())
    }
}

fn plain_text(bytes: Vec<u8>) -> Result<String, Fault> {
    if MAX_LITERAL_BYTES < bytes.len() as u64 {
        return Err(Fault::new("larger than 16 MiB, the limit for any calibration file"));
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(Fault::at(1, "UTF-16 text; save the file as UTF-8"));
    }
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        let line = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
        return Err(Fault::at(
            line,
            "a NUL byte: a binary or damaged file, or UTF-16 text; save the file as UTF-8",
        ));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..good].iter().filter(|b| **b == b'\n').count();
        Fault::at(line, "not UTF-8 text; save the file as UTF-8")
    })?;
    let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
    if text.trim().is_empty() {
        return Err(Fault::new("the file is empty; restore it from a copy or calibrate again"));
    }
    Ok(text)
}

/// A value and the line of its key (or its own, in a list), from 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub line: usize,
    pub value: Value,
}

/// What a node holds; maps keep the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

impl Node {
    pub fn get(&self, key: &str) -> Option<&Node> {
        match &self.value {
            Value::Map(entries) => entries.iter().find(|(k, _)| k == key).map(|(_, node)| node),
            _ => None,
        }
    }
}

impl Value {
    pub fn kind(&self) -> &'static str {
        match self {
            Value::Null => "nothing",
            Value::Bool(_) => "true or false",
            Value::Number(_) => "a number",
            Value::Text(_) => "text",
            Value::List(_) => "a list",
            Value::Map(_) => "a table of keys",
        }
    }
}

/// A map from its entries; refuses a key given twice, naming both lines.
pub(super) fn map_of(line: usize, entries: Vec<(String, Node)>) -> Result<Node, Fault> {
    let mut seen = std::collections::HashMap::new();
    for (key, node) in &entries {
        if let Some(first) = seen.insert(key.as_str(), node.line) {
            return Err(Fault::at(
                node.line,
                format!("{key}: given twice (first on line {first}); remove one"),
            ));
        }
    }
    Ok(Node { line, value: Value::Map(entries) })
}
