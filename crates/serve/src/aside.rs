//! Work beside the threads that answer.

use crate::error::Problem;
use resight::detect::stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;

/// A turn at some kind of work, of which only so much is done at the same time.
pub type Permit = OwnedSemaphorePermit;

/// Waits for a turn.
///
/// # Errors
/// The program ends.
pub async fn turn(turns: &Arc<Semaphore>) -> Result<Permit, Problem> {
    Arc::clone(turns).acquire_owned().await.map_err(|_| Problem::failed())
}

/// Runs on a thread of its own, where a failure loses one request.
///
/// Where nobody waits for it any more (a request that was cancelled, that took too long, or whose client left) a search for a target ends soon,
/// and other work when it is done. `held` is what the work needs besides the thread: its turn, and the memory that it takes. Both are returned
/// when the work has ended, so that there are never more threads at work, and no more memory in use, than turns and memory allow. `()` is for
/// what takes milliseconds.
///
/// # Errors
/// A thread that failed.
pub async fn aside<T: Send + 'static>(
    held: impl Send + 'static,
    job: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    let waiting = Waiting::default();
    let is_left = Arc::clone(&waiting.is_left);
    let work = move || {
        let _held = held;
        stop::unless(move || is_left.load(Ordering::Relaxed), job)
    };
    let done = spawn_blocking(work).await;
    drop(waiting);
    done.ok().flatten().ok_or_else(Problem::failed)
}

/// Somebody who waits for work, until this is dropped.
#[derive(Default)]
struct Waiting {
    is_left: Arc<AtomicBool>,
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.is_left.store(true, Ordering::Relaxed);
    }
}
