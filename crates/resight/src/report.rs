//! Answers for people: verdicts, numbers in words, and self-contained pages.

pub mod explanation;
pub mod face;
pub mod html;
pub mod intrinsics;
pub mod rig;
pub mod truth;
pub mod turned;
pub mod verdict;
pub mod words;

pub use intrinsics::intrinsics_page;
pub use rig::rig_page;
