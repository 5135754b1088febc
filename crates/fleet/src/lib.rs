//! Fleets of cameras: from a day of detections to one question, which cameras moved?
//!
//! | stage | file |
//! | --- | --- |
//! | columns of a table | `layout.rs`, `arrays.rs` |
//! | views to poses, on plain slices and on Arrow | `solve.rs`, `answers.rs`, `batch.rs` |
//! | what is kept of a camera: exact sums that merge in any order | `state.rs` |
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod error;
mod arrays;
pub mod cameras;
pub mod layout;
pub mod solve;
pub mod answers;
pub mod batch;
pub mod state;
mod assemble;
pub mod source;
mod csv_out;
pub mod run;

pub use batch::{SolvedRows, solve_batch};
pub use cameras::Cameras;
pub use error::FleetError;
pub use solve::Solver;
pub use state::FleetState;
