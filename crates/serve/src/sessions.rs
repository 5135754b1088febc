//! The sessions that pages have open, by their ids. Few, and small together: the one that was not used for longest goes.

use resight_session::Session;
use std::collections::HashMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Sessions kept.
const MOST: usize = 32;
/// Pixels and files of photographs of all sessions together, bytes.
const MOST_BYTES: usize = 1 << 30;
/// Photographs that a session may have.
const PHOTOS: usize = 16;

/// A session that several requests may want at once.
pub type Shared = Arc<Mutex<Session>>;

/// All of them.
#[derive(Default)]
pub struct Sessions {
    kept: Mutex<Kept>,
}

/// Sessions by id, each with the count of uses at its last one.
#[derive(Default)]
struct Kept {
    uses: u64,
    by_id: HashMap<String, (u64, Shared)>,
}

impl Sessions {
    /// Keeps a session and names it.
    pub fn add(&self, session: Session) -> (String, Shared) {
        let (id, shared) = (fresh_id(), Arc::new(Mutex::new(session)));
        let mut all = self.lock();
        all.uses += 1;
        let now = all.uses;
        all.by_id.insert(id.clone(), (now, Arc::clone(&shared)));
        drop(all);
        self.make_room(&id);
        (id, shared)
    }

    /// The session of an id.
    pub fn get(&self, id: &str) -> Option<Shared> {
        let mut all = self.lock();
        all.uses += 1;
        let now = all.uses;
        let (used, session) = all.by_id.get_mut(id)?;
        *used = now;
        Some(Arc::clone(session))
    }

    /// Lets the longest unused go until the rest is small enough; `kept` stays.
    pub fn make_room(&self, kept: &str) {
        let mut all = self.lock();
        loop {
            let n = all.by_id.len();
            let bytes: usize =
                all.by_id.values().filter_map(|(_, s)| s.try_lock().ok().map(|s| weight(&s))).sum();
            let oldest =
                all.by_id.iter().filter(|(id, _)| id.as_str() != kept).min_by_key(|(_, (used, _))| *used);
            let Some(id) = oldest.map(|(id, _)| id.clone()).filter(|_| MOST < n || MOST_BYTES < bytes) else {
                return;
            };
            all.by_id.remove(&id);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn weight(session: &Session) -> usize {
    (0..PHOTOS).filter_map(|i| session.photograph(i)).map(|p| p.bytes.len() + p.image.data.len()).sum()
}

/// 128 unpredictable bits: SipHash under keys that the system drew.
fn fresh_id() -> String {
    let half = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", half(), half())
}
