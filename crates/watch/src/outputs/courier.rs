//! A thread that sends one receiver the items of an outbox.

use super::Common;
use super::outbox::{Counted, Outbox, Weight};
use super::retry::Standing;
use anyhow::{Context, Result};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use tokio::runtime::{Builder, Runtime};

/// The session's side of the thread.
pub struct Courier<T> {
    outbox: Arc<Outbox<T>>,
    standing: Standing,
    /// Ends with the thread.
    done: Receiver<()>,
    flush_s: f64,
    capacity: usize,
}

impl<T: Send + 'static> Courier<T> {
    /// Starts `work` on a thread of its own. `part` is its name in the log and in the metrics.
    ///
    /// # Errors
    /// The operating system provides no thread.
    pub fn start(
        part: &'static str,
        receiver: &str,
        capacity: usize,
        common: &mut Common<'_>,
        work: impl FnOnce(Arc<Outbox<T>>, Standing, Runtime) + Send + 'static,
    ) -> Result<Self> {
        let outbox = Arc::new(Outbox::new(capacity));
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let (alive, done) = channel::<()>();
        let (shared, standing) = (Arc::clone(&outbox), Standing::new(common.log, part, receiver));
        let run = move || {
            work(shared, standing, runtime);
            drop(alive); // drop(alive); // Shows the end of the thread to `finish`.
        };
        std::thread::Builder::new().name(part.to_string()).spawn(run).context("a thread for it")?;
        common.counted.push((part, Arc::clone(&outbox) as Arc<dyn Counted>));
        let standing = Standing::new(common.log, part, receiver);
        Ok(Courier { outbox, standing, done, flush_s: common.flush_s, capacity })
    }

    /// Adds an item without waiting.
    pub fn tell(&self, weight: Weight, item: T) {
        if self.outbox.push(weight, item) {
            let capacity = self.capacity;
            self.standing
                .say(&format!("{capacity} wait, no more are kept; from now on the least and oldest go"));
        }
    }

    /// Ends the session: what waits may take at most the configured time.
    pub fn finish(&self) {
        self.outbox.close();
        // Whether it ended or not, the rest is counted.
        let _ = self.done.recv_timeout(Duration::from_secs_f64(self.flush_s));
        let counts = self.outbox.counts();
        let (taken, lost) = (counts.taken, counts.taken.saturating_sub(counts.delivered));
        if 0 < lost {
            let (dropped, refused, waiting) = (counts.dropped, counts.refused, counts.waiting());
            let flush_s = self.flush_s;
            self.standing.say(&format!(
                "{lost} of {taken} never arrived: {dropped} dropped, {refused} refused, {waiting} not taken within --flush-s {flush_s}"
            ));
        }
    }
}
