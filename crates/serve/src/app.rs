//! The state that all routes share.

use crate::capture::Capturing;
use crate::error::Problem;
use crate::live::Live;
use crate::memory::{Memory, Taken, full};
use crate::sessions::Sessions;
use std::sync::{Arc, OnceLock};
use tokio::sync::Semaphore;

/// Number of photographs decoded, and of sessions read, at the same time.
const DECODING: usize = 2;
/// Results that were dropped in, solved at once.
const SOLVING: usize = 1;
/// Other long work at once: searches for targets, reports, images from above, histories.
const WORKING: usize = 2;
/// Sessions that are changed at once, by commands other than searches: a pose may take long to solve.
const CHANGING: usize = 3;
/// Sessions that are measured at once.
const MEASURING: usize = 2;
/// All turns together. What takes milliseconds has threads besides.
pub const PERMITS: usize = DECODING + SOLVING + WORKING + CHANGING + MEASURING;

/// The state that all routes share.
#[derive(Clone)]
pub struct App {
    /// Sessions of pages.
    pub sessions: Arc<Sessions>,
    /// Cameras that are watched.
    watched: Arc<OnceLock<Arc<Live>>>,
    /// A camera that is being calibrated.
    captured: Option<Arc<Capturing>>,
    /// Turns of decoding.
    pub decoding: Arc<Semaphore>,
    /// Turns of solving results that were dropped in.
    pub solving: Arc<Semaphore>,
    /// Turns of other long work.
    pub working: Arc<Semaphore>,
    /// Turns of changing a session.
    pub changing: Arc<Semaphore>,
    /// The memory that all requests together may use.
    pub memory: Memory,
}

impl App {
    /// Nothing is open yet.
    pub fn new(live: Option<Arc<Live>>, captured: Option<Arc<Capturing>>) -> Self {
        let turns = |n| Arc::new(Semaphore::new(n));
        let memory = Memory::default();
        App {
            sessions: Arc::new(Sessions::new(memory.clone(), turns(MEASURING))),
            watched: Arc::new(live.map_or_else(OnceLock::new, OnceLock::from)),
            captured,
            decoding: turns(DECODING),
            solving: turns(SOLVING),
            working: turns(WORKING),
            changing: turns(CHANGING),
            memory,
        }
    }

    /// The cameras that are watched, where any are.
    pub fn live(&self) -> Option<&Arc<Live>> {
        self.watched.get()
    }

    /// The camera that is being calibrated, where one is.
    pub fn capture(&self) -> Option<&Arc<Capturing>> {
        self.captured.as_ref()
    }

    /// Watches these cameras from now on; false where others are watched already.
    pub fn watch(&self, live: Arc<Live>) -> bool {
        self.watched.set(live).is_ok()
    }

    /// Memory for a request; sessions that were not used for longest go for it.
    ///
    /// # Errors
    /// Not as much is left, even so.
    pub fn take(&self, bytes: usize) -> Result<Taken, Problem> {
        let mut taken = Taken::default();
        self.make_room(&mut taken, bytes)?;
        Ok(taken)
    }

    /// Takes more memory for a request.
    ///
    /// # Errors
    /// The errors of [`App::take`].
    pub fn make_room(&self, taken: &mut Taken, bytes: usize) -> Result<(), Problem> {
        while !self.memory.resize(taken, bytes) {
            if !self.sessions.let_oldest_go(None) {
                return Err(full());
            }
        }
        Ok(())
    }
}
