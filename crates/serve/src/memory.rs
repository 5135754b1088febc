//! One limit for the memory that requests may use: bodies during reception, photographs during decoding, sessions as long as they are kept, and
//! large answers. A request that needs more than is left does not wait: sessions that have not been used for long are dropped, or it is refused.

use crate::error::Problem;
use axum::http::StatusCode;
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// The limit, bytes.
pub const CEILING_BYTES: usize = 1 << 30;
/// It is counted in pieces of this size.
const PIECE_BYTES: usize = 1 << 10;

/// The memory that is left.
#[derive(Clone)]
pub struct Memory {
    left: Arc<Semaphore>,
}

impl Default for Memory {
    fn default() -> Self {
        Memory { left: Arc::new(Semaphore::new(CEILING_BYTES / PIECE_BYTES)) }
    }
}

/// Memory that is in use; it is returned when this is dropped.
#[derive(Debug, Default)]
pub struct Taken(Option<OwnedSemaphorePermit>);

impl Memory {
    /// Takes a number of bytes, if they are left.
    pub fn take(&self, bytes: usize) -> Option<Taken> {
        let mut taken = Taken::default();
        self.resize(&mut taken, bytes).then_some(taken)
    }

    /// Makes what was taken larger or smaller; whether as much was left.
    pub fn resize(&self, taken: &mut Taken, bytes: usize) -> bool {
        let pieces = bytes.div_ceil(PIECE_BYTES);
        let has = taken.0.as_ref().map_or(0, OwnedSemaphorePermit::num_permits);
        if pieces <= has {
            drop(taken.0.as_mut().and_then(|permit| permit.split(has - pieces)));
            return true;
        }
        let Ok(more) = u32::try_from(pieces - has) else { return false };
        let Ok(more) = Arc::clone(&self.left).try_acquire_many_owned(more) else { return false };
        match &mut taken.0 {
            Some(permit) => permit.merge(more),
            None => taken.0 = Some(more),
        }
        true
    }

    /// Returns the number of bytes left.
    #[cfg(test)]
    pub fn left_bytes(&self) -> usize {
        self.left.available_permits() * PIECE_BYTES
    }
}

/// Returns the error for a request that was refused for lack of memory.
pub fn full() -> Problem {
    let message = format!(
        "The program holds as much as it may, {} MB, of which other sessions and requests have too much; try again in a moment.",
        CEILING_BYTES >> 20
    );
    Problem::new(StatusCode::SERVICE_UNAVAILABLE, "busy", message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_comes_back() {
        let memory = Memory::default();
        let mut first = memory.take(CEILING_BYTES / 2).expect("half");
        assert!(memory.take(CEILING_BYTES / 2 + 1).is_none());
        let second = memory.take(CEILING_BYTES / 2).expect("the other half");
        assert!(memory.take(1).is_none() && !memory.resize(&mut first, CEILING_BYTES / 2 + PIECE_BYTES));
        assert!(memory.resize(&mut first, 3 * PIECE_BYTES));
        drop(second);
        assert_eq!(memory.left_bytes(), CEILING_BYTES - 3 * PIECE_BYTES);
        drop(first);
        assert_eq!(memory.left_bytes(), CEILING_BYTES);
        assert!(memory.take(usize::MAX).is_none() && memory.take(0).is_some());
    }
}
