//! Ends a search for which nobody waits any more.
//!
//! A search asks before each pass over an image, and before each print that it measures, so that it ends within the time of one pass. It asks the
//! thread and not an argument: every detector then ends, those of explanations included, and no detector has to hand the question on.

use std::cell::{Cell, RefCell};

/// Returns whether nobody waits any more.
type Question = Box<dyn Fn() -> bool>;

thread_local! {
    /// The question of the job that this thread runs.
    static QUESTION: RefCell<Option<Question>> = const { RefCell::new(None) };
    /// Whether the answer was yes: it remains yes.
    static IS_STOPPED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a job whose searches end soon after `is_unwanted` returns true; it is called on this thread, some hundred times a second. Returns `None` for a job
/// that was ended: what it found is not what the image shows.
pub fn unless<T>(is_unwanted: impl Fn() -> bool + 'static, job: impl FnOnce() -> T) -> Option<T> {
    struct Forget;
    impl Drop for Forget {
        fn drop(&mut self) {
            QUESTION.with_borrow_mut(|question| *question = None);
            IS_STOPPED.set(false);
        }
    }
    QUESTION.with_borrow_mut(|question| *question = Some(Box::new(is_unwanted)));
    let _forget = Forget;
    let done = job();
    (!is_stopped()).then_some(done)
}

/// Returns whether the search of this thread is to end: whoever asks finds nothing then.
pub(super) fn is_stopped() -> bool {
    let asked =
        || QUESTION.with_borrow(|question| question.as_ref().is_some_and(|is_unwanted| is_unwanted()));
    let is_stopped = IS_STOPPED.get() || asked();
    IS_STOPPED.set(is_stopped);
    is_stopped
}
