//! A thread that panics takes its camera with it, not the session: the others go on, and what the camera was is no longer said of it.

use super::state::StateFile;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// # Errors
/// The words of a panic.
pub(super) fn guarded(run: impl FnOnce()) -> Result<(), String> {
    // What was half changed is not used again: the caller only tells that it is gone.
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| words(panic.as_ref()))
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("the program failed here: {}; please report it", text.as_deref().unwrap_or("no words"))
}

/// However the thread that hears all events ends, the others do too: they would wait for each other for ever.
pub(super) struct Ending<'a> {
    pub stop: &'a AtomicBool,
    pub state: Option<&'a StateFile>,
}

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.stop.store(true, Ordering::Relaxed);
        }
        if let Some(state) = self.state {
            state.close();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_a_panic_are_reported() {
        assert_eq!(guarded(|| ()), Ok(()));
        let (fixed, made) = (guarded(|| panic!("fixed")), guarded(|| panic!("{} made", 2)));
        assert!(fixed.is_err_and(|words| words.contains("failed here: fixed;")));
        assert!(made.is_err_and(|words| words.contains("failed here: 2 made;")));
    }
}
