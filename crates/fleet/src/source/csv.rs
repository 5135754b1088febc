//! CSV with a header line, its cells separated as in every table. A cell without a number is a missing number, whose row is kept with a status.

use super::lines::Lines;
use super::{Batches, PIECE};
use crate::FleetError;
use crate::layout::Layout;
use arrow_array::builder::{Float64Builder, StringBuilder};
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use resight::input::table::Separator;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

type Reader = csv::Reader<Lines<File>>;

fn open(path: &Path) -> Result<(Reader, SchemaRef, Separator), FleetError> {
    let (reader, header) = separated_by(Separator::Comma, path)?;
    let (reader, header, mark) = match Separator::of_header(&header) {
        Separator::Comma => (reader, header, Separator::Comma),
        other => {
            let (reader, header) = separated_by(other, path)?;
            (reader, header, other)
        }
    };
    let kind =
        |name: &str| if ["camera", "view"].contains(&name) { DataType::Utf8 } else { DataType::Float64 };
    let fields: Vec<Field> = header.iter().map(|name| Field::new(name, kind(name), true)).collect();
    Ok((reader, Arc::new(Schema::new(fields)), mark))
}

fn separated_by(mark: Separator, path: &Path) -> Result<(Reader, Vec<String>), FleetError> {
    let file = File::open(path).map_err(|e| FleetError::at(path, e.to_string()))?;
    let mut builder = csv::ReaderBuilder::new();
    builder.delimiter(mark.byte()).trim(csv::Trim::All).flexible(true).comment(Some(b'#'));
    let mut reader = builder.from_reader(Lines::new(file));
    let header = reader.byte_headers().map_err(|e| FleetError::at(path, e.to_string()))?;
    let name = |cell: &[u8]| String::from_utf8_lossy(cell).trim_start_matches('\u{feff}').to_string();
    let header = header.iter().map(name).collect();
    Ok((reader, header))
}

/// Returns its columns: names are text, all others numbers.
pub(super) fn schema(path: &Path) -> Result<SchemaRef, FleetError> {
    let (_, schema, _) = open(path)?;
    if schema.fields().len() < 2 {
        let reason = "this is no Parquet file, and no table either; a header line camera,time_s,… with commas between the names is needed";
        return Err(FleetError::at(path, reason));
    }
    Ok(schema)
}

/// Returns its rows; columns that are not used stay empty.
pub(super) fn batches(path: &Path, layout: &Layout) -> Result<Batches, FleetError> {
    let (reader, schema, mark) = open(path)?;
    Ok(Box::new(Rows { path: path.to_path_buf(), reader, schema, mark, used: layout.read(), is_over: false }))
}

struct Rows {
    path: PathBuf,
    reader: Reader,
    schema: SchemaRef,
    mark: Separator,
    used: Vec<usize>,
    is_over: bool,
}

enum Column {
    Text(StringBuilder),
    Number(Float64Builder),
    /// An empty cell for each row.
    Unused,
}

impl Iterator for Rows {
    type Item = Result<RecordBatch, FleetError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        let mut columns: Vec<Column> = (0..self.schema.fields().len()).map(|i| self.column(i)).collect();
        let (mut record, mut n) = (csv::ByteRecord::new(), 0);
        while n < PIECE {
            match self.reader.read_byte_record(&mut record) {
                Ok(true) => n += 1,
                Ok(false) => {
                    self.is_over = true;
                    break;
                }
                Err(reason) => {
                    self.is_over = true;
                    return Some(Err(FleetError::at(&self.path, reason.to_string())));
                }
            }
            for (i, column) in columns.iter_mut().enumerate() {
                column.push(record.get(i), self.mark);
            }
        }
        (0 < n).then(|| self.batch(columns, n))
    }
}

impl Rows {
    fn column(&self, i: usize) -> Column {
        match self.schema.field(i).data_type() {
            _ if !self.used.contains(&i) => Column::Unused,
            DataType::Utf8 => Column::Text(StringBuilder::new()),
            _ => Column::Number(Float64Builder::new()),
        }
    }

    fn batch(&self, columns: Vec<Column>, n: usize) -> Result<RecordBatch, FleetError> {
        let array = |(i, column): (usize, Column)| -> ArrayRef {
            match column {
                Column::Text(mut text) => Arc::new(text.finish()),
                Column::Number(mut numbers) => Arc::new(numbers.finish()),
                Column::Unused => arrow_array::new_null_array(self.schema.field(i).data_type(), n),
            }
        };
        let arrays = columns.into_iter().enumerate().map(array).collect();
        Ok(RecordBatch::try_new(self.schema.clone(), arrays)?)
    }
}

impl Column {
    fn push(&mut self, cell: Option<&[u8]>, mark: Separator) {
        let cell = cell.filter(|cell| !cell.is_empty());
        match self {
            Column::Text(text) => text.append_option(cell.map(String::from_utf8_lossy)),
            Column::Number(numbers) => {
                let text = cell.and_then(|cell| std::str::from_utf8(cell).ok());
                numbers.append_option(text.and_then(|text| mark.number(text)));
            }
            Column::Unused => {}
        }
    }
}
