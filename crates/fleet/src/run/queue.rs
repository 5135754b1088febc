//! The remaining work, distributed in the order of the input.

use crate::FleetError;
use crate::source::{Batches, Piece, Source};
use arrow_array::RecordBatch;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A part to be solved.
pub(super) struct Claim {
    /// Its index in the output.
    pub part: usize,
    /// The index of its file.
    pub file: usize,
    pub task: Task,
}

pub(super) enum Task {
    /// Rows to be read and solved.
    Piece(Piece),
    /// Rows of a file that is read from beginning to end.
    Rows(RecordBatch),
    /// The end of such a file, with its error.
    Broken(FleetError),
}

/// The remaining files, from the current one on.
pub(super) struct Queue<'a> {
    sources: &'a [Source],
    file: usize,
    part: usize,
    open: Option<Open>,
}

enum Open {
    Pieces(std::vec::IntoIter<Piece>),
    Stream(Batches),
    /// The file has ended.
    Ended,
}

impl<'a> Queue<'a> {
    pub fn new(sources: &'a [Source]) -> Self {
        Queue { sources, file: 0, part: 0, open: None }
    }

    /// Returns the next part; none when all are distributed.
    pub fn claim(&mut self) -> Option<Claim> {
        while let Some(source) = self.sources.get(self.file) {
            if let Some(task) = self.task(source) {
                let claim = Claim { part: self.part, file: self.file, task };
                self.part += 1;
                return Some(claim);
            }
            (self.open, self.file) = (None, self.file + 1);
        }
        None
    }

    fn task(&mut self, source: &Source) -> Option<Task> {
        if self.open.is_none() {
            self.open = Some(match source.pieces() {
                Some(pieces) => Open::Pieces(pieces.into_iter()),
                None => match guarded(source, || source.stream()) {
                    Ok(batches) => Open::Stream(batches),
                    Err(reason) => {
                        self.open = Some(Open::Ended);
                        return Some(Task::Broken(reason));
                    }
                },
            });
        }
        match self.open.as_mut()? {
            Open::Pieces(pieces) => pieces.next().map(Task::Piece),
            Open::Stream(batches) => match guarded(source, || batches.next().transpose()) {
                Ok(batch) => batch.map(Task::Rows),
                Err(reason) => {
                    self.open = Some(Open::Ended);
                    Some(Task::Broken(reason))
                }
            },
            Open::Ended => None,
        }
    }
}

/// Calls a decoder, which damaged bytes may make panic.
pub(super) fn guarded<T>(
    source: &Source,
    read: impl FnOnce() -> Result<T, FleetError>,
) -> Result<T, FleetError> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(FleetError::at(&source.path, "the bytes are damaged; write the file again")))
}
