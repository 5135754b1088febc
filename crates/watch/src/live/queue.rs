//! A queue of few frames between the thread that reads and the one that processes; a full queue drops its oldest.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Shared by one writer and one reader.
pub(super) struct Queue<T> {
    inner: Mutex<Inner<T>>,
    changed: Condvar,
    capacity: usize,
}

struct Inner<T> {
    waiting: VecDeque<T>,
    /// Used items, returned to the writer.
    spent: Vec<T>,
    dropped: u64,
    is_closed: bool,
    /// Reason why no more items will come, where that is not the end of the source.
    failure: Option<String>,
}

/// The result of taking an item.
pub(super) enum Taken<T> {
    Item(T),
    Nothing,
    Closed,
}

impl<T> Queue<T> {
    pub fn new(capacity: usize) -> Self {
        let inner = Inner {
            waiting: VecDeque::new(),
            spent: Vec::new(),
            dropped: 0,
            is_closed: false,
            failure: None,
        };
        Queue { inner: Mutex::new(inner), changed: Condvar::new(), capacity: capacity.max(1) }
    }

    /// A thread that panicked while it held the lock left a valid queue.
    fn lock(&self) -> MutexGuard<'_, Inner<T>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an item and drops the oldest of a full queue. Returns false when the reader is gone.
    pub fn push_dropping(&self, item: T) -> bool {
        let mut inner = self.lock();
        if inner.is_closed {
            return false;
        }
        if self.capacity <= inner.waiting.len() {
            let oldest = inner.waiting.pop_front();
            inner.spent.extend(oldest);
            inner.dropped += 1;
        }
        inner.waiting.push_back(item);
        drop(inner);
        self.changed.notify_all();
        true
    }

    /// Waits for room and adds an item. Returns false when the reader is gone.
    pub fn push_waiting(&self, item: T) -> bool {
        let mut inner = self.lock();
        while self.capacity <= inner.waiting.len() && !inner.is_closed {
            inner = self.changed.wait(inner).unwrap_or_else(PoisonError::into_inner);
        }
        let is_open = !inner.is_closed;
        if is_open {
            inner.waiting.push_back(item);
        }
        drop(inner);
        self.changed.notify_all();
        is_open
    }

    /// Takes the oldest item; waits for one at most this long.
    pub fn take(&self, patience: Duration) -> Taken<T> {
        let inner = self.lock();
        let (mut inner, _) = self
            .changed
            .wait_timeout_while(inner, patience, |inner| inner.waiting.is_empty() && !inner.is_closed)
            .unwrap_or_else(PoisonError::into_inner);
        let taken = match inner.waiting.pop_front() {
            Some(item) => Taken::Item(item),
            None if inner.is_closed => Taken::Closed,
            None => Taken::Nothing,
        };
        drop(inner);
        self.changed.notify_all();
        taken
    }

    /// Returns a used item to the writer.
    pub fn give_back(&self, item: T) {
        self.lock().spent.push(item);
    }

    /// Returns the items that the writer may use again: those given back, and those dropped.
    pub fn take_back(&self) -> Vec<T> {
        std::mem::take(&mut self.lock().spent)
    }

    /// Closes the queue: no more items will come, or the reader is gone.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_all();
    }

    /// Closes the queue because the writer failed.
    pub fn fail(&self, reason: String) {
        self.lock().failure = Some(reason);
        self.close();
    }

    /// Takes the reason why the writer failed.
    pub fn take_failure(&self) -> Option<String> {
        self.lock().failure.take()
    }

    /// Returns the number of items dropped since the last call.
    pub fn take_dropped(&self) -> u64 {
        std::mem::take(&mut self.lock().dropped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(queue: &Queue<u32>) -> Option<u32> {
        match queue.take(Duration::ZERO) {
            Taken::Item(item) => Some(item),
            _ => None,
        }
    }

    #[test]
    fn a_full_queue_forgets_its_oldest_and_counts() {
        let queue = Queue::new(2);
        (0..5).for_each(|i| assert!(queue.push_dropping(i)));
        assert_eq!((item(&queue), item(&queue), item(&queue)), (Some(3), Some(4), None));
        assert_eq!((queue.take_dropped(), queue.take_dropped()), (3, 0));
    }

    #[test]
    fn what_is_dropped_or_done_with_goes_back_to_the_writer() {
        let queue = Queue::new(2);
        (0..3).for_each(|i| assert!(queue.push_dropping(i)));
        item(&queue).into_iter().for_each(|i| queue.give_back(i));
        assert_eq!((queue.take_back(), queue.take_back()), (vec![0, 1], vec![]));
    }

    #[test]
    fn a_waiting_writer_loses_nothing() {
        let queue = std::sync::Arc::new(Queue::new(1));
        let writer = std::sync::Arc::clone(&queue);
        let thread = std::thread::spawn(move || {
            (0..100).for_each(|i| assert!(writer.push_waiting(i)));
            writer.close();
        });
        let mut got = Vec::new();
        loop {
            match queue.take(Duration::from_secs(10)) {
                Taken::Item(item) => got.push(item),
                Taken::Closed => break,
                Taken::Nothing => panic!("the writer fell silent"),
            }
        }
        thread.join().expect("the writer");
        assert_eq!(got, (0..100).collect::<Vec<_>>());
    }

    #[test]
    fn a_writer_is_reported_that_nobody_reads() {
        let queue = Queue::new(1);
        assert!(queue.push_dropping(1));
        queue.close();
        assert!(!queue.push_waiting(2) && !queue.push_dropping(2));
        assert_eq!((item(&queue), item(&queue)), (Some(1), None));
    }
}
