//! Grants searches of frames to as many cameras at once as there are processors, in the order of their requests.
//!
//! Searches that share a processor slice by slice all end late; one after the other the first ends in half the time, and the last no later.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::available_parallelism;

/// State shared by the threads that process frames.
pub(super) struct Turns {
    line: Mutex<Line>,
    changed: Condvar,
}

struct Line {
    free: usize,
    /// Number of the next request, and of the next one to be granted.
    next: u64,
    called: u64,
}

/// A granted search, given back when dropped.
pub(super) struct Turn<'a>(&'a Turns);

impl Turns {
    /// Allows one search at a time for each processor.
    pub fn new() -> Self {
        Self::of(available_parallelism().map_or(1, usize::from))
    }

    fn of(free: usize) -> Self {
        Turns { line: Mutex::new(Line { free, next: 0, called: 0 }), changed: Condvar::new() }
    }

    /// A thread that panicked during its search has given it back.
    fn lock(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until a search is granted.
    pub fn take(&self) -> Turn<'_> {
        let mut line = self.lock();
        let number = line.next;
        line.next += 1;
        while line.free == 0 || line.called != number {
            line = self.changed.wait(line).unwrap_or_else(PoisonError::into_inner);
        }
        line.free -= 1;
        line.called += 1;
        if 0 < line.free {
            self.changed.notify_all();
        }
        Turn(self)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.lock().free += 1;
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn never_more_at_once_than_turns_and_all_get_theirs() {
        let (turns, now, most) = (Turns::of(2), AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..5 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        let _turn = turns.take();
                        most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        std::thread::yield_now();
                        now.fetch_sub(1, Ordering::SeqCst);
                    }
                });
            }
        });
        assert_eq!((most.load(Ordering::SeqCst), turns.lock().called), (2, 1000));
    }

    #[test]
    fn a_panic_gives_the_turn_back() {
        let turns = Arc::new(Turns::of(1));
        let other = Arc::clone(&turns);
        let failed = std::thread::spawn(move || {
            let _turn = other.take();
            panic!("as a test");
        });
        assert!(failed.join().is_err());
        drop(turns.take());
    }
}
