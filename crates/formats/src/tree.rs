//! Values that know their line, whatever the syntax of their file, and what is wrong with one.

use crate::FileError;
use std::path::Path;

/// Deepest nesting accepted; calibration files need about eight.
pub(super) const MAX_DEPTH: usize = 48;

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
