//! What waits for a receiver that is slow or away: in order, bounded, and what matters least makes room.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::timeout;

/// What makes room first, least first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Weight {
    /// One of many frames.
    Frame,
    /// A camera is (again) as it should be, or not decided yet.
    Routine,
    /// Needs attention.
    Alarm,
}

/// What became of all that was to be reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Put in.
    pub taken: u64,
    /// Acknowledged by the receiver.
    pub delivered: u64,
    /// Not wanted by the receiver, and not tried again.
    pub refused: u64,
    /// Pushed out because too many waited.
    pub dropped: u64,
}

impl Counts {
    /// Not yet acknowledged, those on their way included.
    pub fn waiting(&self) -> u64 {
        self.taken.saturating_sub(self.delivered + self.refused + self.dropped)
    }
}

/// One writer that never waits, one reader that does.
pub struct Outbox<T> {
    inner: Mutex<Inner<T>>,
    changed: Notify,
    capacity: usize,
}

struct Inner<T> {
    waiting: VecDeque<(Weight, T)>,
    counts: Counts,
    /// Dropped since nothing waited any more.
    dropped_lately: u64,
    is_closed: bool,
}

/// Something that counts what it delivers; the metrics read it.
pub trait Counted: Send + Sync {
    /// As of now.
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

    /// A thread that panicked while it held the lock left a queue that is still whole.
    fn lock(&self) -> MutexGuard<'_, Inner<T>> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an item. A full queue drops the oldest of those that weigh least, which may be the new one; true when this is the first
    /// one dropped since nothing waited any more.
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

    /// The oldest item, however long it takes; none when the queue is closed and empty.
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

    /// An item that could not be delivered goes back to where it was.
    pub fn put_back(&self, weight: Weight, item: T) {
        self.lock().waiting.push_front((weight, item));
    }

    /// The receiver acknowledged an item. Where nothing waits any more: how many were dropped since the last time it was so.
    pub fn delivered(&self) -> u64 {
        let mut inner = self.lock();
        inner.counts.delivered += 1;
        inner.dropped_meanwhile()
    }

    /// The receiver does not want an item.
    pub fn refused(&self) -> u64 {
        let mut inner = self.lock();
        inner.counts.refused += 1;
        inner.dropped_meanwhile()
    }

    /// Nothing more will come; a pause of the reader ends at once, so that it tries again while there is time.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_one();
    }

    pub fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// A pause before the next try, cut short where the queue is closed meanwhile.
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
        // Over or cut short: either way it is time to try again.
        let _ = timeout(pause, closed).await;
    }
}

impl<T> Inner<T> {
    /// A receiver that is a little too slow all the time drops something at every step: that is one event, reported at its beginning and its end.
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

    /// Slower than what is to be reported, for long: one beginning and, when it has caught up, one end.
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
