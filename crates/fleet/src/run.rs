//! Files of views to one file of poses, on all cores, in bounded memory; an interrupted run continues.
//!
//! Each piece of the input becomes a part of the output, written in the order of the input and recorded when it is complete. Output and state do
//! not depend on the thread and the run that solved it: they are the same to the last bit.

mod growing;
mod plan;
mod queue;

use crate::batch::{SolvedRows, solve_rows};
use crate::source::{Piece, Source};
use crate::{FleetError, FleetState, Solver};
use growing::{Growing, Note, Ready};
use queue::{Claim, Queue, Task};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// The settings of a run.
pub struct Job<'a> {
    /// Files of views, in order.
    pub inputs: &'a [PathBuf],
    /// Cameras and the noise of pixels.
    pub solver: &'a Solver,
    /// The file of poses: Parquet, or CSV by its ending.
    pub output: &'a Path,
    /// Seconds of a period of the state.
    pub period_s: f64,
    /// Number of threads; 0: all cores.
    pub threads: usize,
}

/// The progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Rows solved, now or by an earlier run.
    pub rows: u64,
    /// Number of all rows, where the files state it.
    pub of: Option<u64>,
}

/// The result of a run.
pub struct Done {
    /// Sums of every camera.
    pub state: FleetState,
    /// Rows written.
    pub rows: u64,
    /// Parts that an earlier, interrupted run had written.
    pub resumed_parts: usize,
    /// Number of all parts.
    pub parts: usize,
    /// Files, or pieces of files, that could not be read, with the reason; everything else is in the output.
    pub failed: Vec<(PathBuf, String)>,
}

/// Solves every row of every file. Where `progress` returns false the run ends; the next run of the same job continues it.
///
/// # Errors
/// Before any work: a file that is missing or lacks columns, an output that cannot be written. A file that turns out to be damaged is in
/// `failed`. `Stopped` where `progress` returns false.
pub fn run(job: &Job, progress: &(dyn Fn(Progress) -> bool + Sync)) -> Result<Done, FleetError> {
    let mut failed = Vec::new();
    let mut sources = Vec::new();
    for path in job.inputs {
        match Source::open(path) {
            Ok(source) => sources.push(source),
            Err(reason) if is_damaged(&reason) => failed.push((path.clone(), reason.to_string())),
            Err(reason) => return Err(reason),
        }
    }
    if sources.is_empty() {
        let reason = failed.into_iter().map(|(_, reason)| reason).next();
        return Err(FleetError::Setting(reason.unwrap_or_else(|| "no file of views is given".into())));
    }
    if job.output.is_dir() {
        let reason = "this is a folder; the output is one file, e.g. poses.parquet";
        return Err(FleetError::at(job.output, reason));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(job.threads).build();
    let pool = pool.map_err(|e| FleetError::Setting(format!("threads cannot be started: {e}")))?;
    let has_view = sources.iter().any(|source| source.layout.view.is_some());
    let rows: Option<usize> = sources.iter().map(Source::rows).sum();
    let work = Work {
        job,
        sources: &sources,
        output: Growing::open(job.output, &plan::of(job), has_view)?,
        queue: Mutex::new(Queue::new(&sources)),
        state: FleetState::new(job.period_s),
        rows: AtomicU64::new(0),
        of: rows.map(|rows| rows as u64),
        resumed: AtomicU64::new(0),
        failed: Mutex::new(Vec::new()),
        progress,
    };
    let ends = pool.broadcast(|_| work.work());
    // The first real error is reported, not that of a thread that stopped because of it.
    let (gone, others): (Vec<_>, Vec<_>) =
        ends.into_iter().filter_map(Result::err).partition(|reason| matches!(reason, FleetError::Stopped));
    if let Some(reason) = others.into_iter().chain(gone).next() {
        return Err(reason);
    }
    let Work { output, state, rows, resumed, failed: broken, .. } = work;
    let mut broken = broken.into_inner().unwrap_or_else(PoisonError::into_inner);
    broken.sort();
    failed.extend(broken.into_iter().map(|(file, _, reason)| (sources[file].path.clone(), reason)));
    let (resumed_parts, rows) = (resumed.into_inner() as usize, rows.into_inner());
    let parts = output.finish(job.output)?;
    Ok(Done { state, rows, resumed_parts, parts, failed })
}

/// Returns whether a file is of the right kind, but damaged: the other files are still solved.
fn is_damaged(reason: &FleetError) -> bool {
    matches!(reason, FleetError::File(file) if file.reason.contains("write the file again"))
}

struct Work<'a> {
    job: &'a Job<'a>,
    sources: &'a [Source],
    output: Growing,
    queue: Mutex<Queue<'a>>,
    state: FleetState,
    rows: AtomicU64,
    of: Option<u64>,
    resumed: AtomicU64,
    /// File, part and reason.
    failed: Mutex<Vec<(usize, usize, String)>>,
    progress: &'a (dyn Fn(Progress) -> bool + Sync),
}

impl Work<'_> {
    /// Processes parts in each thread until nothing is left or one of them fails.
    fn work(&self) -> Result<(), FleetError> {
        let done = catch_unwind(AssertUnwindSafe(|| {
            while let Some(claim) = self.claim() {
                self.part(claim)?;
            }
            Ok(())
        }));
        if !matches!(done, Ok(Ok(()))) {
            self.output.give_up();
        }
        done.unwrap_or_else(|panic| resume_unwind(panic))
    }

    fn claim(&self) -> Option<Claim> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner).claim()
    }

    fn part(&self, claim: Claim) -> Result<(), FleetError> {
        let (part, file) = (claim.part, claim.file);
        let (ready, rows) = self.ready(claim)?;
        if let Ready::Failed(reason) | Ready::Broken(reason) = &ready {
            self.fail(file, part, reason);
        }
        // A solved part is written also when the caller stops the run.
        let goes_on = self.output.write(part, ready)?;
        let rows = self.rows.fetch_add(rows, Ordering::Relaxed) + rows;
        let goes_on = goes_on && (self.progress)(Progress { rows, of: self.of });
        if goes_on { Ok(()) } else { Err(FleetError::Stopped) }
    }

    /// Returns a part with its number of rows, which are in the state from then on.
    fn ready(&self, claim: Claim) -> Result<(Ready, u64), FleetError> {
        match self.output.note(claim.part) {
            Some(Note::Failed(reason)) => return Ok((Ready::Failed(reason.clone()), 0)),
            // Its rows enter the state as if they were solved now.
            Some(Note::Written(group)) => {
                if let Some(rows) = self.output.read(group) {
                    self.resumed.fetch_add(1, Ordering::Relaxed);
                    self.state.add(&rows);
                    return Ok((Ready::There(group.clone()), rows.answers.len() as u64));
                }
            }
            None => {}
        }
        let source = &self.sources[claim.file];
        let solved = match claim.task {
            Task::Piece(piece) => self.solve_piece(source, &piece),
            Task::Rows(batch) => Ok(solve_rows(&batch, &source.view_layout(), self.job.solver)),
            Task::Broken(reason) => return Ok((Ready::Broken(reason.to_string()), 0)),
        };
        match solved {
            Ok(rows) => {
                self.state.add(&rows);
                let n = rows.answers.len() as u64;
                Ok((self.output.encode(claim.part, rows)?, n))
            }
            Err(reason) => Ok((Ready::Failed(reason.to_string()), 0)),
        }
    }

    /// Solves a piece; damaged bytes may make the decoder panic.
    fn solve_piece(&self, source: &Source, piece: &Piece) -> Result<SolvedRows, FleetError> {
        let batch = queue::guarded(source, || source.read(piece))?;
        Ok(solve_rows(&batch, &source.view_layout(), self.job.solver))
    }

    fn fail(&self, file: usize, part: usize, reason: &str) {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).push((file, part, reason.to_string()));
    }
}
