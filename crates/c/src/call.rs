//! What every call is wrapped in: no panic leaves it, and its sentence is where the caller wants it.

use crate::message::Message;
use crate::pointer::Out;
use crate::status::{Refusal, Status};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs a job, and writes the sentence with which it ends where the caller gave memory for one.
///
/// # Safety
/// `message` is null or points to memory for a message that nothing else uses meanwhile.
pub unsafe fn call(message: *mut Message, job: impl FnOnce() -> Result<(Status, String), Refusal>) -> Status {
    // What a job leaves half done is dropped with it: inputs are only read.
    let ended = catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|_| Err(Refusal::mistake()));
    let (status, sentence) = ended.unwrap_or_else(|refusal| (refusal.status, refusal.message));
    // SAFETY: the caller's promise. Without memory there is nobody who wants the sentence.
    if let Ok(out) = unsafe { Out::new("message", message) } {
        out.write(Message::new(&sentence));
    }
    status
}

/// The same for a job that answers nothing.
///
/// # Safety
/// As of `call`.
pub unsafe fn done(message: *mut Message, job: impl FnOnce() -> Result<(), Refusal>) -> Status {
    // SAFETY: the caller's promise.
    unsafe { call(message, || job().map(|()| (Status::Ok, String::new()))) }
}

/// For what has no status: the value, or the one for a mistake of this library.
pub fn guarded<T>(otherwise: T, job: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(job)).unwrap_or(otherwise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_status() {
        let mut message = Message::new("");
        // SAFETY: a message of this test.
        let status = unsafe { call(&mut message, || panic!("on purpose")) };
        assert_eq!(
            (status, message.text),
            (Status::Internal, Message::new(&Refusal::mistake().message).text)
        );
        // SAFETY: null is allowed.
        assert_eq!(unsafe { done(std::ptr::null_mut(), || panic!("on purpose")) }, Status::Internal);
        assert_eq!(guarded(7, || panic!("on purpose")), 7);
    }
}
