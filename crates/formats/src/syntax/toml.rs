//! TOML, through the `toml` crate; tables come back in the order of the file.

use crate::tree::{Fault, Node, Value};
use ::toml::Spanned;
use ::toml::de::{DeTable, DeValue};

/// The tree of a TOML text.
pub(crate) fn parse(text: &str) -> Result<Node, Fault> {
    let lines = LineStarts::of(text);
    let table = DeTable::parse(text).map_err(|e| {
        let (line, reason) = crate::input::toml_reason(text, &e);
        Fault::at(line.unwrap_or(0), format!("not valid TOML: {reason}"))
    })?;
    table_node(table.get_ref(), 1, &lines)
}

struct LineStarts(Vec<usize>);

impl LineStarts {
    fn of(text: &str) -> Self {
        LineStarts(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i).collect())
    }

    fn line_of(&self, offset: usize) -> usize {
        1 + self.0.partition_point(|newline| *newline < offset)
    }
}

fn table_node(table: &DeTable<'_>, line: usize, lines: &LineStarts) -> Result<Node, Fault> {
    // The crate sorts keys by name; sorting by position puts `cam_2` before `cam_10` again.
    let mut keys: Vec<_> = table.iter().collect();
    keys.sort_by_key(|(key, _)| key.span().start);
    let mut entries = Vec::with_capacity(keys.len());
    for (key, value) in keys {
        let mut node = value_node(value, lines)?;
        node.line = lines.line_of(key.span().start);
        entries.push((key.get_ref().to_string(), node));
    }
    Ok(Node { line, value: Value::Map(entries) })
}

fn value_node(value: &Spanned<DeValue<'_>>, lines: &LineStarts) -> Result<Node, Fault> {
    let line = lines.line_of(value.span().start);
    let number =
        |text: &str| text.replace('_', "").parse::<f64>().map_err(|_| Fault::at(line, "not a number"));
    let value = match value.get_ref() {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(i) if i.radix() == 10 => Value::Number(number(i.as_str())?),
        DeValue::Integer(i) => {
            let whole = i64::from_str_radix(i.as_str(), i.radix());
            Value::Number(whole.map_err(|_| Fault::at(line, "an integer out of range"))? as f64)
        }
        DeValue::Float(x) => Value::Number(number(x.as_str())?),
        DeValue::Boolean(flag) => Value::Bool(*flag),
        DeValue::Datetime(date) => Value::Text(date.to_string()),
        DeValue::Array(items) => {
            Value::List(items.iter().map(|item| value_node(item, lines)).collect::<Result<_, _>>()?)
        }
        DeValue::Table(table) => return table_node(table, line, lines),
    };
    Ok(Node { line, value })
}
