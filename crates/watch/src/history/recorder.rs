//! Passes rows from the session to the disk: a bounded queue that never makes the session wait, and the writer that empties it.

use super::rows::{EventRow, FrameRow};
use super::store::{Opened, Store};
use super::{HistoryError, Retention};
use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The settings of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The file.
    pub path: PathBuf,
    /// Cameras with their targets, by name; rows name them by their place here.
    pub pairs: Vec<(String, String)>,
    /// Longest time between commits while rows come, seconds.
    pub commit_s: f64,
    /// Frames that may wait; then the oldest are given up and counted. As many events may wait.
    pub waiting: usize,
    /// After a failure the writer tries again this often, seconds.
    pub retry_s: f64,
    /// The retention of rows.
    pub retention: Retention,
}

/// Rows that were given up, because the disk did not take them in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NotStored {
    /// Frames.
    pub frames: u64,
    /// Events.
    pub events: u64,
}

/// The rows of this session that are on the disk.
#[derive(Debug, Clone, PartialEq)]
pub struct Stored {
    /// Number of the session in the history.
    pub session: i64,
    /// Frames stored so far.
    pub frames: u64,
    /// Events stored so far.
    pub events: u64,
    /// Rows given up so far.
    pub not_stored: NotStored,
    /// For each pair the capture time, seconds, of its newest frame on the disk: every earlier one is there, but those given up.
    pub through_s: Vec<Option<f64>>,
}

/// Reports of the writer.
#[derive(Debug)]
pub enum Reported {
    /// More rows are on the disk, for good.
    Stored(Stored),
    /// They are not, and why; it continues trying. Said once.
    Degraded(HistoryError),
    /// They are again, or the disk is slower than rows come: rows given up in between.
    Recovered(NotStored),
    /// The file was damaged; it is there now, and a new one begun.
    PutAside(PathBuf, String),
    /// The session is over and some rows were not stored.
    Lost(NotStored),
}

/// Takes rows and never waits.
#[derive(Clone)]
pub struct Recorder {
    queue: Arc<Queue>,
}

/// Stores them.
pub struct Writer {
    recording: Recording,
    queue: Arc<Queue>,
    store: Option<Store>,
    /// The rows stored in the current file.
    stored: Stored,
    is_degraded: bool,
    /// The numbers when it was last reported that rows are stored.
    said: NotStored,
    next_saying: Instant,
    next_thinning: Instant,
}

struct Queue {
    inner: Mutex<Inner>,
    changed: Condvar,
    waiting: usize,
}

#[derive(Default)]
struct Inner {
    frames: VecDeque<FrameRow>,
    events: VecDeque<EventRow>,
    not_stored: NotStored,
    is_closed: bool,
}

/// Rows of one transaction at most.
const BATCH: usize = 4096;
/// Rows that are not waited for longer: a commit is worth its price.
const WORTH_A_COMMIT: usize = 1024;
/// Interval in which old rows are searched for.
const THINNING: Duration = Duration::from_secs(10);
/// A disk that is too slow all the time is not reported all the time.
const SAYING: Duration = Duration::from_secs(10);
/// At the end of the session the writer tries for this long.
const LAST_TRIES: Duration = Duration::from_secs(5);

/// Both ends. `store` is what `Store::open` gave, or none where the disk was full: then it is opened later.
pub fn recorder(recording: Recording, store: Option<Store>) -> (Recorder, Writer) {
    let queue = Arc::new(Queue {
        inner: Mutex::default(),
        changed: Condvar::new(),
        waiting: recording.waiting.max(1),
    });
    let stored = Stored {
        session: store.as_ref().map_or(0, Store::session),
        frames: 0,
        events: 0,
        not_stored: NotStored::default(),
        through_s: vec![None; recording.pairs.len()],
    };
    let writer = Writer {
        recording,
        queue: Arc::clone(&queue),
        store,
        stored,
        is_degraded: false,
        said: NotStored::default(),
        next_saying: Instant::now(),
        next_thinning: Instant::now(),
    };
    (Recorder { queue }, writer)
}

impl Recorder {
    /// Takes a frame; the oldest makes room.
    pub fn frame(&self, row: FrameRow) {
        let mut inner = self.queue.lock();
        if !row.t_s.is_finite() {
            inner.not_stored.frames += 1; // A row without a time has no place in a history.
            return;
        }
        if self.queue.waiting <= inner.frames.len() {
            inner.frames.pop_front();
            inner.not_stored.frames += 1;
        }
        inner.frames.push_back(row);
        let is_worth = inner.frames.len() == WORTH_A_COMMIT;
        drop(inner);
        if is_worth {
            self.queue.changed.notify_all();
        }
    }

    /// Takes an event; the oldest makes room.
    pub fn event(&self, row: EventRow) {
        let mut inner = self.queue.lock();
        if self.queue.waiting <= inner.events.len() {
            inner.events.pop_front();
            inner.not_stored.events += 1;
        }
        inner.events.push_back(row);
    }

    /// No more will come: the writer stores what waits and ends.
    pub fn close(&self) {
        self.queue.lock().is_closed = true;
        self.queue.changed.notify_all();
    }
}

impl Queue {
    /// If a thread panics while it holds the lock, the queue is still consistent.
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a commit's worth of rows, the end, or so long.
    fn wait(&self, patience: Duration) -> bool {
        let is_short = |inner: &mut Inner| inner.frames.len() < WORTH_A_COMMIT && !inner.is_closed;
        let waited = self.changed.wait_timeout_while(self.lock(), patience, is_short);
        waited.unwrap_or_else(PoisonError::into_inner).0.is_closed
    }

    /// Waits for the end, or so long.
    fn rest(&self, patience: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |inner| !inner.is_closed);
        waited.unwrap_or_else(PoisonError::into_inner).0.is_closed
    }

    /// The rows that waited longest. All events, of which there are few, unless frames older than they are still wait.
    fn take(&self) -> (Vec<FrameRow>, Vec<EventRow>) {
        let mut inner = self.lock();
        let frames = inner.frames.len().min(BATCH);
        let frames: Vec<FrameRow> = inner.frames.drain(..frames).collect();
        let events = if inner.frames.is_empty() { inner.events.drain(..).collect() } else { Vec::new() };
        (frames, events)
    }

    fn not_stored(&self) -> NotStored {
        self.lock().not_stored
    }

    fn give_up(&self, frames: usize, events: usize) {
        let mut inner = self.lock();
        inner.not_stored.frames += frames as u64;
        inner.not_stored.events += events as u64;
    }
}

impl Writer {
    /// Stores rows until the recorder is closed and the queue is empty, and tells how it goes. Blocks: it needs a thread of its own.
    pub fn run(mut self, mut reported: impl FnMut(Reported)) {
        let commit = Duration::from_secs_f64(self.recording.commit_s);
        loop {
            let is_closed = self.queue.wait(commit);
            let (frames, events) = self.queue.take();
            let is_empty = frames.is_empty() && events.is_empty();
            if is_empty && is_closed {
                break;
            }
            if !is_empty && !self.store_all(&frames, &events, &mut reported) {
                self.queue.give_up(frames.len(), events.len());
                break;
            }
            if !is_closed {
                self.thin(&mut reported);
            }
        }
        self.finish(&mut reported);
    }

    /// Tries until it is done; false when the session ended before it was.
    fn store_all(
        &mut self,
        frames: &[FrameRow],
        events: &[EventRow],
        reported: &mut impl FnMut(Reported),
    ) -> bool {
        let mut last_try: Option<Instant> = None;
        loop {
            match self.try_store(frames, events, reported) {
                Ok(()) => {
                    self.count(frames, events, reported);
                    return true;
                }
                Err(error) => self.degraded(error, reported),
            }
            if self.queue.rest(Duration::from_secs_f64(self.recording.retry_s)) {
                let until = *last_try.get_or_insert_with(|| Instant::now() + LAST_TRIES);
                if until <= Instant::now() {
                    return false;
                }
                std::thread::sleep(Duration::from_millis(50)); // `rest` does not, once the recorder is closed
            }
        }
    }

    fn try_store(
        &mut self,
        frames: &[FrameRow],
        events: &[EventRow],
        reported: &mut impl FnMut(Reported),
    ) -> Result<(), HistoryError> {
        let mut store = match self.store.take() {
            Some(store) => store,
            None => self.open(reported)?,
        };
        let done = store.append(frames, events);
        match &done {
            Err(HistoryError::Corrupt { reason, .. }) => {
                drop(store);
                reported(Reported::PutAside(Store::put_aside(&self.recording.path)?, reason.clone()));
            }
            // Another file in its place, or one that may no longer be written, is opened anew.
            Err(error) if !error.may_pass() => {}
            _ => self.store = Some(store),
        }
        done
    }

    fn open(&mut self, reported: &mut impl FnMut(Reported)) -> Result<Store, HistoryError> {
        let Opened { store, put_aside } = Store::open(&self.recording.path, &self.recording.pairs)?;
        if let Some((path, reason)) = put_aside {
            reported(Reported::PutAside(path, reason));
        }
        self.stored = Stored {
            session: store.session(),
            frames: 0,
            events: 0,
            through_s: vec![None; self.recording.pairs.len()],
            ..self.stored.clone()
        };
        Ok(store)
    }

    fn degraded(&mut self, error: HistoryError, reported: &mut impl FnMut(Reported)) {
        if !self.is_degraded {
            self.is_degraded = true;
            reported(Reported::Degraded(error));
        }
    }

    fn count(&mut self, frames: &[FrameRow], events: &[EventRow], reported: &mut impl FnMut(Reported)) {
        self.stored.frames += frames.len() as u64;
        self.stored.events += events.len() as u64;
        for frame in frames {
            if let Some(through_s) = self.stored.through_s.get_mut(frame.pair) {
                *through_s = Some(through_s.map_or(frame.t_s, |so_far: f64| so_far.max(frame.t_s)));
            }
        }
        self.stored.not_stored = self.queue.not_stored();
        let is_slow = self.said != self.stored.not_stored && self.next_saying <= Instant::now();
        if self.is_degraded || is_slow {
            self.next_saying = Instant::now() + SAYING;
            self.recovered(reported);
        }
        reported(Reported::Stored(self.stored.clone()));
    }

    /// Records in the history itself which rows are missing.
    fn recovered(&mut self, reported: &mut impl FnMut(Reported)) {
        let now = self.stored.not_stored;
        let missing =
            NotStored { frames: now.frames - self.said.frames, events: now.events - self.said.events };
        (self.is_degraded, self.said) = (false, now);
        reported(Reported::Recovered(missing));
        if missing != NotStored::default() {
            let detail = format!("{{\"frames\": {}, \"events\": {}}}", missing.frames, missing.events);
            let row = EventRow { kind: "not_stored".to_string(), detail, ..EventRow::default() };
            Recorder { queue: Arc::clone(&self.queue) }.event(row);
        }
    }

    /// Old rows are joined while nothing else waits.
    fn thin(&mut self, reported: &mut impl FnMut(Reported)) {
        let Some(store) = self.store.as_mut().filter(|_| self.next_thinning <= Instant::now()) else {
            return;
        };
        match store.thin(&self.recording.retention) {
            Ok(true) => {}
            Ok(false) => self.next_thinning = Instant::now() + THINNING,
            Err(error) => {
                self.next_thinning = Instant::now() + THINNING;
                // A step that needs disk space to free some waits until the next commit shows whether there is any.
                if !error.may_pass() {
                    self.store = None;
                    self.degraded(error, reported);
                }
            }
        }
    }

    fn finish(mut self, reported: &mut impl FnMut(Reported)) {
        if let Some(store) = &mut self.store {
            // A session without its end is one that was cut off; nothing else hangs on it.
            let _ = store.end();
        }
        let waiting = {
            let inner = self.queue.lock();
            NotStored { frames: inner.frames.len() as u64, events: inner.events.len() as u64 }
        };
        self.queue.give_up(waiting.frames as usize, waiting.events as usize);
        let total = self.queue.not_stored();
        if total != self.said {
            reported(Reported::Lost(total));
        }
    }
}
