//! The history of a session in one SQLite file: a row for every frame, thinned as it ages, and every event, for good.
//!
//! `Recorder` accepts rows without waiting, and `Writer` stores them in batches on the thread that runs it. Rows that `Writer` has reported as
//! stored are on the disk: they survive the end of the program at any instant, and a power cut. `History` reads such a file.

mod error;
mod rows;
mod bytes;
mod columns;
mod schema;
mod mean;
mod join;
mod store;
mod thin;
mod recorder;
mod read;
mod strip;
pub mod export;

pub use error::HistoryError;
pub use read::{History, PairSummary, Selection, StateShare};
pub use recorder::{NotStored, Recorder, Recording, Reported, Stored, Writer, recorder};
pub use rows::{
    EventRow, FrameRow, Measured, RotationSummary, Span, StoredEvent, StoredRotation, StoredRow, Summary,
};
pub use store::{Opened, Store};
pub use thin::Retention;
