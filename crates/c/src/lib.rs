//! The library for C and C++: the jobs and answers of the crate `resight` behind the header `include/resight.h`. A door: no mathematics.
//!
//! The header is what cbindgen makes of this crate (`cbindgen.toml`), its comments are those of the items below; `tests/header.rs` compares.
//! What a caller promises stands once, at the head of the header: every pointer is null or points to what its type and its comment say.
#![allow(unsafe_code)] // Pointers of C; `pointer` and `call` hold most of it.
#![deny(unsafe_op_in_unsafe_fn, clippy::undocumented_unsafe_blocks)]
#![allow(clippy::missing_safety_doc)] // The head of the header states what callers promise.
#![warn(missing_docs)]

pub mod status;
mod message;
mod pointer;
mod call;
pub mod version;
pub mod camera;
pub mod target;
pub mod image;
pub mod answer;
pub mod solve;
pub mod locate;
pub mod rig;

pub use message::{Message, RESIGHT_MESSAGE_SIZE};
