//! JSON Lines, one object for each row. A line that is no object is a row without a camera, which is kept with a status.

use super::lines::Lines;
use super::{Batches, PIECE};
use crate::FleetError;
use arrow_array::builder::{Float64Builder, ListBuilder, StringBuilder};
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Reader = BufReader<Lines<File>>;

/// Number of lines from which keys are read.
const LOOKED_AT: usize = 1000;
const LISTS: [&str; 2] = ["points_px", "points_m"];

fn open(path: &Path) -> Result<Reader, FleetError> {
    let file = File::open(path).map_err(|e| FleetError::at(path, e.to_string()))?;
    Ok(BufReader::new(Lines::new(file)))
}

/// Returns the keys of the first lines.
pub(super) fn schema(path: &Path) -> Result<SchemaRef, FleetError> {
    let mut keys = BTreeSet::new();
    for line in open(path)?.lines().take(LOOKED_AT) {
        let line = line.map_err(|e| FleetError::at(path, e.to_string()))?;
        if let Ok(Value::Object(object)) = serde_json::from_str(&line) {
            keys.extend(object.into_iter().map(|(key, _)| key));
        }
    }
    let kind = |name: &str| match name {
        "camera" | "view" => DataType::Utf8,
        list if LISTS.contains(&list) => {
            DataType::List(Arc::new(Field::new_list_field(DataType::Float64, true)))
        }
        _ => DataType::Float64,
    };
    let fields: Vec<Field> = keys.iter().map(|key| Field::new(key, kind(key), true)).collect();
    Ok(Arc::new(Schema::new(fields)))
}

/// Returns its rows.
pub(super) fn batches(path: &Path) -> Result<Batches, FleetError> {
    Ok(Box::new(Rows {
        path: path.to_path_buf(),
        lines: open(path)?.lines(),
        schema: schema(path)?,
        is_over: false,
    }))
}

struct Rows {
    path: PathBuf,
    lines: std::io::Lines<Reader>,
    schema: SchemaRef,
    is_over: bool,
}

impl Iterator for Rows {
    type Item = Result<RecordBatch, FleetError>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut objects = Vec::new();
        while !self.is_over && objects.len() < PIECE {
            match self.lines.next() {
                Some(Ok(line)) if line.trim().is_empty() => {}
                Some(Ok(line)) => objects.push(match serde_json::from_str(&line) {
                    Ok(Value::Object(object)) => object,
                    _ => Map::new(),
                }),
                Some(Err(reason)) => {
                    self.is_over = true;
                    return Some(Err(FleetError::at(&self.path, reason.to_string())));
                }
                None => self.is_over = true,
            }
        }
        (!objects.is_empty()).then(|| self.batch(&objects))
    }
}

impl Rows {
    fn batch(&self, objects: &[Map<String, Value>]) -> Result<RecordBatch, FleetError> {
        let column = |field: &Arc<Field>| {
            let values = objects.iter().map(|object| object.get(field.name()));
            match field.data_type() {
                DataType::Utf8 => text(values),
                DataType::List(_) => lists(values),
                _ => numbers(values),
            }
        };
        let columns = self.schema.fields().iter().map(column).collect();
        Ok(RecordBatch::try_new(self.schema.clone(), columns)?)
    }
}

fn text<'a>(values: impl Iterator<Item = Option<&'a Value>>) -> ArrayRef {
    let mut builder = StringBuilder::new();
    for value in values {
        match value {
            Some(Value::String(text)) => builder.append_value(text),
            Some(Value::Number(number)) => builder.append_value(number.to_string()),
            _ => builder.append_null(),
        }
    }
    Arc::new(builder.finish())
}

fn numbers<'a>(values: impl Iterator<Item = Option<&'a Value>>) -> ArrayRef {
    let mut builder = Float64Builder::new();
    values.for_each(|value| builder.append_option(value.and_then(Value::as_f64)));
    Arc::new(builder.finish())
}

fn lists<'a>(values: impl Iterator<Item = Option<&'a Value>>) -> ArrayRef {
    let mut builder = ListBuilder::new(Float64Builder::new());
    for value in values {
        append(value.unwrap_or(&Value::Null), builder.values());
        builder.append(true);
    }
    Arc::new(builder.finish())
}

/// Appends the numbers of an array, of pairs or not.
fn append(value: &Value, builder: &mut Float64Builder) {
    for item in value.as_array().into_iter().flatten() {
        match item {
            Value::Array(_) => append(item, builder),
            number => builder.append_option(number.as_f64()),
        }
    }
}
