//! The state of a fleet from files that `batch` wrote, in one run or in many.

use crate::batch::SolvedRows;
use crate::source::PIECE;
use crate::{FleetError, FleetState};
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder,
};
use rayon::prelude::*;
use resight::input::what_is_it::{HEAD_BYTES, what_is_it};
use resight::parallel::on_all_cores;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Refuses a file that does not begin as Parquet does, with what it is.
fn must_be_parquet(path: &Path, file: &mut File) -> Result<(), FleetError> {
    let mut head = Vec::new();
    file.take(HEAD_BYTES as u64).read_to_end(&mut head).map_err(|e| FleetError::at(path, e.to_string()))?;
    if head.starts_with(b"PAR1") {
        return Ok(());
    }
    let seen = what_is_it(&head).map_or("no Parquet file", |kind| kind.name);
    Err(FleetError::at(path, format!("{seen}; give what `resight batch -o poses.parquet` wrote")))
}

/// Reads all files on all cores; the state is that of the run that wrote them, to the last bit.
///
/// # Errors
/// A file that is damaged, or none of `batch`.
pub fn reread(files: &[PathBuf], period_s: f64) -> Result<FleetState, FleetError> {
    let state = FleetState::new(period_s);
    let mut groups = Vec::new();
    for path in files {
        let mut file = File::open(path).map_err(|e| FleetError::at(path, e.to_string()))?;
        must_be_parquet(path, &mut file)?;
        let metadata = ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())
            .map_err(|e| FleetError::parquet(path, &e))?;
        groups.extend((0..metadata.metadata().num_row_groups()).map(|group| (path, metadata.clone(), group)));
    }
    let read = |(path, metadata, group): &(&PathBuf, ArrowReaderMetadata, usize)| {
        let file = File::open(path).map_err(|e| FleetError::at(path, e.to_string()))?;
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, metadata.clone())
            .with_row_groups(vec![*group]);
        let reader = builder.with_batch_size(PIECE).build().map_err(|e| FleetError::parquet(path, &e))?;
        for batch in reader {
            let batch = batch.map_err(|e| FleetError::at(path, e.to_string()))?;
            let rows =
                SolvedRows::of_record_batch(&batch).map_err(|e| FleetError::at(path, e.to_string()))?;
            state.add(&rows);
        }
        Ok::<(), FleetError>(())
    };
    on_all_cores(|| groups.par_iter().try_for_each(read))?;
    Ok(state)
}
