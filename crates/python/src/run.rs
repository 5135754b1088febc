//! Long jobs: a thread of their own without the interpreter's lock, so that other threads run, Ctrl-C ends the wait and progress is
//! reported from the caller's thread.

use crate::error::error;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// How often a waiting caller looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(20);

enum News<T> {
    Done(usize),
    Answer(T),
}

/// What a job says while it runs.
pub struct Reporter<T> {
    news: Sender<News<T>>,
    stop: Arc<AtomicBool>,
}

impl<T> Reporter<T> {
    /// So many inputs are done; false where nobody waits for the rest.
    pub fn done(&self, n: usize) -> bool {
        self.news.send(News::Done(n)).is_ok() && !self.stop.load(Ordering::Relaxed)
    }
}

/// Runs a job and waits for it. `progress` is called with how many of `total` inputs are done.
///
/// # Errors
/// KeyboardInterrupt, what `progress` raises, and `panic` for a mistake of this library; the job is then told to end, and where it
/// reports nothing it ends by itself, its answer dropped.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    total: usize,
    job: impl FnOnce(&Reporter<T>) -> T + Send + 'static,
) -> PyResult<T> {
    let (news, mut received) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let reporter = Reporter { news, stop: stop.clone() };
    let thread = std::thread::Builder::new().name("resight".to_owned()).spawn(move || {
        let answer = job(&reporter);
        let _ = reporter.news.send(News::Answer(answer)); // Nobody waits any more: dropped.
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
            Ok(News::Done(n)) => {
                if let Some(progress) = progress {
                    progress.call1((n, total)).map_err(ended)?;
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let message =
                    "the library panicked, which is a mistake of its own; please report it".to_owned();
                return Err(error(py, "panic", message));
            }
        }
        py.check_signals().map_err(ended)?;
    }
}

type Next<T> = (Receiver<News<T>>, Result<News<T>, RecvTimeoutError>);

fn next_of<T>(received: Receiver<News<T>>) -> Next<T> {
    let next = received.recv_timeout(LOOK);
    (received, next)
}
