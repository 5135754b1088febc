//! Files of views: Parquet in independent pieces, CSV and JSON Lines from beginning to end.

mod csv;
mod json_lines;
mod lines;
mod paths;

pub use paths::expand;

use crate::FleetError;
use crate::assemble::{Assembler, assembled};
use crate::layout::{Columns, Layout, PointColumns, explain};
use arrow_array::RecordBatch;
use arrow_schema::{DataType, FieldRef, Fields, Schema, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
    RowSelection, RowSelector,
};
use resight::input::what_is_it::{HEAD_BYTES, that_is_no_text};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Number of rows of a piece, which is read, solved and written independently.
pub const PIECE: usize = 49_152;

/// Largest plausible number of rows per byte: a file states its number of rows, and memory is allocated for them.
const MOST_ROWS_PER_BYTE: u64 = 4096;

/// An iterator of batches.
pub type Batches = Box<dyn Iterator<Item = Result<RecordBatch, FleetError>> + Send>;

/// A file whose columns are known.
pub struct Source {
    /// Its path.
    pub path: PathBuf,
    /// The meaning of each column of its batches.
    pub layout: Layout,
    kind: Kind,
}

enum Kind {
    Parquet { metadata: Box<ArrowReaderMetadata>, columns: Vec<usize> },
    Csv,
    JsonLines,
}

/// Some rows of a Parquet file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    group: usize,
    first: usize,
    /// Number of its rows.
    pub rows: usize,
}

impl Source {
    /// Opens a file, recognised by its first bytes.
    ///
    /// # Errors
    /// The fault of the file, or the columns that are missing.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FleetError> {
        let path = path.as_ref();
        let (schema, kind) = schema_of(path)?;
        let layout = Layout::of(&schema).map_err(|reason| FleetError::at(path, reason.to_string()))?;
        let (layout, kind) = match kind {
            Kind::Parquet { metadata, .. } => {
                let columns = layout.read();
                let metadata = Box::new(with_numbered_names(*metadata, layout.camera));
                (projected(&layout, &columns), Kind::Parquet { metadata, columns })
            }
            text => (layout, text),
        };
        Ok(Source { path: path.to_path_buf(), layout, kind })
    }

    /// Returns the layout of the batches that are solved: for rows of points, that of the views made from them.
    pub fn view_layout(&self) -> Layout {
        match self.layout.points {
            PointColumns::Points { .. } => assembled(&self.layout),
            _ => self.layout.clone(),
        }
    }

    /// Returns the number of rows that the file states.
    pub fn rows(&self) -> Option<usize> {
        match &self.kind {
            Kind::Parquet { metadata, .. } => {
                usize::try_from(metadata.metadata().file_metadata().num_rows()).ok()
            }
            _ => None,
        }
    }

    /// Returns the independent pieces; none: the file must be read from beginning to end.
    pub fn pieces(&self) -> Option<Vec<Piece>> {
        let Kind::Parquet { metadata, .. } = &self.kind else { return None };
        if matches!(self.layout.points, PointColumns::Points { .. }) {
            return None;
        }
        let mut pieces = Vec::new();
        for (group, about) in metadata.metadata().row_groups().iter().enumerate() {
            let rows = usize::try_from(about.num_rows()).unwrap_or(0);
            for first in (0..rows).step_by(PIECE) {
                pieces.push(Piece { group, first, rows: PIECE.min(rows - first) });
            }
        }
        Some(pieces)
    }

    /// Returns the rows of a piece.
    ///
    /// # Errors
    /// The fault of the file.
    pub fn read(&self, piece: &Piece) -> Result<RecordBatch, FleetError> {
        let Kind::Parquet { metadata, columns } = &self.kind else {
            return Err(FleetError::at(&self.path, "this file has no pieces"));
        };
        let skipped = RowSelector::skip(piece.first);
        let selection = RowSelection::from(vec![skipped, RowSelector::select(piece.rows)]);
        let builder = self.builder(metadata, columns)?.with_row_groups(vec![piece.group]);
        let builder = if piece.first == 0 {
            builder.with_limit(piece.rows)
        } else {
            builder.with_row_selection(selection)
        };
        let batch = self.batches(builder.build())?.next().transpose()?;
        let n = batch.as_ref().map_or(0, RecordBatch::num_rows);
        batch.filter(|_| n == piece.rows).ok_or_else(|| self.cut_short(piece, n))
    }

    /// Returns all rows, with views put together, in batches of at most `PIECE` rows.
    ///
    /// # Errors
    /// The fault of the file.
    pub fn stream(&self) -> Result<Batches, FleetError> {
        let batches = match &self.kind {
            Kind::Parquet { metadata, columns } => self.batches(self.builder(metadata, columns)?.build())?,
            Kind::Csv => csv::batches(&self.path, &self.layout)?,
            Kind::JsonLines => json_lines::batches(&self.path)?,
        };
        match self.layout.points {
            PointColumns::Points { .. } => Ok(Box::new(Views {
                batches,
                layout: self.layout.clone(),
                assembler: Assembler::default(),
                is_over: false,
            })),
            _ => Ok(batches),
        }
    }

    /// Returns the error that a piece has fewer rows than the file states.
    fn cut_short(&self, piece: &Piece, rows: usize) -> FleetError {
        let (group, stated) = (piece.group, piece.rows);
        let reason = format!(
            "{rows} of {stated} rows of row group {group} are there; write the file again, or leave it out"
        );
        FleetError::at(&self.path, reason)
    }

    fn builder(
        &self,
        metadata: &ArrowReaderMetadata,
        columns: &[usize],
    ) -> Result<ParquetRecordBatchReaderBuilder<File>, FleetError> {
        let file = File::open(&self.path).map_err(|e| FleetError::at(&self.path, e.to_string()))?;
        let mask = ProjectionMask::roots(metadata.parquet_schema(), columns.iter().copied());
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata.clone());
        Ok(builder.with_projection(mask).with_batch_size(PIECE))
    }

    fn batches(
        &self,
        reader: Result<ParquetRecordBatchReader, parquet::errors::ParquetError>,
    ) -> Result<Batches, FleetError> {
        let path = self.path.clone();
        let reader = reader.map_err(|e| FleetError::parquet(&path, &e))?;
        Ok(Box::new(reader.map(move |batch| {
            batch.map_err(|e| FleetError::at(&path, format!("{e}; write the file again, or leave it out")))
        })))
    }
}

/// Returns the columns of a file, whatever is missing.
///
/// # Errors
/// A file that cannot be read at all.
pub fn explain_file(path: impl AsRef<Path>) -> Result<(Columns, Option<usize>), FleetError> {
    let path = path.as_ref();
    let (schema, kind) = schema_of(path)?;
    let rows = match kind {
        Kind::Parquet { metadata, .. } => {
            usize::try_from(metadata.metadata().file_metadata().num_rows()).ok()
        }
        _ => None,
    };
    Ok((explain(&schema), rows))
}

fn schema_of(path: &Path) -> Result<(SchemaRef, Kind), FleetError> {
    resight::input::must_not_block(path)?;
    let mut file = File::open(path).map_err(|e| FleetError::at(path, e.to_string()))?;
    let mut head = [0; HEAD_BYTES];
    let read = std::io::Read::read(&mut file, &mut head).map_err(|e| FleetError::at(path, e.to_string()))?;
    let head = &head[..read];
    if head.starts_with(b"PAR1") {
        let metadata =
            ArrowReaderMetadata::load(&file, ArrowReaderOptions::new().with_skip_arrow_metadata(false));
        let metadata = metadata.map_err(|e| FleetError::parquet(path, &e))?;
        let bytes = file.metadata().map_err(|e| FleetError::at(path, e.to_string()))?.len();
        check_rows(&metadata, bytes).map_err(|reason| FleetError::at(path, reason))?;
        return Ok((
            metadata.schema().clone(),
            Kind::Parquet { metadata: Box::new(metadata), columns: Vec::new() },
        ));
    }
    if let Some(other) = that_is_no_text(head) {
        return Err(FleetError::at(path, other));
    }
    let is_json = head.iter().find(|byte| !byte.is_ascii_whitespace()) == Some(&b'{');
    match is_json {
        true => Ok((json_lines::schema(path)?, Kind::JsonLines)),
        false => Ok((csv::schema(path)?, Kind::Csv)),
    }
}

/// Reads a column of names as numbers into a dictionary, which most files contain: few names occur in many rows.
fn with_numbered_names(metadata: ArrowReaderMetadata, column: usize) -> ArrowReaderMetadata {
    let schema = metadata.schema();
    if !matches!(schema.field(column).data_type(), DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View)
    {
        return metadata;
    }
    let numbered = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let as_read = |(i, field): (usize, &FieldRef)| match i == column {
        true => Arc::new(field.as_ref().clone().with_data_type(numbered.clone())),
        false => field.clone(),
    };
    let fields: Fields = schema.fields().iter().enumerate().map(as_read).collect();
    let options = ArrowReaderOptions::new().with_schema(Arc::new(Schema::new(fields)));
    // A file that does not allow this is read without it.
    ArrowReaderMetadata::try_new(metadata.metadata().clone(), options).unwrap_or(metadata)
}

/// Refuses numbers that no file of this size has.
fn check_rows(metadata: &ArrowReaderMetadata, bytes: u64) -> Result<(), String> {
    let most = i64::try_from(bytes.saturating_mul(MOST_ROWS_PER_BYTE)).unwrap_or(i64::MAX);
    let groups = metadata.metadata().row_groups();
    let in_groups = groups.iter().try_fold(0_i64, |sum, group| {
        Some(group.num_rows()).filter(|n| (0..=most).contains(n)).and_then(|n| sum.checked_add(n))
    });
    let stated = metadata.metadata().file_metadata().num_rows();
    if in_groups == Some(stated) && stated <= most {
        return Ok(());
    }
    let groups = groups.len();
    Err(format!(
        "it states {stated} rows in {groups} groups, which do not add up or do not fit its {bytes} bytes; write the file again"
    ))
}

/// Returns the layout of batches that contain these columns only.
fn projected(layout: &Layout, columns: &[usize]) -> Layout {
    let at = |column: usize| columns.iter().position(|kept| *kept == column).unwrap_or(0);
    let all = |columns: &[usize]| columns.iter().map(|column| at(*column)).collect::<Vec<_>>();
    Layout {
        camera: at(layout.camera),
        time: layout.time.map(at),
        view: layout.view.map(at),
        sigma_px: layout.sigma_px.map(at),
        points: match &layout.points {
            PointColumns::Flat { pixels, points_m } => {
                PointColumns::Flat { pixels: all(pixels), points_m: points_m.as_deref().map(all) }
            }
            PointColumns::Lists { pixels, points_m } => {
                PointColumns::Lists { pixels: at(*pixels), points_m: points_m.map(at) }
            }
            PointColumns::Points { pixels, points_m } => {
                PointColumns::Points { pixels: pixels.map(at), points_m: points_m.map(at) }
            }
        },
    }
}

/// Rows of points that are being put together to views.
struct Views {
    batches: Batches,
    layout: Layout,
    assembler: Assembler,
    is_over: bool,
}

impl Iterator for Views {
    type Item = Result<RecordBatch, FleetError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.is_over && self.assembler.waiting() < PIECE {
            match self.batches.next() {
                Some(Ok(batch)) => self.assembler.push(&batch, &self.layout),
                Some(Err(reason)) => {
                    self.is_over = true;
                    return Some(Err(reason));
                }
                None => {
                    self.is_over = true;
                    self.assembler.finish();
                }
            }
        }
        let is_any = 0 < self.assembler.waiting();
        is_any.then(|| Ok(self.assembler.take(PIECE, &self.layout)?.0))
    }
}
