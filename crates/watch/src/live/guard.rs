//! Limits a panic of a thread to its camera: the session continues with the others, and the camera's last state is not reported any more.

use super::state::StateFile;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// # Errors
/// Runs a function, and returns the message of a panic as an error.
pub(super) fn guarded(run: impl FnOnce()) -> Result<(), String> {
    // State that may be inconsistent is not used again: the caller only reports that it is lost.
    catch_unwind(AssertUnwindSafe(run)).map_err(|panic| words(panic.as_ref()))
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("the program failed here: {}; please report it", text.as_deref().unwrap_or("no words"))
}

/// Ends the other threads when the thread that receives all events ends, however it does: they would wait for each other for ever.
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
