//! The largest lead of cameras whose frames form frame sets: the reader of a recording waits for those behind it.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// State shared by the threads that read and the one that forms frame sets.
pub(super) struct Pace {
    runners: Mutex<Vec<Runner>>,
    changed: Condvar,
}

#[derive(Debug, Clone, Copy, Default)]
struct Runner {
    is_held: bool,
    /// Time since which its source has provided nothing; none while it is read, however long that takes.
    silent_since: Option<Instant>,
}

impl Pace {
    pub fn new(cameras: usize) -> Self {
        Pace { runners: Mutex::new(vec![Runner::default(); cameras]), changed: Condvar::new() }
    }

    /// A thread that panicked while it held the lock left valid entries.
    fn lock(&self) -> MutexGuard<'_, Vec<Runner>> {
        self.runners.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether a camera may read on; one that is held waits, but not longer than `patience`.
    pub fn may_read(&self, camera: usize, patience: Duration) -> bool {
        let is_held = |runners: &mut Vec<Runner>| runners[camera].is_held;
        let waited = self.changed.wait_timeout_while(self.lock(), patience, is_held);
        let (runners, _) = waited.unwrap_or_else(PoisonError::into_inner);
        !runners[camera].is_held
    }

    /// Sets which cameras are held.
    pub fn hold(&self, held: &[bool]) {
        self.lock().iter_mut().zip(held).for_each(|(runner, is_held)| runner.is_held = *is_held);
        self.changed.notify_all();
    }

    /// Records that the camera's source provided a frame.
    pub fn gave(&self, camera: usize) {
        self.lock()[camera].silent_since = None;
    }

    /// Records that the camera's source has nothing to provide.
    pub fn fell_silent(&self, camera: usize, now: Instant) {
        self.lock()[camera].silent_since.get_or_insert(now);
    }

    /// Returns the time since which it has provided nothing.
    pub fn silent_since(&self, camera: usize) -> Option<Instant> {
        self.lock()[camera].silent_since
    }
}
