//! One error type: what is wrong, the number seen, the number needed, the way out.

use thiserror::Error;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A quantity is NaN or infinite.
    #[error("{what} is not a finite number; correct it or leave the row empty")]
    NotFinite {
        /// Which quantity.
        what: &'static str,
    },
    /// A quantity that must be positive is not.
    #[error("{what} is {seen}; it must be positive")]
    NotPositive {
        /// Which quantity.
        what: &'static str,
        /// The value given.
        seen: f64,
    },
    /// Too few samples in contact for the question asked.
    #[error("{seen} {what} given, {needed} needed; {way_out}")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many came in.
        seen: usize,
        /// How many are needed.
        needed: usize,
        /// What to do.
        way_out: &'static str,
    },
    /// A fit that does not settle.
    #[error("{what} does not settle; {way_out}")]
    NoFit {
        /// Which fit.
        what: &'static str,
        /// What to do.
        way_out: &'static str,
    },
}
