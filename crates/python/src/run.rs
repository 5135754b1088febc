//! Long jobs: a thread of their own without the interpreter's lock, so that other threads run, Ctrl-C ends the wait and progress is
//! reported from the caller's thread.

use crate::error::error;
use pyo3::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// How often a waiting caller looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(20);

enum News<T> {
    Done(usize, usize),
    Answer(T),
}

/// What a job says while it runs.
pub struct Reporter<T> {
    news: Sender<News<T>>,
    stop: Arc<AtomicBool>,
}

impl<T> Clone for Reporter<T> {
    fn clone(&self) -> Self {
        Reporter { news: self.news.clone(), stop: self.stop.clone() }
    }
}

impl<T> Reporter<T> {
    /// Reports how many of how many inputs are done; returns false where the caller stopped.
    pub fn done(&self, n_done: usize, n_all: usize) -> bool {
        self.news.send(News::Done(n_done, n_all)).is_ok() && !self.stop.load(Ordering::Relaxed)
    }
}

/// Runs a job and waits for it. `progress` is called with how many of how many inputs are done; `True` is a bar in the terminal.
///
/// # Errors
/// KeyboardInterrupt, what `progress` raises, and `panic` for a mistake of this library; the job then ends, and where it
/// reports nothing it ends by itself, its answer dropped.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce(&Reporter<T>) -> T + Send + 'static,
) -> PyResult<T> {
    let progress = progress.map(|progress| hearer(py, progress)).transpose()?;
    let (news, mut received) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let reporter = Reporter { news, stop: stop.clone() };
    let thread = std::thread::Builder::new().name("resight".to_owned()).spawn(move || {
        let answer = job(&reporter);
        let _ = reporter.news.send(News::Answer(answer)); // Dropped where the caller stopped.
    });
    thread.map_err(|reason| error(py, "panic", format!("no thread can be started: {reason}")))?;
    let ended = |reason: PyErr| {
        stop.store(true, Ordering::Relaxed);
        reason
    };
    loop {
        let (back, next) = py.detach(move || next_of(received));
        received = back;
        match next {
            Ok(News::Answer(answer)) => return Ok(answer),
            Ok(News::Done(n_done, n_all)) => {
                if let Some(progress) = &progress {
                    progress.call1((n_done, n_all)).map_err(ended)?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(panicked(py)),
        }
        py.check_signals().map_err(ended)?;
    }
}

/// Runs a short job on the caller's thread, meanwhile without the interpreter's lock.
///
/// # Errors
/// `panic` for a mistake of this library.
pub fn here<T: Send>(py: Python<'_>, job: impl FnOnce() -> T + Send) -> PyResult<T> {
    let job = AssertUnwindSafe(job); // What it leaves half done is dropped with it: inputs are only read.
    py.detach(|| catch_unwind(job)).map_err(|_| panicked(py))
}

fn panicked(py: Python<'_>) -> PyErr {
    let message = "the library panicked, which is a mistake of its own; please report it".to_owned();
    error(py, "panic", message)
}

/// Panics, on a thread of its own or here: how the tests see what becomes of a mistake of the library.
#[pyfunction]
pub fn panic_on_purpose(py: Python<'_>, on_own_thread: bool) -> PyResult<()> {
    let job = || panic!("on purpose");
    if on_own_thread { run(py, None, move |_| job()) } else { here(py, job) }
}

/// The receiver of the progress: `progress` itself, or a bar.
fn hearer<'py>(py: Python<'py>, progress: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    match progress.extract::<bool>() {
        Ok(true) => py.import("resight._progress")?.call_method0("bar"),
        Ok(false) => py.import("resight._progress")?.getattr("silence"),
        Err(_) => Ok(progress.clone()),
    }
}

/// What a caller wants to hear of a job on its own thread.
pub struct Heard<'py>(Option<Bound<'py, PyAny>>);

impl<'py> Heard<'py> {
    /// Of the argument `progress`.
    pub fn new(py: Python<'py>, progress: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        Ok(Heard(progress.map(|progress| hearer(py, progress)).transpose()?))
    }

    /// So many of so many are done.
    ///
    /// # Errors
    /// What the caller's function raises.
    pub fn done(&self, n_done: usize, n_all: usize) -> PyResult<()> {
        self.0.as_ref().map_or(Ok(()), |hear| hear.call1((n_done, n_all)).map(|_| ()))
    }
}

type Next<T> = (Receiver<News<T>>, Result<News<T>, RecvTimeoutError>);

fn next_of<T>(received: Receiver<News<T>>) -> Next<T> {
    let next = received.recv_timeout(LOOK);
    (received, next)
}
