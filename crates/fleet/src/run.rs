//! Files of views to one file of poses, on all cores, in bounded memory, and from where it was when it was cut off.
//!
//! Each piece of the input becomes a part, which is written whole or not at all; in the end the parts are joined in the order of the input.
//! Which thread wrote a part, and in which run, leaves no trace in it: output and state are the same to the last bit.

mod join;
mod parts;
mod plan;

use crate::batch::{SolvedRows, solve_rows};
use crate::source::{Batches, Piece, Source};
use crate::{FleetError, FleetState, Solver};
use parts::{Part, Parts};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// What is to be done.
pub struct Job<'a> {
    /// Files of views, in order.
    pub inputs: &'a [PathBuf],
    /// Cameras and the noise of pixels.
    pub solver: &'a Solver,
    /// Where the poses go: Parquet, or CSV by its ending.
    pub output: &'a Path,
    /// Seconds of a period of the state.
    pub period_s: f64,
    /// Threads; 0: all cores.
    pub threads: usize,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Rows solved, or found solved by an earlier run.
    pub rows: u64,
    /// Rows there are, where the files say so.
    pub of: Option<u64>,
}

/// What came of it.
pub struct Done {
    /// Sums of every camera.
    pub state: FleetState,
    /// Rows written.
    pub rows: u64,
    /// Parts that an earlier run, cut off, had written.
    pub resumed_parts: usize,
    /// Parts in all.
    pub parts: usize,
    /// Files, or pieces of files, that could not be read, and why; everything else is in the output.
    pub failed: Vec<(PathBuf, String)>,
}

/// Solves every row of every file. Where `progress` returns false the work ends; the next run of the same job continues it.
///
/// # Errors
/// Before any work: a file that is missing or lacks columns, an output that cannot be written. A file that turns out to be damaged is in
/// `failed`. `Stopped` where `progress` wants no more.
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
    let parts = Parts::open(job.output, &plan::of(job))?;
    let rows: Option<usize> = sources.iter().map(Source::rows).sum();
    let work = Work {
        job,
        sources: &sources,
        parts: &parts,
        state: FleetState::new(job.period_s),
        has_view: sources.iter().any(|source| source.layout.view.is_some()),
        rows: AtomicU64::new(0),
        of: rows.map(|rows| rows as u64),
        resumed: AtomicU64::new(0),
        failed: Mutex::new(Vec::new()),
        progress,
    };
    let names = pool.install(|| work.all())?;
    let (state, resumed) = (work.state, work.resumed.into_inner() as usize);
    let mut broken = work.failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    broken.sort();
    failed.extend(broken.into_iter().map(|(file, _, reason)| (sources[file].path.clone(), reason)));
    join::join(&parts, &names, job.output, work.has_view)?;
    parts.remove();
    Ok(Done { state, rows: work.rows.into_inner(), resumed_parts: resumed, parts: names.len(), failed })
}

/// Whether a file is of the right kind, but broken: the others are still worth the work.
fn is_damaged(reason: &FleetError) -> bool {
    matches!(reason, FleetError::File(file) if file.reason.contains("write the file again"))
}

struct Work<'a> {
    job: &'a Job<'a>,
    sources: &'a [Source],
    parts: &'a Parts,
    state: FleetState,
    has_view: bool,
    rows: AtomicU64,
    of: Option<u64>,
    resumed: AtomicU64,
    /// File, part and reason.
    failed: Mutex<Vec<(usize, usize, String)>>,
    progress: &'a (dyn Fn(Progress) -> bool + Sync),
}

impl Work<'_> {
    /// The parts that there are in the end, in order.
    fn all(&self) -> Result<Vec<Part>, FleetError> {
        let mut pieces: Vec<(Part, Piece)> = Vec::new();
        let mut streams = Vec::new();
        for (file, source) in self.sources.iter().enumerate() {
            match source.pieces() {
                Some(own) => pieces
                    .extend(own.into_iter().enumerate().map(|(i, piece)| (Part { file, number: i }, piece))),
                None => streams.push(file),
            }
        }
        let done: Result<Vec<Option<Part>>, FleetError> =
            pieces.par_iter().with_max_len(1).map(|(part, piece)| self.piece(*part, piece)).collect();
        let mut parts: Vec<Part> = done?.into_iter().flatten().collect();
        for file in streams {
            parts.extend(self.stream(file)?);
        }
        parts.sort();
        Ok(parts)
    }

    /// None where the piece cannot be read.
    fn piece(&self, part: Part, piece: &Piece) -> Result<Option<Part>, FleetError> {
        let source = &self.sources[part.file];
        if self.is_there(part)? {
            return Ok(Some(part));
        }
        // Damaged bytes may make the decoder give up in its own way.
        let read = || {
            let rows = self.solved(source, source.read(piece)?)?;
            let n: usize = rows.iter().map(|rows| rows.answers.len()).sum();
            if n == piece.rows { Ok(rows) } else { Err(source.cut_short(piece, n)) }
        };
        let solved = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read));
        match solved.unwrap_or_else(|_| {
            Err(FleetError::at(&source.path, "the bytes are damaged; write the file again"))
        }) {
            Ok(rows) => self.write(part, rows).map(Some),
            Err(reason) => {
                self.fail(part, &reason);
                Ok(None)
            }
        }
    }

    fn solved(&self, source: &Source, batches: Batches) -> Result<Vec<SolvedRows>, FleetError> {
        let layout = source.view_layout();
        batches.map(|batch| Ok(solve_rows(&batch?, &layout, self.job.solver))).collect()
    }

    /// A file that is read from beginning to end: one thread reads, all solve.
    fn stream(&self, file: usize) -> Result<Vec<Part>, FleetError> {
        let source = &self.sources[file];
        let (mut batches, layout) = (source.stream()?, source.view_layout());
        let mut parts = Vec::new();
        loop {
            let some: Vec<_> = batches.by_ref().take(rayon::current_num_threads()).collect();
            if some.is_empty() {
                return Ok(parts);
            }
            let first = parts.len();
            let work = |(i, batch): (usize, Result<arrow_array::RecordBatch, FleetError>)| {
                let part = Part { file, number: first + i };
                match batch {
                    Ok(_) if self.is_there(part)? => Ok(Some(part)),
                    Ok(batch) => {
                        self.write(part, vec![solve_rows(&batch, &layout, self.job.solver)]).map(Some)
                    }
                    Err(reason) => {
                        self.fail(part, &reason);
                        Ok(None)
                    }
                }
            };
            let done: Result<Vec<Option<Part>>, FleetError> =
                some.into_par_iter().enumerate().map(work).collect();
            let done = done?;
            let is_broken = done.iter().any(Option::is_none);
            parts.extend(done.into_iter().flatten());
            if is_broken {
                return Ok(parts);
            }
        }
    }

    /// Whether an earlier run has written a part; its rows enter the state as if they were solved now.
    fn is_there(&self, part: Part) -> Result<bool, FleetError> {
        let Some(batches) = self.parts.read(part) else { return Ok(false) };
        let Ok(rows) = batches.collect::<Result<Vec<SolvedRows>, FleetError>>() else { return Ok(false) };
        self.resumed.fetch_add(1, Ordering::Relaxed);
        rows.iter().try_for_each(|rows| self.enter(rows))?;
        Ok(true)
    }

    fn write(&self, part: Part, rows: Vec<SolvedRows>) -> Result<Part, FleetError> {
        // What is solved is kept, whoever wants no more.
        let entered = rows.iter().try_for_each(|rows| self.enter(rows));
        self.parts.write(part, rows, self.has_view)?;
        entered.map(|()| part)
    }

    fn enter(&self, rows: &SolvedRows) -> Result<(), FleetError> {
        self.state.add(rows);
        let n = rows.answers.len() as u64;
        let rows = self.rows.fetch_add(n, Ordering::Relaxed) + n;
        let goes_on = (self.progress)(Progress { rows, of: self.of });
        if goes_on { Ok(()) } else { Err(FleetError::Stopped) }
    }

    fn fail(&self, part: Part, reason: &FleetError) {
        let mut failed = self.failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        failed.push((part.file, part.number, reason.to_string()));
    }
}
