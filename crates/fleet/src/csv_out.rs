//! Answers as CSV: every number with as many digits as it needs to be read back the same.

use crate::arrays::names;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int32Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, Schema};
use std::io::Write;

/// A table being written.
pub(crate) struct CsvOut<W: Write> {
    writer: csv::Writer<W>,
}

impl<W: Write> CsvOut<W> {
    /// With its header line.
    pub fn new(out: W, schema: &Schema) -> std::io::Result<Self> {
        let mut writer = csv::Writer::from_writer(out);
        writer.write_record(schema.fields().iter().map(|field| field.name()))?;
        Ok(CsvOut { writer })
    }

    /// More rows; what is missing is an empty cell.
    pub fn write(&mut self, batch: &RecordBatch) -> std::io::Result<()> {
        let columns: Vec<Vec<String>> = batch.columns().iter().map(|column| cells(column.as_ref())).collect();
        for row in 0..batch.num_rows() {
            self.writer.write_record(columns.iter().map(|column| &column[row]))?;
        }
        Ok(())
    }

    /// No more rows come.
    pub fn finish(mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

fn cells(array: &dyn Array) -> Vec<String> {
    let text = |x: Option<String>| x.unwrap_or_default();
    match array.data_type() {
        DataType::Float64 => {
            array.as_primitive::<Float64Type>().iter().map(|x| text(x.map(|x| format!("{x}")))).collect()
        }
        DataType::Int32 => {
            array.as_primitive::<Int32Type>().iter().map(|x| text(x.map(|x| x.to_string()))).collect()
        }
        _ => {
            let (names, rows) = names(array);
            rows.iter().map(|row| text(names.get(*row as usize).cloned())).collect()
        }
    }
}
