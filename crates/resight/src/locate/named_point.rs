//! Known points with the names that people give them.

use resight_core::Correspondence;

/// A known point and where it was seen, as a person calls it.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoint {
    /// Its name: an id, or a number.
    pub name: String,
    /// The line of the file that it stands in, where it comes from one.
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
