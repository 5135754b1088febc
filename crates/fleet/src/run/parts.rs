//! The parts of an output, in a folder beside it.

use crate::FleetError;
use crate::batch::{SolvedRows, schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnPath;
use resight::formats::{stream_atomically, write_atomically};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// A piece of a file, in the order of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Part {
    pub file: usize,
    pub number: usize,
}

pub(super) struct Parts {
    folder: PathBuf,
}

/// The file that says of which run the parts are.
const PLAN: &str = "plan.txt";

impl Parts {
    /// The parts of this run; those of another are removed.
    pub fn open(output: &Path, plan: &str) -> Result<Self, FleetError> {
        let mut name = output.file_name().unwrap_or_default().to_os_string();
        name.push(".parts");
        let folder = output.with_file_name(name);
        let parts = Parts { folder };
        let known = std::fs::read_to_string(parts.folder.join(PLAN));
        if known.is_ok_and(|known| known == plan) {
            return Ok(parts);
        }
        parts.remove();
        std::fs::create_dir_all(&parts.folder).map_err(|e| FleetError::at(&parts.folder, e.to_string()))?;
        write_atomically(&parts.folder.join(PLAN), plan.as_bytes())?;
        Ok(parts)
    }

    pub fn path(&self, part: Part) -> PathBuf {
        self.folder.join(format!("{:06}-{:08}.parquet", part.file, part.number))
    }

    /// Only files with names of parts, then the folder if nothing else is in it: it may be somebody's.
    pub fn remove(&self) {
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return };
        for path in entries.flatten().map(|entry| entry.path()) {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name == PLAN || name.ends_with(".parquet") || name.ends_with(".tmp") {
                // What cannot be removed is in nobody's way: the next run removes it, or says why it cannot write.
                let _ = std::fs::remove_file(path);
            }
        }
        let _ = std::fs::remove_dir(&self.folder);
    }

    /// The rows of a part that is there.
    pub fn read(&self, part: Part) -> Option<impl Iterator<Item = Result<SolvedRows, FleetError>>> {
        let path = self.path(part);
        let file = File::open(&path).ok()?;
        let reader = ParquetRecordBatchReaderBuilder::try_new(file)
            .ok()?
            .with_batch_size(crate::source::BATCH)
            .build()
            .ok()?;
        Some(reader.map(|batch| SolvedRows::of_record_batch(&batch?)))
    }

    pub fn write(&self, part: Part, rows: Vec<SolvedRows>, has_view: bool) -> Result<(), FleetError> {
        let mut batches = Vec::with_capacity(rows.len());
        for rows in rows {
            batches.push(rows.with_view(has_view).record_batch()?);
        }
        stream_atomically(&self.path(part), |file| {
            let options = ArrowWriterOptions::new()
                .with_properties(properties().build())
                .with_skip_arrow_metadata(true);
            let written = ArrowWriter::try_new_with_options(BufWriter::new(file), schema(has_view), options);
            let mut writer = written.map_err(io)?;
            for batch in batches {
                writer.write(&batch).map_err(io)?;
            }
            writer.close().map(|_| ()).map_err(io)
        })?;
        Ok(())
    }
}

/// Poses are random to a compressor: their columns are written as they are; names and statuses are numbers into a dictionary.
pub(super) fn properties() -> WriterPropertiesBuilder {
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::UNCOMPRESSED)
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::None)
        .set_created_by("resight".to_string())
        .set_offset_index_disabled(true);
    for name in ["camera", "status", "n_points"] {
        properties = properties.set_column_dictionary_enabled(ColumnPath::from(name), true);
    }
    for name in ["time_s", "status"] {
        properties =
            properties.set_column_statistics_enabled(ColumnPath::from(name), EnabledStatistics::Chunk);
    }
    properties.set_column_compression(ColumnPath::from("reason"), Compression::SNAPPY)
}

pub(super) fn io(reason: ParquetError) -> std::io::Error {
    std::io::Error::other(reason.to_string())
}
