//! The queue for a receiver that is slow or absent: in order and bounded; the items of least weight are dropped first.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::timeout;

/// The weights in the order in which items are dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// One of many frames.
    Frame,
    /// A state without an alarm: steady again, or not decided yet.
    Routine,
    /// An event that needs attention.
    Alarm,
}

/// The counts of all items.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Items added.
    pub taken: u64,
    /// Acknowledged by the receiver.
    pub delivered: u64,
    /// Items that the receiver rejected, and that are not tried again.
    pub refused: u64,
    /// Items dropped because too many waited.
    pub dropped: u64,
}

impl Counts {
    /// Returns the number of items not yet acknowledged, including those being sent.
    pub fn waiting(&self) -> u64 {
        self.taken.saturating_sub(self.delivered + self.refused + self.dropped)
    }
}

/// A queue with one writer that never waits and one reader that does.
pub struct Outbox<T> {
    inner: Mutex<Inner<T>>,
    changed: Notify,
    capacity: usize,
}

struct Inner<T> {
    waiting: VecDeque<(Weight, T)>,
    counts: Counts,
    /// Items dropped since the queue was last empty.
    dropped_lately: u64,
    is_closed: bool,
}

/// An output that counts its deliveries; the metrics read the counts.
pub trait Counted: Send + Sync {
    /// Returns the present counts.
    fn counts(&self) -> Counts;
}

impl<T: Send> Counted for Outbox<T> {
    fn counts(&self) -> Counts {
        self.lock().counts
    }
}

impl<T> Outbox<T> {
    pub fn new(capacity: usize) -> Self {
        let inner = Inner {
            waiting: VecDeque::new(),
            counts: Counts::default(),
            dropped_lately: 0,
            is_closed: false,
        };
        Outbox { inner: Mutex::new(inner), changed: Notify::new(), capacity: capacity.max(1) }
    }

    /// A thread that panicked while it held the lock left a valid queue.
    fn lock(&self) -> MutexGuard<'_, Inner<T>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an item. A full queue drops the oldest of least weight, which may be the new one; returns true when this is the first one dropped
    /// since the queue was last empty.
    pub fn push(&self, weight: Weight, item: T) -> bool {
        let mut inner = self.lock();
        inner.counts.taken += 1;
        inner.waiting.push_back((weight, item));
        let is_over = self.capacity < inner.waiting.len();
        if is_over {
            inner.drop_least();
        }
        let is_first = is_over && inner.dropped_lately == 1;
        drop(inner);
        self.changed.notify_one();
        is_first
    }

    /// Waits for the oldest item; none when the queue is closed and empty.
    pub async fn next(&self) -> Option<(Weight, T)> {
        loop {
            {
                let mut inner = self.lock();
                match inner.waiting.pop_front() {
                    Some(item) => return Some(item),
                    None if inner.is_closed => return None,
                    None => {}
                }
            }
            self.changed.notified().await;
        }
    }

    /// Puts an item that could not be delivered back at its place.
    pub fn put_back(&self, weight: Weight, item: T) {
        self.lock().waiting.push_front((weight, item));
    }

    /// Counts an acknowledged item. Where the queue is empty now, returns how many were dropped since it was last empty.
    pub fn delivered(&self) -> u64 {
        let mut inner = self.lock();
        inner.counts.delivered += 1;
        inner.dropped_meanwhile()
    }

    /// Counts an item that the receiver rejects.
    pub fn refused(&self) -> u64 {
        let mut inner = self.lock();
        inner.counts.refused += 1;
        inner.dropped_meanwhile()
    }

    /// Closes the queue; a pause of the reader ends at once, so that it tries again while there is time.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_one();
    }

    pub fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// Waits before the next try, at most until the queue is closed.
    pub async fn rest(&self, pause: Duration) {
        if self.is_closed() {
            tokio::time::sleep(pause).await;
            return;
        }
        let closed = async {
            while !self.is_closed() {
                self.changed.notified().await;
            }
        };
        // Whether over or cut short, the pause ends with a try.
        let _ = timeout(pause, closed).await;
    }
}

impl<T> Inner<T> {
    /// Returns the number dropped. A slightly slow receiver drops something at every step: that is one event, reported at its beginning and its
    /// end.
    fn dropped_meanwhile(&mut self) -> u64 {
        if self.waiting.is_empty() { std::mem::take(&mut self.dropped_lately) } else { 0 }
    }

    fn drop_least(&mut self) {
        let least = self.waiting.iter().map(|(weight, _)| *weight).min();
        if let Some(place) = self.waiting.iter().position(|(weight, _)| Some(*weight) == least) {
            self.waiting.remove(place);
            self.counts.dropped += 1;
            self.dropped_lately += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(outbox: &Outbox<u32>) -> Vec<u32> {
        outbox.close();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        runtime.block_on(async {
            let mut items = Vec::new();
            while let Some((_, item)) = outbox.next().await {
                items.push(item);
            }
            items
        })
    }

    #[test]
    fn order_is_kept_and_the_oldest_of_the_least_makes_room() {
        let outbox = Outbox::new(3);
        let weights = [Weight::Routine, Weight::Alarm, Weight::Routine, Weight::Alarm, Weight::Alarm];
        let first: Vec<bool> =
            weights.iter().zip(0..).map(|(weight, item)| outbox.push(*weight, item)).collect();
        assert_eq!(first, [false, false, false, true, false]);
        assert_eq!(all(&outbox), [1, 3, 4]);
        assert_eq!(outbox.counts(), Counts { taken: 5, delivered: 0, refused: 0, dropped: 2 });
    }

    #[test]
    fn among_equals_the_oldest_goes_and_a_light_newcomer_goes_at_once() {
        let outbox = Outbox::new(2);
        for item in 0..4 {
            outbox.push(Weight::Alarm, item);
        }
        outbox.push(Weight::Frame, 9);
        assert_eq!(all(&outbox), [2, 3]);
    }

    /// A receiver that is slower than the events for long: one beginning and, when it has caught up, one end.
    #[test]
    fn a_slow_receiver_is_one_story() {
        let outbox = Outbox::new(3);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        let take = || {
            runtime.block_on(outbox.next()).expect("an item");
            outbox.delivered()
        };
        let (mut begun, mut ended) = (0, Vec::new());
        for item in 0..100 {
            begun += u32::from(outbox.push(Weight::Alarm, item));
            if item % 2 == 0 {
                ended.push(take());
            }
        }
        ended.extend([take(), take(), take()]);
        ended.retain(|dropped| *dropped != 0);
        assert_eq!((begun, ended), (1, vec![outbox.counts().dropped]));
        assert!(!outbox.push(Weight::Alarm, 0));
    }

    #[test]
    fn what_is_put_back_is_first_again_and_counts_add_up() {
        let outbox = Outbox::new(2);
        outbox.push(Weight::Alarm, 1);
        outbox.put_back(Weight::Alarm, 0);
        outbox.delivered();
        assert_eq!(outbox.counts().waiting(), 0);
        assert_eq!(all(&outbox), [0, 1]);
    }
}
