//! Parts become one file: column chunks are copied, not decoded.

use super::parts::{Part, Parts, io, properties};
use crate::FleetError;
use crate::batch::schema;
use crate::csv_out::CsvOut;
use parquet::arrow::ArrowSchemaConverter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::column::writer::ColumnCloseResult;
use parquet::file::metadata::ParquetMetaDataReader;
use parquet::file::writer::SerializedFileWriter;
use resight::formats::stream_atomically;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

pub(super) fn join(parts: &Parts, names: &[Part], output: &Path, has_view: bool) -> Result<(), FleetError> {
    let is_csv = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    stream_atomically(output, |file| match is_csv {
        true => as_csv(parts, names, has_view, file),
        false => as_parquet(parts, names, has_view, file),
    })?;
    Ok(())
}

fn as_parquet(parts: &Parts, names: &[Part], has_view: bool, file: &mut File) -> std::io::Result<()> {
    let described = ArrowSchemaConverter::new().convert(&schema(has_view)).map_err(io)?;
    let writer = SerializedFileWriter::new(
        BufWriter::new(file),
        described.root_schema_ptr(),
        Arc::new(properties().build()),
    );
    let mut writer = writer.map_err(io)?;
    for part in names {
        copy(&parts.path(*part), &mut writer)?;
    }
    writer.close().map(|_| ()).map_err(io)
}

fn copy<W: Write + Send>(path: &Path, writer: &mut SerializedFileWriter<W>) -> std::io::Result<()> {
    let input = File::open(path)?;
    let metadata = ParquetMetaDataReader::new().parse_and_finish(&input).map_err(io)?;
    for group in metadata.row_groups() {
        let mut out = writer.next_row_group().map_err(io)?;
        for column in group.columns() {
            let result = ColumnCloseResult {
                bytes_written: column.compressed_size() as u64,
                rows_written: group.num_rows() as u64,
                metadata: column.clone(),
                bloom_filter: None,
                column_index: None,
                offset_index: None,
            };
            out.append_column(&input, result).map_err(io)?;
        }
        out.close().map_err(io)?;
    }
    Ok(())
}

fn as_csv(parts: &Parts, names: &[Part], has_view: bool, file: &mut File) -> std::io::Result<()> {
    let mut out = CsvOut::new(BufWriter::new(file), &schema(has_view))?;
    for part in names {
        let input = File::open(parts.path(*part))?;
        let reader = ParquetRecordBatchReaderBuilder::try_new(input).and_then(|builder| builder.build());
        for batch in reader.map_err(io)? {
            out.write(&batch.map_err(std::io::Error::other)?)?;
        }
    }
    out.finish()
}
