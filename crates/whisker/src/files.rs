//! Text into rows and rows into text; the caller owns disks and pipes.
//!
//! One file per kind: the whisker (meta.json), hub readings, contacts, truth, objects and paths. CSV and JSON Lines carry the same
//! keys. Everything foreign (units, force frames, signs, spellings) becomes SI, hub axes and ours while it is read, never later.

pub mod units;
pub mod line;
pub mod node;
pub mod object;
pub mod calibration;
pub mod hub;
pub mod whisker;
pub mod contacts;
pub mod six_axis;
pub mod truth;
pub mod score;
pub mod identification;

pub use contacts::ContactRow;
pub use hub::{HubFormat, HubRow, read_hub};
pub use whisker::WhiskerFile;

use thiserror::Error;

/// What is wrong with a text: the place, what was seen, what is needed.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}{message}", line.map(|line| format!("line {line}: ")).unwrap_or_default())]
pub struct TextError {
    /// Line, counted from 1; none where it concerns the whole text.
    pub line: Option<u64>,
    /// The sentence.
    pub message: String,
}

impl TextError {
    /// About one line.
    pub fn at(line: u64, message: impl Into<String>) -> Self {
        TextError { line: Some(line), message: message.into() }
    }

    /// About the whole text.
    pub fn whole(message: impl Into<String>) -> Self {
        TextError { line: None, message: message.into() }
    }
}

/// At most this many letters of a foreign cell are quoted back.
const QUOTED: usize = 40;

/// A cell's text, short enough for a message.
fn quoted(text: &str) -> String {
    match text.chars().count() {
        n if n <= QUOTED => format!("`{text}`"),
        _ => format!("`{}…`", text.chars().take(QUOTED).collect::<String>()),
    }
}
