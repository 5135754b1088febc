//! The incomplete output, in a folder beside it: one file of rows, written once and in order, and a note of each part in it.
//!
//! A part is a row group. Its note is the footer of a file that would contain it alone, so that the next run finds the parts of an interrupted
//! one, reads them (each page has a checksum) and continues behind them.

use crate::FleetError;
use crate::batch::{SolvedRows, schema};
use crate::csv_out::CsvOut;
use parquet::arrow::ArrowSchemaConverter;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder,
};
use parquet::arrow::arrow_writer::{ArrowColumnChunk, ArrowRowGroupWriterFactory, compute_leaves};
use parquet::basic::Compression;
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::ParquetError;
use parquet::file::metadata::{
    FileMetaData, ParquetMetaData, ParquetMetaDataOptions, ParquetMetaDataReader, ParquetMetaDataWriter,
    RowGroupMetaData,
};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, SchemaDescriptor};
use resight::formats::{stream_atomically, write_atomically};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// The file that identifies the run of the parts.
const PLAN: &str = "plan.txt";
/// The file of the rows.
const ROWS: &str = "rows.parquet";
/// Length and magic number of the format, behind the footer of a note.
const FOOTER_END: usize = 8;

type Writer = SerializedFileWriter<BufWriter<File>>;

/// The record of a part of an earlier run.
pub(super) enum Note {
    /// The position of its rows.
    Written(RowGroupMetaData),
    /// The reason why it could not be read.
    Failed(String),
}

/// A part ready to be written.
pub(super) enum Ready {
    Solved(Vec<ArrowColumnChunk>),
    /// It is in the file already.
    There(RowGroupMetaData),
    /// A piece that cannot be read.
    Failed(String),
    /// The end of a file that is read from beginning to end. There is no note of it: where it ends another time, others have the numbers of its
    /// parts.
    Broken(String),
}

pub(super) struct Growing {
    folder: PathBuf,
    schema: arrow_schema::SchemaRef,
    described: Arc<SchemaDescriptor>,
    factory: ArrowRowGroupWriterFactory,
    tail: Mutex<Tail>,
    turn: Condvar,
    notes: Vec<Note>,
}

/// The end of the file, where one part at a time is written.
struct Tail {
    writer: Writer,
    /// The part that is written next.
    next: usize,
    is_given_up: bool,
}

impl Growing {
    /// Opens what an earlier run of the same plan has left, or an empty file; removes what another run left.
    pub fn open(output: &Path, plan: &str, has_view: bool) -> Result<Self, FleetError> {
        let mut name = output.file_name().unwrap_or_default().to_os_string();
        name.push(".parts");
        let folder = output.with_file_name(name);
        let is_known = std::fs::read_to_string(folder.join(PLAN)).is_ok_and(|known| known == plan);
        if !is_known {
            remove(&folder);
            std::fs::create_dir_all(&folder).map_err(|e| FleetError::at(&folder, e.to_string()))?;
            write_atomically(folder.join(PLAN), plan.as_bytes())?;
        }
        let rows = folder.join(ROWS);
        let at_rows = |e: std::io::Error| FleetError::at(&rows, e.to_string());
        let file = File::options().create(true).truncate(false).write(true).open(&rows).map_err(at_rows)?;
        let bytes = file.metadata().map_err(at_rows)?.len();
        let notes = notes(&folder, bytes);
        let schema = schema(has_view);
        let described =
            ArrowSchemaConverter::new().convert(&schema).map_err(|e| FleetError::parquet(&rows, &e))?;
        // The new writer starts at the beginning of the file and overwrites what is there.
        let writer = SerializedFileWriter::new(
            BufWriter::new(file),
            described.root_schema_ptr(),
            Arc::new(properties()),
        );
        let writer = writer.map_err(|e| FleetError::parquet(&rows, &e))?;
        let factory = ArrowRowGroupWriterFactory::new(&writer, schema.clone());
        Ok(Growing {
            folder,
            schema,
            described: Arc::new(described),
            factory,
            tail: Mutex::new(Tail { writer, next: 0, is_given_up: false }),
            turn: Condvar::new(),
            notes,
        })
    }

    /// Returns the note of an earlier run on a part.
    pub fn note(&self, part: usize) -> Option<&Note> {
        self.notes.get(part)
    }

    /// Returns the rows of a part that is there; none where they cannot be read after all.
    pub fn read(&self, group: &RowGroupMetaData) -> Option<SolvedRows> {
        let metadata = Arc::new(self.alone(group));
        let metadata = ArrowReaderMetadata::try_new(metadata, ArrowReaderOptions::new()).ok()?;
        let file = File::open(self.folder.join(ROWS)).ok()?;
        let rows = usize::try_from(group.num_rows()).ok()?;
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata);
        let mut batches = builder.with_batch_size(rows).build().ok()?;
        let batch = batches.next()?.ok()?;
        SolvedRows::of_record_batch(&batch).ok().filter(|solved| solved.answers.len() == rows)
    }

    /// Encodes rows as in the file. Each column is freed when it is encoded.
    pub fn encode(&self, part: usize, rows: SolvedRows) -> Result<Ready, FleetError> {
        let rows = rows.with_view(self.schema.column_with_name("view").is_some()).record_batch()?;
        let (_, columns, _) = rows.into_parts();
        let encoded = || -> Result<Vec<ArrowColumnChunk>, ParquetError> {
            let writers = self.factory.create_column_writers(part)?;
            let all = writers.into_iter().zip(self.schema.fields()).zip(columns);
            all.map(|((mut writer, field), column)| {
                for leaf in compute_leaves(field, &column)? {
                    writer.write(&leaf)?;
                }
                writer.close()
            })
            .collect()
        };
        encoded().map(Ready::Solved).map_err(|e| FleetError::parquet(&self.folder, &e))
    }

    /// Writes a part when all before it are written, and records it. Returns false where the run was given up meanwhile.
    pub fn write(&self, part: usize, ready: Ready) -> Result<bool, FleetError> {
        let mut tail = self.lock();
        while tail.next != part && !tail.is_given_up {
            tail = self.turn.wait(tail).unwrap_or_else(PoisonError::into_inner);
        }
        if tail.is_given_up {
            return Ok(false);
        }
        let written = match ready {
            Ready::Broken(_) => Ok(()),
            Ready::Failed(reason) => std::fs::write(self.folder.join(name(part, FAILED)), reason),
            Ready::Solved(columns) => tail
                .group(|group| columns.into_iter().try_for_each(|column| column.append_to_row_group(group)))
                .and_then(|group| self.note_down(part, &group)),
            Ready::There(group) => File::open(self.folder.join(ROWS)).and_then(|rows| {
                tail.group(|out| copied(&rows, &group, out)).and_then(|group| self.note_down(part, &group))
            }),
        };
        tail.next += 1;
        drop(tail);
        self.turn.notify_all();
        written.map(|()| true).map_err(|e| FleetError::at(&self.folder, format!("cannot write: {e}")))
    }

    /// Stops threads that wait for a part that will not come.
    pub fn give_up(&self) {
        self.lock().is_given_up = true;
        self.turn.notify_all();
    }

    /// Completes the file with its footer and its name. Returns the number of its row groups.
    pub fn finish(self, output: &Path) -> Result<usize, FleetError> {
        let rows = self.folder.join(ROWS);
        let at_rows = |e: std::io::Error| FleetError::at(&rows, format!("cannot write: {e}"));
        let tail = self.tail.into_inner().unwrap_or_else(PoisonError::into_inner);
        let groups = close(tail.writer).map_err(at_rows)?;
        if output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
            stream_atomically(output, |file| as_csv(&rows, &self.schema, file))?;
        } else {
            // A symbolic link remains one; its destination is replaced.
            let destination = std::fs::canonicalize(output).unwrap_or_else(|_| output.to_path_buf());
            std::fs::rename(&rows, &destination)
                .map_err(|e| FleetError::at(output, format!("cannot write: {e}")))?;
        }
        remove(&self.folder);
        Ok(groups)
    }

    fn lock(&self) -> MutexGuard<'_, Tail> {
        self.tail.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note_down(&self, part: usize, group: &RowGroupMetaData) -> std::io::Result<()> {
        let mut note = Vec::new();
        ParquetMetaDataWriter::new(&mut note, &self.alone(group)).finish().map_err(io)?;
        std::fs::write(self.folder.join(name(part, WRITTEN)), note)
    }

    /// Returns the footer of a file that contains one row group.
    fn alone(&self, group: &RowGroupMetaData) -> ParquetMetaData {
        let about = FileMetaData::new(1, group.num_rows(), None, None, self.described.clone(), None);
        ParquetMetaData::new(about, vec![group.clone()])
    }
}

impl Tail {
    /// Writes a row group, which is in the file when this returns.
    fn group(
        &mut self,
        fill: impl FnOnce(&mut SerializedRowGroupWriter<'_, BufWriter<File>>) -> Result<(), ParquetError>,
    ) -> std::io::Result<RowGroupMetaData> {
        let mut group = self.writer.next_row_group().map_err(io)?;
        fill(&mut group).map_err(io)?;
        let written = group.close().map_err(io)?;
        self.writer.flush()?;
        Ok(written.as_ref().clone())
    }
}

const WRITTEN: &str = "written";
const FAILED: &str = "failed";

fn name(part: usize, ending: &str) -> String {
    format!("{part:08}.{ending}")
}

/// Returns the notes of the first parts, as far as they are consistent with a file of so many bytes; removes others.
fn notes(folder: &Path, bytes: u64) -> Vec<Note> {
    let mut notes = Vec::new();
    let mut end = 4;
    loop {
        let part = notes.len();
        let failed = std::fs::read_to_string(folder.join(name(part, FAILED))).ok();
        let group = std::fs::read(folder.join(name(part, WRITTEN))).ok().and_then(|note| group_of(&note));
        match (group, failed) {
            (Some(group), _) if follows(&group, &mut end) && end <= bytes => notes.push(Note::Written(group)),
            (None, Some(reason)) => notes.push(Note::Failed(reason)),
            _ => break,
        }
    }
    for part in notes.len().. {
        let removed = [WRITTEN, FAILED].map(|ending| std::fs::remove_file(folder.join(name(part, ending))));
        if removed.iter().all(Result::is_err) {
            break;
        }
    }
    notes
}

fn group_of(note: &[u8]) -> Option<RowGroupMetaData> {
    let (footer, end) = note.split_at_checked(note.len().checked_sub(FOOTER_END)?)?;
    let is_whole = end[4..] == *b"PAR1" && end[..4] == u32::try_from(footer.len()).ok()?.to_le_bytes();
    // The statistics are read completely, because the note is written again.
    let options = ParquetMetaDataOptions::new().with_encoding_stats_as_mask(false);
    let decoded = ParquetMetaDataReader::decode_metadata_with_options(footer, Some(&options));
    let metadata = decoded.ok().filter(|_| is_whole)?;
    metadata.row_groups().first().cloned()
}

/// Returns whether each column begins where the one before it ends.
fn follows(group: &RowGroupMetaData, end: &mut u64) -> bool {
    group.columns().iter().all(|column| {
        let (first, length) = column.byte_range();
        let is_next = first == *end;
        *end = first.saturating_add(length);
        is_next
    })
}

/// Copies a row group without decoding it.
fn copied(
    rows: &File,
    group: &RowGroupMetaData,
    out: &mut SerializedRowGroupWriter<'_, BufWriter<File>>,
) -> Result<(), ParquetError> {
    for column in group.columns() {
        let result = ColumnCloseResult {
            bytes_written: column.compressed_size() as u64,
            rows_written: group.num_rows() as u64,
            metadata: column.clone(),
            bloom_filter: None,
            column_index: None,
            offset_index: None,
        };
        out.append_column(rows, result)?;
    }
    Ok(())
}

/// Writes the footer and flushes the file. What an earlier run left behind the end is cut off.
fn close(mut writer: Writer) -> std::io::Result<usize> {
    let metadata = writer.finish().map_err(io)?;
    writer.flush()?;
    let length = writer.bytes_written() as u64;
    let file = writer.inner().get_ref();
    file.set_len(length)?;
    file.sync_all()?;
    Ok(metadata.num_row_groups())
}

fn as_csv(rows: &Path, schema: &arrow_schema::SchemaRef, file: &mut File) -> std::io::Result<()> {
    let mut out = CsvOut::new(BufWriter::new(file), schema)?;
    let reader =
        ParquetRecordBatchReaderBuilder::try_new(File::open(rows)?).and_then(|builder| builder.build());
    for batch in reader.map_err(io)? {
        out.write(&batch.map_err(std::io::Error::other)?)?;
    }
    out.finish()
}

/// Removes only files with names of this program, then the folder if nothing else is in it.
fn remove(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let endings = [".parquet", ".tmp", ".written", ".failed"];
        if name == PLAN || endings.iter().any(|ending| name.ends_with(ending)) {
            // What cannot be removed now is removed by the next run, or reported there.
            let _ = std::fs::remove_file(path);
        }
    }
    let _ = std::fs::remove_dir(folder);
}

/// Returns the properties. Poses cannot be compressed, so their columns are written as they are; names and statuses are numbers into a
/// dictionary.
fn properties() -> WriterProperties {
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
    properties.set_column_compression(ColumnPath::from("reason"), Compression::SNAPPY).build()
}

fn io(reason: ParquetError) -> std::io::Error {
    std::io::Error::other(reason.to_string())
}
