//! Known points with names.

use resight_core::Correspondence;

/// A known point and its observation, with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoint {
    /// Its name: an id, or a number.
    pub name: String,
    /// Its line in the file from which it was read.
    pub line: Option<u64>,
    /// Point, pixel and their standard deviations.
    pub seen: Correspondence,
}

impl NamedPoint {
    pub(super) fn label(&self) -> String {
        match self.line {
            Some(line) => format!("{} (line {line})", self.name),
            None => self.name.clone(),
        }
    }
}
