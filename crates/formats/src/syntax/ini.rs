//! The INI of ROS 1's `camera_calibration_parsers`: a camera's name in brackets, names of fields on lines of their own, numbers below.
//!
//! Becomes the tree of the YAML that the same program writes, so that `ros` reads both. Also the INI of ZED cameras, as a table of its sections.

use crate::tree::{Fault, Node, Value, map_of};

/// What follows each name, and how many numbers; the distortion may have any number of them.
const FIELDS: [(&str, &str, usize); 6] = [
    ("width", "image_width", 1),
    ("height", "image_height", 1),
    ("camera matrix", "camera_matrix", 9),
    ("distortion", "distortion_coefficients", 0),
    ("rectification", "rectification_matrix", 9),
    ("projection", "projection_matrix", 12),
];

/// Whether a text in sections is such a file: no TOML has a line of the words "camera matrix".
pub(crate) fn is_camera(text: &str) -> bool {
    text.lines().any(|line| line.trim() == "camera matrix")
}

pub(crate) fn parse(text: &str) -> Result<Node, Fault> {
    let mut entries: Vec<(String, Node)> = Vec::new();
    let mut open: Option<(&str, usize, usize, Vec<Node>)> = None;
    for (i, line) in text.lines().enumerate() {
        let (at, line) = (i + 1, line.trim());
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let field = FIELDS.iter().find(|(name, ..)| *name == line);
        let section = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        if field.is_some() || section.is_some() {
            close(&mut entries, open.take())?;
        }
        match (field, section, &mut open) {
            (Some((_, key, count)), ..) => open = Some((key, *count, at, Vec::new())),
            (None, Some("image" | "externals"), _) => {}
            (None, Some(name), _) => entries.push(("camera_name".into(), node(at, Value::Text(name.into())))),
            (None, None, Some((.., numbers))) => {
                for word in line.split_whitespace() {
                    let x = word.parse().map_err(|_| Fault::at(at, format!("`{word}` is not a number")))?;
                    numbers.push(node(at, Value::Number(x)));
                }
            }
            (None, None, None) => {
                return Err(Fault::at(at, format!("`{line}` belongs to no field of a camera's INI file")));
            }
        }
    }
    close(&mut entries, open)?;
    let n =
        entries.iter().find(|(key, _)| key == "distortion_coefficients").map_or(0, |(_, d)| match &d.value {
            Value::List(numbers) => numbers.len(),
            _ => 0,
        });
    let model = if n <= 5 { "plumb_bob" } else { "rational_polynomial" };
    entries.push(("distortion_model".into(), node(1, Value::Text(model.into()))));
    Ok(node(1, Value::Map(entries)))
}

/// Whether a text is a calibration of a ZED: sections of a side and a resolution.
pub(crate) fn is_zed(text: &str) -> bool {
    let begins =
        |line: &str, prefix: &str| line.get(..prefix.len()).is_some_and(|l| l.eq_ignore_ascii_case(prefix));
    text.lines().map(str::trim).any(|line| begins(line, "[LEFT_CAM_") || begins(line, "[RIGHT_CAM_"))
}

/// Name, line and entries.
type Section = (String, usize, Vec<(String, Node)>);

/// Sections of `key = value`: a table of tables. Numbers are numbers, everything else is text.
pub(crate) fn parse_sections(text: &str) -> Result<Node, Fault> {
    let mut sections: Vec<Section> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let (at, line) = (i + 1, line.trim());
        if line.is_empty() || line.starts_with(['#', ';']) {
            continue;
        }
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            sections.push((name.trim().to_owned(), at, Vec::new()));
            continue;
        }
        match (sections.last_mut(), line.split_once('=')) {
            (Some((.., entries)), Some((key, value))) => {
                let value = value.trim();
                let value = value.parse().map_or_else(|_| Value::Text(value.to_owned()), Value::Number);
                entries.push((key.trim().to_owned(), node(at, value)));
            }
            _ => {
                let short: String = line.chars().take(40).collect();
                return Err(Fault::at(
                    at,
                    format!("`{short}` is neither a [section] nor `key = value` in one"),
                ));
            }
        }
    }
    let table = |(name, at, entries)| Ok((name, map_of(at, entries)?));
    map_of(1, sections.into_iter().map(table).collect::<Result<Vec<_>, Fault>>()?)
}

fn close(
    entries: &mut Vec<(String, Node)>,
    field: Option<(&str, usize, usize, Vec<Node>)>,
) -> Result<(), Fault> {
    let Some((key, count, line, mut numbers)) = field else { return Ok(()) };
    if entries.iter().any(|(known, _)| known == key) {
        return Err(Fault::at(
            line,
            format!("{key} is there twice: a file of several cameras; give one a file"),
        ));
    }
    if count != 0 && numbers.len() != count {
        return Err(Fault::at(line, format!("{key}: {} numbers; {count} are needed", numbers.len())));
    }
    let value = match (count, numbers.pop()) {
        (1, Some(only)) => only.value,
        (_, last) => Value::List(numbers.into_iter().chain(last).collect()),
    };
    entries.push((key.into(), node(line, value)));
    Ok(())
}

fn node(line: usize, value: Value) -> Node {
    Node { line, value }
}
