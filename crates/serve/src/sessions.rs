//! The sessions that pages have open, by their ids.
//!
//! A session is never locked during a computation: readers take its current state, and a change is applied to a copy (photographs and answers
//! are shared), which replaces it at the end. Changes of one session are applied one after the other, in the order of the requests. A change that
//! is cancelled leaves the session free at once; its thread works on its copy, and keeps what it holds, until it notices (see [`aside`]).

use crate::aside::{aside, turn};
use crate::error::Problem;
use crate::memory::{Memory, Taken, full};
use axum::http::StatusCode;
use resight_session::{Measured, Measuring, Session};
use std::collections::HashMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, Semaphore, watch};

/// Number of sessions kept.
const MOST: usize = 32;

/// Between two measurements during a drag, at least: poses take precedence.
const REST: Duration = Duration::from_millis(40);
/// How many times as long as a measurement takes the rest after it is: a third of a processor measures at most.
const REST_TIMES: u32 = 2;

/// A session that several requests may want at once.
pub struct Shared {
    now: Mutex<Arc<Session>>,
    taken: Mutex<Taken>,
    memory: Memory,
    turn: Semaphore,
    cancelled: Notify,
    /// Turns of measuring, which all sessions share.
    measuring: Arc<Semaphore>,
    is_measuring: AtomicBool,
    /// How many wait for the measurements, which then take no rest and are whole.
    awaiting: AtomicUsize,
    awaited: Notify,
    /// Is notified of changes of the session, and closed when the session is no longer kept.
    news: watch::Sender<bool>,
}

impl Shared {
    fn new(session: Session, memory: Memory, measuring: Arc<Semaphore>) -> Option<Arc<Self>> {
        let taken = memory.take(session.weight_bytes())?;
        Some(Arc::new(Shared {
            now: Mutex::new(Arc::new(session)),
            taken: Mutex::new(taken),
            memory,
            turn: Semaphore::new(1),
            cancelled: Notify::new(),
            measuring,
            is_measuring: AtomicBool::new(false),
            awaiting: AtomicUsize::new(0),
            awaited: Notify::new(),
            news: watch::Sender::new(true),
        }))
    }

    /// The session as it is now.
    pub fn now(&self) -> Arc<Session> {
        Arc::clone(&self.now.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns a receiver that is notified of changes; false once the session is no longer kept.
    pub fn news(&self) -> watch::Receiver<bool> {
        self.news.subscribe()
    }

    /// Gives up what is being changed, if it takes long; the session stays as it was before.
    pub fn cancel(&self) {
        self.cancelled.notify_waiters();
    }

    /// Waits for `work`, which does not change the session by itself, until somebody gives it up.
    ///
    /// # Errors
    /// Those of the work, or a cancellation.
    pub async fn unless_cancelled<T>(
        &self,
        work: impl Future<Output = Result<T, Problem>>,
    ) -> Result<T, Problem> {
        tokio::select! {
            done = work => done,
            () = self.cancelled.notified() => {
                Err(Problem::new(StatusCode::CONFLICT, "cancelled", "This was cancelled; nothing has changed."))
            }
        }
    }

    /// Changes the session, on a thread of its own, and returns the result. `turns` are those of the work, of which one is waited for when the session
    /// is free: a session with much to do leaves turns to others. `take` takes its memory.
    ///
    /// # Errors
    /// A thread that failed, no memory left, or a cancellation: then nothing has changed.
    pub async fn change<T: Send + 'static, H: Send + 'static>(
        self: &Arc<Self>,
        sessions: &Sessions,
        turns: &Arc<Semaphore>,
        take: impl FnOnce() -> Result<H, Problem>,
        change: impl FnOnce(&mut Session) -> T + Send + 'static,
    ) -> Result<T, Problem> {
        let _turn = self.turn.acquire().await.map_err(|_| Problem::failed())?;
        let turn = self.unless_cancelled(turn(turns)).await?;
        let held = take()?;
        let mut after = (*self.now()).clone();
        let changed = aside((turn, held), move || {
            let done = change(&mut after);
            (after, done)
        });
        let (after, done) = self.unless_cancelled(changed).await?;
        self.keep(sessions, after)?;
        Ok(done)
    }

    /// Keeps a changed session; where memory is short, the steps that could be undone go first, then sessions that were not used for longest.
    fn keep(&self, sessions: &Sessions, mut after: Session) -> Result<(), Problem> {
        if !self.fits(&after) {
            while !self.fits(&after) && sessions.let_oldest_go(Some(self)) {}
        }
        if !self.fits(&after) {
            after.forget_steps();
        }
        if !self.fits(&after) {
            return Err(full());
        }
        self.replace(after);
        self.news.send_replace(true);
        Ok(())
    }

    fn fits(&self, session: &Session) -> bool {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        self.memory.resize(&mut taken, session.weight_bytes())
    }

    /// Returns what is to be measured next: provisionally while something is dragged and nobody waits for the whole.
    fn unmeasured(&self) -> Option<Measuring> {
        let now = self.now();
        match now.is_dragging() && self.awaiting.load(Ordering::Acquire) == 0 {
            true => now.measuring_provisionally(),
            false => now.measuring(),
        }
    }

    /// Measures what is not measured yet, on a thread of its own, the newest state each time; at most one such thread works for a session.
    pub fn measure(self: &Arc<Self>) {
        if self.unmeasured().is_none() || self.is_measuring.swap(true, Ordering::AcqRel) {
            return;
        }
        let shared = Arc::clone(self);
        tokio::spawn(async move {
            while let Some(task) = shared.unmeasured() {
                let Ok(turn) = turn(&shared.measuring).await else { break };
                let began = Instant::now();
                let Ok(measured) = aside(turn, move || task.run()).await else { break };
                let rest = REST.max(REST_TIMES * began.elapsed());
                shared.take(measured).await;
                if shared.now().is_dragging() {
                    tokio::select! {
                        () = tokio::time::sleep(rest) => {}
                        () = shared.awaited.notified() => {}
                    }
                }
            }
            shared.is_measuring.store(false, Ordering::Release);
            // Something may have come in between.
            if shared.unmeasured().is_some() {
                shared.measure();
            }
        });
    }

    /// Returns the session when everything in it is measured.
    ///
    /// # Errors
    /// The session is no longer kept.
    pub async fn measured(self: &Arc<Self>) -> Result<Arc<Session>, Problem> {
        let _awaits = Awaits::new(&self.awaiting);
        let mut news = self.news();
        loop {
            let now = self.now();
            if now.measuring().is_none() {
                return Ok(now);
            }
            self.measure();
            self.awaited.notify_one();
            news.changed().await.map_err(|_| Problem::failed())?;
        }
    }

    async fn take(&self, measured: Measured) {
        let Ok(_turn) = self.turn.acquire().await else { return };
        let mut after = (*self.now()).clone();
        after.take(measured);
        self.replace(after);
        self.news.send_replace(true);
    }

    /// The lock is held for the exchange of two pointers.
    fn replace(&self, after: Session) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = Arc::new(after);
    }

    /// Drops the session: nobody can request it any more, and its memory is freed, even if a page still shows it.
    fn leave(&self) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = Arc::default();
        *self.taken.lock().unwrap_or_else(PoisonError::into_inner) = Taken::default();
        self.news.send_replace(false);
    }
}

/// Somebody who waits for the measurements, until this is dropped.
struct Awaits<'a>(&'a AtomicUsize);

impl<'a> Awaits<'a> {
    fn new(awaiting: &'a AtomicUsize) -> Self {
        awaiting.fetch_add(1, Ordering::AcqRel);
        Awaits(awaiting)
    }
}

impl Drop for Awaits<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// All open sessions.
pub struct Sessions {
    kept: Mutex<Kept>,
    memory: Memory,
    measuring: Arc<Semaphore>,
}

/// Sessions by id, each with the count of uses at its last one.
#[derive(Default)]
struct Kept {
    uses: u64,
    by_id: HashMap<String, (u64, Arc<Shared>)>,
}

impl Sessions {
    /// Starts without sessions.
    pub fn new(memory: Memory, measuring: Arc<Semaphore>) -> Self {
        Sessions { kept: Mutex::default(), memory, measuring }
    }

    /// Keeps a session and names it; those that were not used for longest go for it.
    ///
    /// # Errors
    /// No memory left.
    pub fn add(&self, session: Session) -> Result<(String, Arc<Shared>), Problem> {
        let shared = loop {
            match Shared::new(session.clone(), self.memory.clone(), Arc::clone(&self.measuring)) {
                Some(shared) => break shared,
                None if self.let_oldest_go(None) => {}
                None => return Err(full()),
            }
        };
        let id = fresh_id();
        let is_full = {
            let mut all = self.lock();
            all.uses += 1;
            let now = all.uses;
            all.by_id.insert(id.clone(), (now, Arc::clone(&shared)));
            MOST < all.by_id.len()
        };
        if is_full {
            self.let_oldest_go(Some(&shared));
        }
        Ok((id, shared))
    }

    /// The session of an id.
    pub fn get(&self, id: &str) -> Option<Arc<Shared>> {
        let mut all = self.lock();
        all.uses += 1;
        let now = all.uses;
        let (used, session) = all.by_id.get_mut(id)?;
        *used = now;
        Some(Arc::clone(session))
    }

    /// Lets the one go that was not used for longest; whether there was one besides `kept`.
    pub fn let_oldest_go(&self, kept: Option<&Shared>) -> bool {
        let gone = {
            let mut all = self.lock();
            let others =
                all.by_id.iter().filter(|(_, (_, s))| !kept.is_some_and(|kept| std::ptr::eq(&**s, kept)));
            let oldest = others.min_by_key(|(_, (used, _))| *used).map(|(id, _)| id.clone());
            oldest.and_then(|id| all.by_id.remove(&id))
        };
        gone.map(|(_, shared)| shared.leave()).is_some()
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns 128 bits that cannot be guessed: SipHash under keys from the system's random numbers.
fn fresh_id() -> String {
    let half = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", half(), half())
}
