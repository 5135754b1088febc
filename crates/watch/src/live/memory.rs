//! The state of a camera that one session saves for the next.

use super::LiveCamera;
use super::look::CameraWatcher;
use super::state::{EVERY, StateFile, unix_s};
use std::time::Instant;

/// One camera's part of the state file.
pub(super) struct Memory<'a> {
    name: String,
    state: Option<&'a StateFile>,
    /// Capture time of the earlier session's last frame, and its age, seconds.
    pub resumed: Option<(f64, f64)>,
    due: Instant,
}

impl<'a> Memory<'a> {
    /// Restores the saved state into `look`.
    pub fn restore(look: &mut CameraWatcher, camera: &LiveCamera, state: Option<&'a StateFile>) -> Self {
        let mut memory = Memory { name: camera.name.clone(), state, resumed: None, due: Instant::now() };
        let Some((state, record)) = state.and_then(|state| Some((state, state.of(&camera.name)?))) else {
            return memory;
        };
        let refused = |target: usize, reason: String| {
            let target = camera.targets.get(target).map_or("landmarks", |watched| watched.name.as_str());
            state.say(&format!("{} with {target} begins anew: {reason}", camera.name));
        };
        if look.restore(&record, refused) {
            let ago_s = (unix_s() - record.last_unix_s).max(0.0);
            state.say(&format!("{} continues from {:.3} s, {ago_s:.1} s ago", camera.name, record.last_s));
            memory.resumed = Some((record.last_s, ago_s));
        }
        memory
    }

    /// Hands the state over when it is due, and at the end. Returns true when it did.
    pub fn keep(&mut self, look: &CameraWatcher, last: Option<(f64, Instant)>, is_end: bool) -> bool {
        let (Some(state), Some((last_s, arrived))) = (self.state, last) else { return false };
        let is_due = is_end || self.due <= Instant::now();
        if is_due {
            self.due = Instant::now() + EVERY;
            state.put(look.record(&self.name, last_s, arrived.elapsed().as_secs_f64()));
        }
        is_due
    }
}
