//! Work beside the threads that answer.

use crate::error::Problem;
use tokio::task::spawn_blocking;

/// Runs on a thread of its own, where a failure loses one request.
///
/// # Errors
/// A thread that failed.
pub async fn aside<T: Send + 'static>(job: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    spawn_blocking(job).await.map_err(|_| Problem::failed())
}
