//! Writes Parquet: each column of doubles, integers or text, missing values as null, row groups of bounded size.

use super::Sheet;
use super::cells::{Cell, Kind, Table};
use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use ::parquet::schema::types::Type;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;

/// Number of rows in memory; about 20 MB of frames.
const ROWS: usize = 8_192;

struct Groups {
    writer: SerializedFileWriter<BufWriter<File>>,
    kinds: Vec<Kind>,
    /// Column by column.
    cells: Vec<Vec<Cell>>,
}

pub(super) fn open(table: Table, file: File) -> std::io::Result<Box<dyn Sheet>> {
    let columns = table.columns();
    let kinds: Vec<Kind> = columns.iter().map(|(_, kind)| *kind).collect();
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let schema = Arc::new(schema(&columns).map_err(reported)?);
    let writer =
        SerializedFileWriter::new(BufWriter::new(file), schema, Arc::new(properties)).map_err(reported)?;
    let cells = vec![Vec::new(); kinds.len()];
    Ok(Box::new(Groups { writer, kinds, cells }))
}

fn schema(columns: &[(String, Kind)]) -> Result<Type, ParquetError> {
    let field = |(name, kind): &(String, Kind)| {
        let (physical, logical) = match kind {
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Kind::Whole => (Physical::INT64, None),
            Kind::Real => (Physical::DOUBLE, None),
        };
        let built = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build();
        built.map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<_, _>>()?;
    Type::group_type_builder("history").with_fields(fields).build()
}

impl Sheet for Groups {
    fn row(&mut self, cells: Vec<Cell>) -> std::io::Result<()> {
        self.cells.iter_mut().zip(cells).for_each(|(column, cell)| column.push(cell));
        if ROWS <= self.cells.first().map_or(0, Vec::len) { self.flush().map_err(reported) } else { Ok(()) }
    }

    fn finish(mut self: Box<Self>) -> std::io::Result<()> {
        self.flush().map_err(reported)?;
        self.writer.close().map(|_| ()).map_err(reported)
    }
}

impl Groups {
    /// The rows in memory become a row group.
    fn flush(&mut self) -> Result<(), ParquetError> {
        if self.cells.first().is_none_or(Vec::is_empty) {
            return Ok(());
        }
        let mut group = self.writer.next_row_group()?;
        for (kind, column) in self.kinds.iter().zip(&mut self.cells) {
            match kind {
                Kind::Text => write::<ByteArrayType>(&mut group, column, |cell| match cell {
                    Cell::Text(text) => Some(ByteArray::from(text.as_str())),
                    _ => None,
                }),
                Kind::Whole => write::<Int64Type>(&mut group, column, |cell| match cell {
                    Cell::Whole(number) => Some(*number),
                    _ => None,
                }),
                Kind::Real => write::<DoubleType>(&mut group, column, |cell| match cell {
                    Cell::Real(number) => Some(*number),
                    _ => None,
                }),
            }?;
            column.clear();
        }
        group.close().map(|_| ())
    }
}

fn write<T: DataType>(
    group: &mut SerializedRowGroupWriter<BufWriter<File>>,
    cells: &[Cell],
    value: impl Fn(&Cell) -> Option<T::T>,
) -> Result<(), ParquetError> {
    let values: Vec<Option<T::T>> = cells.iter().map(value).collect();
    let connected: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
    let there: Vec<T::T> = values.into_iter().flatten().collect();
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("the schema has fewer columns than the rows".to_string()));
    };
    column.typed::<T>().write_batch(&there, Some(&connected), None)?;
    column.close()
}

fn reported(error: ParquetError) -> std::io::Error {
    std::io::Error::other(error.to_string())
}
