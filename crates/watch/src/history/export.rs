//! Exports a history as a table for other programs: CSV, or Parquet if the file name has that extension. Rows are streamed, so that the length
//! of a history does not matter.

mod cells;
mod csv;
mod parquet;

use super::{History, HistoryError, Selection};
use cells::Cell;
use resight::FileError;
use resight::formats::stream_atomically;
use std::fs::File;
use std::path::Path;

pub use cells::Table;

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// An error of the history.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// An error of the file to be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// An unknown extension of the file name.
    #[error("{name}: a table ends in .csv or .parquet; rename it")]
    Kind {
        /// The name given.
        name: String,
    },
}

/// Takes rows of cells.
trait Sheet {
    fn row(&mut self, cells: Vec<Cell>) -> std::io::Result<()>;
    fn finish(self: Box<Self>) -> std::io::Result<()>;
}

/// Writes the selected rows of a table to a `.csv` or `.parquet` file, complete or not at all, and says how many there were.
///
/// # Errors
/// A damaged history, another kind of file, a file that cannot be written.
pub fn export(
    history: &History,
    table: Table,
    selection: &Selection,
    path: &Path,
) -> Result<u64, ExportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let open: fn(Table, File) -> std::io::Result<Box<dyn Sheet>> = match extension.as_deref() {
        Some("csv") => csv::open,
        Some("parquet") => parquet::open,
        _ => return Err(ExportError::Kind { name: path.display().to_string() }),
    };
    let (mut rows, mut of_history) = (0, None);
    let written = stream_atomically(path, |file| {
        let mut sheet = open(table, file.try_clone()?)?;
        match fill(history, table, selection, sheet.as_mut(), &mut rows) {
            Ok(()) => sheet.finish(),
            Err(Cause::Disk(reason)) => Err(reason),
            Err(Cause::History(reason)) => {
                let words = reason.to_string();
                of_history = Some(reason);
                Err(std::io::Error::other(words))
            }
        }
    });
    match of_history {
        Some(reason) => Err(reason.into()),
        None => Ok(written.map(|()| rows)?),
    }
}

enum Cause {
    Disk(std::io::Error),
    History(HistoryError),
}

fn fill(
    history: &History,
    table: Table,
    selection: &Selection,
    sheet: &mut dyn Sheet,
    rows: &mut u64,
) -> Result<(), Cause> {
    let mut disk = Ok(());
    let mut take = |cells| {
        *rows += 1;
        disk = sheet.row(cells);
        disk.is_ok()
    };
    match table {
        Table::Frames => history.rows(selection, |row| take(cells::of_row(&row))),
        Table::Events => history.events(selection, &[], |event| take(cells::of_event(&event))),
    }
    .map_err(Cause::History)?;
    disk.map_err(Cause::Disk)
}
