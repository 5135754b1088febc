//! A file from the disk or from memory to a [`Document`]: its syntax by its content, then the parser of that syntax.

use super::document::{Document, Syntax};
use super::tree::{Fault, Node, Value};
use super::{
    argoverse, colmap, kalibr_report, krtd, matlab, pose_matrix, robotcar, syntax, tf_echo, tf_launch,
};
use crate::FileError;
use crate::input::Kind;
use std::path::Path;

/// Largest text accepted where the parser allocates much more than it reads (YAML, XML).
const MAX_TEXT_BYTES: u64 = Kind::Text.limit_bytes();
/// Largest TOML: a map of a hundred tags with the covariance of all of them together.
const MAX_TOML_BYTES: u64 = Kind::Toml.limit_bytes();
/// Largest JSON, Python literal or table: PhotonVision, mrcal and COLMAP store every observation.
const MAX_LITERAL_BYTES: u64 = Kind::Literal.limit_bytes();

/// Reads at most 16 MiB (recordings: whatever they hold, in bounded memory) and parses; refuses what is not plain text before any parser sees it.
pub fn read(path: impl AsRef<Path>) -> Result<Document, FileError> {
    let path = path.as_ref();
    crate::input::must_not_block(path)?;
    #[cfg(feature = "recordings")]
    if resight_recording::is_recording(path) {
        let mut file = std::fs::File::open(path).map_err(|e| FileError::of_system(path, &e))?;
        return super::mcap::document(path, &mut file).map_err(|fault| fault.in_file(path));
    }
    let bytes = crate::input::read(path, Kind::Literal)?;
    parse(path, bytes).map_err(|fault| fault.in_file(path))
}

/// Parses bytes already in memory; `path` serves names and messages.
pub fn parse(path: &Path, bytes: Vec<u8>) -> Result<Document, Fault> {
    #[cfg(feature = "recordings")]
    if resight_recording::begins_one(&bytes) {
        return super::mcap::document(path, &mut std::io::Cursor::new(bytes));
    }
    #[cfg(not(feature = "recordings"))]
    if bytes.starts_with(b"\x89MCAP0\r\n") {
        return Err(Fault::new(
            "a recording (MCAP), which this build does not read; build with the feature `recordings` of resight-formats",
        ));
    }
    let text = plain_text(bytes)?;
    let syntax = syntax_of(&text);
    let limit = match syntax {
        Syntax::Json | Syntax::Python | Syntax::Lines => MAX_LITERAL_BYTES,
        Syntax::Toml => MAX_TOML_BYTES,
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
        Syntax::Ini if syntax::ini::is_zed(&text) => syntax::ini::parse_sections(&text)?,
        Syntax::Ini => syntax::ini::parse(&text)?,
        Syntax::Records => argoverse::parse_table(&text)?,
        Syntax::Display => matlab::parse_display(&text)?,
        Syntax::Lines | Syntax::Launch => Node { line: 1, value: Value::Null },
        #[cfg(feature = "recordings")]
        Syntax::Mcap => Node { line: 1, value: Value::Null },
    };
    Ok(Document { path: path.to_path_buf(), syntax, text, root })
}

/// By content: the first line that is neither blank nor a comment decides.
fn syntax_of(text: &str) -> Syntax {
    if colmap::is_points_table(text)
        || kalibr_report::is_report(text)
        || krtd::is_krtd(text)
        || pose_matrix::is_bare_text(text)
        || robotcar::is_model(text)
        || robotcar::is_six_numbers(text)
        || tf_echo::is_echo(text)
    {
        return Syntax::Lines;
    }
    if argoverse::is_table(text) {
        return Syntax::Records;
    }
    if matlab::is_display(text) {
        return Syntax::Display;
    }
    let significant = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let first = text.lines().map(str::trim).find(significant).unwrap_or_default();
    match first.chars().next() {
        Some('<') => Syntax::Xml,
        Some('{') => of_braces(text),
        Some('%') => Syntax::Yaml,
        // A table of TOML, or a list of JSON objects, or of rows of numbers.
        Some('[') if is_json_list(text) => Syntax::Json,
        _ if tf_launch::runs_publishers(text) => Syntax::Launch,
        Some('[') if syntax::ini::is_camera(text) || syntax::ini::is_zed(text) => Syntax::Ini,
        Some('[') => Syntax::Toml,
        _ if colmap::is_table_line(first) => Syntax::Lines,
        _ => match (first.find('='), first.find(':')) {
            (Some(equals), Some(colon)) if equals < colon => Syntax::Toml,
            (Some(_), None) => Syntax::Toml,
            _ => Syntax::Yaml,
        },
    }
}

fn is_json_list(text: &str) -> bool {
    let rest = text.trim_start()[1..].trim_start();
    let is_row = |row: &str| row.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '-');
    let inner = |rest: &str| is_row(rest.trim_start_matches(|c: char| c == '[' || c.is_whitespace()));
    rest.starts_with('{') || rest.strip_prefix('[').is_some_and(inner)
}

/// mrcal writes comments above and single quotes; JSON knows neither.
fn of_braces(text: &str) -> Syntax {
    let commented = text.trim_start().starts_with('#');
    let quote = text.split_once('{').and_then(|(_, rest)| rest.chars().find(|c| matches!(c, '\'' | '"')));
    if commented || quote == Some('\'') { Syntax::Python } else { Syntax::Json }
}

fn plain_text(bytes: Vec<u8>) -> Result<String, Fault> {
    if MAX_LITERAL_BYTES < bytes.len() as u64 {
        return Err(Fault::new("larger than 16 MiB, the limit for any calibration file"));
    }
    if let Some(what) = crate::input::what_is_it::that_is_no_text(&bytes) {
        return Err(Fault::new(what));
    }
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        let line = 1 + bytes[..at].iter().filter(|b| **b == b'\n').count();
        return Err(Fault::at(line, crate::input::NUL));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let line = 1 + e.as_bytes()[..good].iter().filter(|b| **b == b'\n').count();
        Fault::at(line, crate::input::NOT_UTF_8)
    })?;
    let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
    if text.trim().is_empty() {
        return Err(Fault::new("the file is empty; restore it from a copy or calibrate again"));
    }
    Ok(text)
}
