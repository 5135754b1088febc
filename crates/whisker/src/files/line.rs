//! One line of text as cells: CSV under a header, or a JSON object. Line by line, so that a stream can be answered at once.

use super::{TextError, quoted};
use serde_json::Value;

/// How the lines of a text are written.
#[derive(Debug, Clone, PartialEq)]
pub enum Layout {
    /// Cells under a header.
    Csv {
        /// Between cells: comma, semicolon or tab.
        separator: u8,
        /// Names of the columns, trimmed.
        header: Vec<String>,
    },
    /// One JSON object a line.
    JsonLines,
}

impl Layout {
    /// Told by the first line that says something: an object begins with a brace, anything else is a header.
    ///
    /// # Errors
    /// A header with a name twice, or with numbers instead of names.
    pub fn of_first_line(line: u64, text: &str) -> Result<Self, TextError> {
        if text.trim_start().starts_with('{') {
            return Ok(Layout::JsonLines);
        }
        let separator = [b',', b';', b'\t'].into_iter().max_by_key(|s| (count(text, *s), *s == b','));
        let separator = separator.unwrap_or(b',');
        let header = cells(line, text, separator)?;
        if let Some(number) = header.iter().find(|name| name.parse::<f64>().is_ok()) {
            return Err(TextError::at(
                line,
                format!(
                    "the header is missing: {} is a number where a column's name is needed",
                    quoted(number)
                ),
            ));
        }
        let is_duplicate = |(i, name): &(usize, &String)| !name.is_empty() && header[..*i].contains(name);
        if let Some((_, name)) = header.iter().enumerate().find(is_duplicate) {
            return Err(TextError::at(line, format!("column {} appears twice", quoted(name))));
        }
        Ok(Layout::Csv { separator, header })
    }
}

fn count(text: &str, separator: u8) -> usize {
    text.bytes().filter(|b| *b == separator).count()
}

/// A number with a decimal comma as one with a point; other cells as they are.
fn with_point(cell: String) -> String {
    let point = cell.replacen(',', ".", 1);
    if point.parse::<f64>().is_ok() { point } else { cell }
}

/// Whether a line says nothing: blank, or a comment.
pub fn is_silent(text: &str) -> bool {
    let text = text.trim();
    text.is_empty() || text.starts_with('#')
}

/// The lines of a text with their numbers, without those that say nothing.
pub fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    let text = text.trim_start_matches('\u{feff}');
    (1..).zip(text.lines()).filter(|(_, line)| !is_silent(line))
}

/// Cuts a line at its separators; quotes as in RFC 4180.
pub fn cells(line: u64, text: &str, separator: u8) -> Result<Vec<String>, TextError> {
    let text = text.trim_end_matches(['\r', '\n']);
    if !text.contains('"') {
        return Ok(text.split(char::from(separator)).map(|cell| cell.trim().to_string()).collect());
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    match reader.records().next() {
        Some(Ok(record)) => Ok(record.iter().map(str::to_string).collect()),
        Some(Err(reason)) => Err(TextError::at(line, reason.to_string())),
        None => Ok(Vec::new()),
    }
}

/// A line's cells, addressed by column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// In the order of the header.
    Row(Vec<String>),
    /// By key.
    Object(serde_json::Map<String, Value>),
}

/// Reads a line in its layout.
///
/// # Errors
/// A torn row, or what JSON says.
pub fn read(layout: &Layout, line: u64, text: &str) -> Result<Cells, TextError> {
    match layout {
        Layout::Csv { separator, header } => {
            let row = cells(line, text, *separator)?;
            match row.len() == header.len() {
                true if *separator != b',' => Ok(Cells::Row(row.into_iter().map(with_point).collect())),
                true => Ok(Cells::Row(row)),
                false => Err(TextError::at(
                    line,
                    format!("{} cells where the header has {}", row.len(), header.len()),
                )),
            }
        }
        Layout::JsonLines => match serde_json::from_str(text) {
            Ok(Value::Object(object)) => Ok(Cells::Object(object)),
            Ok(other) => {
                Err(TextError::at(line, format!("{} is no JSON object", quoted(&other.to_string()))))
            }
            Err(reason) => Err(TextError::at(line, format!("no JSON object: {reason}"))),
        },
    }
}

/// A cell's number: `Ok(None)` where it is missing (empty, null, NaN, NA, -).
pub fn number(cells: &Cells, line: u64, column: usize, name: &str) -> Result<Option<f64>, TextError> {
    let text = match cells {
        Cells::Row(row) => row.get(column).map_or("", String::as_str),
        Cells::Object(object) => match object.get(name) {
            None | Some(Value::Null) => return Ok(None),
            Some(Value::Number(number)) => return finite(number.as_f64(), &number.to_string(), line, name),
            Some(Value::String(text)) => text.trim(),
            Some(other) => return finite(None, &other.to_string(), line, name),
        },
    };
    match text.to_ascii_lowercase().as_str() {
        "" | "nan" | "na" | "n/a" | "null" | "none" | "-" => Ok(None),
        _ => finite(text.parse().ok(), text, line, name),
    }
}

fn finite(value: Option<f64>, seen: &str, line: u64, name: &str) -> Result<Option<f64>, TextError> {
    match value {
        Some(value) if value.is_finite() => Ok(Some(value)),
        Some(_) => Err(TextError::at(
            line,
            format!("column `{name}` is {}; a finite number is needed", quoted(seen)),
        )),
        None => {
            let hint = if seen.contains(',') { " (write numbers with a point)" } else { "" };
            Err(TextError::at(
                line,
                format!("column `{name}` is {}, which is not a number{hint}", quoted(seen)),
            ))
        }
    }
}

/// A cell's text; none where it is empty.
pub fn text<'a>(cells: &'a Cells, column: usize, name: &str) -> Option<&'a str> {
    match cells {
        Cells::Row(row) => row.get(column).map(String::as_str).filter(|text| !text.is_empty()),
        Cells::Object(object) => object.get(name).and_then(Value::as_str),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_between_semicolons_may_have_decimal_commas() {
        let of = |header: &str, row: &str| {
            let layout = Layout::of_first_line(1, header)?;
            let cells = read(&layout, 2, row)?;
            Ok::<_, TextError>((number(&cells, 2, 1, "fx")?, text(&cells, 0, "sweep").map(str::to_owned)))
        };
        assert_eq!(of("sweep;fx", "a,b;-0,5"), Ok((Some(-0.5), Some("a,b".to_owned()))));
        assert_eq!(of("sweep\tfx", "a\t1,5e-3"), Ok((Some(1.5e-3), Some("a".to_owned()))));
        assert!(of("sweep;fx", "a;1.234,5").is_err() && of("sweep,fx", "a,0,5").is_err());
    }
}
